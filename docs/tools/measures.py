"""Draw `docs/pictures/measures.svg`: measures of difficulty beside the steps that learners need: `python -m docs.tools.measures`.

Results are kept in `build/measures`; a run that was stopped goes on from there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from docs.tools.markdown import filled
from taskspec.base.display import fixed
from taskspec.exact.scores.difficulty import MEASURES, difficulty
from taskspec.exact.scores.measures import score_of
from taskspec.exact.scores.returns import Results
from taskspec.learn.exam.case import Case, ExamTerms
from taskspec.learn.exam.curves import steps_to
from taskspec.learn.exam.trial import Trial, key_of, run_trial
from taskspec.learn.experiments.instances import Instance
from taskspec.learn.experiments.tabular_learners import GAMMA, STEP_SIZE, ObservationTable
from taskspec.learn.jobs.running import Running, run
from taskspec.learn.jobs.store import Job, Store
from taskspec.learn.learners.built_in import learner
from taskspec.learn.observed_policies import observed_value
from taskspec.show.figures import chart
from taskspec.show.figures.chart import Chart
from taskspec.tools.separation.races import family_of, rounds

DOCS = Path(__file__).parents[1]
FAMILIES = ("tables", "chains", "trees", "grids", "delays")
EACH = 40
"""Tasks of each family."""
SEEDS = 3
STEPS = {"Q-learning": 5_000, "PPO": 20_000}
EVERY = 100
"""Steps between looks at the greedy policy of Q-learning."""
LOOKS = 78
"""Looks at the policy of PPO, one after every second round of 128 steps."""
SOLVED = 0.9
COLUMNS = (1.28, 1.45)
"""Where the numbers of each learner end, on the axis of correlations."""
SHOWN = [name for name in MEASURES if name not in ("hidden_bits",)]


def measured(instance: Instance) -> dict[str, float | None]:
    """Return the measures of a task, and the median numbers of steps after which Q-learning and PPO solve it.

    Nothing is returned for a task on which random actions are as good as any.
    """
    results = Results(instance.load(), 1000)
    if results.random is None or results.optimal is None or results.optimal.value - results.random.value < 1e-6:
        return {}
    found = dict(difficulty(results, SHOWN))
    return {**found, "Q-learning": float(np.median(q_learning(results))), "PPO": float(np.median(ppo(results)))}


def q_learning(results: Results) -> list[float]:
    """Return the steps of each seed after which the greedy policy has a score of 0.9; infinite where it never has."""
    return [_q_learning(results, seed) for seed in range(SEEDS)]


def _q_learning(results: Results, seed: int) -> float:
    case = Case(results.task, (seed,), ExamTerms(STEPS["Q-learning"], ("reward",)))
    Q = ObservationTable(case)
    env = case.env()
    obs, info = env.reset()
    for step in range(case.steps):
        if step % EVERY == 0 and score_of(results, observed_value(results, Q, seed).deterministic.value) >= SOLVED:
            return step
        a = Q.explored(obs, info)
        after, reward, terminated, truncated, info = env.step(Q.first + a)
        V = 0.0 if terminated else Q[after].max()
        Q[obs][a] += STEP_SIZE * (reward + GAMMA * V - Q[obs][a])
        obs = after
        if terminated or truncated:
            obs, info = env.reset()
    return math.inf


def ppo(results: Results) -> list[float]:
    """Return the steps of each seed after which the best actions of PPO have a score of 0.9; infinite where they never have."""
    from taskspec.learn.learners.deep import world

    world.CHUNKS = LOOKS  # a finer learning curve than exams need
    terms = ExamTerms(STEPS["PPO"], ("reward",))
    rows = run_trial(Trial(results.task, False, "ppo", "", terms, tuple(range(SEEDS)), 1000, ""), learner("ppo"))
    curves = [[(steps, score_of(results, value)) for steps, value in row["curve"]] for row in rows]
    needed = [steps_to(curve, SOLVED) for curve in curves]
    return [math.inf if steps is None else steps for steps in needed]


def rows() -> list[dict[str, float | None]]:
    """Return the measures of all tasks on which something can be won."""
    jobs = []
    for family in FAMILIES:
        for instance in next(rounds(family_of(f"families/{family}"), 0))[:EACH]:
            key = key_of("measures", instance.id, instance.content_hash, SHOWN, SEEDS, STEPS, LOOKS)
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


def correlations(found: Sequence[dict[str, float | None]], learner: str) -> Iterator[Correlation]:
    """Yield Spearman's correlations, with the intervals of Bonett and Wright (2000)."""
    for name in SHOWN:
        pairs = [(row[name], row[learner]) for row in found if row[name] is not None]
        if len({value for value, _ in pairs}) < 2:
            continue
        value = float(stats.spearmanr(*zip(*pairs, strict=True)).statistic)
        reach = 1.96 * math.sqrt((1 + value**2 / 2) / (len(pairs) - 3))
        yield Correlation(
            name, value, math.tanh(math.atanh(value) - reach), math.tanh(math.atanh(value) + reach), len(pairs)
        )


def picture(found: dict[str, dict[str, Correlation]]) -> Chart:
    """Draw correlations as marks with their intervals, one row for each measure.

    Args:
        found: by learner and measure.
    """
    first, second = found.values()
    names = sorted(first, key=lambda name: -first[name].value - second[name].value)
    with chart.style():
        figure = chart.figure(5, 0.24 * len(names))
        axes = figure.add_axes((0, 0, 1, 1))
        axes.set_xlim(-1, 1)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.axvline(0, color=chart.MUTED, linestyle="--", linewidth=0.8)
        for i, (who, by_measure) in enumerate(found.items()):
            color, _, marker = chart.SERIES[i]
            shown = [by_measure[name] for name in names]
            ends = [[each.value - each.low for each in shown], [each.high - each.value for each in shown]]
            rows = np.arange(len(names)) + 0.3 * i - 0.15
            values = [each.value for each in shown]
            axes.errorbar(values, rows, xerr=ends, fmt=marker, color=color, elinewidth=1, label=who)
            _column(axes, COLUMNS[i], color, [who, *(fixed(value, 2) for value in values)])
        axes.set_yticks(range(len(names)), names)
        axes.set_xlabel("rank correlation with the steps of a learner")
        chart.numbers(axes.xaxis)
        axes.legend(loc="lower right")
    return Chart(figure, "Rank correlations of measures of difficulty with the steps that Q-learning and PPO need")


def _column(axes: Any, x: float, color: str, texts: Sequence[str]) -> None:
    """Write a heading and a text for each row, flush right."""
    for row, text in enumerate(texts, start=-1):
        axes.text(x, row, text, color=color, ha="right", va="center")


def main() -> None:
    """Draw the figure, and write the numbers of tasks that were solved."""
    found = rows()
    by_learner = {who: {each.name: each for each in correlations(found, who)} for who in STEPS}
    chart.save(picture(by_learner), DOCS / "pictures" / "measures.svg")
    solved = {who: f"{sum(row[who] != math.inf for row in found)}" for who in STEPS}
    page = DOCS / "explain" / "difficulty.md"
    page.write_text(filled(page, {**solved, "compared": f"{len(found)}"}), encoding="utf-8")


if __name__ == "__main__":
    main()
