"""Claims in words, and worked examples as a table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import groupby

from taskspec.exact.rules.claim_rules import MODELS, RESULTS
from taskspec.language.expressions import syntax as s
from taskspec.language.expressions.types import Role
from taskspec.language.task.parts import Claim, Example, Followed
from taskspec.show.pages import lines
from taskspec.show.pages import prose as p
from taskspec.show.pages.equations import Writing
from taskspec.show.printers import tree as m
from taskspec.show.printers.names import expression
from taskspec.show.printers.text import text

_ENDS = {"terminal": "terminates", "truncated": "is truncated"}


def claim_text(w: Writing, claim: Claim) -> p.Inlines:
    """Return a claim with what it was written beside: the decision model, the tolerance, where the source states it."""
    options = claim.options
    under = None
    if options.get("under") is not None:
        under = expression(str(options["under"]))
    content = sentence(w, claim.expr, under)
    if options.get("tolerance") is not None:
        content += (p.Text(", to within "), p.Formula(w.declared(options["tolerance"])))
    if options.get("where"):
        content += (p.Text(f" ({options['where']})"),)
    return content


def sentence(w: Writing, expr: s.Expr, under: s.Expr | None = None) -> p.Inlines:
    """Return a claim in words where it is about behaviour or reachability, as mathematics otherwise."""
    match expr:
        case s.Unary(op="not", operand=s.Call(function="reachable", args=(what, *_))):
            return (_truth(w, what), p.Text(" cannot be reached"))
        case s.Call(function="reachable", args=(what, *_)):
            return (_truth(w, what), p.Text(" can be reached"))
        case s.Unary(op="not", operand=s.Call(function="influences", args=(cause, effect))):
            return (_truth(w, cause), p.Text(" has no effect on "), _truth(w, effect))
        case s.Call(function="influences", args=(cause, effect)):
            return (_truth(w, cause), p.Text(" has an effect on "), _truth(w, effect))
        case s.Unary(op="not", operand=operand):
            return (p.Text("it is not so that "), *sentence(w, operand, under))
        case s.Call(function="prefers") as call:
            names = ["model", "condition", "at"]
            if under is not None:
                del names[0]
            given = dict(zip(names, call.args, strict=False)) | dict(call.keywords)
            content = (*_model(w, under or given["model"]), p.Text(" prefers "), _truth(w, given["condition"]))
            if "at" in given:
                return (*content, p.Text(" where "), _truth(w, given["at"]))
            return content
        case s.Logical(op=op, operands=operands):
            return p.separated([sentence(w, o, under) for o in operands], f" {op} ")
        case _:
            return (_truth(w, expr, under),)


def _truth(w: Writing, expr: s.Expr, under: s.Expr | None = None) -> p.Formula:
    symbols: dict[str, m.Math] = {name: m.Words(word.phrase) for name, word in RESULTS.items()}
    if w.spec.abstraction is not None:
        symbols["states"] = m.Words("number of abstract states")
    symbols["probability"] = m.Ident("P", "blackboard")
    symbols["measure"] = m.Ident("E", "blackboard")
    policy = "random"
    if under is not None:
        policy = text(under)
    events = {"probability": policy, "measure": policy}
    return p.Formula(w.truth(expr, replace(w.notation.with_symbols(symbols), events=events)))


def _model(w: Writing, model: s.Expr) -> p.Inlines:
    match model:
        case s.Name(id=name) if name in MODELS:
            return (p.Text(MODELS[name].phrase),)
        case s.Call(function=name, args=(number,)) if name in MODELS:
            return (p.Text(f"{MODELS[name].phrase} {MODELS[name].given} "), p.Formula(w.math(number)))
        case _:
            return (p.Formula(w.math(model)),)


def examples(w: Writing, wrong: frozenset[int] = frozenset()) -> p.CellTable | None:
    """Return the examples of a task without columns that stay empty; None if there are none."""
    columns: dict[str, list[p.Inlines]] = {}
    for title, make in _COLUMNS:
        columns[title] = [make(w, example) for example in w.task.annotations.examples]
    entries = w.spec.examples
    columns[""] = [p.inlines(entry.doc) for entry in entries]
    kept = [(title, cells) for title, cells in columns.items() if any(cells)]
    if wrong:
        marks: list[p.Inlines] = [()] * len(entries)
        for i in wrong:
            marks[i] = (p.Mark(False, "does not hold"),)
        kept.append(("", marks))
    if not kept:
        return None
    titles, cells = zip(*kept, strict=True)
    return p.CellTable(titles, tuple(zip(*cells, strict=True)))


def _given(role: Role) -> Callable[[Writing, Example], p.Inlines]:
    def cell(w: Writing, example: Example) -> p.Inlines:
        equations: list[m.Math] = []
        for (of, name), expr in example.given.items():
            if of is role:
                equations.append(w.equation(w.symbol(name), expr, name))
        if example.t and role is Role.STATE:
            equations.append(m.equal(m.Ident("t"), m.Num(str(example.t))))
        return _formulas(equations)

    return cell


def _what_follows(w: Writing, example: Example) -> p.Inlines:
    ends = {}
    others = []
    for f in example.follows:
        if f.section in _ENDS:
            ends[f.section] = f.expr
        else:
            others.append(f)
    parts = []
    for section, same in groupby(others, lambda f: f.section):
        parts.append(_of_section(w, section, list(same)))
    if any(not isinstance(expr, s.Boolean) for expr in ends.values()):
        parts.append((p.Text("ends: "), *_formulas(list(map(w.truth, ends.values())))))
    elif ends:
        words = []
        for key, expr in ends.items():
            if isinstance(expr, s.Boolean) and expr.value:
                words.append(_ENDS[key])
        parts.append((p.Text("the episode " + (" and ".join(words) or "goes on")),))
    if example.probability is not None:
        parts.append((p.Text("with probability "), p.Formula(w.math(example.probability))))
    return p.separated(parts)


def _of_section(w: Writing, section: str, followed: list[Followed]) -> p.Inlines:
    items = []
    for f in followed:
        if f.name is None:
            items.append(w.math(f.expr))
        else:
            items.append(w.equation(w.symbol(f.name, section == "next"), f.expr, f.name))
    words = {"initial": "first", "reward": "reward", "observation": "observed", "expert": "expert"}
    if section in words:
        return (p.Text(f"{words[section]} "), *_formulas(items))
    return _formulas(items)


def _formulas(items: list[m.Math]) -> p.Inlines:
    return p.separated([(p.Formula(item),) for item in items])


_COLUMNS: tuple[tuple[str, Callable[[Writing, Example], p.Inlines]], ...] = (
    ("for", lambda w, example: lines.cases(w, example.cases)),
    ("state", _given(Role.STATE)),
    ("action", _given(Role.ACTION)),
    ("what follows", _what_follows),
)
