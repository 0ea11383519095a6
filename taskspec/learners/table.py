"""The learners that come with the package, by name."""

from __future__ import annotations

from dataclasses import dataclass

from taskspec.learners.configurations import Cloning, Configuration, Matching, Ppo


@dataclass(frozen=True, slots=True)
class Entry:
    """A learner: what it is in a sentence, what it has to be granted, and its settings as published."""

    name: str
    summary: str
    learns_from: tuple[str, ...]
    published: Configuration


_REWARD, _SHOWN = ("reward",), ("demonstrations",)
BUILT_IN: dict[str, Entry] = {
    entry.name: entry
    for entry in (
        Entry("ppo", "proximal policy optimisation on the true reward", _REWARD, Ppo()),
        Entry("bc", "behavioural cloning", _SHOWN, Cloning()),
        Entry("maxent", "maximum-entropy inverse reinforcement learning on the exact model", _SHOWN, Matching(causal=False)),
        Entry("mce", "its causal kind, which does not take chance for choice", _SHOWN, Matching()),
    )
}  # fmt: skip
"""Every learner by its name."""
