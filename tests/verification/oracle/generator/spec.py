"""Random specs: all sections, in terms of what the sections before declare."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from tests.verification.oracle.generator import conditions, extras, nothing, scalars
from tests.verification.oracle.generator.assign import fitted
from tests.verification.oracle.generator.declarations import (
    ACTION,
    PRIME,
    STATE,
    Component,
    Data,
    Declared,
    component,
    constants,
    parameters,
)
from tests.verification.oracle.generator.makers import limited
from tests.verification.oracle.generator.tables import table
from tests.verification.oracle.generator.terms import Context, Function, Term, call

DEPTH = 3


@dataclass
class Draft:
    """A spec in the making."""

    rng: random.Random
    declared: Declared
    endless: bool
    """Whether draws may have infinitely many outcomes."""
    state: list[Component] = field(default_factory=list)
    action: list[Component] = field(default_factory=list)
    shared: list[tuple[Term, frozenset[str]]] = field(default_factory=list)
    """Definitions and noises, with what they read."""
    functions: list[Function] = field(default_factory=list)
    asks_end: bool = False
    """Whether the reward names the end, so that there must be one."""
    folds: bool = False
    """Whether there is a definition `mix`, of two small ints."""
    data: Data = field(default_factory=dict)
    horizon: bool = True

    def chance(self, p: float) -> bool:
        return self.rng.random() < p

    def depth(self) -> int:
        return self.rng.choice((0, 0, 1, 1, 2, DEPTH))

    def context(self, allowed: set[str], *, draws: bool = False) -> Context:
        """What an expression may read that may depend on `allowed`: "state", "action", "prime", "t", "noise"."""
        names = list(self.declared.known)
        for kind, components, reads, suffix in (
            ("state", self.state, STATE, ""),
            ("action", self.action, ACTION, ""),
            ("prime", self.state, PRIME, "'"),
        ):
            if kind in allowed:
                names += [t for c in components for t in c.terms(c.name + suffix, reads)]
        if "t" in allowed:
            time = Term("t", "int", size=50, reads=frozenset({"t"}))
            names += [time, Term("T", "int", size=50, reads=time.reads)] if self.horizon else [far(time)]
        names += [t for t, needs in self.shared if needs <= allowed]
        return Context(
            self.rng, names, list(self.functions) if "state" in allowed else [], draws, not self.endless, self.folds
        )


def spec(rng: random.Random) -> Data:
    """A random spec that is sound: every value stays where it is declared to be."""
    d = Draft(rng, Declared(rng), endless=rng.random() < 0.25)
    parameters(d.declared)
    constants(d.declared)
    wide = d.chance(0.06)
    d.state = [
        component(d.declared, n, action=False, wide=wide and n == "s") for n in names(rng, "suvwxy", (1, 2, 2, 3, 4))
    ]
    d.action = [component(d.declared, n, action=True) for n in names(rng, "ac", (1, 1, 1, 2))]
    d.data = {"taskspec": 1, "name": "Random"}
    d.data |= {k: v for k, v in (("parameters", d.declared.parameters), ("constants", d.declared.constants)) if v}
    d.data["state"] = {c.name: c.data for c in d.state}
    d.data["action"] = {c.name: c.data for c in d.action}
    horizon(d)
    shared(d)
    d.data["initial"] = initial(d)
    d.data["dynamics"] = dynamics(d)
    d.data["reward"] = reward(d)
    extras.add(d)
    if d.chance(0.15):
        nothing.add(d)
    return d.data


def far(time: Term) -> Term:
    """The time where there is no horizon, and so no bound for it."""
    return Term("min(t, 20)", "int", size=20, reads=time.reads)


def names(rng: random.Random, letters: str, counts: tuple[int, ...]) -> list[str]:
    return list(letters[: rng.choice(counts)])


def horizon(d: Draft) -> None:
    options: list[Any] = [1, 2, 3, 4, 6, 8]
    if d.declared.small:
        options += ["L", "2 * L", "L + 1"]
    d.data["horizon"] = d.rng.choice(options)
    if d.chance(0.12):
        d.data["horizon"] = "none"
        d.horizon = False
    if d.chance(0.2):
        d.data["discount"] = d.rng.choice((0.5, 0.9, "1/2", 1))


# ------------------------------------------------------------------------------ definitions and noise


def shared(d: Draft) -> None:
    if d.chance(0.35):
        d.data["noise"] = {}
        for name in names(d.rng, "nm", (1, 2)):
            noise(d, name)
    if d.chance(0.4):
        d.data["definitions"] = {}
        for name in ("size", "near")[: d.rng.choice((1, 2))]:
            definition(d, name)
        if d.chance(0.5):
            function(d)
        if d.chance(0.4):
            d.data["definitions"]["mix(p, q)"] = d.rng.choice(MIXES)
            d.folds = True


MIXES = ("(2 * p + q) % 7", "max(p - 1, min(q, 3))", "p if q < p else min(q, 4)", "(p - q) % 5 if p > q else 1")
"""Functions of two ints that give small ones."""


def noise(d: Draft, name: str) -> None:
    if d.chance(0.2):
        order(d, name)
        return
    allowed = d.rng.choice(({"noise"}, {"t", "noise"}, {"state", "action", "t", "noise"}))
    kind = d.rng.choice(("bool", "int", "int", "real") if d.endless else ("bool", "bool", "int"))
    c = d.context(allowed, draws=True)
    made = {"bool": conditions.flag_draw, "int": scalars.int_draw, "real": scalars.real_draw}[kind](c, 1)
    if made.size > 2**31 or not made.finite:
        made = call("clip", [made, Term("0", "int"), Term("3", "int", size=3)], made.kind, size=3)
    d.data["noise"][name] = made.text
    needs = (made.reads | {"noise"}) - {"draw"}
    if needs & {"state", "action"}:
        needs |= {"state", "action"}
    term = Term(name, made.kind, size=made.size, reads=needs, fan=made.fan)
    d.shared.append((term, frozenset(needs)))


def order(d: Draft, name: str) -> None:
    """A vector that is drawn as a whole, for several lines to share."""
    kind, text = d.rng.choice((("int", "Permutation(3)"), ("bool", "Subset(3, 1)"), ("bool", "Subset(3, 2)")))
    d.data["noise"][name] = text
    needs = frozenset({"noise"})
    d.shared.append((Term(name, kind, (3,), size=2, reads=needs, fan=6), needs))


def definition(d: Draft, name: str) -> None:
    allowed = {"state"} if d.chance(0.4) else {"state", "action", "t"} if d.chance(0.7) else {"state", "prime"}
    kind = d.rng.choice(("bool", "int", "int", "real"))
    shape = d.rng.choice(((), (), (), (2,)))
    made = scalars.term(d.context(allowed), kind, shape, 2)
    d.data["definitions"][name] = made.text
    term = Term(name, kind, shape, size=made.size, finite=made.finite, reads=made.reads)
    d.shared.append((term, frozenset(made.reads & {"state", "action", "prime", "t", "noise"})))


def function(d: Draft) -> None:
    takes = tuple(
        (d.rng.choice(("int", "int", "real")), d.rng.choice(((), (), (2,)))) for _ in range(d.rng.choice((1, 2)))
    )
    arguments = [Term(n, k, s, size=1e4) for n, (k, s) in zip(("p", "q"), takes, strict=False)]
    c = d.context({"state"})
    made = scalars.term(c.with_names(arguments * 3), d.rng.choice(("bool", "int", "real")), (), 2)
    key = f"f({', '.join(a.text for a in arguments)})"
    d.data["definitions"][key] = made.text
    made = limited(made)
    d.functions.append(
        Function("f", takes, Term("f", made.kind, size=max(made.size, 1e4), finite=made.finite, reads=made.reads))
    )


# ------------------------------------------------------------------------------ initial, dynamics, reward


def initial(d: Draft) -> Data:
    """A line for each component; later ones may use earlier ones."""
    made: Data = {}
    names = list(d.declared.known)
    if d.chance(0.5):
        names += 2 * [t for t, needs in d.shared if needs == {"noise"}]
    for c in d.state:
        context = Context(d.rng, names, [], d.chance(0.4), not d.endless)
        made[c.name] = fitted(context, c, d.rng.choice((0, 0, 1)))
        names = names + c.terms(c.name, frozenset({"beginning"}))
    return made


def dynamics(d: Draft) -> Data:
    """Lines for most components; some read next values of others, but never in a circle."""
    made: Data = {}
    order = d.rng.sample(d.state, len(d.state))
    for i, c in enumerate(order):
        if d.chance(0.15):
            continue
        context = d.context({"state", "action", "t", "noise"}, draws=d.chance(0.35))
        primes = [t for o in order[:i] for t in o.terms(o.name + "'", PRIME)]
        made[c.name + "'"] = fitted(context.with_names(primes), c, d.depth())
    return {c.name + "'": made[c.name + "'"] for c in d.rng.sample(d.state, len(d.state)) if c.name + "'" in made}


def reward(d: Draft) -> Any:
    c = d.context({"state", "action", "prime", "t", "noise"}, draws=d.chance(0.2))
    if d.chance(0.25):
        return table(c, lambda: scalars.integer(c.without_draws(), 1).text)
    made = scalars.term(c, d.rng.choice(("bool", "int", "int", "real")), (), d.depth())
    if not made.finite:
        made = scalars.integer(c, 1)
    if d.chance(0.3):
        d.asks_end = True
        return f"{d.rng.choice((5, -2, 'T' if d.horizon else 9))} if terminal else {made.at(1)}"
    return bare(d, made)


def bare(d: Draft, made: Term) -> Any:
    """A number may stand without quotes."""
    if made.text.removeprefix("-").isdigit() and d.chance(0.7):
        return int(made.text)
    return made.text
