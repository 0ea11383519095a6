"""`python -m tests.verification.study`: examine learners with mistakes against those without, and write docs/mutation_study.md.

    python -m tests.verification.study --baselines        # examine the right versions, and keep what came out beside the specs
    python -m tests.verification.study                    # the study, and the page
    python -m tests.verification.study --first 100        # on other seeds, such as those for trying things out: no page

What was done is read again, from build/study, as long as no learner has changed.
"""

from __future__ import annotations

import argparse
import json
import time

from tests.verification.study import exams
from tests.verification.study.bugs import bugs
from tests.verification.study.page import written


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.study", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--learner", choices=exams.TERMS, action="append", help="default: all of them; else no page")
    parser.add_argument("--first", type=int, default=exams.OF_BUGS, help="the first seed of learners with mistakes")
    parser.add_argument("--baselines", action="store_true", help="keep the results of the right versions")
    given = parser.parse_args()
    learners = given.learner or list(exams.TERMS)
    if given.baselines:
        for learner in learners:
            keep(learner)
        return
    begin = time.perf_counter()
    wrong = []
    for bug in exams.chosen(bugs(), learners):
        wrong.append((bug, exams.found(exams.wrong(bug, given.first), bug.learner)))
        told(bug.learner, bug.name, wrong[-1][1], begin)
    right = {}
    for learner in learners:
        for first in exams.OF_RIGHT_ONES if given.first == exams.OF_BUGS else (given.first,):
            exam = exams.right(learner, first, exams.baseline(learner))
            right[learner, first] = exams.found(exam, learner)
            told(learner, f"right, seeds from {first}", right[learner, first], begin)
    if given.first == exams.OF_BUGS and not given.learner:
        written(wrong, right)


def keep(learner: str) -> None:
    """Examine a right version, and keep its results in the repository."""
    exam = exams.right(learner, exams.OF_BASELINES, None)
    path = exams.baseline(learner)
    path.parent.mkdir(exist_ok=True)
    path.write_text(json.dumps({**exam, "learner": learner}, indent=1) + "\n", encoding="utf-8")
    print(path.relative_to(exams.ROOT))


def told(learner: str, name: str, found: exams.Found, begin: float) -> None:
    """A line of progress."""
    print(f"{time.perf_counter() - begin:6.0f} s  {learner}, {name}: {found.whole or 'nothing'}", flush=True)
    if found.printed != found.whole:
        print(f"          without twins: {found.printed or 'nothing'}", flush=True)


if __name__ == "__main__":
    main()
