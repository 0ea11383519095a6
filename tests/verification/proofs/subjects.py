"""What claims are made about: a random spec, its numbers by brute force, and the conditions that can be asked of it."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from taskspec.base.diagnostics import SpecError
from tests.verification.oracle.compare import claims as written
from tests.verification.oracle.compare.cases import Case
from tests.verification.oracle.compare.exact import reference_model
from tests.verification.oracle.reference.model import Model
from tests.verification.oracle.worker import case_of
from tests.verification.proofs.brute import Solved
from tests.verification.proofs.hard import hard
from tests.verification.proofs.process import Key, of_model
from tests.verification.proofs.standin import standin

Condition = tuple[str, Callable[[Key], bool]]
Data = dict[str, Any]


@dataclass
class Subject:
    """A case, and its numbers: for each reading of decimals, and for each value of its parameter.

    `rough` numbers are known to a few digits only, as they were computed in floats.
    """

    family: str
    case: Case
    solved: Callable[[int | None], list[Solved]]
    condition: Callable[[random.Random], Condition] | None
    model: Model | None
    rough: bool = False
    horizon: int | None = None
    """The default of the parameter H, if there is one."""
    decoy: Solved | None = None
    """The stand-in, as brute force finds it."""
    _known: dict[int | None, list[Solved]] = field(default_factory=dict)

    def worlds(self, horizon: int | None = None) -> list[Solved]:
        """By reading; `horizon`: the value of H."""
        if horizon not in self._known:
            self._known[horizon] = self.solved(horizon)
        return self._known[horizon]

    def claiming(self, claims: list[Data]) -> Case:
        return Case(self.case.spec | {"claims": claims}, self.case.variant, self.case.seed, self.case.given)


def subject(number: int) -> Subject:
    """The subject with a number: of hard numbers, with a stand-in, or any that the second interpreter can list."""
    rng = random.Random(f"subject {number}")
    return rng.choice((of_hard, of_hard, of_hard, of_any, of_standin))(number, rng)


def of_hard(number: int, rng: random.Random) -> Subject:
    made = hard(rng)
    case = Case(made.spec, None, number)

    def solved(horizon: int | None) -> list[Solved]:
        return [Solved(made.process(reading, horizon or made.horizon)) for reading in ("written", "held")]

    def condition(rng: random.Random) -> Condition:
        i = rng.randrange(made.states)
        return rng.choice((
            (f"s == {i}", lambda key: key[0] == i), (f"s >= {i}", lambda key: key[0] >= i),
            (f"s in {{0, {i}}}", lambda key: key[0] in (0, i)), (f"s != {i}", lambda key: key[0] != i),
        ))  # fmt: skip

    return Subject(made.theme.name, case, solved, condition, reference_model(case), horizon=made.horizon)


def of_standin(number: int, rng: random.Random) -> Subject:
    while True:
        made = standin(rng)
        model = reference_model(Case(made.real, None, number))
        if model is not None:
            break
    found = [Solved(of_model(model))]
    decoy = reference_model(Case(made.alone, None, number))
    return Subject(
        f"stand-in, {made.wrong or 'right'}", Case(made.spec, None, number), lambda _: found, None, model,
        rough="0.1" in made.spec["reward"], decoy=None if decoy is None else Solved(of_model(decoy)),
    )  # fmt: skip


def of_any(number: int, rng: random.Random) -> Subject:
    """A spec of the generator beside the second interpreter that ends, whose outcomes can be listed."""
    while True:
        case = case_of(rng.randrange(10**9))
        model = None if case.reference.horizon is None else reference_model(case)
        if model is not None and is_taken(case):
            break

    def condition(rng: random.Random) -> Condition:
        text = written.state_condition(case, rng)
        return text, lambda key: written.holds(case, model, key, text)

    found = [Solved(of_model(model))]
    return Subject("any", case, lambda _: found, condition, model, rough=True)


def is_taken(case: Case) -> bool:
    """Whether the compiler takes a spec; those that it should and does not are found by `tests.verification.oracle`."""
    try:
        return bool(case.task.state)
    except SpecError:
        return False
