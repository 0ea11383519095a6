"""Claims as sentences, and worked examples as a table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import groupby

from taskspec.lang import syntax as s
from taskspec.lang.ir import Role
from taskspec.pages import lines
from taskspec.pages.equations import Writing
from taskspec.pages.prose import CellTable, Formula, Inlines, Mark, Text, inlines
from taskspec.printers import tree as m
from taskspec.printers.names import expression
from taskspec.printers.text import text
from taskspec.rules.claim_rules import MODELS, RESULTS
from taskspec.task.task import Claim, Example, Followed


def claim(w: Writing, found: Claim) -> Inlines:
    """Return a claim with what it was written beside: the decision model, the tolerance, where the source states it."""
    options = found.options
    under = options.get("under")
    content = sentence(w, found.expr, None if under is None else expression(str(under)))
    if options.get("tolerance") is not None:
        content += (Text(", to within "), Formula(w.declared(options["tolerance"])))
    if options.get("where"):
        content += (Text(f" ({options['where']})"),)
    return content


def sentence(w: Writing, expr: s.Expr, under: s.Expr | None = None) -> Inlines:
    """Return a claim in words where it is about behaviour or reachability, as mathematics otherwise."""
    match expr:
        case s.Call(function="prefers"):
            return _preference(w, expr, under)
        case s.Call(function="reachable", args=(what, *_)):
            return (_truth(w, what), Text(" can be reached"))
        case s.Unary(op="not", operand=s.Call(function="reachable", args=(what, *_))):
            return (_truth(w, what), Text(" cannot be reached"))
        case s.Call(function="influences", args=(cause, effect)):
            return (_truth(w, cause), Text(" has an effect on "), _truth(w, effect))
        case s.Unary(op="not", operand=s.Call(function="influences", args=(cause, effect))):
            return (_truth(w, cause), Text(" has no effect on "), _truth(w, effect))
        case s.Unary(op="not", operand=operand):
            return (Text("it is not so that "), *sentence(w, operand, under))
        case s.Logical(op=op, operands=operands):
            parts = [sentence(w, o, under) for o in operands]
            return tuple(x for i, p in enumerate(parts) for x in ((Text(f" {op} "), *p) if i else p))
        case _:
            return (_truth(w, expr, under),)


def _preference(w: Writing, expr: s.Call, under: s.Expr | None) -> Inlines:
    names = ("model", "condition", "at") if under is None else ("condition", "at")
    given = dict(zip(names, expr.args, strict=False)) | dict(expr.keywords)
    content: Inlines = (*_model(w, under or given["model"]), Text(" prefers "), _truth(w, given["condition"]))
    return (*content, Text(" where "), _truth(w, given["at"])) if "at" in given else content


def _truth(w: Writing, expr: s.Expr, under: s.Expr | None = None) -> Formula:
    words: dict[str, m.Math] = {name: m.Words(word.phrase) for name, word in RESULTS.items()}
    if w.spec.abstraction is not None:
        words["states"] = m.Words("number of abstract states")
    chance: dict[str, m.Math] = {"probability": m.Ident("P", "blackboard")}
    policy = "random" if under is None else text(under)
    return Formula(w.truth(expr, replace(w.notation.with_symbols(words | chance), events={"probability": policy})))


def _model(w: Writing, model: s.Expr) -> Inlines:
    match model:
        case s.Name(id=name) if name in MODELS:
            return (Text(MODELS[name].phrase),)
        case s.Call(function=name, args=(number,)) if name in MODELS:
            return (Text(f"{MODELS[name].phrase} {MODELS[name].given} "), Formula(w.math(number)))
        case _:
            return (Formula(w.math(model)),)


# -- worked examples as a table


def table(w: Writing, wrong: frozenset[int] = frozenset()) -> CellTable | None:
    """Return the examples of a task without columns that stay empty; None if there are none."""
    written = w.spec.examples
    columns = [(title, tuple(make(w, e) for e in w.task.examples)) for title, make in _COLUMNS if w.task.examples]
    columns.append(("", tuple(inlines(entry.doc) for entry in written)))
    columns.append(("", tuple(_mark(i in wrong) for i in range(len(written)))))
    kept = [(title, cells) for title, cells in columns if any(cells)]
    return (
        CellTable(tuple(t for t, _ in kept), tuple(zip(*(cells for _, cells in kept), strict=True))) if kept else None
    )


def _mark(wrong: bool) -> Inlines:
    return (Mark(False, "does not hold"),) if wrong else ()


def _cases(w: Writing, example: Example) -> Inlines:
    return lines.cases(w, example.cases)


def _given(role: Role) -> Callable[[Writing, Example], Inlines]:
    def cell(w: Writing, example: Example) -> Inlines:
        found = [(name, expr) for (of, name), expr in example.given.items() if of is role]
        time = [m.Row((m.Ident("t"), m.Sym("="), m.Num(str(example.t))))] if example.t and role is Role.STATE else []
        return _joined([*(w.equation(w.symbol(name), expr, name) for name, expr in found), *time])

    return cell


def _what_follows(w: Writing, example: Example) -> Inlines:
    """Return everything that follows, as one list."""
    said = [f for f in example.follows if f.section not in _ENDS]
    parts = [_of(w, section, list(found)) for section, found in groupby(said, lambda f: f.section)]
    parts += [_ends(w, example)] if len(said) < len(example.follows) else []
    if example.probability is not None:
        parts.append((Text("with probability "), Formula(w.math(example.probability))))
    return tuple(piece for i, part in enumerate(parts) for piece in ((Text(", "), *part) if i else part))


def _of(w: Writing, section: str, found: list[Followed]) -> Inlines:
    """Return what follows in one section, after its word."""
    word = Text(f"{_WORDS[section]} ") if section in _WORDS else None
    items = [
        w.math(f.expr) if f.name is None else w.equation(w.symbol(f.name, section == "next"), f.expr, f.name)
        for f in found
    ]
    return (*([word] if word else []), *_joined(items))


_WORDS = {"initial": "first", "reward": "reward", "observation": "observed", "expert": "expert"}
_ENDS = {"terminal": "terminates", "truncated": "is truncated"}


def _ends(w: Writing, example: Example) -> Inlines:
    """Return whether the episode ends, and how."""
    said = {f.section: f.expr for f in example.follows if f.section in _ENDS}
    if any(not isinstance(expr, s.Boolean) for expr in said.values()):
        return (Text("ends: "), *_joined([w.truth(expr) for expr in said.values()]))
    words = [_ENDS[key] for key, expr in said.items() if isinstance(expr, s.Boolean) and expr.value]
    return (Text("the episode " + (" and ".join(words) or "goes on")),)


def _joined(items: list[m.Math]) -> Inlines:
    return tuple(_with_commas(items))


def _with_commas(items: list[m.Math]) -> Iterator[Text | Formula]:
    for i, item in enumerate(items):
        if i:
            yield Text(", ")
        yield Formula(item)


_COLUMNS: tuple[tuple[str, Callable[[Writing, Example], Inlines]], ...] = (
    ("for", _cases),
    ("state", _given(Role.STATE)),
    ("action", _given(Role.ACTION)),
    ("what follows", _what_follows),
)
