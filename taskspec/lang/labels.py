"""Labels and ints: which label an int is, where a choice is given a value."""

from __future__ import annotations

from taskspec.lang import syntax as s
from taskspec.lang.basechecker import BaseChecker
from taskspec.lang.ir import Node
from taskspec.lang.scope import Value
from taskspec.lang.types import INT, Domain, Kind, Refused


def numbered(checker: BaseChecker, value: Value, expr: s.Expr, domain: Domain) -> Node:
    """A value as positions of labels: a label of the choice, or an int, which is the label of that position or value.

    What is no label's is -1, or beyond the last position.

    Raises:
        Refused: (E306) when it is neither, or when values of labels are no different ints.
    """
    if value.domain == domain:
        return value.node
    if value.domain is not None and value.domain.values is None:
        message = f"one of the labels {listed(domain)} is needed here, not a choice between other labels"
        pairs = ", ".join(f"{a}: {b}" for a, b in zip(value.domain.labels, domain.labels, strict=False))
        raise Refused(message, hint=f"a table says which goes with which: `{{by: ..., rows: {{{pairs}}}}}`")
    node = checker.number_of(value)
    if node.type.kind is Kind.REAL:
        message = f"one of the labels {listed(domain)} is needed here, not a real"
        raise Refused(message, hint="`floor(x)` and `round(x)` give ints")
    return _by_value(checker, checker.builder.cast(node, Kind.INT), domain)


def _by_value(checker: BaseChecker, node: Node, domain: Domain) -> Node:
    if domain.values is None or domain.value_type is None:
        return node
    b, values = checker.builder, domain.values
    if domain.value_type != INT or len(set(values)) < len(values):
        message = f"the labels {listed(domain)} do not stand for different ints, so a number does not identify a label"
        raise Refused(message, hint=_table(domain))
    if all(v == values[0] + i for i, v in enumerate(values)):  # type: ignore[operator]
        return b.apply("sub", node, b.scalar(values[0]))
    result: Node = b.scalar(-1)
    for position, number in enumerate(values):
        result = b.apply("where", b.apply("eq", node, b.scalar(number)), b.scalar(position), result)
    return result


def _table(domain: Domain) -> str:
    rows = ", ".join(f"{i}: {label}" for i, label in enumerate(domain.labels[:3]))
    more = ", ..." * (len(domain.labels) > 3)
    return f"a table gives each number its label: `{{by: i, rows: {{{rows}{more}}}}}`"


def listed(domain: Domain) -> str:
    """The labels of a choice in words, the first few of many."""
    return ", ".join(domain.labels[:6]) + ", ..." * (len(domain.labels) > 6)


def check_comparable(one: Domain | None, other: Domain | None) -> None:
    """Refuse (E306) to compare labels of two choices by where they stand in them."""
    if one is not None and other is not None and (one.values is None or other.values is None):
        message = f"labels of one choice ({listed(one)}) are not labels of another ({listed(other)})"
        shared = [label for label in one.labels if label in other.labels]
        hint = "where their positions are meant, say so with arithmetic: `x + 0 == y + 0`"
        if shared:  # positions would be something else
            hint = f"where labels of one name are meant, say which: `x == {shared[0]} and y == {shared[0]} or ...`"
        raise Refused(message, hint=hint)
