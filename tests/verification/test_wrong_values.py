"""Every wrong kind of value at every place of a spec and of a variant: a task, or diagnostics with places in the file.

The base spec has every key of the models, so that a new key is tested without a change here (a test sees to that).
"""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.codes import codes
from taskspec.base.diagnostics import Diagnostic, SpecError, render
from taskspec.exact import check
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.schema.export import json_schema
from tests.shared.sparse import sparse

Path = tuple[str | int, ...]
CORE: dict[str, Any] = {
    "taskspec": 1,
    "name": "Walk",
    "state": {"s": {"type": "int", "low": 0, "high": 3}},
    "action": {"a": {"type": "choice", "values": {"back": -1, "on": 1}}},
    "horizon": 4,
    "initial": {"s": 0},
    "dynamics": {"s'": "clip(s + a, 0, 3)"},
    "reward": "s' == 3",
}
# Sections that are laid over those of the core; together they have every key that there is.
FEATURES: dict[str, dict[str, Any]] = {
    "core": CORE,
    "words": {
        "title": "A walk", "summary": "Walk to the end.", "description": "Text with $x$.", "capability": "walking",
        "keywords": ["steps"],
        "sources": ["paper", {"key": "other", "where": "page 3"}],
        "errata": [{"source": "it said so", "here": "it does not", "because": "it is wrong", "about": ["reward"]}],
        "version": 1, "info": ["old_state", "new_state"], "accept": {"W506": "meant to be"},
        "roles": {"expert": "Walk", "learner": "WalkOther"}, "variants": {"other": {"title": "x"}},
    },
    "numbers": {
        "parameters": {
            "L": {"type": "int", "default": 3, "low": 1, "high": 9, "symbol": "L", "doc": "length", "alias": "n"},
            "p": {"type": "real", "default": "1/4", "low": 0, "high": 1},
            "require": [{"condition": "L > 0", "message": "too short"}],
        },
        "initial": {"s": "Bernoulli(p)"}, "horizon": "L + 1",
    },
    "labels": {
        "parameters": {
            "m": {"type": "choice", "default": "slow", "values": ["slow", "fast"]},
            "w": {"type": "choice", "default": "x", "values": {"x": 1, "y": 2}}, "b": {"type": "bool", "default": False},
        },
        "reward": "w if m == slow and not b else 0",
    },
    "constants": {
        "parameters": {"instance_seed": {"type": "int", "default": 0, "low": 0}},
        "constants": {"k": 2, "v": [1, 2, "k"], "drawn": "Normal(shape=2)"}, "reward": "v[s] + drawn[0]",
    },
    "grids": {
        "constants": {
            "k": 2, "map": {"grid": ["ab", "ba"], "legend": {"a": 0, "b": "k"}},
            "block": {"grid": "ab\nba\n", "legend": {"a": [0, 1], "b": [1, 0]}},
        },
        "reward": "map[0, s] + block[0, s][1]",
    },
    "names": {
        "definitions": {"twice": "2 * s", "plus(x, y)": "x + y", "near": [{"if": "s > 1", "then": True}, {"else": "s == 0"}]},
        "noise": {"slip": "Bernoulli(1/4)", "turn": {"0": "1/2", "1": "1/2"}},
        "reward": "twice + plus(s, slip) + near * turn",
    },
    "choices": {
        "state": {"c": {"type": "choice", "values": ["calm", "cross"], "symbols": ["c_0", "c_1"]}},
        "action": {"w": {"type": "bool", "symbol": "w", "doc": "wait"}},
        "initial": {"c": "calm"},
        "dynamics": {
            "c'": {"by": ["c", "w"], "rows": {"calm": {"true": "cross", "else": {"calm": "1/2", "cross": "1/2"}}, "else": "c"}},
        },
        "reward": {"by": "w", "rows": {"false": 0, "else": 1}}, "expert": {"w": "c == calm"},
    },
    "vectors": {
        "state": {"z": {"type": "int", "low": [0, 0], "high": [1, 1], "shape": [2]}},
        "action": {"u": {"type": "int", "low": 0, "high": 1}, "v": {"type": "int", "low": 0, "high": 1}},
        "initial": {"z": ["0", 1]}, "dynamics": {"z'": "(u, z[0])"},
        "reward": [{"if": "z'[0] == 1", "then": 1}, {"if": "u == v", "then": "-z[1] / 2"}, {"else": 0}],
        "expert": {"u": 1, "v": "z[0]"},
    },
    "measures": {"measures": {"cost": "s' - s", "far": {"value": "s > 1", "doc": "far"}}},
    "legal": {"legal": "a == on or s > 0", "expert": "on"},
    "observation": {"observation": {"space": "box", "s": "s", "o": {"value": "s + 1", "low": 0, "high": 99}}},
    "ends": {"terminal": "s' == 3", "discount": "9/10", "absorbing_reward": "s / 3", "expert": "on"},
    "memory": {
        "memory": {"m": {"type": "int", "low": 0, "high": 9, "initial": "s", "next": "min(m + s', 9)"}},
        "expert": {"a": "on if m > 4 else back"},
    },
    "claims": {
        "parameters": {"L": {"type": "int", "default": 3, "low": 1, "high": 9}},
        "claims": [
            "states > 1",
            {"claim": "actions == 2", "for": [{"L": 2}], "under": "optimal", "where": "page 1", "tolerance": 0.1, "episodes": 10},
        ],
        "variants": {"fewer": {"claims": {"drop": ["states > 1"], "add": [{"claim": "states > 2", "for": {"L": [2, 3]}}]}}},
    },
    "examples": {
        "examples": [
            {
                "doc": "the last step", "for": [{}], "state": {"s": 2}, "action": {"a": "on"}, "t": 3,
                "next": {"s": 3}, "reward": 1, "terminal": False, "truncated": True, "observation": {"s": 3}, "probability": 1,
            },
            {"initial": {"s": 0}},
        ],
    },
    "abstraction": {
        "claims": ["optimal_return == 2"],
        "abstraction": {
            "state": {"d": {"type": "int", "low": 0, "high": 3}}, "map": {"d": "s"}, "initial": {"d": 0},
            "dynamics": {"d'": "clip(d + a, 0, 3)"}, "reward": "d' == 3", "terminal": False, "expert": {"a": "on"},
        },
    },
    "symmetries": {
        "symmetries": {
            "mirror": {"doc": "from behind", "observation": {"s": "3 - s"}, "action": {"a": "back if a == on else on"}},
        },
        "variants": {"plain": {"symmetries": {"mirror": None}}},
    },
    "figure": {
        "constants": {"map": {"grid": ["ab"], "legend": {"a": 0, "b": 1}}},
        "figure": {
            "kind": "grid", "at": ["s", 0], "map": "map", "curve": "s", "values": "[s]", "objects": {"prey": ["s", 0]},
            "highlight": {"good": "s == 3", "bad": "s == 2", "end": "s == 3", "first": "s == 3", "second": "s == 3"},
        },
    },
}  # fmt: skip
WRONG: tuple[Any, ...] = (
    None, True, 3, -1, 0, 2.5, 1e999, math.inf, -math.inf, math.nan, 10**40, "", " ", "text", "s", "inf", "-inf", "0/0",
    "9**9**9",
    "2.0**2000", "10**300", "1 +", "a: b", [], [1], [[1, 2], [3]], ["s"], [None], {}, {"a": 1}, {"a": None}, {"a": {"b": 1}},
    {"1": "s"}, {"by": "s"}, {"by": "s", "rows": {"0": 1, "else": "s"}}, {"if": "s", "then": 1}, [{"if": "s > 0", "then": 1}],
    {"grid": ["ab"], "legend": {"a": 1}}, {"type": "int"}, "Normal()", "x'", "[s, s]", "c", "calm",
)  # fmt: skip
KEYS = (
    "",
    "1",
    "a b",
    "s'",
    "else",
    "true",
    "if",
    "f(",
    "f(x",
    "f()",
    "é",
    "x" * 300,
    "type",
    "base",
    "L",
    "sum",
    "_x",
    "{",
    "\t",
    "²",
)


