"""One input through what users run, layer after layer, and what must hold of every answer.

No exception but ours; every message has a code, and a place inside the file; the same input gives the same answer. Time and
memory are watched by the process that runs this (`worker`).
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import tempfile
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import taskspec
from taskspec.base.codes import codes
from taskspec.base.diagnostics import Diagnostic, SpecError, TaskspecError, render
from taskspec.envs.vector import VectorEnvironment
from taskspec.language.source import Document, read_file
from taskspec.language.task.build import build
from taskspec.language.task.merge import variant_names
from taskspec.language.task.schema.check import check_shape
from taskspec.language.task.task import Task
from taskspec.show import pages
from taskspec.tools.authoring.checks import check_file, examine
from taskspec.tools.targets import File

PACKAGE = Path(pages.__file__).parents[1]
FOLDER = next((p for p in (Path("/dev/shm"),) if os.access(p, os.W_OK)), Path(tempfile.gettempdir()))
SHARES = {"step": 0.5, "check": 0.07, "pages": 0.05}
"""How many of the inputs that get so far go through a layer that takes longer."""
PARAMETERS = (
    0,
    1,
    2,
    3,
    7,
    -1,
    1000,
    10**9,
    10**30,
    0.5,
    -0.0,
    1e-300,
    float("inf"),
    float("nan"),
    True,
    None,
    "x",
    "",
    [],
    {},
)
VARIANTS = 5
STEPS = 4
_BREAK = re.compile(r"\r\n|\r|\n")


@dataclass(frozen=True)
class Fault:
    """An answer that should not be: the layer, the kind, where in our code, and the details."""

    layer: str
    kind: str
    where: str
    detail: str

    @property
    def signature(self) -> str:
        return f"{self.layer}: {self.kind} at {self.where}"


@dataclass
class Outcome:
    """What an input came to: how far it got, what was said, and what is wrong with it."""

    layers: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    @property
    def digest(self) -> str:
        return hashlib.sha256("\0".join((*self.layers, *self.said)).encode("utf-8", "surrogatepass")).hexdigest()[:16]


class Run:
    """An input on its way."""

    def __init__(self, content: bytes, chance: random.Random | None) -> None:
        """`chance` decides about the layers that take longer; None: all of them."""
        self.content = content
        self.chance = chance
        self.outcome = Outcome()

    def goes(self, layer: str) -> bool:
        return self.chance is None or self.chance.random() < SHARES[layer]

    def through(self, layer: str, do: Callable[[], Any]) -> Any:
        """What a layer gives; None where it refuses the input, or fails."""
        self.outcome.layers.append(layer)
        try:
            return do()
        except SpecError as error:
            self.heard(layer, error.diagnostics)
        except TaskspecError as error:
            self.outcome.said.append(f"{type(error).__name__}: {error}")
        except Exception as error:
            self.outcome.faults.append(fault(layer, error))
        return None

    def heard(self, layer: str, diagnostics: Iterable[Diagnostic]) -> None:
        """Keep what was said, and look at it."""
        found = tuple(diagnostics)
        try:
            self.outcome.said.append(render(found))
            render(found, "text", color=True, width=40), render(found, "github")
            assert len(json.loads(render(found, "json"))) == len(found)
            self.outcome.faults += [Fault(layer, "message", d.code, problem) for d in found if (problem := wrong(d))]
        except Exception as error:
            self.outcome.faults.append(fault(layer, error))


def fault(layer: str, error: BaseException) -> Fault:
    frames = traceback.extract_tb(error.__traceback__)
    ours = [f for f in frames if Path(f.filename).is_relative_to(PACKAGE)]
    where = f"{Path(ours[-1].filename).relative_to(PACKAGE).as_posix()} {ours[-1].name}" if ours else "outside"
    detail = "".join(traceback.format_exception(error))
    return Fault(layer, type(error).__name__, where, detail[-3000:])


def wrong(diagnostic: Diagnostic) -> str | None:
    """What is wrong with a message."""
    span = diagnostic.span
    if diagnostic.code not in codes() or not diagnostic.message.strip():
        return "no code, or no words"
    if span is None:
        return None
    lines = _BREAK.split(span.origin.text)
    inside = 1 <= span.line <= span.end_line <= len(lines)
    if not inside or not 1 <= span.column <= len(lines[span.line - 1]) + 1:
        return f"{span} is outside the file"
    if not 1 <= span.end_column <= len(lines[span.end_line - 1]) + 1:
        return f"{span} ends outside the file, at {span.end_line}:{span.end_column}"
    if (span.line, span.column) > (span.end_line, span.end_column):
        return f"{span} ends before it begins"
    return None


# -- layers -------------------------------------------------------------------------------------------------------


def put_through(content: bytes, chance: random.Random | None = None) -> Outcome:
    """An input through all the layers that it gets to."""
    run = Run(content, chance)
    with tempfile.NamedTemporaryFile(suffix=".yaml", prefix="fuzz", dir=FOLDER) as file:
        file.write(content)
        file.flush()
        path = Path(file.name)
        document = run.through("read", lambda: read_file(path, "spec.yaml"))
        if document is not None and shaped(run, document):
            tasks = list(built(run, document))
            for task in tasks[:VARIANTS]:
                if run.goes("step"):
                    run.through("scalar", partial(stepped, run, task))
                    run.through("numpy", partial(lanes, run, task))
            if run.goes("check"):
                run.through("check", lambda: checked(run, path))
            if tasks and run.goes("pages"):
                run.through("pages", lambda: printed(run, tasks))
    return run.outcome


def shaped(run: Run, document: Document) -> bool:
    found = run.through("shape", lambda: check_shape(document))
    if found:
        run.heard("shape", found)
    return found is not None and not any(d.severity == "error" for d in found)


def built(run: Run, document: Document) -> Iterable[Task]:
    names = run.through("variants", lambda: list(variant_names(document.data).values()))
    for variant, values in product((names or [])[:VARIANTS], assigned(run, document)):
        task = run.through("build", partial(build, document, variant, values))
        if task is not None:
            run.outcome.said.append(f"{task.id} {task.content_hash}")
            yield task


def assigned(run: Run, document: Document) -> list[dict[str, Any]]:
    """Values for parameters: mostly none, sometimes one, right or wrong; without chance all that are ever given."""
    declared = document.data.get("parameters")
    names = [name for name in declared if name != "require"] if isinstance(declared, dict) else []
    every = [{name: value} for name in names for value in PARAMETERS]
    if run.chance is None:
        return [{}, *every[:100]]
    return [run.chance.choice(every)] if every and run.chance.random() < 0.2 else [{}]


def stepped(run: Run, task: Task) -> None:
    env = taskspec.make(task)
    env.action_space.seed(1)
    seen = [env.reset(seed=1)[0]]
    for _ in range(STEPS):
        seen += (result := env.step(env.action_space.sample()))[:4]
        if result[2] or result[3]:
            seen.append(env.reset()[0])
    env.render()
    run.outcome.said.append(repr(seen))


def lanes(run: Run, task: Task) -> None:
    env = VectorEnvironment(task, 3, backend="numpy")
    env.action_space.seed(1)
    seen = [env.reset(seed=1)[0]]
    with np.errstate(all="ignore"):
        for _ in range(STEPS):
            seen += env.step(env.action_space.sample())[:4]
    run.outcome.said.append(repr(seen))


def checked(run: Run, path: Path) -> None:
    report = check_file(File(path, "fuzz"), examine)
    run.heard("check", report.diagnostics)
    run.outcome.said[-1] = run.outcome.said[-1].replace(str(path), "spec.yaml")


def printed(run: Run, tasks: list[Task]) -> None:
    with tempfile.TemporaryDirectory(dir=FOLDER) as folder:
        for path in pages.write(tasks[:2], ["markdown", "html", "latex"], Path(folder)):
            run.outcome.said.append(hashlib.sha256(path.read_bytes()).hexdigest())
