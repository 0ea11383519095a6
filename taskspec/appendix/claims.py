"""Claims about exact results as sentences."""

from __future__ import annotations

from dataclasses import replace

from taskspec.appendix.prose import Formula, Inlines, Text
from taskspec.appendix.writing import Writing
from taskspec.exact.claims.vocabulary import MODELS, RESULTS
from taskspec.lang import syntax as s
from taskspec.printers import tree as m
from taskspec.printers.names import expression
from taskspec.printers.text import text
from taskspec.task.task import Claim


def claim(w: Writing, found: Claim) -> Inlines:
    """A claim with what it was written beside: the decision model, the tolerance, where the source states it."""
    options = found.options
    under = options.get("under")
    content = sentence(w, found.expr, None if under is None else expression(str(under)))
    if options.get("tolerance") is not None:
        content += (Text(", to within "), Formula(w.declared(options["tolerance"])))
    if options.get("where"):
        content += (Text(f" ({options['where']})"),)
    return content


def sentence(w: Writing, expr: s.Expr, under: s.Expr | None = None) -> Inlines:
    """A claim in words where it is about behaviour or reachability, as mathematics otherwise."""
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
