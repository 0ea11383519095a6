"""One process of a run: a range of models with claims on each, one line of JSON on each."""

from __future__ import annotations

import sys
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any
from unittest import mock

from taskspec.base.diagnostics import SpecError
from taskspec.exact import verdicts
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve import rational
from tests.verification.oracle.compare import exact
from tests.verification.oracle.compare.cases import Difference
from tests.verification.oracle.worker import Hang, patience, peak_memory, say
from tests.verification.proofs import storm
from tests.verification.proofs.claims import Claim, claims
from tests.verification.proofs.subjects import Subject, subject

PATIENCE = 60
"""Seconds of the processor that a model may take, with everything that is asked of it."""
IN_FLOATS = 3
"""One model in so many is solved in floats with error bounds, although rationals could."""


@dataclass
class Outcome:
    made: Counter[str] = field(default_factory=Counter)
    found: list[dict[str, Any]] = field(default_factory=list)

    def fault(self, stage: str, what: str, detail: str) -> None:
        self.found.append({"stage": stage, "what": what, "detail": detail})


def examined(number: int, count: int) -> Outcome:
    """The model with a number, and so many claims about it."""
    outcome = Outcome()
    try:
        with patience(PATIENCE):
            put_through(subject(number), count, outcome)
    except Hang:
        outcome.fault("any", "hang", f"longer than {PATIENCE} s")
    return outcome


def put_through(about: Subject, count: int, outcome: Outcome) -> None:
    outcome.made[f"family {about.family}"] += 1
    stages: dict[str, Callable[[], None]] = {
        "rows": lambda: rows(about, outcome),
        "storm": lambda: by_storm(about, outcome),
        "returns": lambda: returns(about, outcome),
        "claims": lambda: judged(about, claims(about, count), outcome),
    }
    for name, stage in stages.items():
        in_floats = about.case.seed % IN_FLOATS == 0 and name in ("returns", "claims")
        context: AbstractContextManager[Any] = (
            mock.patch.object(rational, "MOST_WORK", 0) if in_floats else nullcontext()
        )
        try:
            with context:
                stage()
        except Difference as difference:
            outcome.fault(name, difference.what, str(difference))
        except Exception as error:
            outcome.fault(name, f"crash {type(error).__name__}", traceback.format_exc()[-1500:])


def rows(about: Subject, outcome: Outcome) -> None:
    """The rows of the exact model beside those of the second interpreter."""
    if about.model is None or "abstraction" in about.case.spec:
        return
    try:
        outcome.made["rows"] += exact.rows(about.case, about.model)
    except SpecError as error:
        if not exact.refused(error):
            raise


def by_storm(about: Subject, outcome: Outcome) -> None:
    """Storm beside brute force: the same rationals."""
    if not storm.is_installed():
        return
    for world in about.worlds():
        mine = world.returns
        for name, value in storm.returns(world).items():
            outcome.made["storm"] += 1
            if name not in mine or mine[name] != value:
                raise Difference("Storm differs", f"{name} is {value}, by brute force {mine.get(name)}")


def returns(about: Subject, outcome: Outcome) -> None:
    """Returns with their errors beside brute force, for both readings of decimals."""
    results = Results(about.case.task)
    for as_written, world in zip((True, False), about.worlds(), strict=False):
        for name, value in world.returns.items():
            which = name.removesuffix("_return")
            found = results.enclosure(which, as_written)
            if found is None:
                outcome.made["returns withheld"] += 1
                continue
            slack = Fraction(1, 10**9) * max(1, abs(value)) if about.rough else 0
            if not found.low - slack <= value <= found.high + slack:
                raise Difference("return", f"{name} is {found}, expected {float(value)} = {value}")
            outcome.made["returns"] += 1


ALLOWED = {
    True: ("proved", "tested", "undecided"),
    False: ("false", "contradicted", "tested", "undecided"),
    None: ("undecided", "tested"),
}
TRUTH = {True: "true", False: "false", None: "decimals decide"}


def judged(about: Subject, made: list[Claim], outcome: Outcome) -> None:
    """The verdicts on claims beside the truth."""
    task = about.claiming([c.data for c in made]).task
    expected = [(c, truth) for c in made for truth in c.truths]
    for (claim, truth), verdict in zip(expected, verdicts(task), strict=True):
        outcome.made["claims"] += 1
        outcome.made[f"claims, {claim.kind}: {TRUTH[truth]}, {verdict.status}"] += 1
        if verdict.status not in ALLOWED[truth]:
            detail = f"{claim.data} for {dict(verdict.parameters)}: {verdict.detail}"
            outcome.fault("claims", f"{TRUTH[truth]} claim {verdict.status}", detail)


def main(first: int, last: int, count: int) -> None:
    warnings.simplefilter("error")  # nothing that warns goes unnoticed
    for number in range(first, last):
        say({"begun": number})
        begun = time.process_time()
        outcome = examined(number, count)
        seconds = round(time.process_time() - begun, 4)
        say({"spec": number, "made": outcome.made, "found": outcome.found, "seconds": seconds})
    say({"peak": peak_memory()})


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4]))