def places(value: Any, path: Path = ()) -> Iterator[Path]:
    """Every value below the root, the outermost first."""
    for step in value if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ():
        yield (*path, step)
        yield from places(value[step], (*path, step))


PLACES = [(feature, path) for feature, sections in FEATURES.items() for path in places(sections)]
OVERRIDABLE = [p for p in PLACES if p[1][0] not in ("variants", "taskspec", "name")]


def spec_of(feature: str) -> dict[str, Any]:
    return copy.deepcopy(CORE | FEATURES[feature])


def at(spec: Any, path: Path) -> Any:
    for step in path:
        spec = spec[step]
    return spec


def replaced(feature: str, path: Path, value: Any) -> dict[str, Any]:
    """A spec with another value at a place."""
    spec = spec_of(feature)
    at(spec, path[:-1])[path[-1]] = value
    return spec


def overridden(feature: str, path: Path, value: Any) -> dict[str, Any]:
    """A spec with a variant that overrides a place, and of what lies around it no more than it must."""
    listed = next((i for i, step in enumerate(path) if isinstance(step, int)), len(path))
    over = value if listed == len(path) else at(replaced(feature, path, value), path[:listed])
    for step in reversed(path[:listed]):
        over = {step: over}
    spec = spec_of(feature)
    spec.setdefault("variants", {})["tried"] = over
    return spec


def renamed(feature: str, path: Path, key: str) -> dict[str, Any]:
    """A spec with another key at a place."""
    spec = spec_of(feature)
    parent = at(spec, path[:-1])
    entries = {key if k == path[-1] else k: v for k, v in parent.items()}
    parent.clear()
    parent.update(entries)
    return spec


