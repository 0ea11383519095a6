"""Draw `docs/measures.svg`: measures of difficulty beside the steps that Q-learning needs: `python -m docs.tools.measures`.

Results are kept in `build/measures`; a run that was stopped goes on from there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import stats

from docs.tools.markdown import filled
from taskspec.base.display import fixed
from taskspec.exam.case import Case, ExamTerms
from taskspec.exam.trial import key_of
from taskspec.experiments.instances import Instance
from taskspec.experiments.races import family_of, rounds
from taskspec.experiments.references import GAMMA, STEP_SIZE, ObservationTable
from taskspec.figures import chart
from taskspec.figures.chart import Axes, Scale
from taskspec.figures.shapes import Item, Line, Scene
from taskspec.figures.vector_formats import svg
from taskspec.jobs.running import Running, run
from taskspec.jobs.store import Job, Store
from taskspec.policies.values import observed_value
from taskspec.scores.difficulty import MEASURES, difficulty
from taskspec.scores.returns import Results

DOCS = Path(__file__).parents[1]
FAMILIES = ("tables", "chains", "trees", "grids", "delays")
EACH = 40
"""Tasks of each family."""
SEEDS = 3
STEPS = 5_000
EVERY = 100
"""Steps between looks at the greedy policy."""
SOLVED = 0.9
SHOWN = [name for name in MEASURES if name not in ("hidden_bits",)]


def measured(instance: Instance) -> dict[str, float | None]:
    """Return the measures of a task, and the median number of steps after which Q-learning solves it.

    Nothing is returned for a task on which random actions are as good as any.
    """
    results = Results(instance.load(), 1000)
    if results.random is None or results.optimal is None or results.optimal.value - results.random.value < 1e-6:
        return {}
    found = dict(difficulty(results, SHOWN))
    needed = [steps_to_solve(results, seed) for seed in range(SEEDS)]
    return {**found, "steps": float(np.median(needed))}


def steps_to_solve(results: Results, seed: int) -> float:
    """Return the steps after which the greedy policy of Q-learning has a score of 0.9; infinite where it never has."""
    random = results.random
    best = results.optimal
    assert random is not None and best is not None
    case = Case(results.task, (seed,), ExamTerms(STEPS, ("reward",)))
    Q = ObservationTable(case)
    env = case.env()
    obs, _ = env.reset()
    for step in range(STEPS):
        if step % EVERY == 0:
            value = observed_value(results, Q, seed).deterministic.value
            if value - random.value >= SOLVED * (best.value - random.value):
                return step
        a = Q.explored(obs)
        after, reward, terminated, truncated, _ = env.step(Q.first + a)
        V = 0.0 if terminated else Q[after].max()
        Q[obs][a] += STEP_SIZE * (reward + GAMMA * V - Q[obs][a])
        obs = env.reset()[0] if terminated or truncated else after
    return math.inf


def rows() -> list[dict[str, float | None]]:
    """Return the measures of all tasks on which something can be won."""
    jobs = []
    for family in FAMILIES:
        for instance in next(rounds(family_of(f"families/{family}"), 0))[:EACH]:
            key = key_of("measures", instance.id, instance.content_hash, SHOWN, SEEDS, STEPS)
            jobs.append(Job(key, instance.id, "docs.tools.measures:measured", (instance,)))
    with Store(Path("build/measures/results.sqlite")) as store:
        found = run(jobs, store, Running(seconds=600), "measures")
    return [each.value for each in found.values() if each.value]


class Correlation(NamedTuple):
    """The rank correlation of a measure with the steps that are needed, its 95 % interval, and the number of tasks."""

    name: str
    value: float
    low: float
    high: float
    tasks: int


def correlations(found: Sequence[dict[str, float | None]]) -> Iterator[Correlation]:
    """Yield Spearman's correlations, with the intervals of Bonett and Wright (2000)."""
    for name in SHOWN:
        pairs = [(row[name], row["steps"]) for row in found if row[name] is not None]
        if len({value for value, _ in pairs}) < 2:
            continue
        value = float(stats.spearmanr(*zip(*pairs, strict=True)).statistic)
        reach = 1.96 * math.sqrt((1 + value**2 / 2) / (len(pairs) - 3))
        yield Correlation(
            name, value, math.tanh(math.atanh(value) - reach), math.tanh(math.atanh(value) + reach), len(pairs)
        )


def picture(found: Sequence[Correlation]) -> Scene:
    """Draw correlations as marks with their intervals, one row for each measure."""
    ends = Scale(
        -1, 1, tuple((x, f"{x:g}") for x in (-1, -0.5, 0, 0.5, 1)), "rank correlation with the steps of Q-learning"
    )
    ticks = tuple((len(found) - 1 - i, f"{c.name}  {fixed(c.value, 2)}") for i, c in enumerate(found))
    names = Scale(-0.5, len(found) - 0.5, ticks)
    plot = Axes(0.0, 0.0, 8.0, 0.5 * len(found), ends, names)
    items: list[Item] = [*chart.frame(plot), chart.upright(plot, 0)]
    for i, each in enumerate(found):
        y = len(found) - 1 - i
        items.append(Line((plot.at(each.low, y), plot.at(each.high, y)), color=chart.BLUE))
        items.append(chart.mark(plot.at(each.value, y), "circle", chart.BLUE, filled=True))
    return chart.chart(items, "Rank correlations of measures of difficulty with the steps that Q-learning needs")


def main() -> None:
    """Draw the figure, and write the number of tasks that were solved."""
    found = rows()
    ordered = sorted(correlations(found), key=lambda each: -each.value)
    (DOCS / "measures.svg").write_text(svg(picture(ordered)) + "\n", encoding="utf-8")
    solved = sum(row["steps"] != math.inf for row in found)
    page = DOCS / "difficulty.md"
    page.write_text(filled(page, {"solved": f"{solved} of {len(found)}"}), encoding="utf-8")


if __name__ == "__main__":
    main()
