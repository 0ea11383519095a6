"""Specs that leave their states and look things up by anything: does any backend read outside, or differ from the others?

    python -m tests.verification.fuzz.hostile --seconds 600

builds random specs whose next states keep to no range, and walks them on the reference interpreter, in the scalar environment,
on NumPy, and through the loops of Numba's kernels with every look-up checked; `--compiled` also on Numba and JAX themselves.
"""

from __future__ import annotations

import argparse
import json
import math
import random
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from taskspec.base.diagnostics import SpecError
from taskspec.exact.model.extract import extract
from taskspec.exact.soundness.soundness import examine
from taskspec.language.expressions.types import Kind
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.programs.numba.kernel import suits
from taskspec.programs.reference import ReferenceProgram
from tests.shared.conformance import Agreement
from tests.shared.invariants import broken
from tests.verification.fuzz.kernels import Kernel

STEPS = 12


class Writer:
    """Writes expressions of ints, reals and conditions from the choices of one source of randomness."""

    def __init__(self, chance: random.Random) -> None:
        self.chance = chance
        self.primed = False
        self.drawing = True
        self.acting = True

    def whole(self, depth: int) -> str:
        c = self.chance
        if depth == 0 or c.random() < 0.15:
            atoms = ["s", "u", "t", str(c.randint(-4, 4)), str(c.choice((7, 100, -1000, 10**9)))]
            atoms += ["a"] * self.acting + ["s'", "u'"] * self.primed
            return c.choice(atoms)
        a = self.whole(depth - 1)
        b = self.whole(depth - 1)
        forms = [
            f"({a} + {b})", f"({a} - {b})", f"({a} * {b})", f"({a} // {b})", f"({a} % {b})", f"min({a}, {b})", f"max({a}, {b})",
            f"abs({a})", f"K[{a}]", f"v[{a}]", f"M[{a}, {b}]", f"K[{a}]", f"v[{a}]", f"v[{a} - 1]", f"put(v, {a}, {b})[{a}]",
            f"swap(v, {a}, {b})[{a}]", f"floor({self.real(depth - 1)})", f"round({self.real(depth - 1)})",
            f"({a} if {self.condition(depth - 1)} else {b})", "sum(v)", "argmax(v)", f"count(v < {a})", f"v[-{c.randint(1, 3)}]",
        ]  # fmt: skip
        if self.drawing:
            forms += [f"UniformInt(0, {a})", f"UniformInt({a}, {b})", f"K[UniformInt(0, {a})]"]
        return c.choice(forms)

    def real(self, depth: int) -> str:
        c = self.chance
        if depth == 0 or c.random() < 0.2:
            return c.choice(("x", "x", "y[0]", "0.5", "1e10", "-2.5", "s / 2"))
        a = self.real(depth - 1)
        i = self.whole(depth - 1)
        return c.choice(
            (f"({a} + {i})", f"({a} * 1000.0)", f"({a} / {i})", f"({i} / {a})", f"({a} % {i})", f"({a} // 0.3)", f"R[{i}]",
             f"y[{i}]", f"exp({a})", f"sum(y) * {a}", f"clip({a}, 0, {i})")
        )  # fmt: skip

    def condition(self, depth: int) -> str:
        a = self.whole(depth)
        b = self.whole(0)
        return self.chance.choice((f"{a} < {b}", f"{a} == {b}", f"{self.real(depth)} <= {b}", "f", f"(f or {a} > {b})"))


def spec(seed: int) -> dict[str, Any]:
    """A spec as plain data; `check` finds most of them unsound."""
    c = random.Random(seed)
    w = Writer(c)
    low = c.choice((0, 0, -3, 1))
    n = c.randint(2, 5)
    rows = c.choice((2, 3, 30))
    state = {
        "s": {"type": "int", "low": low, "high": low + c.choice((1, 3, 40))}, "u": {"type": "int"},
        "v": {"type": "int", "shape": n, "low": 0, "high": c.choice((3, n - 1))},
        "x": {"type": "real", "low": -1, "high": 1}, "y": {"type": "real", "shape": n}, "f": {"type": "bool"},
    }  # fmt: skip
    if c.random() < 0.6:
        state["u"] |= {"low": 0, "high": c.choice((2, 9))}
    initial = {
        "s": c.randint(low, low + 1),
        "u": 0,
        "v": [c.randint(0, 1) for _ in range(n)],
        "x": 0.25,
        "y": 1,
        "f": True,
    }
    depth = lambda: c.choice((1, 2, 2, 3))  # noqa: E731
    dynamics = {"s'": w.whole(depth()), "u'": w.whole(depth()), "x'": w.real(depth()), "f'": w.condition(1)}
    i = w.whole(1)
    j = w.whole(1)
    dynamics["v'"] = c.choice((f"v + {i}", f"put(v, {i}, {j})", f"swap(v, {i}, {j})"))
    w.primed = True
    reward: Any = f"{w.whole(depth())} + {w.real(1)}"
    if c.random() < 0.3:
        reward = {"by": c.choice((["s'"], ["s", "f"], ["s' - s", "a"])), "rows": {"else": w.whole(2)}}
    whole: dict[str, Any] = {
        "taskspec": 1, "name": "Hostile", "state": state, "action": {"a": {"type": "int", "low": 0, "high": 2}}, "horizon": 9,
        "constants": {
            "K": f"[(7 * i) % 5 - 1 for i in range({rows})]", "M": f"[[i + j for i in range(3)] for j in range({rows})]",
            "R": f"[i / 4 for i in range({rows})]",
        },
        "initial": initial, "dynamics": dynamics, "reward": reward,
    }  # fmt: skip
    w.primed = w.drawing = w.acting = False
    if c.random() < 0.5:
        whole["observation"] = {"o": f"[{w.whole(2)}, {w.whole(1)}]"}
    return whole


