"""A spec under test: written to a file, loaded by the compiler, and read by the second interpreter."""

from __future__ import annotations

import atexit
import os
import random
import shutil
import tempfile
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

import taskspec
from tests.verification.oracle.reference.components import Component
from tests.verification.oracle.reference.merging import merged
from tests.verification.oracle.reference.task import State, Task
from tests.verification.oracle.reference.values import as_float

Data = dict[str, Any]


class Difference(AssertionError):
    """The compiler and the second interpreter disagree. `what`: the kind of difference, in a few words."""

    def __init__(self, what: str, detail: str) -> None:
        super().__init__(f"{what}: {detail}")
        self.what = what


class Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    def ignore_aliases(self, data: Any) -> bool:
        return True


def text_of(spec: Data) -> str:
    return yaml.dump(spec, Dumper=Dumper, sort_keys=False, width=10_000, allow_unicode=True)


FOLDER = Path(tempfile.mkdtemp(prefix="oracle"))
atexit.register(shutil.rmtree, FOLDER, ignore_errors=True)


@dataclass
class Case:
    """One task of a spec, and the numbers from which its comparison follows."""

    spec: Data
    variant: str | None = None
    seed: int = 0
    given: Data = field(default_factory=dict)

    @cached_property
    def path(self) -> Path:
        path = FOLDER / f"case{os.getpid()}.yaml"
        path.write_text(text_of(self.spec), "utf-8")
        return path

    @cached_property
    def task(self) -> taskspec.Task:
        return taskspec.load(str(self.path), self.variant, **self.given)

    @cached_property
    def reference(self) -> Task:
        return Task(merged(self.spec, self.variant), self.given)

    def rng(self, purpose: str) -> random.Random:
        return random.Random(f"{self.seed} {purpose}")


def random_action(action: list[Component], rng: random.Random) -> State:
    """A random action; reals as float32 holds them."""
    return {c.name: c.of(tuple(random_element(c, i, rng) for i in range(c.size))) for c in action}


def random_element(c: Component, i: int, rng: random.Random) -> Any:
    low, high = c.ends(i)
    if c.kind == "real":
        import numpy as np

        return as_float(float(np.float32(rng.uniform(max(low, -9), min(high, 9)))))
    return rng.randint(int(low), int(high))
