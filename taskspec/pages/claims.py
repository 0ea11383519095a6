"""Claims as sentences, and worked examples as a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby

from taskspec.lang import syntax as s
from taskspec.lang.ir import Role
from taskspec.pages import lines
from taskspec.pages.equations import Writing
from taskspec.pages.prose import CellTable, Formula, Inline, Inlines, Mark, Text, inlines, separated
from taskspec.printers import tree as m
from taskspec.printers.names import expression
from taskspec.printers.text import text
from taskspec.rules.claim_rules import MODELS, RESULTS
from taskspec.task.task import Claim, Example, Followed

_ENDS = {"terminal": "terminates", "truncated": "is truncated"}


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
    denied = isinstance(expr, s.Unary) and expr.op == "not"
    match expr.operand if isinstance(expr, s.Unary) and denied else expr:
        case s.Call(function="reachable", args=(what, *_)):
            return (_truth(w, what), Text(" cannot be reached" if denied else " can be reached"))
        case s.Call(function="influences", args=(cause, effect)):
            verb = " has no effect on " if denied else " has an effect on "
            return (_truth(w, cause), Text(verb), _truth(w, effect))
        case operand if denied:
            return (Text("it is not so that "), *sentence(w, operand, under))
        case s.Call(function="prefers") as call:
            names = ("model", "condition", "at") if under is None else ("condition", "at")
            given = dict(zip(names, call.args, strict=False)) | dict(call.keywords)
            content = (*_model(w, under or given["model"]), Text(" prefers "), _truth(w, given["condition"]))
            return (*content, Text(" where "), _truth(w, given["at"])) if "at" in given else content
        case s.Logical(op=op, operands=operands):
            return separated([sentence(w, o, under) for o in operands], f" {op} ")
        case _:
            return (_truth(w, expr, under),)


def _truth(w: Writing, expr: s.Expr, under: s.Expr | None = None) -> Formula:
    symbols: dict[str, m.Math] = {name: m.Words(word.phrase) for name, word in RESULTS.items()}
    if w.spec.abstraction is not None:
        symbols["states"] = m.Words("number of abstract states")
    symbols["probability"] = m.Ident("P", "blackboard")
    policy = "random" if under is None else text(under)
    return Formula(w.truth(expr, replace(w.notation.with_symbols(symbols), events={"probability": policy})))


def _model(w: Writing, model: s.Expr) -> Inlines:
    match model:
        case s.Name(id=name) if name in MODELS:
            return (Text(MODELS[name].phrase),)
        case s.Call(function=name, args=(number,)) if name in MODELS:
            return (Text(f"{MODELS[name].phrase} {MODELS[name].given} "), Formula(w.math(number)))
        case _:
            return (Formula(w.math(model)),)


def table(w: Writing, wrong: frozenset[int] = frozenset()) -> CellTable | None:
    """Return the examples of a task without columns that stay empty; None if there are none."""
    columns: dict[str, list[Inlines]] = {}
    for title, make in _COLUMNS:
        columns[title] = [make(w, example) for example in w.task.examples]
    entries = w.spec.examples
    columns[""] = [inlines(entry.doc) for entry in entries]
    kept = [(title, cells) for title, cells in columns.items() if any(cells)]
    if wrong:
        mark: Inlines = (Mark(False, "does not hold"),)
        kept.append(("", [mark if i in wrong else () for i in range(len(entries))]))
    if not kept:
        return None
    return CellTable(tuple(title for title, _ in kept), tuple(zip(*(cells for _, cells in kept), strict=True)))


def _given(role: Role) -> Callable[[Writing, Example], Inlines]:
    def cell(w: Writing, example: Example) -> Inlines:
        found = [w.equation(w.symbol(name), expr, name) for (of, name), expr in example.given.items() if of is role]
        if example.t and role is Role.STATE:
            found.append(m.Row((m.Ident("t"), m.Sym("="), m.Num(str(example.t)))))
        return _formulas(found)

    return cell


def _what_follows(w: Writing, example: Example) -> Inlines:
    """Return everything that follows, as one list."""
    ends = {f.section: f.expr for f in example.follows if f.section in _ENDS}
    said = [f for f in example.follows if f.section not in _ENDS]
    parts = [_of_section(w, section, list(found)) for section, found in groupby(said, lambda f: f.section)]
    if any(not isinstance(expr, s.Boolean) for expr in ends.values()):
        parts.append((Text("ends: "), *_formulas([w.truth(expr) for expr in ends.values()])))
    elif ends:
        words = [_ENDS[key] for key, expr in ends.items() if isinstance(expr, s.Boolean) and expr.value]
        parts.append((Text("the episode " + (" and ".join(words) or "goes on")),))
    if example.probability is not None:
        parts.append((Text("with probability "), Formula(w.math(example.probability))))
    return separated(parts)


def _of_section(w: Writing, section: str, found: list[Followed]) -> Inlines:
    """Return what follows in one section, after its word."""
    items = []
    for f in found:
        if f.name is None:
            items.append(w.math(f.expr))
        else:
            items.append(w.equation(w.symbol(f.name, section == "next"), f.expr, f.name))
    words = {"initial": "first", "reward": "reward", "observation": "observed", "expert": "expert"}
    before: list[Inline] = [Text(f"{words[section]} ")] if section in words else []
    return (*before, *_formulas(items))


def _formulas(items: list[m.Math]) -> Inlines:
    return separated([(Formula(item),) for item in items])


_COLUMNS: tuple[tuple[str, Callable[[Writing, Example], Inlines]], ...] = (
    ("for", lambda w, example: lines.cases(w, example.cases)),
    ("state", _given(Role.STATE)),
    ("action", _given(Role.ACTION)),
    ("what follows", _what_follows),
)
