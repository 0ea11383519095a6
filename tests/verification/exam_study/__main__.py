"""`python -m tests.verification.exam_study`: examine learners with mistakes against those without, and write the page of it.

    python -m tests.verification.exam_study                    # the study, and the page
    python -m tests.verification.exam_study --learner replay   # the exams of one learner alone
    python -m tests.verification.exam_study --page             # the page, from the results that are kept
    python -m tests.verification.exam_study --baselines        # keep the exams of right versions beside the specs

An exam is read again from build/exam_study as long as its learner has not changed; what exams found is kept in results.json.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections.abc import Sequence

from tests.verification.exam_study import exams
from tests.verification.exam_study.bugs import bugs
from tests.verification.exam_study.exams import Found
from tests.verification.exam_study.page import NAMES, written


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.exam_study",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--learner", choices=exams.TERMS, action="append", help="default: all of them")
    parser.add_argument("--mistakes", action="store_true", help="no exams of right versions")
    parser.add_argument("--right", type=int, default=100, help="exams of each right version, at most")
    parser.add_argument("--page", action="store_true", help="no exams: the page, from the results that are kept")
    parser.add_argument("--baselines", action="store_true", help="keep the exams of the right versions")
    given = parser.parse_args()
    learners = given.learner or list(exams.TERMS)
    if given.baselines:
        for learner in learners:
            keep(learner)
        return
    if not given.page:
        examine_all(learners, 0 if given.mistakes else given.right)
    written(exams.results())


def examine_all(learners: Sequence[str], right: int) -> None:
    """Examine the learners with mistakes, then each right version up to `right` times."""
    begin = time.perf_counter()
    for bug in bugs():
        if bug.learner in learners:
            found = exams.of_bug(bug)
            exams.store(f"{bug.learner} {bug.name}", found)
            progress(begin, bug.learner, bug.what, found, found.cause(bug))
    for number, learner in itertools.product(range(right), learners):
        if number < exams.TERMS[learner].right:
            first = exams.OF_RIGHT_ONES[number]
            found = exams.of_right(learner, number)
            exams.store(f"{learner} {first}", found)
            progress(begin, learner, f"right, seeds from {first}", found, "")


def keep(learner: str) -> None:
    """Examine a right version, and keep its results in the repository."""
    if not exams.TERMS[learner].is_shipped:
        return
    path = exams.BASELINES / f"{learner}.json"
    path.write_text(json.dumps({**exams.shipped(learner), "learner": learner}, indent=1) + "\n", encoding="utf-8")
    print(path.relative_to(exams.ROOT))


def progress(begin: float, learner: str, what: str, found: Found, cause: str) -> None:
    """Print a line about a learner: the parts of the exam that flag it, and the cause."""
    parts = [part for part, flagged in found.flagged.items() if flagged]
    named = (
        f"; named: {', '.join(found.named)} ({cause or 'right versions have none'})" if found.named else f"; {cause}"
    )
    line = f"{NAMES[learner]}, {what}: {', '.join(parts) or 'nothing'}{named}"
    print(f"{time.perf_counter() - begin:6.0f} s  {line}", flush=True)


if __name__ == "__main__":
    main()
