"""`taskspec separate`: a small task that tells two learners apart."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from taskspec.base.files import near, write_text
from taskspec.base.limits import tell
from taskspec.cli import options
from taskspec.cli.completions import complete_experiments, complete_learners
from taskspec.cli.console import misuse, progress, say, write_json

FAMILY = "families/tables"
Learner = Annotated[
    str,
    Argument(metavar="A", autocompletion=complete_learners, help="A learner, as [cyan]FILE.py:train[/] or by name."),
]
Opponent = Annotated[
    str | None,
    Argument(
        metavar="[B]", autocompletion=complete_learners,
        help="Another one; right Q-learning unless given, on tasks that right learners master.",
    ),
]  # fmt: skip
Family = Annotated[
    str,
    Option(
        "--in", metavar="EXPERIMENT", autocompletion=complete_experiments,
        help="Tasks to search: an experiment, by its path or name, or a suite.",
    ),
]  # fmt: skip
Output = Annotated[Path, options.file_option("--output", "-o", help="The spec; separates.yaml by default.")]


def separate(
    first: Learner,
    second: Opponent = None,
    family: Family = FAMILY,
    minutes: Annotated[float, Option("--minutes", help="Time that the search may take.")] = 3.0,
    steps: Annotated[int, Option("--steps", min=1, help="Environment steps of each training run.")] = 3000,
    seed: Annotated[int, options.seed_option("Seed of the search.")] = 0,
    output: Output = Path("separates.yaml"),
    jobs: options.Jobs = None,
    json: options.Json = False,
) -> None:
    """Find the smallest task on which a learner does worse than another.

    Many instances of a family are tried, the best of them is tested on fresh seeds, shrunk while the difference holds, and
    tested on fresh seeds again. Ctrl-C ends the search, and keeps the best task so far.
    """
    from taskspec.learn.exam.examinee import learner_of
    from taskspec.tools.separation.races import family_of
    from taskspec.tools.separation.separate import Search, print_separation, record, spec_of

    if not minutes > 0:
        raise misuse(f"--minutes is a number above 0, not {minutes:g}")
    tasks = family_of(family)
    opponent = None
    if second is not None:
        opponent = learner_of(second)
    search = Search(
        tasks, learner_of(first), opponent, seed=seed, steps=steps, minutes=minutes, workers=jobs, progress=tell
    )
    with progress("searching"):
        separation = search.run()
    if json:
        write_json(record(separation))
        return
    if not separation.worse:
        say(f"No difference found in {separation.tried} tasks of {family}.")
        return
    print_separation(separation)
    text = spec_of(separation, family)
    if text is not None:
        write_text(output, text)
        say("\n" + text[text.index("state:") :])
        say(f"wrote {near(output)}")
