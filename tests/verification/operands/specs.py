"""Specs whose components hold the values of expressions, with those left out that the language refuses."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass

from taskspec.base.diagnostics import SpecError
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.verification.operands.forms import KINDS, POINTS, SINGLE

DECLARED = {"b": "bool", "i": "int, low: -7, high: 1000", "r": "real"}
ZERO = {"bool": "False", "int": "0", "real": "0.0"}
HORIZON = 9


@dataclass(frozen=True)
class Held:
    """An expression with the type of its value."""

    text: str
    kind: str
    shape: tuple[int, ...]


def task_of(held: Sequence[Held], shapes: Sequence[int], small: bool = False, single: bool = False) -> Task:
    """A task with a component `e0`, `e1`, ... for every expression, which rewards and ends also take turns to be.

    A `small` one, for backends that compile for long, observes none of them and has no components that stay as they are;
    `single` leaves out numbers that float32 does not hold.
    """
    lines = [*_head(single), *_sections(held, shapes, not small)]
    scalars = [h.text for h in held if not h.shape][:HORIZON]
    lines += ["reward:", *(f"  - {{if: t == {n}, then: {json.dumps(text)}}}" for n, text in enumerate(scalars))]
    lines += ["  - else: 0", "terminal:"]
    conditions = [h.text for h in held if not h.shape and h.kind == "bool"][:HORIZON]
    lines += [f"  - {{if: t == {n}, then: {json.dumps(text)}}}" for n, text in enumerate(conditions, 2)]
    lines.append("  - else: false")
    seen = [(n, h.text) for n, h in enumerate(held) if "'" not in h.text and not small]
    lines += ["observation:", "  space: dict", "  k: k", *(f"  o{n}: {json.dumps(text)}" for n, text in seen)]
    return build(read_text("\n".join(lines)), None, {}, "")


def _head(single: bool) -> list[str]:
    points = {k: p[:SINGLE] if single else p for k, p in POINTS.items()}
    lines = ["taskspec: 1", "name: Operands", "action: {a: {type: bool}}", f"horizon: {HORIZON}", "constants:"]
    for kind, values in points.items():
        turns = {n: ", ".join(f"P{kind}[{(5 * j + 1) % len(values)}]" for j in range(n)) for n in (3, 40)}
        lines.append(f'  P{kind}: "[{", ".join(values)}]"')
        lines += [f'  K{kind}{n}: "[{text}]"' for n, text in turns.items()]
    return lines


def _sections(held: Sequence[Held], shapes: Sequence[int], kept: bool) -> list[str]:
    state = ["  k: {type: int, low: 0, high: 6}"]
    initial = ["  k: 1"]
    dynamics = ['  k\': "(k + 1) % 7"']
    for kind in KINDS:
        for shape in shapes:
            suffix, size = (str(shape), f", shape: [{shape}]") if shape else ("", "")
            drawn = f'"P{kind}[UniformInt(0, len(P{kind}) - 1{f", shape={shape}" if shape else ""})]"'
            for prefix in "xf" if kept else "x":
                state.append(f"  {prefix}{kind}{suffix}: {{type: {DECLARED[kind]}{size}}}")
                initial.append(f"  {prefix}{kind}{suffix}: {drawn}")
            dynamics.append(f"  x{kind}{suffix}': {drawn}")
    for n, h in enumerate(held):
        zero = ZERO[h.kind]
        for size in reversed(h.shape):
            zero = f"[{', '.join([zero] * size)}]"
        state.append(
            f"  e{n}: {{type: {h.kind}, shape: {list(h.shape)}}}" if h.shape else f"  e{n}: {{type: {h.kind}}}"
        )
        initial.append(f'  e{n}: "{zero}"')
        dynamics.append(f"  e{n}': {json.dumps(h.text)}")
    return ["state:", *state, "initial:", *initial, "dynamics:", *dynamics]


def typed(texts: Sequence[str], shapes: Sequence[int]) -> list[Held]:
    """The expressions that the language takes, with their types, which are those that observations of them have."""
    while texts:
        plain = [re.sub(r"\b(x[bir]\d*)'", r"\1", text) for text in texts]  # what is observed has no next value
        lines = [*_head(False), *_sections((), shapes, True), "reward: 0", "observation:"]
        spec = "\n".join([*lines, *(f"  o{n}: {json.dumps(text)}" for n, text in enumerate(plain))])
        try:
            components = build(read_text(spec), None, {}, "").observation.components
        except SpecError as error:
            broken = {d.span.line - len(lines) - 1 for d in error.diagnostics if d.span is not None}
            assert broken and min(broken) >= 0, error
            texts = [text for n, text in enumerate(texts) if n not in broken]
        else:
            return [Held(t, str(c.type.kind), c.type.shape) for t, c in zip(texts, components, strict=True)]
    return []
