"""Operators in states, rewards, ends and observations of tasks, as users run them: the same on every backend, to the bit.

Operands are of every kind and shape, and constants, components, parts of components or draws; see
`tests.verification.operands`. What a backend gives is compared with the reference interpreter, with the signs of zeros,
and infinities and nan where they belong.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.envs.vector import VectorEnvironment
from tests.shared.conformance import ReferenceEnv
from tests.shared.sparse import sparse
from tests.verification.operands.forms import FORMS, LAST_DIGIT, ORIGINS, PLAIN, SHAPES, expressions
from tests.verification.operands.specs import HORIZON, Held, task_of, typed

LANES = 2


class Walk:
    """A vector environment, or the scalar one as its first lane, beside as many reference interpreters."""

    def __init__(self, held: Sequence[Held], backend: str, lanes: int = LANES, **how: Any) -> None:
        self.held = held
        self.backend = backend
        self.lanes = lanes
        self.task = task_of(held, **how)
        self.references = [ReferenceEnv(self.task) for _ in range(lanes)]
        self.wrong: list[str] = []

    def run(self) -> list[str]:
        """Steps of more than an episode; gives what is wrong."""
        env = (
            taskspec.make(self.task)
            if self.backend == "scalar"
            else VectorEnvironment(self.task, self.lanes, backend=self.backend)
        )
        seen, _ = env.reset(seed=3)
        for i, reference in enumerate(self.references):
            self.same(self.lane(seen, i), reference.reset(seed=3 + i)[0], "reset")
        late = [False] * self.lanes
        for step in range(HORIZON + 3):
            result = self.step(env, step, any(late))
            for i, reference in enumerate(self.references):
                late[i] = self.compare(reference, [self.lane(part, i) for part in result[:4]], step, late[i])
                state = env.unwrapped.state if self.backend == "scalar" else env.state(i)
                self.same(state, reference.state, f"state after step {step}")
        return self.wrong

    def step(self, env: Any, step: int, late: bool) -> Any:
        if self.backend != "scalar":
            return env.step(np.arange(self.lanes) + step & 1)
        return (env.reset()[0], 0.0, False, False) if late else env.step(step & 1)

    def compare(self, reference: ReferenceEnv, found: list[Any], step: int, late: bool) -> bool:
        """Whether the episode has ended; one that had begins anew, as `NextStep` has it."""
        if late:
            self.same(found[0], reference.reset()[0], f"reset in step {step}")
            return False
        expected = reference.step((step + self.references.index(reference)) & 1)
        self.same(found[0], expected[0], f"seen in step {step}")
        self.same({"reward": found[1]}, {"reward": expected[1]}, f"step {step}")
        if (bool(found[2]), bool(found[3])) != expected[2:4]:
            self.wrong.append(f"step {step} ends {found[2:]}, not {expected[2:4]}")
        return expected[2] or expected[3]

    def lane(self, value: Any, i: int) -> Any:
        if self.backend == "scalar":
            return value
        return {k: v[i] for k, v in value.items()} if isinstance(value, dict) else value[i]

    def same(self, found: Any, expected: Any, where: str) -> None:
        for name, value in expected.items():
            held = self.held[int(name[1:])] if name[0] in "eo" else None
            if not alike(found[name], value, self.tolerance(held.text if held else "")):
                text = held.text if held else name
                self.wrong.append(f"{text} ({where}) is {found[name]!r}, not {value!r}")

    def tolerance(self, text: str) -> float:
        if self.backend == "jax":
            return 1e-5
        if self.backend == "numba" and any(f in text for f in ("sin(", "cos(")):
            return 1e-7  # beyond a million
        return 1e-13 if not text or any(f in text for f in LAST_DIGIT) else 0


def alike(found: Any, expected: Any, tolerance: float) -> bool:
    """Equal up to the tolerance, with zeros of one sign, and with infinities and nan in the same places."""
    a = np.asarray(found)
    b = np.asarray(expected)
    if a.shape != b.shape or a.dtype.kind != b.dtype.kind:
        return False
    if a.dtype.kind != "f":
        return bool((a == b).all())
    with np.errstate(all="ignore"):
        near = np.isclose(a, b, rtol=max(tolerance, 2e-7 * bool(tolerance) * (a.dtype == np.float32)), atol=tolerance)
    equal = (a == b) | (np.isnan(a) & np.isnan(b)) | (near & np.isfinite(b) & bool(tolerance))
    zeros = (a == 0) & (b == 0)
    return bool(equal.all() and (np.signbit(a) == np.signbit(b))[zeros].all())


def chunks(held: list[Held], size: int) -> list[list[Held]]:
    return [held[i : i + size] for i in range(0, len(held), size)]


@pytest.mark.parametrize("some", [2, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.parametrize("form", sparse(FORMS, 8))
def test_operands_of_all_kinds_on_python_and_numpy(form: str, some: int | None) -> None:
    texts = expressions(FORMS[form], ORIGINS, SHAPES)
    wanted = texts if some is None else texts[:: 1 + len(texts) // some]
    for held in chunks(typed(wanted, SHAPES), 150):
        for backend, lanes in (("scalar", 1), ("numpy", LANES)):
            wrong = Walk(held, backend, lanes, shapes=SHAPES).run()
            assert not wrong, f"{backend}: {wrong[:3]}"


SMALL_SHAPES = (0, 3)
PARTS = 40


@cache
def small() -> list[Held]:
    """Some expressions of every form, for backends that take seconds to compile them."""
    texts = [text for form in FORMS.values() for text in expressions(form, PLAIN, SMALL_SHAPES)[1::7][:12]]
    return typed(texts, SMALL_SHAPES)


COMPILED = [
    pytest.param(backend, part, marks=[pytest.mark.slow] if part % PARTS else [])
    for backend in ("numba", "jax")
    for part in range(PARTS)
]


@pytest.mark.parametrize(("backend", "part"), COMPILED)
def test_operands_of_all_kinds_on_compiled_backends(backend: str, part: int) -> None:
    pytest.importorskip(backend)
    wrong = Walk(small()[part::PARTS], backend, 3, shapes=SMALL_SHAPES, small=True, single=backend == "jax").run()
    assert not wrong, wrong[:3]
