"""A short episode as one SVG that repeats, without script; readers who ask for less motion see its first frame."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from itertools import groupby
from typing import Any

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.base.display import number
from taskspec.exact.policies.policy import EpisodeBatch, named
from taskspec.exact.rollout.rollout import Rollout
from taskspec.language.task.parts import Component
from taskspec.language.task.task import Task
from taskspec.show.figures import scene
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.shapes import WORD, Item, Label, Scene, text_width
from taskspec.show.figures.states import STEPS, first_lane
from taskspec.show.figures.vector_formats import svg_document, svg_item
from taskspec.show.printers import tree as m

FRAMES = 12  # the largest number of frames, of the start of an episode or evenly spread over it
ITEMS = 600  # the largest number of items in a frame
SAME = 0.1  # centimetres by which frames of one size may differ
SECONDS = 0.7
LAST = 3  # the last frame is shown as long as so many others
_STYLE = (
    ".film g{{animation-duration:{seconds:.1f}s;animation-timing-function:step-end;animation-iteration-count:infinite}}"
    ".film:hover g{{animation-play-state:paused}}@media(prefers-reduced-motion:reduce){{.film g{{animation:none}}}}"
)

Step = tuple[dict[str, Any], str]  # a state, and words for the step that led to it


def film(task: Task) -> str | None:
    """Return an episode of the expert, or of an optimal policy without one.

    None where nobody knows how to act, and for figures that are large or whose frames differ in size.
    """
    task = task.unmodified
    who = "optimal" if task.annotations.expert is None else "expert"
    try:
        steps = list(_episode(task, who))
    except SpecError:
        return None
    while len(steps) > 2 and all(map(np.array_equal, steps[-1][0].values(), steps[-2][0].values())):
        steps.pop()
    every = 1
    if not task.is_finite:
        every = math.ceil(len(steps) / FRAMES)
    seen: dict[int, dict[str, Any]] = {}
    frames: list[Scene] = []
    for t, (state, words) in enumerate(steps[: every * FRAMES]):
        seen[t] = state
        if t % every == 0:
            drawn = scene(task, Overlay(here=state, seen=seen))
            if drawn is None or len(drawn.items) > ITEMS:
                return None
            label = Label((0.15, drawn.height + WORD), m.Words(words), WORD, "start", "muted")
            width = max(drawn.width, text_width(label.text, WORD) + 0.3)
            frames.append(replace(drawn, width=width, height=drawn.height + 2 * WORD, items=(*drawn.items, label)))
    if len(frames) < 2 or np.ptp([frame.height for frame in frames]) > SAME:
        return None
    whose = "an optimal policy" if who == "optimal" else "the expert"
    width = max(frame.width for frame in frames)
    alt = f"An episode of {whose} in {task.name}, {len(frames)} frames"
    return animated(replace(frames[0], width=width, alt=alt), [frame.items for frame in frames])


def _episode(task: Task, who: str) -> Iterator[Step]:
    policy = named(task, who)
    rollout = Rollout(policy.task, 1)
    rng = np.random.default_rng(0)
    state = rollout.start()
    total = 0.0
    yield first_lane(state), "start"
    for t in range(min(STEPS, task.horizon or STEPS)):
        action = policy.choose(EpisodeBatch.sharing(t, state, None, rng))
        moved = rollout.step(state, action, t)
        state = moved.state
        reward = float(moved.reward[0])
        total += task.discount**t * reward
        taken = ", ".join(_value(c, action[c.name]) for c in task.action)
        yield first_lane(state), f"step {t + 1}: {taken}; reward {number(reward, 4)}, return {number(total, 4)}"
        if bool(moved.terminal[0]):
            return


def _value(c: Component, value: Any) -> str:
    words = []
    for x in np.asarray(value).reshape(-1).tolist():
        if c.domain is None:
            words.append(number(float(x), 3))
        else:
            words.append(c.domain.labels[int(x)].replace("_", " "))
    text = ", ".join(words)
    if c.domain is not None:
        return text
    return f"{c.name} = {text}" if c.type.is_scalar else f"{c.name} = ({text})"


def animated(first: Scene, frames: Sequence[Sequence[Item]]) -> str:
    """Return an SVG that shows the items of one frame after the other, in the frame of a scene."""
    count = len(frames) + LAST - 1
    body = ""
    styles = {}
    for where, group in groupby(_merged(frames), key=lambda each: each[1]):
        inside = "".join(svg_item(item) for item, _ in group)
        if len(where) == len(frames):
            body += inside
            continue
        name = "at-" + "-".join(map(str, sorted(where)))
        hidden = ' visibility="hidden"' * (0 not in where)
        body += f'<g style="animation-name:{name}"{hidden}>{inside}</g>'
        states = ""
        before = None
        for i in range(count):
            shown = "visible" if min(i, len(frames) - 1) in where else "hidden"
            if shown != before:
                states += f"{100 * i / count:.4g}%{{visibility:{shown}}}"
            before = shown
        styles[name] = f"@keyframes {name}{{{states}}}"
    style = _STYLE.format(seconds=SECONDS * count) + "".join(styles.values())
    return svg_document(first, f"<style>{style}</style>{body}", kind="figure film")


def _merged(frames: Sequence[Sequence[Item]]) -> list[tuple[Item, frozenset[int]]]:
    merged: list[tuple[Item, frozenset[int]]] = []
    for number_of_frame, items in enumerate(frames):
        own = frozenset({number_of_frame})
        known = [item for item, _ in merged]
        shared: list[tuple[Item, frozenset[int]]] = []
        for kind, a, b, c, d in SequenceMatcher(None, known, items, autojunk=False).get_opcodes():
            if kind == "equal":
                for item, where in merged[a:b]:
                    shared.append((item, where | own))
            else:
                shared += merged[a:b]
                for item in items[c:d]:
                    shared.append((item, own))
        merged = shared
    return merged
