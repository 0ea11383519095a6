"""Programs beside the reference interpreter: reset and stepped with the same seeds and actions, and compared."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np

from taskspec.base.arrays import Array, part_at
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import plural
from taskspec.base.limits import tell
from taskspec.language import draws
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.ir import children, plain, walk
from taskspec.language.expressions.types import Kind, total_size
from taskspec.language.task.parts import are_finite
from taskspec.language.task.spaces import SpaceLayout, pack, unpack
from taskspec.language.task.task import Task
from taskspec.programs import backend_table
from taskspec.programs.reference import Flat, ReferenceProgram
from taskspec.programs.scalar import Clock, compile_scalar
from taskspec.programs.vector_program import Masks, Options

EVERY = ("scalar", *backend_table.BACKENDS)
"""The scalar program, and the programs of all vector backends."""
QUICK = ("scalar", "numpy")
"""Programs that are generated in milliseconds; others take seconds to compile."""
LANES = 2
STEPS = 6
FEWER_STEPS = 2
"""Steps at further settings of a task, where the same program works with other numbers."""
WORK = 10_000
"""Numbers that the interpreter works out for a setting, about: in larger tasks it takes fewer steps."""
LARGEST = 50_000
"""Numbers in a step up to which programs are run."""
SEED = 7
FAR = 10.0
"""Actions without ends are drawn from -10 to 10, those with one end from the 20 beside it."""
ROUNDING = 1e-9
"""The largest difference of reals of double precision after one step, relative to 1 + |x|."""
SINGLE = 1e-6
"""The same of numbers that are kept in single precision."""


class ProgramChecks:
    """Runs some programs of one task at several settings, and keeps count.

    Attributes:
        settings: the number of settings at which each program did what the interpreter does.
        left_out: the number of settings at which a program was not, by program and reason.
    """

    def __init__(self, programs: Sequence[str]) -> None:
        self.settings: Counter[str] = Counter()
        self.left_out: Counter[tuple[str, str]] = Counter()
        self._programs = list(programs)

    def problems(self, task: Task) -> list[Diagnostic]:
        """Run the programs at one setting; return an error for each that fails, or differs from the interpreter.

        After its first error, a program is not run again.
        """
        problems = []
        if any(self.settings.values()):
            reference = ReferenceRun(task, FEWER_STEPS)
        else:
            reference = ReferenceRun(task, STEPS)
        for program in tuple(self._programs):
            tell(f"{program} program")
            try:
                problem = difference(reference, program)
            except SpecError as error:  # it is not for this task
                self.left_out[program, error.diagnostics[0].message] += 1
                continue
            self.settings[program] += problem is None
            if problem is not None:
                self._programs.remove(program)
                place = task.source.document.span(("name",))
                hint = "taskspec is wrong here, not the spec: please report it, with the spec"
                problems.append(Diagnostic("E801", place, f"the {program} program {problem}", hint))
        return problems


class ReferenceRun:
    """Random steps of a few lanes of the reference interpreter, taken once for all programs.

    Attributes:
        task: a sound task.
        count: the number of steps, fewer where they are large.
        size: the numbers that a reset and a step work out.
    """

    def __init__(self, task: Task, count: int = STEPS) -> None:
        self.task = task
        self.count = count
        self.size = total_size(walk(task.roots))

    @cached_property
    def first(self) -> list[Seen]:
        """The values of each lane after the first reset."""
        return self._lanes.reset()

    @cached_property
    def steps(self) -> list[tuple[Array, list[Seen]]]:
        """The actions of each step, as Gymnasium has them, and the values of each lane after it."""
        assert self.first
        rng = np.random.default_rng(SEED)
        trajectory = []
        for _ in range(max(1, min(self.count, WORK // (LANES * self.size)))):
            actions = random_actions(self.task.action_layout, rng)
            trajectory.append((actions, self._lanes.step(actions)))
        return trajectory

    @cached_property
    def _lanes(self) -> ReferenceLanes:
        return ReferenceLanes(self.task)


def random_actions(layout: SpaceLayout, rng: np.random.Generator) -> Array:
    """Draw an action for every lane, as Gymnasium has them: uniform, near 0 or their end where they lack an end."""
    (part,) = layout.parts
    low, high = np.array(layout.ends).reshape(-1, 2).T
    if part.is_whole:
        numbers = rng.integers(low.astype(np.int64), high.astype(np.int64), (LANES, len(low)), endpoint=True)
        return numbers.reshape(LANES, *part.shape)
    near_low = np.maximum(low, np.minimum(high, FAR) - 2 * FAR)
    near_high = np.minimum(high, near_low + 2 * FAR)
    reals = rng.uniform(near_low, near_high, (LANES, len(low)))
    return reals.astype(np.float32).reshape(LANES, *part.shape)


def difference(reference: ReferenceRun, program: str) -> str | None:
    """Describe how a program differs from the reference interpreter; None where it does not.

    Args:
        reference: the same steps in the interpreter.
        program: "scalar", or the name of a backend.

    Raises:
        SpecError: the program is not for this task, or cannot be compared.
    """
    task = reference.task
    if reference.size > LARGEST:
        raise spec_error("E713", f"a step has more than {LARGEST:,} numbers")
    if program != "scalar" and not backend_table.installed(program):
        raise spec_error("E705", "not installed")
    if program != "scalar" and not backend_table.suits(program, task):
        raise spec_error("E713", "too large to compile")
    try:
        if program == "scalar":
            return _first_difference(ScalarLanes(task), reference, 0.0)
        tolerance = max(ROUNDING, backend_table.BACKENDS[program].tolerance)
        problem = _first_difference(VectorLanes(task, program), reference, tolerance)
    except SpecError:
        raise
    except Exception as error:  # generated code may raise anything
        return f"fails: {type(error).__name__}: {error}"
    if problem is not None and tolerance > SINGLE and _reals_decide(task):
        raise spec_error("E713", "in single precision, a real may decide otherwise")
    return problem


def _reals_decide(task: Task) -> bool:
    for node in walk(task.roots):
        if node.type.kind is not Kind.REAL and any(child.type.kind is Kind.REAL for child in children(node)):
            return True
    return False


def _first_difference(lanes: Lanes, reference: ReferenceRun, tolerance: float) -> str | None:
    problem = _different(lanes.reset(), reference.first, tolerance)
    if problem is not None:
        return f"differs from the interpreter: after reset(), {problem}"
    for step, (actions, expected) in enumerate(reference.steps, 1):
        problem = _different(lanes.step(actions), expected, tolerance)
        if problem is not None:
            return f"differs from the interpreter: after {plural(step, 'step')}, {problem}"
        lanes.follow(expected)
    return None


def _different(actual: Iterable[Seen], expected: Iterable[Seen], tolerance: float) -> str | None:
    for lane, (ours, theirs) in enumerate(zip(actual, expected, strict=True)):
        for name, value in ours.items():
            if not _same(value, theirs[name], tolerance):
                return f"{name} is {_words(value)}, not {_words(theirs[name])} (seed {SEED + lane})"
    return None


def _same(actual: Any, expected: Any, tolerance: float) -> bool:
    if isinstance(expected, Mapping):
        return actual.keys() == expected.keys() and all(_same(actual[k], expected[k], tolerance) for k in expected)
    if isinstance(expected, int | float) and actual == expected:
        return True
    ours = np.asarray(actual)
    theirs = np.asarray(expected)
    if ours.shape != theirs.shape:
        return False
    if not tolerance or theirs.dtype.kind != "f":
        return np.array_equal(ours, theirs, equal_nan=theirs.dtype.kind == "f")
    if theirs.dtype == np.float32:
        tolerance = max(tolerance, SINGLE)
    return np.allclose(ours, theirs, tolerance, tolerance, equal_nan=True)


def _words(value: Any) -> str:
    text = str(value).replace("\n", "")
    if len(text) > 60:
        return f"{text[:57]}..."
    return text


# -- a few lanes of each program ----------------------------------------------------------------------------------------

Seen = dict[str, Any]
"""The values of one lane after a reset or a step, by their names in messages."""


class Lanes(Protocol):
    """Some environments of a task; one whose episode ends in a step begins the next in the same step."""

    def reset(self) -> list[Seen]:
        """Begin an episode in every lane."""

    def step(self, actions: Array) -> list[Seen]:
        """Take a step in every lane."""

    def follow(self, seen: Sequence[Seen]) -> None:
        """Take over the states of other lanes, so that rounding errors of reals do not grow from step to step."""


FIRST = "the first observation"


def _step(observation: Any, reward: Any, terminated: Any, truncated: Any, measures: Mapping[str, Any]) -> Seen:
    seen = {"the observation": observation, "the reward": reward, "`terminated`": terminated, "`truncated`": truncated}
    for name, value in measures.items():
        seen[f"the measure '{name}'"] = value
    return seen


def _state(task: Task, values: Sequence[Any]) -> Seen:
    seen = {}
    for c, value in zip(task.state, values, strict=True):
        seen[f"'{c.name}'"] = np.array(value, DTYPES[c.type.kind]).reshape(-1)
    return seen


class ReferenceLanes:
    """Lanes of the reference interpreter."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._lanes = [ReferenceProgram(task, SEED + i) for i in range(LANES)]

    def reset(self) -> list[Seen]:
        return [self._begin(lane) | self._present(lane) for lane in self._lanes]

    def step(self, actions: Array) -> list[Seen]:
        results = []
        for lane, action in zip(self._lanes, actions, strict=True):
            left = lane.state
            flats, reward, terminated, truncated = lane.step(unpack(self._task.action_layout, action))
            observation = pack(self._task.observation_layout, flats)
            seen = _step(observation, reward, terminated, truncated, lane.measures)
            states = {"old_state": left, "new_state": lane.state}
            for name in self._task.info:
                seen[name] = self._info(states[name])
            if terminated or truncated:
                seen |= self._begin(lane)
            results.append(seen | self._present(lane))
        return results

    def _begin(self, lane: ReferenceProgram) -> Seen:
        return {FIRST: pack(self._task.observation_layout, lane.reset())}

    def _present(self, lane: ReferenceProgram) -> Seen:
        seen = _state(self._task, [list(map(plain, flat)) for flat in lane.state])
        if self._task.mask:
            seen["the mask of legal actions"] = lane.mask()
        return seen

    def _info(self, state: Sequence[Flat]) -> Array:
        numbers = []
        for flat in state:
            for number in flat:
                numbers.append(plain(number))
        if are_finite(self._task.state):
            return np.array(numbers, np.int64)
        with np.errstate(over="ignore"):
            return np.array(numbers, np.float64).astype(np.float32)


