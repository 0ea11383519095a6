"""Random specs with a finite stand-in: a component is shifted or turned round. It is right, or wrong in one place.

Whatever rests on a stand-in, claims are about the task itself: a false one is never proved, and one that is right is
never called unfaithful.
"""

from __future__ import annotations

import ast
import copy
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from taskspec.base.diagnostics import SpecError
from taskspec.exact import verdicts
from taskspec.exact.scores.returns import Results
from tests.verification.oracle.compare.cases import Case, Data, Difference
from tests.verification.oracle.compare.claims import Claim, about_number, written
from tests.verification.oracle.compare.exact import reference_model
from tests.verification.oracle.reference import solve
from tests.verification.oracle.reference.merging import merged
from tests.verification.oracle.reference.model import Model
from tests.verification.oracle.reference.syntax import PRIME, parse

TAKEN = ("initial", "dynamics", "reward", "terminal", "expert")
KEPT = ("definitions", "noise", "absorbing_reward")
"""Sections that a stand-in shares with the task."""
OTHER = "z"


@dataclass(frozen=True)
class Shift:
    """`z = sign * name + by`."""

    name: str
    sign: int
    by: int

    def of(self, text: str) -> str:
        return f"{self.sign} * ({text}) + {self.by}"

    def back(self, z: str) -> str:
        return f"{self.sign} * ({z} - {self.by})"


def compare(case: Case, model: Model) -> int:
    """How many claims were looked at; 0 where no component can be replaced.

    The stand-in of a spec that was kept is right.
    """
    rng = case.rng("stand-in")
    real = merged(case.spec, case.variant)
    section = real.get("abstraction") or standin(real, rng)
    if section is None or "legal" in real:
        return 0
    wrong = "abstraction" not in real and rng.random() < 0.6 and spoiled(section, real, rng)
    asked = Case(real | {"abstraction": section}, None, case.seed, case.given)
    truth = solve.returns(model)
    others = decoys(asked, model)
    try:
        found = Results(asked.task).abstraction_check
    except SpecError:
        if wrong:  # a stand-in with a mistake may be no task
            return 0
        raise
    assert found is not None
    if not wrong and found.problem is not None:
        raise Difference("right stand-in refused", found.problem)
    made = [about_number(name, value, rng) for name, value in truth.items()]
    made += [
        Claim(f"{n} == {written(v)}", False) for n, v in others.items() if abs(v - truth[n]) > abs(truth[n]) / 10**6
    ]
    return judged(asked, made, "wrong" if wrong else "right")


ALLOWED = {True: ("proved", "tested", "undecided"), False: ("false", "contradicted", "tested", "undecided")}


def judged(case: Case, made: list[Claim], sort: str) -> int:
    claimed = Case(case.spec | {"claims": [c.entry for c in made]}, None, case.seed, case.given)
    for claim, verdict in zip(made, verdicts(claimed.task), strict=True):
        if verdict.status not in ALLOWED[claim.holds]:
            what = f"{str(claim.holds).lower()} claim {verdict.status}, {sort} stand-in"
            raise Difference(what, f"{claim.text}: {verdict.detail}")
    return len(made)


def decoys(case: Case, model: Model) -> Data:
    """The returns of the stand-in as a task of its own, as far as it has any."""
    section = case.spec["abstraction"]
    alone = {k: v for k, v in case.spec.items() if k not in ("abstraction", "observation")}
    try:
        found = reference_model(
            Case(alone | {k: v for k, v in section.items() if k != "map"}, None, case.seed, case.given)
        )
    except Exception:  # a stand-in with a mistake may be no task
        return {}
    known = solve.returns(model)
    return {} if found is None else {k: v for k, v in solve.returns(found).items() if k in known}


# ------------------------------------------------------------------------------ a stand-in that is right


def standin(real: Data, rng: random.Random) -> Data | None:
    """An `abstraction:` in which one component is replaced by another with other values."""
    names = [n for n, c in real["state"].items() if is_single(c) and not is_read(n, [real.get(k) for k in KEPT])]
    names = [n for n in names if not has_table([real["initial"][n], real["dynamics"].get(n + "'")])]
    if not names:
        return None
    shift = Shift(rng.choice(names), rng.choice((1, 1, -1)), rng.choice((-2, 0, 1, 3)))
    ends = [shift.of(str(real["state"][shift.name][k])) for k in ("low", "high")]
    low, high = ends if shift.sign > 0 else reversed(ends)
    replacement = {"type": "int", "low": low, "high": high}
    taken = {k: renamed(real[k], shift) for k in TAKEN if k in real and k not in ("initial", "dynamics")}
    for section, mark in (("initial", ""), ("dynamics", "'")):
        lines = {n: renamed(v, shift) for n, v in real[section].items()}
        taken[section] = {
            OTHER + mark if n == shift.name + mark else n: leaves(v, shift.of) if n == shift.name + mark else v
            for n, v in lines.items()
        }
    return {
        "state": {
            (OTHER if n == shift.name else n): replacement if n == shift.name else c for n, c in real["state"].items()
        },
        "map": {(OTHER if n == shift.name else n): shift.of(n) if n == shift.name else n for n in real["state"]},
        **taken,
    }


