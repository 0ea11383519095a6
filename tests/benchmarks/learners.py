"""Training steps per second of learners with nets, for numbers of seeds that are trained together."""

from __future__ import annotations

import time
from collections.abc import Sequence

from taskspec.cli.console import say, write_json
from taskspec.language.registry import load
from taskspec.learn.exam.case import Case, ExamTerms
from taskspec.learn.jobs.code_hash import machine
from taskspec.learn.learners import learner
from taskspec.show.terminal.styled_text import Columns, console
from tests.benchmarks import printed

LEARNERS = ("ppo", "gail_im", "airl_im_sa", "drlhp_sa")
SHORT = 12_800
LONG = 499_200
"""Granted steps of two trainings. What both take, such as compilation, is no part of the rate, which is of the steps taken."""


def bench(names: Sequence[str], task: str, seeds: Sequence[int], json: bool) -> None:
    """Print steps per second of wall-clock time, summed over the seeds."""
    import jax

    device = jax.devices()[0].device_kind
    rows = []
    _trained(names[0], task, seeds[0], SHORT)  # what the device does once
    for name in names:
        for count in seeds:
            few, short = _trained(name, task, count, SHORT)
            many, long = _trained(name, task, count, LONG)
            rows.append({"learner": name, "seeds": count, "steps_per_second": count * (many - few) / (long - short)})
            say(f"{name}, {count} seeds: {short:.1f} s and {long:.1f} s", err=True)
    if json:
        write_json({"machine": machine(), "device": device, "task": task, "results": rows})
        return
    table = Columns("learner", "seeds", "thousand steps/s", right=(1, 2))
    for row in rows:
        table.add_row(row["learner"], f"{row['seeds']:,}", f"{row['steps_per_second'] / 1000:,.0f}")
    console().print(table)
    printed.footer(f"steps per second on {task}, on {device}", 1, "wall", {"python", "jax", "optax"})


def _trained(name: str, task: str, seeds: int, steps: int) -> tuple[int, float]:
    """Return the steps that each seed took, and the wall-clock seconds of a training, compilation included."""
    train = learner(name)
    case = Case(load(task), tuple(range(seeds)), ExamTerms(steps, train.learns_from, steps), False)
    begin = time.perf_counter()
    train(case)
    seconds = time.perf_counter() - begin
    return case.spent.steps, seconds
