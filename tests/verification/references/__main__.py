"""`python -m tests.verification.references`: our learners beside those of other libraries, with the same settings.

    python -m tests.verification.references ppo         # beside that of Stable-Baselines3
    python -m tests.verification.references bc gail     # beside those of imitation, which needs Gymnasium 0.29
    python -m tests.verification.references             # all of them, and the table and picture of docs/explain/learners.md

Ours and theirs are trained by the same exam, for as many steps, on as many seeds. What was done is read again from
build/references.
"""

from __future__ import annotations

import argparse
from importlib.metadata import version
from pathlib import Path

from taskspec.exam import Exam, Running, examine
from tests.verification.references import page
from tests.verification.references.theirs import SETTINGS

HERE = Path(__file__).parent
BUILD = HERE.parents[2] / "build/references"
TERMS = {
    "ppo": {"tasks": ["NoisyObs?L=5", "Parabola"], "steps": 60_000},
    "bc": {"tasks": ["NoisyObs", "LargestSum"], "steps": 1, "transitions": 1_000},
    "gail": {"tasks": ["NoisyObs?L=5", "LargestSum?L=4"], "steps": 40_000, "transitions": 2_000},
}
"""What each of them is examined on."""
LIBRARIES = {"ppo": "stable-baselines3", "bc": "imitation", "gail": "imitation"}


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m tests.verification.references",
        description=__doc__,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    parser.add_argument("learners", nargs="*", choices=[*TERMS, []], help="default: all of them; else no page")
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    found = []
    for name in given.learners or TERMS:
        library = f"{LIBRARIES[name]} {version(LIBRARIES[name])}"
        ours = examined(name, f"{SETTINGS / name}.yaml", "ours", given.seeds, given.jobs)
        theirs = examined(name, f"{HERE / 'theirs.py'}:{name}", "theirs", given.seeds, given.jobs)
        found += page.compared(name, library, ours, theirs)
        print("\n".join(page.row(each) for each in found if each.learner == name), flush=True)
    if not given.learners:
        page.written(found)


def examined(name: str, learner: str, whose: str, seeds: int, jobs: int) -> Exam:
    return examine(
        learner, seeds=seeds, twins=0, peeks=False, out=BUILD / name / whose, running=Running(jobs), **TERMS[name]
    )


if __name__ == "__main__":
    main()
