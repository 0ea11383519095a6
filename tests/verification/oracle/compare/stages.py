"""Everything that one spec is put through: stages, each with the share of specs that it is made for."""

from __future__ import annotations

import random
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from taskspec.base.diagnostics import SpecError, TaskspecError
from taskspec.exact import check
from tests.verification.oracle.compare import claims, exact, lanes, printed, scalar, standins, vectors
from tests.verification.oracle.compare.cases import Case, Difference
from tests.verification.oracle.reference.model import Model

STEPS = 8


@dataclass(frozen=True)
class Finding:
    """Something wrong: in which stage, what kind of thing, and the details."""

    stage: str
    what: str
    detail: str

    @property
    def signature(self) -> str:
        return f"{self.stage}: {self.what}"


@dataclass
class Subject:
    """A case with what several stages need of it, worked out once."""

    case: Case

    @cached_property
    def lanes(self) -> list[lanes.Lane]:
        return [lanes.lane(self.case, 100 + i, STEPS) for i in range(2)]

    @cached_property
    def model(self) -> Model | None:
        return exact.reference_model(self.case)


Stage = Callable[[Subject], int]
"""Compares something, and says how many steps, rows or numbers there were. `Difference`: they disagree."""


def load(subject: Subject) -> int:
    """The spec is sound by construction, so that the compiler must take it."""
    assert subject.case.reference.state
    return len(subject.case.task.state)


def scalar_environment(subject: Subject) -> int:
    return sum(scalar.walk(subject.case, lane) for lane in subject.lanes)


def options(subject: Subject) -> int:
    """The scalar environment with terminal states that absorb, and with the time among what is seen."""
    if subject.case.reference.horizon is None:
        return 0
    absorbing = lanes.lane(subject.case, 7, STEPS, absorb=True)
    return scalar.walk(subject.case, absorbing, ending="absorb", observe_time=True)


def vector(backend: str, mode: str, tolerance: float = 0.0) -> Stage:
    def walk(subject: Subject) -> int:
        return vectors.walk(subject.case, subject.lanes, backend, mode, tolerance=tolerance)

    return walk


def jax(subject: Subject) -> int:
    """JAX holds reals in float32, so that specs with reals are compared as long as nothing hangs on their last digits."""
    try:
        return vectors.walk(subject.case, subject.lanes, "jax", "SameStep", tolerance=2e-4)
    except SpecError as error:
        if all(d.code == "E715" for d in error.diagnostics):
            return 0
        raise


def model_rows(subject: Subject) -> int:
    if subject.model is None:
        return 0
    try:
        return exact.rows(subject.case, subject.model)
    except SpecError as error:
        if exact.refused(error):
            return 0
        raise


def model_returns(subject: Subject) -> int:
    if subject.model is None or subject.case.reference.horizon is None:
        return 0
    return exact.returns(subject.case, subject.model)


def random_claims(subject: Subject) -> int:
    if subject.model is None or subject.case.reference.horizon is None:
        return 0
    return claims.compare(subject.case, subject.model)


def stand_ins(subject: Subject) -> int:
    if subject.model is None or subject.case.reference.horizon is None:
        return 0
    return standins.compare(subject.case, subject.model)


def soundness(subject: Subject) -> int:
    """`check` has nothing to say against a spec that is sound by construction."""
    report = check(subject.case.task, claims=False)
    for error in report.errors:
        raise Difference(f"check {error.code}", f"{error.message} {' '.join(error.notes)}")
    return 1 + len(report.coverage.cases)


def texts(subject: Subject) -> int:
    return printed.compare(subject.case, subject.lanes)


ALWAYS = 1.0
SAMPLE = 0.03
STAGES: dict[str, tuple[float, Stage]] = {
    "load": (ALWAYS, load),
    "scalar": (ALWAYS, scalar_environment),
    "options": (0.15, options),
    **{f"numpy {mode}": (0.4, vector("numpy", mode)) for mode in vectors.MODES},
    "numba": (SAMPLE, vector("numba", "NextStep")),
    "jax": (SAMPLE, jax),
    "rows": (0.35, model_rows),
    "returns": (0.3, model_returns),
    "check": (0.2, soundness),
    "claims": (0.15, random_claims),
    "text": (0.2, texts),
    "stand-in": (0.1, stand_ins),
}
"""By name: for which share of the specs a stage is made, and the stage."""


@dataclass
class Outcome:
    """What came of one case."""

    made: dict[str, int] = field(default_factory=dict)
    findings: list[Finding] = field(default_factory=list)


def put_through(case: Case, stages: dict[str, tuple[float, Stage]], rng: random.Random | None) -> Outcome:
    """Put a case through stages: those that chance picks, or all of them."""
    subject = Subject(case)
    outcome = Outcome()
    for name, (share, stage) in stages.items():
        if rng is not None and rng.random() >= share:
            continue
        finding = attempt(name, stage, subject, outcome)
        if finding is not None:
            outcome.findings.append(finding)
            if name == "load":
                break
    return outcome


def attempt(name: str, stage: Stage, subject: Subject, outcome: Outcome) -> Finding | None:
    """Make one stage; whatever goes wrong is a finding."""
    try:
        outcome.made[name] = stage(subject)
    except Difference as difference:
        return Finding(name, difference.what, str(difference))
    except SpecError as error:
        return Finding(name, f"refused {error.diagnostics[0].code}", str(error))
    except Exception as error:
        kind = "raised" if isinstance(error, TaskspecError) else "crash"
        return Finding(name, f"{kind} {type(error).__name__}", traceback.format_exc()[-1500:])
    return None


def of(names: list[str]) -> dict[str, tuple[float, Stage]]:
    """The stages of the backends asked for."""
    return {k: v for k, v in STAGES.items() if k.split()[0] in names or k.split()[0] not in BACKENDS}


BACKENDS = ("numpy", "numba", "jax")
