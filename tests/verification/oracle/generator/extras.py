"""The sections that a task may do without: terminal, observation, expert, variants."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tests.verification.oracle.generator import conditions, scalars
from tests.verification.oracle.generator.assign import fitted
from tests.verification.oracle.generator.terms import call, number

if TYPE_CHECKING:
    from tests.verification.oracle.generator.declarations import Component
    from tests.verification.oracle.generator.spec import Draft

EVERYTHING = {"state", "action", "prime", "t", "noise"}


def add(d: Draft) -> None:
    if d.asks_end or d.chance(0.6):
        d.data["terminal"] = terminal(d)
    if d.chance(0.2):
        made = scalars.term(d.context({"state", "t"}), "int", (), 1)
        d.data["absorbing_reward"] = made.text
    if d.chance(0.6):
        d.data["observation"] = observation(d)
    if d.chance(0.35):
        d.data["expert"] = expert(d)
    if d.chance(0.25):
        d.data["variants"] = variants(d)
    if d.chance(0.3):
        d.data["measures"] = measures(d)
    if d.chance(0.3) and len(d.action) == 1 and not d.action[0].shape and d.action[0].kind in ("bool", "choice"):
        legal(d)


def legal(d: Draft) -> None:
    """Add a condition that always allows one action; an expert takes that one."""
    (c,) = d.action
    allowed: Any = True
    test = c.name
    if c.kind == "choice":
        allowed = next(label for label in c.labels if label.isidentifier())
        test = f"{c.name} == {allowed}"
    if "expert" in d.data and d.data["expert"] != "optimal":
        d.data["expert"] = {c.name: allowed}
    condition = conditions.condition(d.context({"state", "action"}), d.depth()).text
    d.data["legal"] = f"({condition}) or {test}"


def measures(d: Draft) -> dict[str, Any]:
    """One or two measures, which may draw."""
    c = d.context(EVERYTHING, draws=d.chance(0.2))
    found: dict[str, Any] = {"cost": scalars.term(c, d.rng.choice(("bool", "int", "real")), (), d.depth()).text}
    if d.chance(0.3):
        found["other"] = {"value": scalars.integer(c, 1).text, "doc": "something else"}
    return found


def terminal(d: Draft) -> str | bool:
    flags = [n.text for n in d.context(EVERYTHING).names if n.kind == "bool" and n.shape == ()]
    if flags and d.chance(0.4):
        return d.rng.choice(flags)
    if d.chance(0.05):
        return d.rng.choice((True, False, "1 == 2"))
    return conditions.condition(d.context(EVERYTHING, draws=d.chance(0.2)), d.depth()).text


def expert(d: Draft) -> Any:
    c = d.context({"state", "t"}, draws=d.chance(0.2))
    made = {a.name: fitted(c, a, 1) for a in d.action}
    if d.chance(0.1):
        return "optimal"
    only = next(iter(made.values()))
    return only if len(made) == 1 and isinstance(only, str) and d.chance(0.3) else made


# ------------------------------------------------------------------------------ observations


def observation(d: Draft) -> dict[str, Any]:
    """A few entries: components as they are, expressions, draws; in every kind of space."""
    allowed = {"state", "t"}
    c = d.context(allowed, draws=d.chance(0.25))
    noises = [t for t, needs in d.shared if needs <= {"noise"} and "noise" in needs]
    seen: dict[str, Any] = {}
    for name in ("o", "z", "q")[: d.rng.choice((1, 1, 2, 3))]:
        seen[name] = entry(d, c.with_names(noises))
    if d.chance(0.3):
        space = d.rng.choice(("box", "dict", "multi_discrete", "one_hot"))
        if space in ("multi_discrete", "one_hot"):
            seen = {name: finite_entry(d) for name in seen}
        seen["space"] = space
    return seen


def entry(d: Draft, c: Any) -> Any:
    if d.chance(0.5):
        return d.rng.choice(d.state).name
    labelled = [s for s in d.state if s.labels and all(x.isidentifier() for x in s.labels)]
    if labelled and d.chance(0.2):
        return beside(d, c, d.rng.choice(labelled))
    made = scalars.term(c, d.rng.choice(("bool", "int", "int", "real")), d.rng.choice(((), (), (), (2,))), d.depth())
    if not made.finite:
        return d.rng.choice(d.state).name
    if d.chance(0.2) and made.kind != "bool":
        moved = call("clip", [made, number(-2), number(5)], made.kind, size=5)
        return {"value": moved.text, "low": -2, "high": 5}
    return made.text


def beside(d: Draft, c: Any, s: Component) -> Any:
    """A label that means what the component beside it makes of it: in an expression, cases, a table, a draw."""
    label = d.rng.choice(s.labels)
    test = conditions.condition(c, 1)
    forms: list[Any] = [
        f"{label} if {test.at(1)} else {s.name}",
        [{"if": test.text, "then": label}, {"else": s.name}],
        {"by": "t", "rows": {0: s.name, 3: label, "else": d.rng.choice(s.labels)}},
    ]
    return d.rng.choice([*forms, {s.name: "1/3", label: "2/3"}] if c.may_draw else forms)


def finite_entry(d: Draft) -> Any:
    """Something of finitely many values, with bounds that are declared."""
    finite = [c.name for c in d.state if c.kind != "real" and (c.low or c.kind != "int")]
    if finite and d.chance(0.6):
        return d.rng.choice(finite)
    made = scalars.integer(d.context({"state", "t"}), 1)
    return {"value": call("clip", [made, number(-1), number(3)], "int", size=3).text, "low": -1, "high": 3}


# ------------------------------------------------------------------------------ variants


def variants(d: Draft) -> dict[str, Any]:
    """Variants that replace, add and remove, and one that is based on another."""
    made: dict[str, Any] = {"first": change(d)}
    if d.chance(0.5):
        made["RandomSecond"] = {"base": "first", **change(d, removes=False)}
    return made


def change(d: Draft, *, removes: bool = True) -> dict[str, Any]:
    found: dict[str, Any] = {}
    if d.chance(0.4):
        found["reward"] = scalars.integer(d.context(EVERYTHING), 1).text
    if d.chance(0.3):
        c = d.rng.choice(d.state)
        found["dynamics"] = {c.name + "'": fitted(d.context({"state", "action", "t", "noise"}), c, 1)}
    if d.chance(0.3):
        c = d.rng.choice(d.state)
        found["initial"] = {c.name: fitted(d.context(set()), c, 0)}
    if d.chance(0.2) and "L" in d.declared.parameters:
        found["parameters"] = {"L": {"default": 3}}
    if removes and d.chance(0.3):
        removed = [k for k in ("terminal", "observation", "expert", "discount", "absorbing_reward") if k in d.data]
        removed = [k for k in removed if k != "terminal" or not d.asks_end]
        if removed:
            found[d.rng.choice(removed)] = None
    if removes and d.chance(0.2) and d.data["dynamics"]:
        found.setdefault("dynamics", {})[d.rng.choice(list(d.data["dynamics"]))] = None
    if not found:
        found["horizon"] = 2
    return found
