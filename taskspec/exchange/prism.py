"""The PRISM language and JANI: a module with the components of the state as variables, and a command for each state and action.

Sources: https://www.prismmodelchecker.org/manual/ThePRISMLanguage; https://jani-spec.org, version 1.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from taskspec.exchange.settled import END, FIRST, PHASE, expected_rewards, legal_choices
from taskspec.exchange.tables import FrozenTask, Number

_WORD = re.compile(r"[A-Za-z_]\w*", re.ASCII)
_RESERVED = re.compile(
    "A|bool|clock|const|ctmc|C|double|dtmc|E|end\\w+|false|formula|filter|func|F|global|G|init|invariant|I|int|label|max|mdp|min|"
    "module|X|nondeterministic|observables?|of|Pm(ax|in)|P|pomdp|popta|probabilistic|prob|pta|rates?|rewards?|Rm(ax|in)|R|S|"
    "stochastic|system|true|U|W|task"
)
"""Words of the PRISM language, and the names that this file gives."""


@dataclass(frozen=True)
class Variable:
    """A variable of a module: its name, the component's name in the task, its range and its first value."""

    name: str
    component: str
    low: int
    high: int
    first: int


def plain_words(names: Sequence[str], letter: str) -> list[str]:
    """Return names that both languages take; others get a letter and their number."""
    found = []
    for i, name in enumerate(names):
        is_plain = _WORD.fullmatch(name) and not _RESERVED.fullmatch(name)
        found.append(name if is_plain else f"{letter}{i}_")
    return found


def _variables(task: FrozenTask) -> list[Variable]:
    components = list(task.values[0])
    first = next(s for s, probability in enumerate(task.start) if probability)
    found = []
    for name, component in zip(plain_words(components, "v"), components, strict=True):
        column = [row[component] for row in task.values]
        found.append(Variable(name, component, min(column), max(column), column[first]))
    return [v for v in found if v.low < v.high] or found[:1]


def _cases(task: FrozenTask, variables: Sequence[Variable], name: str) -> list[dict[str, int]]:
    """Return values of variables that make up a label."""
    held = sorted(task.labels[name])
    phase = {END: 2, FIRST: 0}.get(name)
    if phase is not None:
        return [{v.name: phase for v in variables if v.component == PHASE}] if held else []
    return [{v.name: task.values[s][v.component] for v in variables} for s in held]


def _labels(task: FrozenTask, variables: Sequence[Variable]) -> Iterator[tuple[str, list[dict[str, int]]]]:
    names = list(task.labels)
    for plain, name in zip(plain_words(names, "label"), names, strict=True):
        yield plain, _cases(task, variables, name)


def _guard(values: Mapping[str, int]) -> str:
    return " & ".join(f"{name}={value}" for name, value in values.items())


def prism(task: FrozenTask) -> bytes:
    """Return the program of a settled task; rewards are those expected of an action."""
    variables = _variables(task)
    actions = plain_words(task.actions, "a")
    lines = [f"// {task.name}, by taskspec", f"// {property_of(task, 'max')}", f"// {property_of(task, 'min')}"]
    lines += ["mdp", "", "module task"]
    lines += [f"  {v.name} : [{v.low}..{v.high}] init {v.first};" for v in variables]
    paid = []
    for s, by_action in enumerate(task.outcomes):
        guard = _guard({v.name: task.values[s][v.component] for v in variables})
        for a, outcomes in legal_choices(by_action):
            parts = []
            for outcome in outcomes:
                parts.append(f"{_number(outcome.probability)} : {_updates(task, variables, s, outcome.state)}")
            lines.append(f"  [{actions[a]}] {guard} -> {' + '.join(parts)};")
            reward = expected_rewards(outcomes)
            if reward:
                paid.append(f"  [{actions[a]}] {guard} : {_number(reward)};")
    lines += ["endmodule", "", 'rewards "reward"', *(paid or ["  false : 0;"]), "endrewards", ""]
    for name, cases in _labels(task, variables):
        lines.append(f'label "{name}" = {" | ".join(f"({_guard(case)})" for case in cases) or "false"};')
    return ("\n".join(lines) + "\n").encode()


