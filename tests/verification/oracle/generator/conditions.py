"""Random conditions."""

from __future__ import annotations

from tests.verification.oracle.generator import draws, scalars, vectors
from tests.verification.oracle.generator.makers import Maker, chosen, defined, element, pick
from tests.verification.oracle.generator.terms import Context, Term, boolean, call, infix, joined


def condition(c: Context, depth: int) -> Term:
    known = [n for n in c.names if n.kind == "bool" and n.shape == ()]
    if depth <= 0 or c.chance(0.15):
        return c.rng.choice(known) if known and c.chance(0.8) else simple_condition(c)
    return pick(c, CONDITIONS, depth)


def simple_condition(c: Context) -> Term:
    labelled = [n for n in c.names if n.kind == "label"]
    if labelled and c.chance(0.4):
        return of_label(c, 0)
    ints = c.readable(("int",), ())
    if ints and c.chance(0.9):
        return infix(c.rng.choice(ints), c.rng.choice(RELATIONS), scalars.small_int(c), "bool", size=1)
    return boolean(c.chance(0.5))


RELATIONS = ("==", "!=", "<", "<=", ">", ">=")


def of_label(c: Context, depth: int) -> Term:
    labelled = [n for n in c.names if n.kind == "label"]
    if not labelled:
        return relation(c, depth)
    name = c.rng.choice(labelled)
    label = c.rng.choice(name.labels)
    written = label_text(c, label)
    if c.chance(0.25):
        members = c.rng.sample(name.labels, c.rng.randint(1, len(name.labels)))
        text = f"{name.text} {c.rng.choice(('in', 'not in'))} {{{', '.join(label_text(c, m) for m in members)}}}"
        return joined(text, "bool", (name,), level=4)
    op = c.rng.choice(("==", "!="))
    twins = [n for n in labelled if n.labels == name.labels and n.size == name.size == 1]
    if c.chance(0.3) and len(twins) > 1:
        other = c.rng.choice(twins)
        return joined(f"{name.text} {op} {other.text}", "bool", (name, other), level=4)
    pair = (name.text, written) if c.chance(0.8) else (written, name.text)
    return joined(f"{pair[0]} {op} {pair[1]}", "bool", (name,), level=4)


def label_text(c: Context, label: str) -> str:
    return f"'{label}'" if not label.isidentifier() or c.chance(0.05) else label


def relation(c: Context, depth: int) -> Term:
    kinds = c.rng.choice((("int", "int"), ("int", "int"), ("real", "real"), ("int", "real"), ("bool", "bool")))
    left, right = (scalars.term(c, k, (), depth) for k in kinds)
    return infix(left, c.rng.choice(RELATIONS), right, "bool", size=1)


def chain(c: Context, depth: int) -> Term:
    """`a <= b < c`, draws and all."""
    kind = c.rng.choice(("int", "int", "real"))
    parts = [scalars.term(c, kind, (), depth - 1) for _ in range(c.rng.choice((3, 3, 4)))]
    text = parts[0].at(5) + "".join(f" {c.rng.choice(RELATIONS)} {p.at(5)}" for p in parts[1:])
    return joined(text, "bool", parts, level=4)


def connective(c: Context, depth: int) -> Term:
    op = c.rng.choice(("and", "or"))
    left = condition(c, depth)
    right = condition(c, depth)
    return infix(left, op, right, "bool", size=1)


def negation(c: Context, depth: int) -> Term:
    inner = condition(c, depth)
    return joined(f"not {inner.at(3)}", "bool", (inner,), level=3)


def membership(c: Context, depth: int) -> Term:
    asked = scalars.integer(c, depth)
    op = c.rng.choice(("in", "not in"))
    if c.chance(0.3):
        return joined(f"{asked.at(5)} {op} range({c.rng.randint(1, 4)})", "bool", (asked,), level=4)
    parts = [scalars.integer(c, min(depth - 1, 1)) for _ in range(c.rng.randint(1, 3))]
    return joined(f"{asked.at(5)} {op} {{{', '.join(p.text for p in parts)}}}", "bool", (asked, *parts), level=4)


def quantified(c: Context, depth: int) -> Term:
    inner = vectors.any_vector(c, "bool", depth)
    return call(c.rng.choice(("any", "all")), [inner], "bool", size=1)


def flag_draw(c: Context, depth: int) -> Term:
    return draws.flag(c, depth) if c.may_draw else condition(c, depth)


CONDITIONS: list[tuple[float, Maker]] = [
    (5, relation),
    (2, chain),
    (3, of_label),
    (3, connective),
    (2, negation),
    (1.5, membership),
    (1.5, quantified),
    (1, chosen("bool")),
    (1, element("bool")),
    (0.7, defined("bool")),
    (1.5, flag_draw),
]
