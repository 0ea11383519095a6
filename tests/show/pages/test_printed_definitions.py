"""What pages print of definitions is what they mean: functions of numbers, lists of lists, both products, constants drawn once.

Random definitions of a whole task are printed, read back by the tests' own readers, and compared with the spec's text.
"""

from collections.abc import Callable
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from taskspec.language.expressions.parse import parse
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.pages import page
from taskspec.show.pages.prose import Formula, Text
from taskspec.show.printers import latex, mathml, plain
from taskspec.show.printers.names import nowhere
from tests.verification.printed import algebra as al
from tests.verification.printed import latex as tex
from tests.verification.printed import mathml as xml
from tests.verification.printed import reading, unicode
from tests.verification.printed.marks import Line, Mark, Script, Word
from tests.verification.printed.meaning import Meaning

SPEC = """
taskspec: 1
name: Definitions
parameters: {{L: {{type: int, default: 2, low: 1, high: 4}}, instance_seed: {{type: int, default: 0, low: 0}}}}
constants: {{v: [0, 5, 7, 9], w: [1, 2, 3, 4], h: "Normal(0, 1, shape=4)"}}
state: {{x: {{type: int, low: 0, high: 9}}, p: {{type: int, shape: [4], low: 0, high: 9}}}}
action: {{a: {{type: int, low: 0, high: 3}}}}
definitions:
  "f(b)": "{number}"
  "g(y)": "{vector}"
horizon: 3
initial: {{x: 0, p: 1}}
dynamics: {{x': "clip(x + a, 0, 9)"}}
reward: f(x) + f(a) + sum(g(x))
"""
VECTORS = ("v", "w", "h", "p")
READERS: tuple[tuple[Callable[[Any], str], Callable[[str], Line]], ...] = (
    (plain, unicode.read), (latex, tex.read), (mathml, xml.read),
)  # fmt: skip


@st.composite
def vectors(draw: Callable[..., Any], argument: str, depth: int = 2) -> str:
    """A vector of the spec, or one made of others and of a function's argument, element by element."""
    one = draw(st.sampled_from(VECTORS))
    number = draw(st.sampled_from((argument, "x", "3")))
    if depth == 0:
        return one
    other = draw(vectors(argument, depth - 1))
    forms = [f"{one} * {other}", f"{one} + {other}", f"{number} * {one}", f"{one} * ({other} == {number})",
             f"where({one} > {number}, {other}, {number})", f"{number} * {one} * {other}"]  # fmt: skip
    return draw(st.sampled_from([one, *(f"({form})" if "where" not in form else form for form in forms)]))


@st.composite
def numbers(draw: Callable[..., Any], argument: str = "b") -> str:
    """A number made of vectors, of a list of lists, or of both products."""
    vector = draw(vectors(argument))
    other = draw(st.sampled_from(VECTORS))
    return draw(st.sampled_from([
        f"sum({vector})", f"argmax({vector} == {argument})", f"count({vector} > {argument})", f"dot({other}, w)",
        f"dot(v, {other}) * {argument}", f"sum([[{argument} * i + j for j in range(L)] for i in range(3)])",
        f"prod([[i + j + {argument} for j in range(2)] for i in range(L)])", f"{other}[{argument}] + sum({other} * v)",
    ]))  # fmt: skip


@given(numbers(), vectors("y"), st.integers(0, 30))
def test_definitions_mean_on_paper_what_they_mean_in_the_spec(number: str, vector: str, point: int) -> None:
    found = page(build(read_text(SPEC.format(number=number, vector=vector), "definitions.yaml")))
    section = found.section("definitions")
    assert section is not None
    formulas = {}
    for line in section.lines:
        (formula, *rest) = line.content
        assert isinstance(formula, Formula)
        formulas[plain(formula.math).lstrip("(")[0]] = formula.math
        assert rest == ([Text(", drawn once per instance")] if plain(formula.math).startswith("h ∼") else [])
    names = {name: al.mixed(name, point) for name in (*VECTORS, "x", "b", "y", "L", "a")}
    meaning = Meaning(names, {"p": parse(nowhere("4"))})
    for name, text in (("f", number), ("g", vector)):
        for write, read in READERS:
            left, right = reading.split(read(write(formulas[name])), "=", first=True)
            expr = parse(nowhere(text))
            index = _index(left)
            if index is None:
                assert reading.value(right, names) == meaning.of(expr), (text, write(formulas[name]))
            else:
                bound = {**names, index: al.bound(0)}
                assert reading.value(right, bound, depth=1) == meaning.element(expr), (text, write(formulas[name]))


def _index(left: Line) -> str | None:
    """The index on the left side, `g(y)_i`."""
    last = left[-1]
    if not isinstance(last, Script) or last.sub is None or Mark(",") in last.sub:
        return None
    (word,) = last.sub
    assert isinstance(word, Word)
    return word.text
