"""The section on the abstraction: the finite task that exact results of a continuous one come from."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.appendix import lines
from taskspec.appendix.lines import Maker, formula
from taskspec.appendix.prose import Inlines, Text, inlines
from taskspec.appendix.writing import Writing
from taskspec.printers import tree as m
from taskspec.task.derived import build_abstract

_OWN: tuple[tuple[str, str, Maker], ...] = (
    ("initial", "initial state", lines.initial),
    ("dynamics", "dynamics", lines.dynamics),
    ("reward", "rewards", lines.rewards),
    ("terminal", "termination", lines.termination),
    ("expert", "expert", lines.expert),
)


def abstraction(w: Writing) -> Iterator[Inlines]:
    """Its components as functions of the state, and what it does not take from the task."""
    stand_in, written = build_abstract(w.task), w.spec.abstraction
    if stand_in is None or written is None:
        return
    own = Writing(stand_in, w.values, hatted=frozenset(written.state) & {*w.spec.state, *w.spec.action})
    exprs = w.parsed("abstraction")
    for c in stand_in.state:
        equation = w.equation(own.symbol(c.name), exprs[c.name])
        content: Inlines = (formula(equation, m.Sym("∈"), own.domain(c.name, written.state[c.name])),)
        yield (*content, Text(": "), *inlines(c.doc)) if c.doc else content
    for section, title, make in _OWN:
        if getattr(written, section) is not None:
            yield from ((Text(f"{title}: "), *line) for line in make(own))
    if own.hatted and any(getattr(written, section) is None for section, _, _ in _OWN):
        pairs = (m.Row((own.symbol(n), m.Words(" in place of "), own.plain.symbol(n))) for n in sorted(own.hatted))
        yield (Text("all else as above, with "), formula(m.joined(pairs)))
