"""No code from data: whatever a spec's names, labels, texts and file are called, the generated source is the same program.

A spec is written with plain names and with hostile ones. On every backend the two sources have the same syntax tree when names
are numbered in the order in which they appear, the same names but for those of components, which have a prefix, and the
same texts but for a docstring and the keys of observations.
"""

from __future__ import annotations

import ast
import builtins
import json
import random
from collections.abc import Iterator
from functools import cache
from typing import Any

import pytest

import taskspec
from taskspec.base.diagnostics import SpecError
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.programs.numba.module import generate
from taskspec.programs.numpy import compile_numpy
from taskspec.programs.scalar import compile_scalar
from tests.shared.for_each import for_each
from tests.verification.fuzz import corpus

NAMED = ("s", "m", "v", "a", "b", "p", "tab", "twice", "wind", "gust", "o", "u")
PLAIN = ("sa", "ma", "va", "aa", "ba", "pa", "ta", "da", "wa", "ga", "oa", "ua")
LABELS = ("one", "two", "go", "off")
TEXTS = ("a text", "plain.yaml", "suite")
PREFIXES = ("s_", "a_", "n_s_")

Names = tuple[str, ...]


def spec(names: Names, labels: Names, text: str) -> dict[str, Any]:
    """Has every kind of name, label and text that reaches a generator."""
    s, m, v, a, b, p, tab, twice, wind, gust, o, u = names
    one, two, go, off = labels
    return {
        "taskspec": 1, "name": "Walk", "title": text, "summary": text, "description": text, "capability": text,
        "parameters": {p: {"type": "int", "default": 2, "low": 1, "high": 9, "doc": text}},
        "constants": {tab: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10]}, "definitions": {f"{twice}({u})": f"2 * {u}"},
        "noise": {wind: "UniformInt(0, 1)", gust: "Normal()"},
        "state": {
            s: {"type": "int", "low": 0, "high": 9, "doc": text}, m: {"type": "choice", "values": [one, two], "doc": text},
            v: {"type": "real", "shape": 3, "low": -9, "high": 9},
        },
        "action": {a: {"type": "choice", "values": [go, off]}, b: {"type": "int", "low": 0, "high": 3, "doc": text}},
        "horizon": 10, "initial": {s: "UniformInt(0, 9)", m: one, v: "Normal(shape=3)"},
        "dynamics": {
            f"{s}'": f"clip({s} + {twice}({wind}) + {b}, 0, 9)", f"{m}'": {"by": a, "rows": {go: one, off: two}},
            f"{v}'": f"clip({v} + {gust}, -9, 9)",
        },
        "reward": {"by": m, "rows": {one: f"{tab}[{s}'] + {p}", two: f"sum({v}) * exp({gust})"}},
        "terminal": f"{s}' == 9", "observation": {o: f"{s} + 1", s: v, "space": "dict"},
    }  # fmt: skip


def task_of(names: Names, labels: Names, texts: Names) -> Task:
    text, file, suite = texts
    return build(read_text(json.dumps(spec(names, labels, text), ensure_ascii=False), file), None, {}, suite)


def sources(task: Task) -> Iterator[tuple[str, str]]:
    """Each backend with its source."""
    yield "scalar", compile_scalar(task).source
    for mode in ("next_step", "same_step", "disabled"):
        yield f"numpy {mode}", compile_numpy(task, mode).source
        yield f"numba {mode}", generate(task, mode)[0]
    jax = pytest.importorskip("taskspec.programs.jax.program", exc_type=SpecError)
    yield "jax", jax.compile_jax(task).source


def shape(source: str) -> list[Any]:
    """The syntax tree as a list: names as numbers, in the order in which they first appear; texts left out."""
    numbers: dict[str, int] = {}
    found: list[Any] = []
    for node in ast.walk(ast.parse(source)):
        found.append(type(node).__name__)
        for field, value in ast.iter_fields(node):
            if field in ("id", "arg", "name") and isinstance(value, str) and not isinstance(node, ast.alias):
                found.append(numbers.setdefault(value, len(numbers)))
            elif not isinstance(value, ast.AST | list):
                found.append(0 if isinstance(value, str) and isinstance(node, ast.Constant) else value)
    return found


def words(source: str, names: Names) -> tuple[set[str], set[str]]:
    """The names and texts in a source that are not those of components, the docstring left out."""
    numbers = ("0", "1", "2")  # in the place of names that are not ASCII
    own = {prefix + name for name in names + numbers for prefix in PREFIXES}
    tree = ast.parse(source)
    head = tree.body.pop(0)
    assert isinstance(head, ast.Expr) and isinstance(head.value, ast.Constant)
    called = {getattr(n, field, None) for n in ast.walk(tree) for field in ("id", "arg", "name", "attr", "module")}
    keys = {k for n in ast.walk(tree) if isinstance(n, ast.Dict) for k in n.keys}
    assert {k.value for k in keys if isinstance(k, ast.Constant)} <= set(names)
    texts = {
        n.value
        for n in ast.walk(tree)
        if isinstance(n, ast.Constant) and isinstance(n.value, str | bytes) and n not in keys
    }
    return {name for name in called if isinstance(name, str)} - own, texts  # type: ignore[arg-type]