def written(value: Any) -> str:
    """A value as YAML of one line."""
    match value:
        case dict():
            return "{" + ", ".join(f"{json.dumps(k)}: {written(v)}" for k, v in value.items()) + "}"
        case list():
            return "[" + ", ".join(map(written, value)) + "]"
        case float() if not math.isfinite(value):
            return ".nan" if value != value else "-.inf" if value < 0 else ".inf" if value == math.inf else "1e999"
        case _:
            return json.dumps(value)


def lines(spec: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)}: {written(value)}\n" for key, value in spec.items())


def outcome(text: str, variant: str | None = None, whole: bool = False) -> tuple[Diagnostic, ...]:
    """What is said about a spec: all that is done with it, from reading to a step, raises SpecError or nothing."""
    try:
        task = build(read_text(text, "walk.yaml"), variant)
        found = check(task, ranges=bool(task.parameters), with_warnings=whole, claims=whole).diagnostics
        env = taskspec.make(task)
        env.reset(seed=0)
        env.step(env.action_space.sample())
    except SpecError as error:
        return error.diagnostics
    return found


def assert_placed(text: str, found: tuple[Diagnostic, ...]) -> None:
    """Every diagnostic has a code, words, and a place inside the text."""
    rows = text.split("\n")
    for d in found:
        assert d.code in codes() and d.message
        if d.span is not None:
            assert 1 <= d.span.line <= d.span.end_line <= len(rows)
            assert 1 <= d.span.column <= len(rows[d.span.line - 1]) + 1
            assert 1 <= d.span.end_column <= len(rows[d.span.end_line - 1]) + 1
    render(found)


def assert_said(feature: str, spec: dict[str, Any], variant: str | None = None) -> None:
    text = "".join(f"{json.dumps(key)}: {written(value)}\n" for key, value in spec.items())
    try:
        assert_placed(text, outcome(text, variant, feature in ("claims", "abstraction", "symmetries", "figure")))
    except Exception as error:
        if hasattr(error, "add_note"):
            error.add_note(text)
        raise


@pytest.mark.parametrize("feature", FEATURES)
def test_the_specs_are_right(feature: str) -> None:
    text = written(spec_of(feature))
    assert [d for d in outcome(text) if d.severity == "error"] == []


def test_the_specs_have_every_key() -> None:
    used = {step for _, path in PLACES for step in path}
    assert {key for key, _ in _keys(json_schema())} - {"base", "extends"} <= used


def _keys(schema: Any) -> Iterator[tuple[str, Any]]:
    if isinstance(schema, dict):
        yield from schema.get("properties", {}).items()
    for part in schema.values() if isinstance(schema, dict) else schema if isinstance(schema, list) else ():
        yield from _keys(part)


def ids(value: Any) -> str:
    return value if isinstance(value, str) else ".".join(map(str, value))


@pytest.mark.parametrize(("feature", "path"), sparse(PLACES, 20), ids=ids)
def test_wrong_values_in_a_spec(feature: str, path: Path) -> None:
    for value in WRONG:
        assert_said(feature, replaced(feature, path, value))


@pytest.mark.parametrize(("feature", "path"), sparse(OVERRIDABLE, 20), ids=ids)
def test_wrong_values_in_a_variant(feature: str, path: Path) -> None:
    """Every second of them: a variant is merged first, and then read as a spec is."""
    for value in WRONG[OVERRIDABLE.index((feature, path)) % 2 :: 2]:
        assert_said(feature, overridden(feature, path, value), "tried")


GIVEN = (
    *(v for v in WRONG if not isinstance(v, dict)), 10**400, -(10**400), 2**63, 1e300, Fraction(1, 3), Decimal(3), 1j, b"x",
    np.int8(3), np.float32(3), np.float64("nan"), np.bool_(True), np.str_("slow"), np.array(3), np.array([1]), range(3), {1}, int,
)  # fmt: skip


@pytest.mark.parametrize("feature", ["numbers", "labels", "constants"])
def test_wrong_parameters(feature: str, tmp_path: FilePath) -> None:
    """Values of parameters from Python: a task, or one diagnostic that needs no place."""
    path = tmp_path / "walk.yaml"
    path.write_text(written(spec_of(feature)), encoding="utf-8")
    for name in FEATURES[feature]["parameters"]:
        for value in GIVEN:
            try:
                task = taskspec.load(path, **{name: value})
                taskspec.make(task).reset(seed=0)
                assert task.values[name] in (value, float(value) if isinstance(value, Fraction) else value)
            except SpecError as error:
                assert {d.code for d in error.diagnostics} <= {"E314", "E702", "E703", "E704", "E407"}, (name, value)


@pytest.mark.parametrize(("feature", "path"), sparse([p for p in PLACES if isinstance(p[1][-1], str)], 40), ids=ids)
def test_wrong_keys(feature: str, path: Path) -> None:
    for key in KEYS:
        assert_said(feature, renamed(feature, path, key))
