"""The same process given to the model checker Storm, in rationals, where `stormpy` 2 is installed."""

from __future__ import annotations

from fractions import Fraction

from taskspec.exact.solve.outcomes import Outcome
from taskspec.tools.exchange.frozen_task import FrozenTask
from taskspec.tools.exchange.settled import END as ENDS
from taskspec.tools.exchange.settled import property_of
from taskspec.tools.exchange.storm import is_installed as is_installed
from taskspec.tools.exchange.storm import solved as solved_by_storm
from tests.verification.proofs.brute import Rule, Solved, expert, uniform
from tests.verification.proofs.process import Key, Process, Shares

END = ("the end",)
Place = tuple[Key, int]
Choice = tuple[Fraction, dict[Place, Fraction]]
"""What an action pays on average, and where it leads."""
ENDED: Place = (END, 0)
BEFORE = Fraction(1)
"""Paid before the beginning, and taken off again: Storm refuses to add up rewards where there is none."""


def returns(solved: Solved) -> dict[str, Fraction]:
    """Optimal, worst, random and expert return, as Storm finds them; none where an episode may go on for ever."""
    process = solved.process
    if process.horizon is None and process.discount == 1 and not always_ends(process):
        return {}
    found = dict(zip(("optimal_return", "worst_return"), asked(unrolled(process), "max", "min"), strict=True))
    rules: dict[str, Rule] = {"random_return": uniform(process.actions)}
    if process.expert is not None:
        rules["expert_return"] = expert(process)
    for name, rule in rules.items():
        (found[name],) = asked(unrolled(process, solved, rule), "max")
    return found


def always_ends(process: Process) -> bool:
    """Whether every policy ends: from each set of states some action's every outcome might not stay."""
    inside = set(process.acting())
    while True:
        staying = {
            k for k in inside
            if any(all(not o.terminated and o.state in inside for o in process.row(k, a, 0)) for a in range(process.actions))
        }  # fmt: skip
        if staying == inside:
            return not inside
        inside = staying


def unrolled(process: Process, solved: Solved | None = None, rule: Rule | None = None) -> dict[Place, list[Choice]]:
    """States at times, from which every way leads to the end; by a rule, with one choice in each.

    A discount is a chance to end.
    """
    found: dict[Place, list[Choice]] = {}
    todo: list[Place] = [(k, 0) for k in process.start]
    while todo:
        at = todo.pop()
        if at in found:
            continue
        choices = [_choice(process, at, {a: Fraction(1)}) for a in range(process.actions)]
        if solved is not None and rule is not None:
            choices = [_choice(process, at, solved.shares(rule, *at))]
        found[at] = choices
        todo += [place for _, row in choices for place in row if place != ENDED]
    first = {(k, 0): p for k, p in process.start.items()}
    return {((), -1): [(BEFORE, first)], **found, ENDED: [(Fraction(0), {ENDED: Fraction(1)})]}


def _choice(process: Process, at: Place, shares: Shares) -> Choice:
    key, t = at
    paid = Fraction(0)
    row = {ENDED: Fraction(0)}
    after = t + 1 if process.horizon is not None else 0
    for a, share in shares.items():
        for o in process.row(key, a, t):
            p = share * o.probability
            paid += p * o.reward
            over = o.terminated or after == process.horizon
            goes = Fraction(0) if over else p * process.discount
            row[o.state, after] = row.get((o.state, after), Fraction(0)) + goes
            row[ENDED] += p - goes
    return paid, {place: p for place, p in row.items() if p}


def asked(places: dict[Place, list[Choice]], *extremes: str) -> list[Fraction]:
    """The expected reward before the end, at most or at least, from the first place."""
    number = {place: i for i, place in enumerate(places)}
    rows = []
    for choices in places.values():
        row = [tuple(Outcome(p, number[to], paid, False) for to, p in found.items()) for paid, found in choices]
        rows.append(tuple(row))
    actions = tuple(f"a{i}" for i in range(max(map(len, rows))))
    start = tuple(Fraction(not i) for i in range(len(rows)))
    names = tuple(f"s{i}" for i in range(len(rows)))
    labels = {ENDS: frozenset({number[ENDED]})}
    values = tuple({"s": i} for i in range(len(rows)))
    task = FrozenTask("process", names, actions, start, tuple(rows), None, labels=labels, values=values)
    properties = [property_of(task, extreme) for extreme in extremes]
    return [value - BEFORE for value in solved_by_storm(task, *properties)]
