"""Names in print: the labels of a choice, and letters for indices."""

import pytest

from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.parse import parse
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.show.printers import tree as m
from taskspec.show.printers.expressions import mathematics
from taskspec.show.printers.markup import latex
from taskspec.show.printers.names import Notation, nowhere, of_task

PLACE = s.Place(nowhere(""), 0, 0)


def test_columns_of_a_table_may_be_expressions_beside_choices() -> None:
    """A label is printed by the symbol that its own choice has."""
    rows = (s.TableRow(parse(nowhere("1")), (s.TableRow(parse(nowhere("up")), parse(nowhere("L")), PLACE),), PLACE),
            s.TableRow(None, parse(nowhere("B")), PLACE))  # fmt: skip
    notation = Notation(labels={"move": {"up": m.Ident("U")}})
    found = s.Table((parse(nowhere("s + 1")), parse(nowhere("move"))), rows, PLACE)
    expected = r"\begin{cases} L & \text{if }s + 1 = 1 \land \mathrm{move} = U \\ B & \text{otherwise} \end{cases}"
    assert latex(mathematics(found, notation)) == expected


@pytest.mark.parametrize(
    ("source", "expected"),
    [("sum(d * x)", r"\sum_{i} dx_i"), ("sum(k * x)", r"\sum_{i} kx_i"), ("sum(l * x)", r"\sum_{i} lx_i"),
     ("sum(q * x)", r"\sum_{i} q_ix_i")],
    ids=["a definition", "a constant", "a noise", "unknown"],
)  # fmt: skip
def test_names_that_are_no_vectors_have_no_index(source: str, expected: str) -> None:
    task = build(read_text("""
taskspec: 1
name: Sums
constants: {k: 2}
noise: {l: Bernoulli(1/2)}
state: {x: {type: int, shape: 3, low: 0, high: 2}, j: {type: bool}}
action: {a: {type: bool}}
definitions: {d: 'x[0] + 1'}
horizon: 3
initial: {x: 0, j: false}
dynamics: {j': l}
reward: d + k
""", "sums.yaml"))  # fmt: skip
    assert latex(mathematics(parse(nowhere(source)), of_task(task))) == expected
