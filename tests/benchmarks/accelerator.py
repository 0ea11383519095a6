"""Many lanes inside `scan`, on the device that JAX finds: the tasks of DERAIL, and games beside gymnax."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from taskspec.base.extras import is_installed
from taskspec.cli.console import say, write_json
from taskspec.language.registry import load
from taskspec.learn.jobs.code_hash import machine
from taskspec.show.terminal.styled_text import console
from tests.benchmarks import peers, printed
from tests.benchmarks.race import Contestant, Rate, ours, rates
from tests.benchmarks.tables import CHOSEN, SUITE
from tests.shared.specs import spec_file

LANES = (2**14, 2**20)


def bench(lanes: Sequence[int], rounds: int, seconds: float, json: bool) -> None:
    """Print steps per second, in wall-clock time, of each task and number of lanes."""
    import jax

    device = jax.devices()[0].device_kind
    measured: list[Rate] = []
    missing: dict[str, str] = {}
    for group in _groups(lanes):
        say(group[0].task, err=True)
        measured += _raced(group, rounds, seconds, missing)
    if json:
        results = [rate.data() for rate in measured]
        write_json({"machine": machine(), "device": device, "rounds": rounds, "results": results, "missing": missing})
        return
    console(wide=True).print(printed.sections(measured))
    for name, why in missing.items():
        say(f"{name}: not measured ({why})")
    packages = {"python", "numpy", "jax", "gymnax"}
    printed.footer(f"steps per second inside scan, with resets, on {device}", rounds, "wall", packages)


def _groups(lanes: Sequence[int]) -> list[list[Contestant]]:
    """Return what is compared: a group for each task, with gymnax where that has the same game."""
    found = []
    for game in CHOSEN:
        task = load(spec_file(game.spec), **game.parameters)
        group = [ours(task, "jax-scan", count, name=task.name) for count in lanes]
        if is_installed("gymnax"):
            group += [peers.gymnax(game.gymnax, task.name, count, game.options, game.params) for count in lanes]
        found.append(group)
    for name in SUITE:
        task = load(f"derail/{name}-v0")
        found.append([ours(task, "jax-scan", count, name=name) for count in lanes])
    return found


def _raced(group: Sequence[Contestant], rounds: int, seconds: float, missing: dict[str, str]) -> list[Rate]:
    """Return the rates of those in a group that fit into the memory of the device."""
    ready: list[tuple[Contestant, Any]] = []
    for contestant in group:
        try:
            drive = contestant.make()
            drive()
        except Exception as error:  # the memory of the device, or the code of others
            label = f"{contestant.task} on {contestant.program}, {contestant.lanes:,} lanes"
            missing[label] = str(error).partition("\n")[0]
            continue
        ready.append((contestant, drive))
    return rates(ready, rounds, seconds, time.perf_counter)
