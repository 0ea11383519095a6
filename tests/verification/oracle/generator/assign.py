"""Values for components: random ones that stay inside their bounds, in all the forms that may stand in an expression's place."""

from __future__ import annotations

from typing import Any

from tests.verification.oracle.generator import conditions, draws, scalars
from tests.verification.oracle.generator.declarations import Component
from tests.verification.oracle.generator.tables import table
from tests.verification.oracle.generator.terms import Context, Shape, Term


def fitted(c: Context, to: Component, depth: int) -> Any:
    """What may be assigned to a component: sometimes an expression, sometimes cases, tables or draws."""
    if to.kind == "choice":
        return labelled(c, to, depth)
    if c.chance(0.12):
        return [
            {"if": conditions.condition(c, 1).text, "then": single(c, to, 0)},
            *([{"if": conditions.condition(c, 1).text, "then": single(c, to, 1)}] if c.chance(0.4) else []),
            {"else": single(c, to, depth)},
        ]
    if c.chance(0.08) and to.shape == ():
        return table(c, lambda: single(c.without_draws(), to, 0))
    if c.may_draw and to.shape == () and c.chance(0.15):
        return two_outcomes(c, to)
    return single(c, to, depth)


def two_outcomes(c: Context, to: Component) -> Any:
    """`{value: probability, ...}`: one of the values may be read from the state."""
    p = draws.probability(c.without_draws(), 1)
    if to.kind == "bool":
        return {True: p.text, False: f"1 - ({p.text})"}
    if not to.low:
        return {0: p.text, 1: f"1 - ({p.text})"}
    first = float(to.low) if to.kind == "real" else int(to.low)
    moved = scalars.term(c.without_draws(), to.kind, (), 1)
    if not moved.finite or not moved.reads:
        return {first: 1}
    return {first: p.text, f"max(min({moved.text}, {to.high}), {to.low})": f"1 - ({p.text})"}


def single(c: Context, to: Component, depth: int) -> str:
    """One expression within the bounds of the component."""
    if to.kind != "bool" and not to.low:
        return unbounded(c, to, depth)
    same = [n for n in c.names if n.text.rstrip("'") == to.name and n.kind == to.kind]
    if to.kind == "bool":
        options = [n for n in c.names if n.kind == "bool" and n.shape == to.shape]
        if options and c.chance(0.35):
            return c.rng.choice(options).text
        return scalars.term(c, "bool", to.shape, depth).text
    if same and c.chance(0.15):
        return same[0].text
    twins = copies(c, to)
    if twins and c.chance(0.2):
        return c.rng.choice(twins).text
    made = scalars.term(c, to.kind, to.shape, depth)
    if not made.finite:
        made = scalars.integer(c, 1) if to.shape == () else Term(to.low, "int")
    return within(c, to, made)


def copies(c: Context, to: Component) -> list[Term]:
    """Ints, read bare, that are certain to lie within the bounds of the component."""
    if to.kind != "int" or to.shape or not to.high.isdigit():
        return []
    least = int(to.low)
    most = int(to.high)
    ints = [n for n in c.names if n.kind == "int" and n.shape == () and n.rows]
    return [n for n in ints if least <= min(n.rows) and max(n.rows) <= most]


def unbounded(c: Context, to: Component, depth: int) -> str:
    """A value for a component without bounds: anything, or a walk."""
    made = scalars.term(c, to.kind, to.shape, depth)
    made = made if made.finite else scalars.integer(c, 0) if to.shape == () else Term("0", "int")
    if to.name in (n.text for n in c.names if n.shape == to.shape) and c.chance(0.6):
        return f"{to.name} + {made.at(6)}"
    return made.text if made.shape == to.shape else zeros(to.shape)


def zeros(shape: Shape) -> str:
    """A vector or a matrix of zeros."""
    return f"[{zeros(shape[1:])} for i in range({shape[0]})]" if shape else "0"


def within(c: Context, to: Component, made: Term) -> str:
    """The term, brought within the bounds of the component."""
    if to.kind == "int" and c.chance(0.25) and to.low == "0" and not to.high.startswith("("):
        return f"{made.at(6)} % ({to.high} + 1)"
    if c.chance(0.2):
        return f"max(min({made.text}, {to.high}), {to.low})"
    return f"clip({made.text}, {to.low}, {to.high})"


# ------------------------------------------------------------------------------ labels


def labelled(c: Context, to: Component, depth: int) -> Any:
    """A label: written, copied, chosen by cases or a table, or drawn."""
    labels = to.labels
    copies = [n.text for n in c.names if n.kind == "label" and n.labels == labels and same_meaning(n, to)]
    if copies and c.chance(0.3):
        return c.rng.choice(copies)
    if c.chance(0.2) and (found := numbered(c, to, depth)):
        return found
    one, other = (label(c, c.rng.choice(labels)) for _ in range(2))
    match c.rng.randrange(5 if c.may_draw else 4):
        case 0:
            return one
        case 1:
            return f"{one} if {conditions.condition(c, depth).at(1)} else {other}"
        case 2:
            return [{"if": conditions.condition(c, depth).text, "then": one}, {"else": other}]
        case 3:
            return table(c, lambda: c.rng.choice(labels))
    shares = {1: ["1"], 2: ["1/2", "1/2"], 3: ["1/2", "1/3", "1/6"]}[len(labels)]
    if c.chance(0.4):
        return f"Categorical({{{', '.join(f'{label(c, x)}: {p}' for x, p in zip(labels, shares, strict=True))}}})"
    return dict(zip(labels, shares, strict=True))


def numbered(c: Context, to: Component, depth: int) -> str | None:
    """A label by its number, or by the number that it stands for; None where it stands for none of its own."""
    position = f"{scalars.integer(c, depth).at(6)} % {len(to.labels)}"
    if not to.numbers:
        return position
    stand = list(to.data["values"].values())
    if to.means or len(set(stand)) < len(stand):
        return None
    return f"({', '.join(map(str, stand))},)[{position}]"


def same_meaning(name: Term, to: Component) -> bool:
    """Whether a choice with these labels can be copied: it must stand for the same numbers."""
    return name.text.rstrip("'") == to.name or (name.size == 1 and not to.numbers)


def label(c: Context, text: str) -> str:
    return conditions.label_text(c, text)
