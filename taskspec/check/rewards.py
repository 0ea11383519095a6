"""Warnings about rewards that tell no policy from another, and draws that leave nothing to chance."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from taskspec.base.diagnostics import Collector
from taskspec.check.case import SAME, Linted
from taskspec.check.names import followed
from taskspec.lang import syntax as s
from taskspec.lang.dists import CATEGORICAL, DISTS
from taskspec.lang.ir import Const, Draw, Node, draws
from taskspec.model.space import words
from taskspec.soundness.places import SectionScope, distributions
from taskspec.task.task import Task

# ---------- rewards
# Rewards that tell no policy from another.

LONGER = 1000


def rewards(case: Linted, collector: Collector) -> None:
    """W502 and W503: rewards that are always the same."""
    if not case.is_constant or case.paid is None:
        return
    value = words(case.paid[0])
    later = _later_reward(case, case.paid[0])
    if later is None:
        collector.add("W503", case.merged.span(("reward",)), f"every possible step has reward {value}")
        return
    message = f"within {case.task.horizon} steps every reward is {value}; longer episodes have others"
    hint = f"the first of them is paid in step {later}"
    collector.add("W502", case.merged.span(("horizon",)), message, hint)


def _later_reward(case: Linted, before: float) -> int | None:
    """The first step in which a longer episode could be paid otherwise than before."""
    model = case.results.model
    if model is None or model.horizon is None or model.is_timed:
        return None
    level, seen = model.start > 0, np.zeros(model.n_states, np.bool_)
    paid = model.step(0).R.reshape(model.n_actions, -1)
    for t in range(model.horizon + LONGER):
        if not (level & ~seen).any():
            return None
        if np.ptp(np.append(paid[:, level].reshape(-1), before)) > SAME:
            return t + 1
        seen |= level
        level = model.successors(model.step(0).P, level)
    return None


def indifferent(case: Linted, collector: Collector) -> None:
    """W504: the best return is that of random actions."""
    if case.is_constant or (optimal := case.results.optimal) is None or (random := case.results.random) is None:
        return  # random actions are simulated only where the best return is known
    if abs(optimal.value - random.value) <= SAME * max(1.0, abs(optimal.value)):
        message = f"random actions are as good as the best: both return {words(optimal.value)}"
        collector.add("W504", case.merged.span(("reward",)), message)


# ---------- draws
# Draws that leave nothing to chance.

SECTIONS = ("noise", "initial", "dynamics", "reward", "terminal", "observation", "expert")


def certain(case: Linted, collector: Collector) -> None:
    """W512: a draw with a single outcome. Where a real parameter has a say, its ends may be why."""
    reals = {p.name for p in case.task.parameters if p.kind == "real"}
    for written, where in _written(case.task):
        words = {n.id for n in s.names(written) if isinstance(n, s.Name)}
        if _is_certain(written, where) and not followed(case.task, words) & reals:
            collector.add("W512", written.place, "this draw has only one outcome", "write the value itself")


def _written(task: Task) -> Iterator[tuple[s.Call | s.Weights, SectionScope]]:
    """Every distribution of the spec, with the section it stands in."""
    for section in SECTIONS:
        entries = task.surface.sections.get(section)
        where = SectionScope(task, section)
        for expr in entries.values() if isinstance(entries, dict) else [entries]:
            for written in distributions(expr, where) if expr is not None else ():
                yield written.expr, where


def _is_certain(expr: s.Call | s.Weights, where: SectionScope) -> bool:
    match expr:
        case s.Weights(pairs=pairs) | s.Call(args=(s.Weights(pairs=pairs),)):
            return _one_weight(pairs, where)
        case s.Call(args=(s.Comprehension(),)):
            return False  # what is left of a set may be a matter of the map that it is made from
        case s.Call(args=(s.SetOf(),)):
            return _one_element(expr, where)
        case s.Call(function=name, args=args, keywords=keywords):
            dist = CATEGORICAL if name == CATEGORICAL.name else DISTS[name]
            names = [a.name for a in dist.arguments]
            given = dict(zip(names, args, strict=False)) | dict(keywords)
            return dist.certain({key: where.number(value) for key, value in given.items() if key in names})


def _one_weight(pairs: tuple[tuple[s.Expr, s.Expr], ...], where: SectionScope) -> bool:
    """Whether one value alone has a probability above 0."""
    weights = [where.number(p) for _, p in pairs]
    return all(isinstance(w, Const) for w in weights) and sum(_above_zero(w) for w in weights) == 1


def _one_element(expr: s.Call, where: SectionScope) -> bool:
    """Whether the set that is drawn from has one element."""
    value = where.value(expr)
    found = [] if value is None else draws([value.node])
    return value is not None and all(_counts(draw) == 1 for draw in found)


def _counts(draw: Draw) -> int | None:
    """How many outcomes a draw from a set has, where that is fixed."""
    first = draw.args[0] if draw.args else None
    return int(first.value) if draw.base == "index" and isinstance(first, Const) and first.type.is_scalar else None


def _above_zero(node: Node | None) -> bool:
    return isinstance(node, Const) and any(v > 0 for v in node.flat)
