"""`python -m tests.verification.calibration`: examine learners over tables, right and wrong ones, on fresh seeds.

    python -m tests.verification.calibration                          # right learners: nothing may be named or flagged
    python -m tests.verification.calibration --wrong unseen --budgets 1      # wrong ones, each against its right version
    python -m tests.verification.calibration --learner sarsa --first 500000

An exam of a right learner is compared with the one before it. A budget is a multiple of the steps of the probes. What is printed
are lines, and a summary: exams, names, diagnoses, flags.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

from tests.verification.calibration.exams import Asked, Told, is_named, run
from tests.verification.calibration.learners import RIGHT
from tests.verification.calibration.page import SEEDS_OF_AN_EXAM, store, written
from tests.verification.calibration.wrong import Mistake, mistakes


def lines(asked: Asked, results: list[Told]) -> Iterator[str]:
    """Yield a line for each exam."""
    for each in results:
        who = f"{asked.learner}, {asked.budget:g} of the budget, seeds from {each.first}"
        if asked.mistake is not None:
            who = f"{asked.mistake.name} in {who}"
        notes = (f"({name})" for name in each.notes)
        diagnoses = (f"`{name}`" for name in each.diagnoses)
        named = ", ".join((*each.names, *notes, *diagnoses)) or "nothing named"
        flagged = ", ".join(each.flags) or "no flag"
        yield f"{who}: {named}; {flagged}"


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.calibration",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("--wrong", metavar="FILE", help="wrong learners instead of right ones: `wrong` or `unseen`")
    parser.add_argument("--learner", action="append", help="default: all of them")
    parser.add_argument("--budgets", default="0.1,1,5", help="multiples of the steps of the probes (default: 0.1,1,5)")
    parser.add_argument("--exams", type=int, default=2, help="of each learner with each budget")
    parser.add_argument("--seeds", type=int, default=5, help="of each exam")
    parser.add_argument("--first", type=int, default=300_000, help="the first of all seeds")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    given = parser.parse_args()
    firsts = tuple(given.first + SEEDS_OF_AN_EXAM * i for i in range(given.exams))
    budgets = [float(budget) for budget in given.budgets.split(",")]
    subjects: list[tuple[str, Mistake | None]] = [(name, None) for name in RIGHT]
    if given.wrong:
        subjects = [(each.learner, each) for each in mistakes(given.wrong)]
    asked = []
    for (learner, mistake), budget in itertools.product(subjects, budgets):
        if not given.learner or learner in given.learner:
            asked.append(Asked(learner, budget, firsts, given.seeds, mistake))
    everything: list[tuple[Asked, Told]] = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for one, results in zip(asked, pool.map(run, asked), strict=True):
            everything += [(one, each) for each in results]
            store(given.wrong or "right", one, results)
            for line in lines(one, results):
                print(line, flush=True)
    print(summary(everything))
    written()


def summary(everything: list[tuple[Asked, Told]]) -> str:
    """Return the number of exams, of names and of flags; of wrong learners, of right and wrong names."""
    named = [(asked, each) for asked, each in everything if each.names or each.diagnoses]
    flagged = sum(bool(each.flags) for _, each in everything)
    if not any(asked.mistake for asked, _ in everything):
        wrong_names = sum(bool(each.names) for _, each in named)
        return f"{len(everything)} exams, {wrong_names} wrong names, {len(named)} with a name or a diagnosis, {flagged} flagged"
    judged = [is_named(asked.mistake.causes, each) for asked, each in everything if asked.mistake is not None]
    return (
        f"{len(everything)} exams, {judged.count(True)} rightly named, {judged.count(False)} wrongly, {flagged} flagged"
    )


if __name__ == "__main__":
    main()
