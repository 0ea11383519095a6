"""Actions without effect, and experts that are none."""

from __future__ import annotations

from taskspec.diagnostics import Collector
from taskspec.exact.lint.case import SAME, Linted
from taskspec.exact.model.inert import differs
from taskspec.exact.scoring.returns import Return
from taskspec.exact.scoring.yardsticks import yardsticks
from taskspec.exact.simulation.rollout import at_random, is_bounded
from taskspec.lang import syntax as s
from taskspec.lang.ir import Role, reads
from taskspec.task.task import Soft, Task


def inert(case: Linted, collector: Collector) -> None:
    """W505: a component of the action that changes nothing."""
    read = reads((*case.task.next, case.task.reward, case.task.terminal))
    for c in case.task.action:
        if c.is_finite and c.counts == (1,) * c.type.size:
            continue
        if (Role.ACTION, c.name) not in read:
            collector.add("W505", case.key("action", c.name), f"the action '{c.name}' is read nowhere")
        elif case.model is not None and case.model.acting.any() and differs(case.model, c.name)[0] is False:
            message = f"the action '{c.name}' changes neither the next state nor the reward, in any state"
            collector.add("W505", case.key("action", c.name), message)


def expert(case: Linted, collector: Collector) -> None:
    """W507: an expert below the optimum, or no better than random actions where that is all there is to compare with."""
    found, optimal = case.results.expert, case.results.optimal
    if found is None or isinstance(case.task.expert, Soft) or _says_so(case.task):
        return
    if optimal is None:
        _no_better(case, found, collector)
        return
    best, whose = optimal.value, ""
    if case.task.memory is not None and (seen := yardsticks(case.results)) is not None:
        if seen.remembering is None:
            whose = ", which knows the state"
        else:
            best, whose = seen.remembering.value, " of those who remember what they see"
    gap = best - found.value
    if gap > SAME * max(1.0, abs(best)):
        message = f"the expert returns {_shown(found)}, which is {gap:.6g} below the optimum of {best:.10g}{whose}"
        collector.add("W507", case.key("expert"), message)


def _no_better(case: Linted, found: Return, collector: Collector) -> None:
    """By simulation: an expert that is one returns more, on average, than random actions do."""
    results = case.results
    random = results.random if is_bounded(case.task) else results.estimated(at_random(case.task), 200)
    if random is not None and random.value >= found.value:
        message = f"the expert returns {_shown(found)} on average, and random actions {_shown(random)}"
        notes = [f"from {found.episodes:,} and {random.episodes:,} episodes"]
        collector.add("W507", case.key("expert"), message, None, notes)


def _shown(value: Return) -> str:
    return f"{value.value:.10g}"


def _says_so(task: Task) -> bool:
    return any(_compares_expert(claim.expr) for claim in task.claims)


def _compares_expert(expr: s.Expr) -> bool:
    if isinstance(expr, s.Logical):
        return any(_compares_expert(part) for part in expr.operands)
    if not isinstance(expr, s.Compare):
        return False
    names = {n.id for n in s.names(expr) if isinstance(n, s.Name)}
    return {"expert_return", "optimal_return"} <= names and any(op in ("<", ">", "!=") for op, _ in expr.rest)