class ScalarLanes:
    """Lanes of the scalar program, one environment each."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._program = compile_scalar(task)
        ended = partial(ValueError, "the episode is over")
        self._lanes = [self._program.start(SEED + i, Clock(), _refused, ended) for i in range(LANES)]

    def reset(self) -> list[Seen]:
        return [self._begin(i) | self._present(i) for i in range(LANES)]

    def step(self, actions: Array) -> list[Seen]:
        results = []
        for i, action in enumerate(actions):
            observation, reward, terminated, truncated, info = self._lanes[i].step(action)
            measures = {}
            if self._task.process.measures:
                measures = info["measures"]
            seen = _step(observation, reward, terminated, truncated, measures)
            for name in self._task.info:
                seen[name] = np.ravel(info[name])
            if terminated or truncated:
                seen |= self._begin(i)
            results.append(seen | self._present(i))
        return results

    def follow(self, seen: Sequence[Seen]) -> None:
        """Nothing to take over: states are equal."""

    def _begin(self, i: int) -> Seen:
        return {FIRST: self._lanes[i].reset()[0]}

    def _present(self, i: int) -> Seen:
        lane = self._lanes[i]
        values, clock = lane.get()
        if any(value is None for value in values):  # what the program does not keep
            first = self._program.replay(SEED + i, Clock(*clock))
            values = tuple(f if v is None else v for v, f in zip(values, first, strict=True))
        seen = _state(self._task, values)
        if self._task.mask:
            assert lane.mask is not None, "it has no mask of legal actions"
            seen["the mask of legal actions"] = lane.mask()
        return seen


def _refused(action: Any) -> Exception:
    return ValueError(f"the action {action!r} is refused")


class VectorLanes:
    """Lanes of a vector program."""

    def __init__(self, task: Task, backend: str) -> None:
        self._task = task
        self._engine = backend_table.engine(task, LANES, backend, Options("same_step"))
        self._engine.seed(draws.lane_seeds(SEED, LANES))
        self._masks = Masks(task, self._engine.buffers.state) if task.mask else None

    def reset(self) -> list[Seen]:
        self._engine.reset()
        observations = self._engine.buffers.seen.view()
        return [{FIRST: part_at(observations, i)} | self._present(i) for i in range(LANES)]

    def step(self, actions: Array) -> list[Seen]:
        self._engine.step(actions)
        b = self._engine.buffers
        seen = b.seen.view()
        final = b.final.view()
        results = []
        for i in range(LANES):
            measures = {}
            for k, name in enumerate(self._task.process.measures):
                measures[name] = b.measures[k][i]
            shown = final if b.ended[i] else seen
            step = _step(part_at(shown, i), b.reward[i], b.terminated[i], b.truncated[i], measures)
            if b.ended[i]:
                step[FIRST] = part_at(seen, i)
            results.append(step | self._present(i))
        return results

    def follow(self, seen: Sequence[Seen]) -> None:
        if are_finite(self._task.state):
            return
        values = []
        for c in self._task.state:
            flats = [shown[f"'{c.name}'"] for shown in seen]
            values.append(np.stack(flats, axis=-1).reshape(*c.type.shape, LANES))
        self._engine.place(tuple(values), np.arange(LANES))

    def _present(self, i: int) -> Seen:
        seen = _state(self._task, [part[..., i] for part in self._engine.buffers.state])
        if self._masks is not None:
            seen["the mask of legal actions"] = self._masks()[i]
        return seen
