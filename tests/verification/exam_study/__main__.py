"""`python -m tests.verification.exam_study`: examine learners with mistakes against those without, and write docs/exam_study.md.

    python -m tests.verification.exam_study                    # the study, and the page
    python -m tests.verification.exam_study --learner replay   # of one learner; no page
    python -m tests.verification.exam_study --held            # the page, from the exams that were held so far
    python -m tests.verification.exam_study --baselines        # keep the results of right versions beside the specs

What was done is read again, from build/exam_study, as long as no learner has changed.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time

from tests.verification.exam_study import exams
from tests.verification.exam_study.bugs import Bug, bugs
from tests.verification.exam_study.exams import Found
from tests.verification.exam_study.page import NAMES, written


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.exam_study",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--learner", choices=exams.TERMS, action="append", help="default: all of them; else no page")
    parser.add_argument(
        "--right", type=int, default=len(exams.OF_RIGHT_ONES), help="exams of each right version, at most"
    )
    parser.add_argument("--held", action="store_true", help="only exams that were held before; writes the page")
    parser.add_argument("--baselines", action="store_true", help="keep the results of the right versions")
    given = parser.parse_args()
    learners = given.learner or list(exams.TERMS)
    if given.baselines:
        for learner in learners:
            keep(learner)
        return
    begin = time.perf_counter()
    wrong: list[tuple[Bug, Found]] = []
    for bug in exams.chosen(bugs(), learners):
        if given.held and not exams.is_held(f"{bug.learner}-{bug.name}"):
            continue
        found = exams.of_bug(bug)
        wrong.append((bug, found))
        progress(begin, bug.learner, bug.what, found, found.cause(bug))
    right: dict[tuple[str, int], Found] = {}
    for number, learner in itertools.product(range(len(exams.OF_RIGHT_ONES)), learners):
        first = exams.OF_RIGHT_ONES[number]
        is_wanted = number < min(given.right, exams.TERMS[learner].right)
        if is_wanted and (not given.held or exams.is_held(f"{learner}-right-{first}")):
            right[learner, first] = exams.of_right(learner, number)
            progress(begin, learner, f"right, seeds from {first}", right[learner, first], "")
    if not given.learner:
        written(wrong, right)


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