@cache
def plain() -> tuple[Task, dict[str, str]]:
    task = task_of(PLAIN, LABELS, TEXTS)
    return task, dict(sources(task))


def compare(names: Names, labels: Names = LABELS, texts: Names = TEXTS) -> None:
    task = task_of(names, labels, texts)
    (other, expected) = plain()
    for backend, source in sources(task):
        assert shape(source) == shape(expected[backend]), backend
        assert words(source, names) == words(expected[backend], PLAIN), backend
    assert played(task) == played(other)


def played(task: Task) -> list[Any]:
    env = taskspec.make(task)
    found = []
    for k in range(12):
        if not k or any(found[-1][1:]):
            env.reset(seed=3 if not k else None)
        found.append(env.step([k % 2, k % 4])[1:4])
    return found


# What the generators call their own, what Python does, and identifiers of other scripts.
HOSTILE = """
    exec eval compile open print os sys np numpy rt xp add take copyto index singles lane lanes step reset get alive past
    episodes t0 kept h0 h1 v1 v2 C0 C1 b0 o0 w0_0 s_s a_a n_s_s s_sa n action memory data first every what total terminated
    truncated ended seen0 final0 FIRST HORIZON ONE inner apart kernel advance begin check self cls type object globals locals
    vars getattr setattr input breakpoint quit bisect_right nan é λ 変数 x١ ñ_1 Ωmega ß TypeError ValueError as_ints as_floats
    bad_action not_running next_first next_draws math i64 f32 select boxed release jnp jax
""".split()  # noqa: SIM905
REFUSED = """
    class lambda import __class__ __import__ __builtins__ a;b x' ' " \\ a.b a[0] 1x __import__('os').system('x') ﬁ 𝐱 a#b f'{x}'
    None True
""".split()  # noqa: SIM905
CODE = [
    '"""\nraise SystemExit("ran")\n"""\\', "\'\'\'", "\\", '"', "'", "a\nb", "{x}", "%s", "#", "\x1b[2J",
    "\u202e", "'; import os; '", "__import__('os').system('x')", '\\"', "\\N{DIGIT ONE}", "\\x41", "# -*- coding: latin-1 -*-",
    "é", "\U0001f40d",
]  # fmt: skip


@for_each("first", range(0, len(HOSTILE), 9))
def test_every_name_in_every_place(first: int) -> None:
    compare(tuple((HOSTILE * 2)[first : first + len(NAMED)]))


@for_each("text", CODE[::2])
def test_every_text_in_every_place(text: str) -> None:
    compare(PLAIN, (text, text * 2, f"{text} ", f"x{text}"), (text, text, text))


@for_each("seed", range(8))
def test_mixtures(seed: int) -> None:
    chance = random.Random(seed)
    texts = ["".join(chance.choices(CODE, k=3)) + str(i) for i in range(7)]
    compare(tuple(chance.sample(HOSTILE, len(NAMED))), tuple(texts[:4]), tuple(texts[4:]))


@for_each("name", [*REFUSED, "", "a b", "a\nb", "x\u200b"])
def test_what_is_no_name_is_refused(name: str) -> None:
    for place in range(len(NAMED)):
        with pytest.raises(SpecError):
            task_of((*PLAIN[:place], name, *PLAIN[place + 1 :]), LABELS, TEXTS)


# -- what generated code uses at all ---------------------------------------------------------------------------------

USED = {
    "abs",
    "float",
    "int",
    "len",
    "list",
    "max",
    "min",
    "range",
    "round",
    "sorted",
    "zip",
    "TypeError",
    "ValueError",
}


def test_generated_code_uses_few_builtins_and_nothing_hidden() -> None:
    """In the sources of all specs of the repository."""
    seen = 0
    for content in corpus.seeds()[::48]:
        try:
            task = build(read_text(content.decode(), "spec.yaml"))
            found = dict(sources(task))
        except (SpecError, UnicodeError):
            continue
        seen += 1
        for source in found.values():
            nodes = list(ast.walk(ast.parse(source)))
            loaded = {n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
            stored = {n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
            assert {n for n in loaded - stored if hasattr(builtins, n)} <= USED
            assert {n.attr for n in nodes if isinstance(n, ast.Attribute) and n.attr.startswith("_")} <= {"__class__"}
            imported = {n.module for n in nodes if isinstance(n, ast.ImportFrom)}
            assert all(module == "math" or str(module).startswith("taskspec.programs.numba.") for module in imported)
            assert {a.name for n in nodes if isinstance(n, ast.Import) for a in n.names} <= {"numpy"}
    assert seen > 3
