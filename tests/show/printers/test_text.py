"""Surface syntax printed as text parses to the same tree, with no bracket too many."""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskspec.base.diagnostics import Collector
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse
from taskspec.language.source import read_file
from taskspec.language.task.forms import Forms
from taskspec.language.task.merge import merge
from taskspec.show.printers.names import nowhere
from taskspec.show.printers.text import text
from tests.shared.expression_data import data
from tests.shared.for_each import for_each

PLACE = s.Place(nowhere(""), 0, 0)
ROOT = Path(__file__).parents[3]


def bare(node: Any) -> Any:
    """A tree without places, to compare."""
    if isinstance(node, tuple):
        return tuple(bare(x) for x in node)
    if isinstance(node, s.Place):
        return None
    if dataclasses.is_dataclass(node):
        return (type(node).__name__, *(bare(getattr(node, f.name)) for f in dataclasses.fields(node)))
    return node


def parsed(written: str) -> s.Expr:
    return parse(nowhere(written))


NAMES = st.sampled_from(["x", "y", "L", "c_0", "s"])
LEAVES = st.one_of(
    st.integers(0, 99).map(lambda n: s.Number(n, str(n), PLACE)),
    st.sampled_from(["0.5", "1e-3", "2.0"]).map(lambda t: s.Number(float(t), t, PLACE)),
    st.booleans().map(lambda b: s.Boolean(b, PLACE)),
    st.sampled_from(["go-left", "it's", 'a "b"']).map(lambda t: s.Quoted(t, PLACE)),
    st.builds(lambda n, p: s.Name(n, p, PLACE), NAMES, st.booleans()),
)
OPERATORS = st.sampled_from(["==", "!=", "<", "<=", ">", ">=", "in", "not in"])
ARITHMETIC = st.sampled_from(["+", "-", "*", "/", "//", "%", "**"])


def _branches(inner: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    pairs = st.lists(st.tuples(inner, inner), min_size=1, max_size=2).map(tuple)
    several = st.lists(inner, min_size=2, max_size=3).map(tuple)
    part = st.none() | inner
    links = st.lists(st.tuples(OPERATORS, inner), min_size=1, max_size=2).map(tuple)
    clause = st.builds(s.Clause, st.just(("i",)), inner, st.lists(inner, max_size=2).map(tuple))
    index = inner | st.builds(lambda a, b, c: s.Slice(a, b, c, PLACE), part, part, part)
    return st.one_of(
        st.builds(lambda o, x: s.Unary(o, x, PLACE), st.sampled_from(["-", "+", "not"]), inner),
        st.builds(lambda o, x, y: s.Binary(o, x, y, PLACE), ARITHMETIC, inner, inner),
        st.builds(lambda o, x: s.Logical(o, x, PLACE), st.sampled_from(["and", "or"]), several),
        st.builds(lambda x, r: s.Compare(x, r, PLACE), inner, links),
        st.builds(lambda c, x, y: s.IfElse(c, x, y, PLACE), inner, inner, inner),
        st.builds(lambda a, k: s.Call("f", a, tuple(k.items()), PLACE, PLACE), st.lists(inner, max_size=2).map(tuple),
                  st.dictionaries(st.just("shape"), inner)),
        st.builds(lambda v, i: s.Subscript(v, i, PLACE), inner, st.lists(index, min_size=1, max_size=2).map(tuple)),
        st.builds(lambda i: s.Vector(i, PLACE), st.lists(inner, max_size=3).map(tuple)),
        st.builds(lambda i: s.SetOf(i, PLACE), several),
        st.builds(lambda p: s.Weights(p, PLACE), pairs),
        st.builds(lambda e, c, k: s.Comprehension(e, (c,), k, PLACE), inner, clause, st.booleans()),
    )  # fmt: skip


TREES = st.recursive(LEAVES, _branches, max_leaves=12)


@given(TREES)
def test_any_tree_comes_back(tree: s.Expr) -> None:
    written = text(tree)
    assert bare(parsed(written)) == bare(tree), written


@for_each(
    "written",
    ["a - (b - c)", "(a - b) - c", "-x**2", "(-x)**2", "a**b**c", "(a**b)**c", "not a == b", "(not a) == b", "x[1:]",
     "x[::2]", "(a if b else c) if d else e", "{p for p in box(-B, B, 2) if norm1(p) <= B}", "(a, b)[i]", "x[i, j]",
     "(a < b) == c", "a * (b / c)", "a / b / c", "x[[1, 2]]", "(a and b) or c"],
)  # fmt: skip
def test_awkward_precedences(written: str) -> None:
    assert bare(parsed(text(parsed(written)))) == bare(parsed(written))


@pytest.mark.parametrize(
    ("written", "least"),
    [
        ("((a)) + (b*c)", "a + b * c"),
        ("(a+b)+c", "a + b + c"),
        ("((x)[0])", "x[0]"),
        ("(a) if (b) else (c)", "a if b else c"),
    ],
)
def test_brackets_are_the_fewest(written: str, least: str) -> None:
    assert text(parsed(written)) == least


@for_each("path", sorted(ROOT.glob("tasks/*/*.yaml")))
def test_sections_of_shipped_specs_come_back_as_yaml(path: Path) -> None:
    """Every expression, tables and `if:` lists included, read again from its printed YAML data."""
    merged = merge(read_file(path))
    forms = Forms(merged, Collector())
    for section in ("definitions", "initial", "dynamics", "reward", "terminal"):
        found = merged.data.get(section)
        named = section not in ("reward", "terminal") and isinstance(found, dict)
        for place in [(section, key) for key in found] if named else [(section,)] * (found is not None):
            tree = forms.expr(place)
            assert bare(forms.tree(data(tree), place)) == bare(tree)  # type: ignore[arg-type]


def test_cases_are_written_as_conditions() -> None:
    branches = ((parsed("x > 1"), parsed("2")), (parsed("x if y else s"), parsed("3")))
    found = s.Piecewise(branches, parsed("4 + x"), PLACE)
    assert text(found) == "2 if x > 1 else 3 if (x if y else s) else 4 + x"


@for_each("written", ["true", "True"])
def test_truth_values_are_printed_alike(written: str) -> None:
    assert text(parsed(f"2 if s == 0 and {written} else 1")) == text(parsed("2 if s == 0 and True else 1"))
