"""Learners of the table by name, called with their settings."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.learners.case import LearnerCase
from taskspec.learners.settings import (
    Adversarial,
    Cloning,
    Comparing,
    Configuration,
    Experience,
    Matching,
    Novelty,
    Ppo,
    Reward,
    Trpo,
    changed,
)
from taskspec.source import Document, read_file

# ---------- table
# The learners that come with the package, by name.


@dataclass(frozen=True, slots=True)
class BuiltIn:
    """A learner: what it is in a sentence, what it has to be granted, and its settings as published."""

    name: str
    summary: str
    learns_from: tuple[str, ...]
    published: Configuration


_FU = Trpo(
    Experience(lanes=2, steps=100, whole=True), hidden=(32, 32), weights="xavier", trace=1.0, accepted_kl=0.01, strict=True,
    halvings=15, shrink=0.8, damping=1e-5, fisher_every=1, critic="ridge",
)  # fmt: skip
_GAIL_IM = Adversarial(budget_factor=0.64)
_GAIL_SB = Adversarial(
    Trpo(), Reward(hidden=(100, 100), activation="tanh", standardised=True, learning_rate=3e-4),
    updates=1, batch=0, every=3, kept=0, entropy=1e-3, budget_factor=3.0,
)  # fmt: skip
_GAIL_FU = Adversarial(_FU, pay="-softplus(-l)", updates=50, batch=32, kept=0)
_AIRL_SA = replace(
    _GAIL_IM, reward=Reward(shaped=True, scaled=True), pay="l", minus_log_policy=True, deviation_as_variance=True
)
_AIRL_SO = replace(_AIRL_SA, reward=Reward(inputs="state", shaped=True, scaled=True))
_AIRL_FU = replace(_GAIL_FU, policy=replace(_FU, entropy=1.0), pay="f", minus_log_policy=True, updates=100)
_DRLHP_SA = Comparing(budget_factor=0.64)
_DRLHP_SO = replace(_DRLHP_SA, reward=Reward(inputs="state", shaped=True, scaled=True))

_REWARD, _SHOWN, _COMPARED = ("reward",), ("demonstrations",), ("preferences",)
BUILT_IN: dict[str, BuiltIn] = {
    entry.name: entry
    for entry in (
        BuiltIn("ppo", "proximal policy optimisation on the true reward", _REWARD, Ppo()),
        BuiltIn("bc", "behavioural cloning", _SHOWN, Cloning()),
        BuiltIn("gail_im", "GAIL with PPO and reward -log(1 - D) >= 0", _SHOWN, _GAIL_IM),
        BuiltIn("gail_sb", "GAIL with TRPO and reward -log(1 - D) >= 0", _SHOWN, _GAIL_SB),
        BuiltIn("gail_fu", "GAIL with TRPO and reward log D <= 0", _SHOWN, _GAIL_FU),
        BuiltIn("airl_im_sa", "AIRL with PPO and a reward of state and action", _SHOWN, _AIRL_SA),
        BuiltIn("airl_im_so", "AIRL with PPO and a reward of the state", _SHOWN, _AIRL_SO),
        BuiltIn("airl_fu", "AIRL with TRPO", _SHOWN, _AIRL_FU),
        BuiltIn("drlhp_sa", "DRLHP with PPO and a reward of state and action", _COMPARED, _DRLHP_SA),
        BuiltIn("drlhp_so", "DRLHP with PPO and a reward of the state", _COMPARED, _DRLHP_SO),
        BuiltIn("drlhp_slow", "drlhp_sa with a low learning rate of the policy", _COMPARED,
              replace(_DRLHP_SA, policy=Ppo(learning_rate=1e-4))),
        BuiltIn("drlhp_eps", "drlhp_sa with some random actions in the episodes that are compared", _COMPARED,
              replace(_DRLHP_SA, random=0.1)),
        BuiltIn("drlhp_rnd", "drlhp_sa with a bonus for novelty", _COMPARED, replace(_DRLHP_SA, novelty=Novelty())),
        BuiltIn("maxent", "maximum-entropy inverse reinforcement learning on the exact model", _SHOWN, Matching(causal=False)),
        BuiltIn("mce", "the causal version, which does not assume that it can choose random outcomes", _SHOWN, Matching()),
    )
}  # fmt: skip
"""Every learner by its name."""


# ---------- learner
# A learner that can be called: one of the table, with its settings.

FAMILIES = {
    "corrected": "the mistakes of the published code corrected",
    "paper": "the code that the figures of the paper come from",
    "released": "the code as it was published in the end, its mistakes included",
}
"""What the same learners are set to."""
_FOLDER = Path(__file__).parent / "families"
_KEYS = ("learner", "family", "settings")


@dataclass(frozen=True)
class Learner:
    """`learner(case)` gives a policy for each of `case.seeds`, all of them trained together.

    Attributes:
        name, family: which one it is.
        configuration: its settings.
        learns_from: what it has to be granted, of "reward", "demonstrations" and "preferences".
    """

    name: str
    family: str
    configuration: Configuration
    learns_from: tuple[str, ...]
    together: ClassVar[bool] = True

    def __call__(self, case: LearnerCase) -> list[Any]:
        """Raises SpecError: E705 where JAX or optax are not installed, E713 for tasks that it cannot learn."""
        match self.configuration:
            case Matching() as config:
                from taskspec.learners.tabular import matched

                return matched(config, case)
            case Ppo() as config:
                return _deep("reinforce").reinforced(config, case)  # type: ignore[no-any-return]
            case Cloning() as config:
                return _deep("clone").cloned(config, case)  # type: ignore[no-any-return]
            case Adversarial() as config:
                return _deep("adversarial").imitated(config, case)  # type: ignore[no-any-return]
            case Comparing() as config:
                return _deep("preferences").preferred(config, case)  # type: ignore[no-any-return]


def _deep(module: str) -> Any:
    return import_module(f"taskspec.learners.deep.{module}")


def learner(source: str | os.PathLike[str], family: str = "corrected") -> Learner:
    """A learner by its name, or as a file has it: `learner: gail_im`, and maybe a `family` and `settings`.

    A name may have its family in front: `paper/gail_im`.

    Raises:
        SpecError: E710, E713 for a name that there is none of; E2xx for mistakes in the file, each with its place.
    """
    name = os.fspath(source)
    before, slash, rest = name.partition("/")
    if slash and before in FAMILIES and rest in BUILT_IN:
        return _made(BUILT_IN[rest], before)
    if name in BUILT_IN:
        return _made(BUILT_IN[name], family)
    if not name.endswith((".yaml", ".yml")):
        hint = suggest(name, BUILT_IN) or f"there are {', '.join(BUILT_IN)}; a path ends in .yaml"
        raise SpecError([Diagnostic("E713", None, f"there is no learner '{name}'", hint)])
    document = read_file(Path(source))
    made = _made(_written(document), document.data.get("family", family))
    if "settings" not in document.data:
        return made
    return Learner(made.name, made.family, changed(made.configuration, document, ("settings",)), made.learns_from)


def _written(document: Document) -> BuiltIn:
    """The learner that a file names."""
    data = document.data
    if not isinstance(data, dict) or "learner" not in data:
        raise SpecError([Diagnostic("E203", document.span(()), "a learner's file says which one: `learner: bc`")])
    stray = next((key for key in data if key not in _KEYS), None)
    if stray is not None:
        hint = suggest(stray, _KEYS) or f"it has {', '.join(_KEYS)}"
        raise SpecError([Diagnostic("E202", document.key_span((stray,)), f"unknown key `{stray}`", hint)])
    for key, known in (("learner", BUILT_IN), ("family", FAMILIES)):
        if key in data and data[key] not in known:
            near = suggest(str(data[key]), tuple(known))
            message = f"{data[key]!r} is not one of {', '.join(known)}"
            raise SpecError([Diagnostic("E206", document.span((key,)), message, near)])
    return BUILT_IN[data["learner"]]


def _made(entry: BuiltIn, family: str) -> Learner:
    if family not in FAMILIES:
        raise SpecError(
            [
                Diagnostic(
                    "E713",
                    None,
                    f"there is no family '{family}'",
                    suggest(family, FAMILIES) or f"there are {', '.join(FAMILIES)}",
                )
            ]
        )
    document = read_file(_FOLDER / f"{family}.yaml")
    config: Any = entry.published
    for i, rule in enumerate(document.data):
        if any(fnmatchcase(entry.name, pattern) for pattern in rule["learners"]):
            config = changed(config, document, (i, "settings"))
    return Learner(entry.name, family, config, entry.learns_from)
