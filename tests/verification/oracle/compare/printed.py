"""What the text printer makes of a spec, read and played by the second interpreter again."""

from __future__ import annotations

from typing import Any

from tests.shared.expression_data import data as printed
from tests.verification.oracle.compare.cases import Case, Difference
from tests.verification.oracle.compare.lanes import Lane, lane
from tests.verification.oracle.reference.values import Value

SINGLE = ("reward", "terminal", "absorbing_reward")
NAMED = ("definitions", "noise", "initial", "dynamics")


def reprinted(case: Case) -> dict[str, Any]:
    """The sections of the task with every expression as it is printed."""
    sections = dict(case.reference.sections)
    surface = case.task.source.surface.sections
    for name in SINGLE:
        if name in sections:
            sections[name] = printed(surface[name])
    for name in NAMED:
        if name in sections:
            sections[name] = {k: printed(surface[name][k]) for k in sections[name]}
    if "observation" in sections:
        seen = sections["observation"]
        sections["observation"] = {k: again(v, surface["observation"].get(k)) for k, v in seen.items()}
    return sections


def again(entry: Any, expr: Any) -> Any:
    if expr is None:
        return entry
    return entry | {"value": printed(expr)} if isinstance(entry, dict) and "value" in entry else printed(expr)


def compare(case: Case, lanes: list[Lane]) -> int:
    """Play the printed spec with the same seeds; the number of steps compared."""
    twin = Case(reprinted(case), None, case.seed, case.given)
    for old in lanes[:1]:
        new = lane(twin, old.seed, 4)
        for i, (was, now) in enumerate(zip(old.links, new.links, strict=False)):
            seen = [flat(v) for v in was.result.state.values()] + [flat(v) for _, v in was.result.seen]
            other = [flat(v) for v in now.result.state.values()] + [flat(v) for _, v in now.result.seen]
            ends = (was.result.terminated, flat(was.result.reward)), (now.result.terminated, flat(now.result.reward))
            if seen != other or ends[0] != ends[1]:
                detail = f"event {i}: {other}, {ends[1]}, expected {seen}, {ends[0]}"
                raise Difference("printed text", f"{detail}: {twin.spec}")
    return len(lanes)


def flat(value: Value) -> str:
    """Elements in a form in which nan equals nan."""
    return repr([float(x) for x in value.data])
