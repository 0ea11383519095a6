"""The scalar environments that `gym.make` gives, against those of seals: same dynamics, same process, taking turns."""

from __future__ import annotations

import platform
import statistics
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium

from taskspec.cli.failures import refuse
from taskspec.diagnostics import suggest

TABULAR, CONTINUOUS, SORT, NOISY = 30.0, 20.0, 15.0, 10.0
WARM_STEPS = 2000
ACTIONS = 4096


@dataclass(frozen=True, slots=True)
class Pair:
    """One of our tasks, the environment of seals that it equals step for step, and how many times faster it has to be."""

    ours: str
    theirs: str
    target: float


PAIRS = (
    Pair("RiskyPathSeals", "RiskyPath", TABULAR),
    Pair("BranchingSeals", "Branching", TABULAR),
    Pair("EarlyTermPosSeals", "EarlyTermPos", TABULAR),
    Pair("EarlyTermNegSeals", "EarlyTermNeg", TABULAR),
    Pair("InitShiftExpertSeals", "InitShiftTrain", TABULAR),
    Pair("InitShiftLearnerSeals", "InitShiftTest", TABULAR),
    Pair("ParabolaSeals", "Parabola", CONTINUOUS),
    Pair("ProcGoalSeals", "ProcGoal", CONTINUOUS),
    Pair("LargestSumSeals", "LargestSum", CONTINUOUS),
    Pair("SortSeals", "Sort", SORT),
    Pair("NoisyObsSeals", "NoisyObs", NOISY),
)


@dataclass(frozen=True, slots=True)
class Result:
    """Steps per second of both sides, round by round."""

    pair: Pair
    ours: tuple[float, ...]
    theirs: tuple[float, ...]

    @property
    def ratios(self) -> tuple[float, ...]:
        return tuple(a / b for a, b in zip(self.ours, self.theirs, strict=True))

    @property
    def ratio(self) -> float:
        return statistics.median(self.ratios)

    @property
    def met(self) -> bool:
        return self.ratio >= self.pair.target


def bench(tasks: Sequence[str], rounds: int, seconds: float, json: bool) -> bool:
    """Measure, print, and say whether every target is met."""
    _import_seals()
    results = [measure(pair, rounds, seconds) for pair in _shown(_chosen(tasks), json)]
    _print_json(results, rounds, seconds) if json else _print(results)
    return all(result.met for result in results)


def _import_seals() -> None:
    try:
        import seals  # noqa: F401  # registers its environments
    except ImportError:
        hint = 'pip install "taskspec[bench]"'
        raise refuse("E705", "this benchmark needs seals 0.2.1, which is not installed", hint) from None


def _chosen(names: Sequence[str]) -> list[Pair]:
    known = {name: pair for pair in PAIRS for name in (pair.theirs, pair.ours, pair.ours.removesuffix("Seals"))}
    for name in names:
        if name not in known:
            hint = suggest(name, known) or ", ".join(pair.theirs for pair in PAIRS)
            raise refuse("E701", f"the benchmark has no task '{name}'", hint)
    return list(dict.fromkeys(known[name] for name in names)) if names else list(PAIRS)


def _shown(pairs: list[Pair], quiet: bool) -> Any:
    """The pairs, behind a progress bar on a terminal."""
    from rich.progress import track

    from taskspec.cli.console import console

    err = console(err=True)
    return track(pairs, "measuring", console=err, transient=True, disable=quiet or not err.is_terminal)


# -- measuring ----------------------------------------------------------------------------------------------------


def measure(pair: Pair, rounds: int, seconds: float) -> Result:
    """Steps per second of both sides in turn, so that a slow moment of the machine meets both."""
    sides = [_Side(f"derail/{pair.ours}-v0"), _Side(f"seals/{pair.theirs}-v0")]
    for side in sides:
        side.calibrate(seconds)
    found = [[side.steps_per_second() for side in sides] for _ in range(rounds)]
    ours, theirs = zip(*found, strict=True)
    return Result(pair, tuple(ours), tuple(theirs))


class _Side:
    """One environment, as registered, driven by random actions drawn beforehand."""

    def __init__(self, env_id: str) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # seals declares float64 bounds
            self.env = gymnasium.make(env_id)
            self.env.reset(seed=0)
        self.env.action_space.seed(0)
        self.actions = [self.env.action_space.sample() for _ in range(ACTIONS)]
        self.passes = 1

    def calibrate(self, seconds: float) -> None:
        """Warm up, and find how many passes over the actions take so long."""
        self._drive(WARM_STEPS // 2)
        rate = WARM_STEPS / self._drive(WARM_STEPS)
        self.passes = max(1, round(rate * seconds / ACTIONS))

    def steps_per_second(self) -> float:
        return self.passes * ACTIONS / sum(self._drive(ACTIONS) for _ in range(self.passes))

    def _drive(self, steps: int) -> float:
        """Seconds of processor time for so many steps, with the resets that they need."""
        step, reset, actions = self.env.step, self.env.reset, self.actions[:steps]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reset()
            start = time.process_time()
            for action in actions:
                _, _, terminated, truncated, _ = step(action)
                if terminated or truncated:
                    reset()
            return time.process_time() - start


# -- output -------------------------------------------------------------------------------------------------------


def _print(results: Sequence[Result]) -> None:
    from rich.text import Text

    from taskspec.cli.console import columns, console

    table = columns("", "task", "taskspec", "±", "seals", "±", "ratio", "spread", "target", right=(2, 3, 4, 5, 6, 7, 8))
    for r in results:
        mark = Text("✓", style="good") if r.met else Text("✗", style="bad")
        low, high = min(r.ratios), max(r.ratios)
        ratio = Text(f"{r.ratio:.1f}×", style="title")
        table.add_row(
            mark, Text(r.pair.theirs, style="name"), f"{statistics.median(r.ours):,.0f}", _spread(r.ours),
            f"{statistics.median(r.theirs):,.0f}", _spread(r.theirs), ratio, f"{low:.0f}–{high:.0f}", f"{r.pair.target:.0f}×",
        )  # fmt: skip
    out = console(wide=True)
    out.print(table)
    rounds = len(results[0].ours)
    out.print(f"\nsteps per second, resets included: medians of {rounds} rounds, one core, {_machine()}", style="quiet")


def _spread(rates: Sequence[float]) -> str:
    """Half the distance between the quartiles, in percent of the median."""
    if len(rates) < 2:
        return ""
    low, _, high = statistics.quantiles(rates, n=4)
    return f"{50 * (high - low) / statistics.median(rates):.0f}%"


def _machine() -> str:
    return f"Python {platform.python_version()}, gymnasium {gymnasium.__version__}"


def _print_json(results: Sequence[Result], rounds: int, seconds: float) -> None:
    from taskspec.cli.console import write_json

    rows = [
        {
            "task": f"derail/{r.pair.ours}-v0", "seals": f"seals/{r.pair.theirs}-v0", "ratio": r.ratio, "target": r.pair.target,
            "met": r.met, "steps_per_second": statistics.median(r.ours), "seals_steps_per_second": statistics.median(r.theirs),
            "rounds": {"taskspec": list(r.ours), "seals": list(r.theirs)},
        }
        for r in results
    ]  # fmt: skip
    write_json({"machine": _machine(), "rounds": rounds, "seconds": seconds, "results": rows})
