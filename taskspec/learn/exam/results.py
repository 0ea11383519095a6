"""Results of an exam as plain data: the content of `exam.json`."""

from __future__ import annotations

import gzip
import json
import math
import re
import zlib
from pathlib import Path
from typing import Any, Literal, NotRequired, cast

from typing_extensions import TypedDict

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.base.display import InNotebooks
from taskspec.base.files import safe_name, write_text
from taskspec.language import registry
from taskspec.language.task.schema.check import shape_problem
from taskspec.language.task.schema.values import Problem
from taskspec.learn.learners import BUILT_IN, FAMILIES

FORMAT = 1
NAME = "exam.json"
NAMES = (NAME, f"{NAME}.gz")
"""What an exam in a folder may be called: it may be compressed."""
BASELINES = "baselines"
"""The folder of a suite with exams that others can be compared with."""
LIMIT = 256 * 2**20
"""Bytes of an exam, unpacked; the benchmark of the paper leaves some 100 kB for a learner."""
Grade = Literal["masters", "passes", "unsure", "fails"]
"""Seeds that pass where one fixed action passes, too, show no mastery: `passes`."""
Score = TypedDict(
    "Score",
    {
        "task": str, "twin": str | None, "peek": str | None, "seed": int, "deterministic": float | None,
        "stochastic": float | None, "half": float, "return": float | None, "error": str | None, "steps": int,
        "demonstrations": int, "comparisons": int, "seconds": float | None, "starc": float | None,
        "reward_regret": float | None, "curve": list[list[float | None]] | None,
        "operators": NotRequired[dict[str, float] | None], "rewards": NotRequired[dict[str, float] | None],
        "pairings": NotRequired[dict[str, float] | None],
        "told": NotRequired[dict[str, int] | None], "unread": NotRequired[str | None],
        "value": NotRequired[float | None], "explained": NotRequired[float | None], "longer": NotRequired[float | None],
        "reseeded": NotRequired[float | None], "tried": NotRequired[float | None], "agrees": NotRequired[float | None],
        "at_ends": NotRequired[float | None], "before_ends": NotRequired[float | None], "left": NotRequired[float],
        "spent": NotRequired[float], "moved": NotRequired[float | None], "apart": NotRequired[float | None],
        "worst_step": NotRequired[str | None],
    },
)  # fmt: skip
"""One seed on a task (`twin` None), on a twin of it (its modifiers), or (`peek`) with the reward negated, or trained for longer
("extended"); 0 is random, 1 the expert. `half` is half the 95 % confidence interval of a deterministic score that was simulated,
0 where it is exact; `starc` the distance of a learned reward to the true one, `reward_regret` the score lost by optimising it.
`operators` are the distances of learned values from the fixed points of Bellman operators (`fingerprints`), `told` how many
values tell each of them from right ones, `unread` why they are not compared; `rewards` those of a learned reward from known ones
(`starc`), `pairings` those of a policy from what was demonstrated (`pairings`). `value` is the learned value of the first states,
in units of the expert's return less that of random actions, `explained` how much a critic explains of the values of its policy,
`longer` the score on a longer horizon, `reseeded` the share of resets with a seed that was given before.

`spent` is the share of the budget of steps that was taken, `tried` of actions that were tried, `agrees` of the last steps whose
usual action is what the policy does; `at_ends` and `before_ends` are errors of learned values, of steps that end the episode and
of those that go on, `left` the share of both that longer training leaves; `moved` is how far they are from their first values,
as a share of the spread of right ones, `apart` how far a policy is from what was demonstrated, `worst_step` the step with the
largest of these errors, in words. Points of the `curve` are policies that the learner showed, else means of its training
episodes."""


class Examined(TypedDict):
    """A task of the exam: returns, the score of the best constant action, and why the learner cannot learn it (None: it can).

    `fixed` is the score of the best action that is the same as printed and on twins: the lower of its score as printed and its
    mean score on twins.
    """

    capability: str
    title: str
    random: float | None
    expert: float | None
    optimal: float | None
    worst: float | None
    constant: float | None
    fixed: NotRequired[float | None]
    content_hash: str
    cannot: str | None


class MeanScore(TypedDict):
    """A mean score over seeds with its 95 % interval, the number of seeds that pass, and the verdict.

    `rate_low` and `rate_high` are the 95 % interval of the share of seeds that pass.
    """

    verdict: Grade
    mean: float | None
    low: float | None
    high: float | None
    passed: NotRequired[int]
    rate_low: NotRequired[float]
    rate_high: NotRequired[float]


class CapabilityVerdict(MeanScore):
    """Verdict on a capability: the worst verdict of its tasks and twins, and the numbers of its worst task."""

    tasks: list[str]
    seeds: int
    twins: MeanScore | None


FlagKind = Literal[
    "twin", "regression", "changed", "diagnosis", "peeks", "failed", "impossible", "values", "reward", "policy", "law", "seeds",
]  # fmt: skip


class Flag(TypedDict):
    """Something that is wrong; with its size as a difference of scores, and the interval of that, where it has one.

    `advice` is the usual code of a known mistake, and its fix.
    """

    kind: FlagKind
    task: str
    message: str
    effect: float | None
    low: float | None
    high: float | None
    advice: NotRequired[str]


Diagnosis = TypedDict(
    "Diagnosis",
    {
        "name": str, "message": str, "cause": str, "try": str, "source": str, "tasks": list[str], "evidence": list[str],
        "place": NotRequired[bool],
    },
)  # fmt: skip
"""The usual meaning of a pattern of scores, or the place of a mistake: see `taskspec.learn.exam.findings.diagnose`."""


