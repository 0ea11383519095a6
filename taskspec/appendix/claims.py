"""Claims about exact results as sentences."""

from __future__ import annotations

from dataclasses import replace

from taskspec.appendix.prose import Formula, Inlines, Text
from taskspec.appendix.writing import Writing
from taskspec.lang import syntax as s
from taskspec.printers import tree as m

_RESULTS = {
    "optimal_return": "optimal return", "random_return": "random return", "worst_return": "worst return",
    "expert_return": "expert return", "states": "number of states",
}  # fmt: skip
_MODELS = {
    "optimal": "an optimal agent", "maxent": "a non-causal maximum-entropy learner",
    "soft": "a causal maximum-entropy agent", "expert": "the expert",
    "zero_terminal_value": "a learner that values every terminal state at zero", "uniform": "a random agent",
}  # fmt: skip


def sentence(w: Writing, expr: s.Expr) -> Inlines:
    """A claim in words where it is about behaviour or reachability, as mathematics otherwise."""
    match expr:
        case s.Call(function="prefers", args=(model, choice, *_)):
            where = dict(expr.keywords).get("at") or (expr.args[2] if len(expr.args) > 2 else None)
            found: Inlines = (*_model(w, model), Text(" prefers "), _truth(w, choice))
            return found if where is None else (*found, Text(" where "), _truth(w, where))
        case s.Call(function="reachable", args=(what,)):
            return (_truth(w, what), Text(" can be reached"))
        case s.Unary(op="not", operand=s.Call(function="reachable", args=(what,))):
            return (_truth(w, what), Text(" cannot be reached"))
        case s.Call(function="influences", args=(cause, effect)):
            return (_truth(w, cause), Text(" has an effect on "), _truth(w, effect))
        case s.Unary(op="not", operand=s.Call(function="influences", args=(cause, effect))):
            return (_truth(w, cause), Text(" has no effect on "), _truth(w, effect))
        case s.Unary(op="not", operand=operand):
            return (Text("it is not so that "), *sentence(w, operand))
        case s.Logical(op=op, operands=operands):
            parts = [sentence(w, o) for o in operands]
            return tuple(x for i, p in enumerate(parts) for x in ((Text(f" {op} "), *p) if i else p))
        case _:
            return (_truth(w, expr),)


def _truth(w: Writing, expr: s.Expr) -> Formula:
    words: dict[str, m.Math] = {name: m.Words(text) for name, text in _RESULTS.items()}
    chance: dict[str, m.Math] = {"probability": m.Ident("P", "blackboard")}
    return Formula(w.truth(expr, replace(w.notation.with_symbols(words | chance), events=frozenset({"probability"}))))


def _model(w: Writing, model: s.Expr) -> Inlines:
    match model:
        case s.Name(id=name) if name in _MODELS:
            return (Text(_MODELS[name]),)
        case s.Call(function=name, args=(beta,)) if name in _MODELS:
            temperature = m.Row((m.Ident("β"), m.Sym("="), w.math(beta)))
            return (Text(f"{_MODELS[name]} ("), Formula(temperature), Text(")"))
        case _:
            return (Formula(w.math(model)),)