def is_single(c: Data) -> bool:
    return c["type"] == "int" and "shape" not in c and "low" in c and not isinstance(c["high"], list)


def is_read(name: str, data: Any) -> bool:
    return re.search(rf"\b{name}\b", str(data)) is not None


def has_table(data: list[Any]) -> bool:
    return "'by':" in str(data)


def renamed(data: Any, shift: Shift) -> Any:
    """A section in which the component is read through what replaces it."""
    if isinstance(data, dict):
        return {
            k if k in ("if", "then", "else", "by", "rows") else renamed(k, shift): renamed(v, shift)
            for k, v in data.items()
        }
    if isinstance(data, list):
        return [renamed(v, shift) for v in data]
    if not isinstance(data, str) or data in (shift.name, shift.name + "'") or not is_read(shift.name, data):
        return swapped(data, shift)
    return rewritten(data, shift)


def swapped(data: Any, shift: Shift) -> Any:
    if data == shift.name:
        return shift.back(OTHER)
    return shift.back(OTHER + "'") if data == shift.name + "'" else data


def rewritten(text: str, shift: Shift) -> str:
    """An expression with the component replaced."""
    into = {shift.name: parse(shift.back(OTHER)), shift.name + PRIME: parse(shift.back(OTHER + "'"))}

    class Swap(ast.NodeTransformer):
        def visit_Name(self, node: ast.Name) -> ast.AST:
            return into.get(node.id, node)

    try:
        tree = copy.deepcopy(parse(text))
    except SyntaxError:  # a label
        return text
    return re.sub(rf"(\w+){PRIME}\b", r"\1'", ast.unparse(Swap().visit(tree)))


def leaves(data: Any, change: Callable[[str], str]) -> Any:
    """The values of cases, draws and expressions, changed."""
    if isinstance(data, list):
        return [{k: v if k == "if" else leaves(v, change) for k, v in entry.items()} for entry in data]
    if isinstance(data, dict):
        return {change(str(k)): p for k, p in data.items()}
    return change(str(data))


# ------------------------------------------------------------------------------ and one that is wrong


def spoiled(section: Data, real: Data, rng: random.Random) -> bool:
    """Make one mistake in the stand-in of a spec; whether one could be made."""
    mistakes = [mistake for mistake in MISTAKES if mistake(copy.deepcopy(section), real)]
    return bool(mistakes) and rng.choice(mistakes)(section, real)


def other_weights(section: Data, real: Data) -> bool:
    """The first draw of two outcomes has its weights exchanged."""
    for draw in draws([section["initial"], section["dynamics"], section["reward"]]):
        (one, p), (two, q) = draw.items()
        if p != q:
            draw[one] = q
            draw[two] = p
            return True
    return False


def draws(data: Any) -> list[Data]:
    if isinstance(data, list):
        return [d for part in data for d in draws(part)]
    if not isinstance(data, dict):
        return []
    if len(data) == 2 and str(list(data.values())[1]).startswith("1 - ("):
        return [data]
    return [d for part in data.values() for d in draws(part)]


def other_reward(section: Data, real: Data) -> bool:
    if not isinstance(section["reward"], str):
        return False
    section["reward"] = f"({section['reward']}) + (t == 1) / 4"
    return True


def other_end(section: Data, real: Data) -> bool:
    section["terminal"] = f"not ({section['terminal']})" if section.get("terminal") else "t == 1"
    return True


def other_start(section: Data, real: Data) -> bool:
    section["initial"][OTHER] = section["state"][OTHER]["low"]
    return True


def other_step(section: Data, real: Data) -> bool:
    section["dynamics"][OTHER + "'"] = section["state"][OTHER]["high"]
    return True


def other_map(section: Data, real: Data) -> bool:
    section["map"][OTHER] = f"min({section['map'][OTHER]} + 1, {section['state'][OTHER]['high']})"
    return True


def other_expert(section: Data, real: Data) -> bool:
    """The first component of the action is always the same one of its values."""
    expert = section.get("expert")
    if not isinstance(expert, dict):
        return False
    name, now = next(iter(expert.items()))
    others = [v for v in values(real["action"][name]) if v != str(now)]
    if others:
        expert[name] = others[0]
    return bool(others)


def values(c: Data) -> list[str]:
    """Some values of a component, as expressions."""
    if c["type"] == "bool":
        return ["True", "False"]
    if c["type"] == "choice":
        return [repr(label) for label in c["values"]]
    return [f"({c['low']})", f"({c['high']})"] if is_single(c) else []


MISTAKES = (other_weights, other_reward, other_end, other_start, other_step, other_map, other_expert)