class LawScore(TypedDict):
    """Mean scores on a task as printed and with the change of a law, and whether they differ; `error` says why not."""

    law: str
    task: str
    modifier: str
    error: str | None
    printed: NotRequired[float]
    changed: NotRequired[float]
    p_value: NotRequired[float]
    broken: NotRequired[bool]


class Exam(TypedDict):
    """Results of an exam.

    `undecided` has diagnoses that hold for the mean scores, but not in all of their intervals.
    """

    exam: int
    learner: str
    learns_from: list[str]
    suite: str
    steps: int
    transitions: int
    seeds: list[int]
    versions: dict[str, str]
    machine: dict[str, Any]
    command: str
    tasks: dict[str, Examined]
    scores: list[Score]
    verdicts: dict[str, CapabilityVerdict]
    flags: list[Flag]
    diagnoses: list[Diagnosis]
    cost: dict[str, float]
    laws: NotRequired[list[LawScore]]
    undecided: NotRequired[list[str]]


def folder_name(learner: str) -> str:
    """Return the name of the folder of a learner's exam: `bc`, `paper/gail_im`, `mine-train` for `some/mine.py:train`."""
    family, slash, name = learner.partition("/")
    if slash and family in FAMILIES and name in BUILT_IN:
        return learner
    return safe_name(re.sub(r"\W+", "-", learner.rpartition("/")[2].replace(".py", "")).strip("-"))


def write(exam: Exam, folder: Path) -> Path:
    """Write results as `exam.json` into a folder.

    Raises:
        SpecError: E716, it cannot be written.
    """
    path = folder / NAME
    write_text(path, json.dumps(exam, indent=1) + "\n")
    return path


class ShownExam(dict[str, Any], InNotebooks):
    """An exam that notebooks show as a card."""

    def __repr__(self) -> str:
        return f"<Exam of {self['learner']}, {len(self['seeds'])} seeds on {len(self['tasks'])} tasks>"


def exams_below(folder: Path) -> list[Path]:
    """Return the folders with an exam in a folder, at any depth; the folder itself where there is none."""
    if folder.is_file():
        return [folder.parent]
    below = {path.parent for name in NAMES for path in folder.rglob(name)}
    return sorted(below) or [folder]


def read(folder: Path | str) -> Exam:
    """Return the results of an exam in a folder, or one that comes with a suite, such as `derail/bc`.

    Args:
        folder: of the exam; or its suite and name.

    Returns:
        The content of its `exam.json`.

    Raises:
        SpecError: E710, E711 when there is nothing, or it cannot be read; E721 when it is something else.
    """
    path = _place(Path(folder))
    try:
        with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
            content = file.read(LIMIT + 1)
        text = content.decode("utf-8-sig")
        data = None
        if len(content) <= LIMIT:
            data = json.loads(text)
    except FileNotFoundError:
        shipped = [f"{p.parents[1].name}/{p.stem}" for p in sorted(registry.tasks_root().glob(f"*/{BASELINES}/*.json"))]
        hint = (
            suggest(str(folder), shipped)
            or f"`taskspec exam LEARNER --out FOLDER` leaves one; there are {', '.join(shipped)}"
        )
        raise SpecError([Diagnostic("E710", None, f"there is no exam in '{folder}'", hint)]) from None
    except gzip.BadGzipFile:
        data = None
    except OSError as error:
        raise SpecError([Diagnostic("E711", None, f"cannot read '{path}': {error.strerror or error}")]) from None
    except (ValueError, EOFError, RecursionError, zlib.error):
        data = None
    if not isinstance(data, dict) or data.get("exam") != FORMAT:
        raise SpecError([Diagnostic("E721", None, f"'{path}' is not an exam of this version", "run it again")])
    problem = shape_problem(data, Exam) or _inconsistent(data)
    if problem is not None:
        message = f"'{path}', {_words(problem.path)}: {problem.message}"
        raise SpecError([Diagnostic("E721", None, message, "run the exam again, or take the file from a backup")])
    return cast(Exam, ShownExam(data))  # its shape was looked at


def finite(value: float | None) -> float | None:
    """Return a number as JSON has it; None for others."""
    if value is not None and math.isfinite(value):
        return value
    return None


def _inconsistent(exam: dict[str, Any]) -> Problem | None:
    tasks = exam["tasks"]
    for part in ("scores", "flags"):
        for i, entry in enumerate(exam[part]):
            if entry["task"] not in tasks:
                return Problem("E721", (part, i, "task"), f"the exam has no task '{entry['task']}'")
    for i, score in enumerate(exam["scores"]):
        for k, point in enumerate(score["curve"] or ()):
            if len(point) != 2 or point[0] is None:
                message = "a point of a learning curve is two numbers: steps, and a score"
                return Problem("E721", ("scores", i, "curve", k), message)
    return None


def _words(path: tuple[str | int, ...]) -> str:
    """Return a path as a programmer writes it: `scores[3].half`."""
    words = ""
    for step in path:
        words += f"[{step}]" if isinstance(step, int) else f".{step}"
    return words.removeprefix(".") or "the exam"


def _place(given: Path) -> Path:
    suite = given.parent
    name = given.name
    shipped = registry.tasks_root() / suite / BASELINES / f"{name}.json"
    if not given.exists() and shipped.is_file():
        return shipped
    if not given.is_dir():
        return given
    for name in NAMES:
        if (given / name).exists():
            return given / name
    return given / NAME