def task_of(seed: int) -> Task | None:
    """The task, or None where the spec is refused."""
    text = json.dumps(spec(seed), indent=1)
    try:
        return build(read_text(text, f"hostile-{seed}.yaml"))
    except SpecError:
        return None


def faults(seed: int, compiled: Sequence[str] = ()) -> list[str] | None:
    """What is wrong with a random spec's task on some backend; None where the spec is refused."""
    task = task_of(seed)
    if task is None:
        return None
    found = list(broken(task))
    for look in (walk, _sound, _model):
        try:
            found += look(task)
        except Exception as error:
            found.append(f"{look.__name__}: {type(error).__name__}: {error}")
    for backend in ("numpy", *compiled):
        try:
            Agreement(task, backend, 3, "NextStep").run(STEPS)
        except SpecError:
            continue  # ints that the backend does not hold
        except Exception as error:
            found.append(f"{backend}: {type(error).__name__}: {str(error)[:300]}")
    return found


def _sound(task: Task) -> list[str]:
    """Where `check` looks at every point, it knows of a state that is left in an episode."""
    found = examine(task, 2000)
    known = not found.method.exact or any(d.code in ("E403", "E404") for d in found.diagnostics)
    return [] if known or not _leaves(task) else ["a state was left, and nothing was reported"]


def _leaves(task: Task) -> bool:
    """Whether an int of the state was moved in a short episode."""
    if all(
        a is b
        for a, b in zip(
            (*task.process.initial, *task.process.next),
            (*task.process.raw_initial, *task.process.raw_next),
            strict=True,
        )
    ):
        return False
    raw = ReferenceProgram(task.with_process(next=task.process.raw_next), 5)
    kept = ReferenceProgram(task, 5)
    raw.reset(), kept.reset()
    for a in (0, 1, 2, 1, 0):
        raw.state = list(kept.state)
        raw.step([(a,)]), kept.step([(a,)])
        bounded = [i for i, c in enumerate(task.state) if c.type.kind is Kind.INT and math.isfinite(max(c.high))]
        if any(raw.state[i] != kept.state[i] for i in bounded):
            return True
    return False


def _model(task: Task) -> list[str]:
    with suppress(SpecError):
        extract(task, limit=20_000)
    return []


def walk(task: Task, compiled: bool = False, seed: int = 5) -> list[str]:
    """The reference interpreter next to the loop of the kernel, from the same state in every step."""
    program = ReferenceProgram(task, seed)
    kernel = Kernel(task, seed, compiled) if suits(task) else None
    rng = np.random.default_rng(0)
    program.reset()
    found = _left(task, program.state)
    for _ in range(min(STEPS, task.horizon or STEPS)):
        before = list(program.state)
        action = int(rng.integers(0, 3))
        _, reward, terminated, _ = program.step([(action,)])
        found += _left(task, program.state)
        if kernel is not None:
            state, paid, ended = kernel.step(before, [action])
            if not (_same(state, program.state) and _close(paid, reward) and ended == terminated):
                found.append(f"kernel: {before} with {action}: {state}, {paid}; expected {program.state}, {reward}")
    return found


def _left(task: Task, state: Sequence[tuple[Any, ...]]) -> list[str]:
    pairs = ((c, flat) for c, flat in zip(task.state, state, strict=True) if c.type.kind is Kind.INT)
    return [f"{c.name} = {flat}" for c, flat in pairs if not min(c.low) <= min(flat) <= max(flat) <= max(c.high)]


def _same(a: Sequence[tuple[Any, ...]], b: Sequence[tuple[Any, ...]]) -> bool:
    return all(_close(x, y) for p, q in zip(a, b, strict=True) for x, y in zip(p, q, strict=True))


def _close(a: float, b: float) -> bool:
    return a == b or (a != a and b != b) or abs(a - b) <= 1e-12 * (1 + abs(a))


def main() -> int:
    parser = argparse.ArgumentParser(description="Look for reads outside vectors in random specs.")
    parser.add_argument("--seconds", type=float, default=600)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--compiled", type=int, default=0, help="one spec in so many also runs on Numba and JAX")
    options = parser.parse_args()
    end = time.monotonic() + options.seconds
    seed = options.seed
    built = 0
    bad = 0
    while time.monotonic() < end:
        compiled = ("numba", "jax") if options.compiled and seed % options.compiled == 0 else ()
        found = faults(seed, compiled)
        built = built + (found is not None)
        bad = bad + bool(found)
        for each in (found or [])[:2]:
            print(f"seed {seed}: {each}", flush=True)
        seed += 1
    print(f"{seed - options.seed:,} specs, {built:,} built, {bad:,} with faults")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