def _number(value: Number) -> str:
    """Return a rational; the language has ints of 64 bits, and decimals of any length."""
    exact = Fraction(value)
    if max(abs(exact.numerator), exact.denominator) < 2**63:
        return str(exact)
    return f"{exact.numerator}.0/{exact.denominator}.0"


def _updates(task: FrozenTask, variables: Sequence[Variable], s: int, target: int) -> str:
    """Return the assignments of the variables that change."""
    changed = []
    for v in variables:
        value = task.values[target][v.component]
        if value != task.values[s][v.component]:
            changed.append(f"({v.name}'={value})")
    return " & ".join(changed) or "true"


def property_of(task: FrozenTask, extreme: str) -> str:
    """Return the property whose value is the largest (`max`) or smallest (`min`) expected return of a settled task."""
    until = f"C<={task.horizon}" if task.horizon is not None else 'F "end"'
    return f'R{{"reward"}}{extreme}=? [{until}]'


def jani(task: FrozenTask) -> bytes:
    """Return the model of a settled task; rewards are assigned with each next state."""
    variables = _variables(task)
    actions = plain_words(task.actions, "a")
    edges = []
    for s, by_action in enumerate(task.outcomes):
        guard = _all({v.name: task.values[s][v.component] for v in variables})
        for a, outcomes in legal_choices(by_action):
            destinations = []
            for outcome in outcomes:
                assigned = [{"ref": v.name, "value": task.values[outcome.state][v.component]} for v in variables]
                assigned.append({"ref": "reward", "value": _ratio(outcome.reward)})
                destinations.append(
                    {"location": "only", "probability": {"exp": _ratio(outcome.probability)}, "assignments": assigned}
                )
            edges.append(
                {"location": "only", "action": actions[a], "guard": {"exp": guard}, "destinations": destinations}
            )
    declared: list[dict[str, Any]] = []
    for v in variables:
        kind = {"kind": "bounded", "base": "int", "lower-bound": v.low, "upper-bound": v.high}
        declared.append({"name": v.name, "type": kind, "initial-value": v.first})
    declared.append({"name": "reward", "type": "real", "initial-value": 0, "transient": True})
    truths = []
    for name, cases in _labels(task, variables):
        declared.append({"name": name, "type": "bool", "initial-value": False, "transient": True})
        truths.append({"ref": name, "value": _joined("∨", [_all(case) for case in cases], False)})
    used = [*dict.fromkeys(edge["action"] for edge in edges)]
    model = {
        "jani-version": 1, "name": "task", "type": "mdp", "features": ["derived-operators"],
        "metadata": {"description": f"{task.name}, by taskspec; {property_of(task, 'max')}"},
        "actions": [{"name": name} for name in used], "variables": declared, "properties": [],
        "automata": [{
            "name": "task", "locations": [{"name": "only", "transient-values": truths}], "initial-locations": ["only"],
            "edges": edges,
        }],
        "system": {
            "elements": [{"automaton": "task"}],
            "syncs": [{"synchronise": [name], "result": name} for name in used],
        },
    }  # fmt: skip
    return (json.dumps(model, indent=1) + "\n").encode()


def _all(values: Mapping[str, int]) -> Any:
    return _joined("∧", [{"op": "=", "left": name, "right": value} for name, value in values.items()], True)


def _joined(op: str, parts: Sequence[Any], empty: bool) -> Any:
    found: Any = parts[0] if parts else empty
    for part in parts[1:]:
        found = {"op": op, "left": found, "right": part}
    return found


def _ratio(value: Number) -> Any:
    exact = Fraction(value)
    if exact.denominator == 1:
        return exact.numerator
    return {"op": "/", "left": exact.numerator, "right": exact.denominator}
