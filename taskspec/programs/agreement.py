"""Programs beside the reference interpreter: reset and stepped with the same seeds and actions, and compared."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from itertools import chain
from textwrap import shorten
from typing import Any

import numpy as np

from taskspec.base.arrays import Array, part_at
from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error
from taskspec.base.display import plural
from taskspec.base.limits import tell
from taskspec.language import draws
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.ir import Apply, Draw, Node, are_constant, children, plain, walk
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
FINITE_STEPS = 40
"""Steps of a finite task, in which everything is compared exactly."""
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

NEAR = 1e-4
"""The distance from a threshold, relative to 1 + |x|, within which a real in single precision may decide otherwise."""


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
        count = FINITE_STEPS if are_finite(task.state) else STEPS
        if any(self.settings.values()):
            count = FEWER_STEPS
        reference = ReferenceRun(task, count)
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
    def steps(self) -> list[tuple[Array, list[ReferenceProgram], list[Seen]]]:
        """The actions of each step, as Gymnasium has them, the lanes before it, and the values of each lane after it."""
        assert self.first
        rng = np.random.default_rng(SEED)
        trajectory = []
        for _ in range(max(1, min(self.count, WORK // (LANES * self.size)))):
            actions = random_actions(self.task.action_layout, rng)
            before = list(map(copy, self._lanes.lanes))
            trajectory.append((actions, before, self._lanes.step(actions)))
        return trajectory

    @cached_property
    def _lanes(self) -> ReferenceLanes:
        return ReferenceLanes(self.task)

    def rounds(self, step: int) -> bool:
        """Test whether rounding to single precision may decide something in a step; in the first reset for 0."""
        others = list(walk((*self.task.reset_roots, *self.task.mask)))
        if _rounding_decides(others, [(math.nan,)] * len(others)):  # whatever the values
            return True
        nodes = list(walk(self.task.step_roots))
        for actions, before, _ in self.steps[step - 1 : step]:
            for lane, action in zip(before, actions, strict=True):
                if _rounding_decides(nodes, lane.values(nodes, unpack(self.task.action_layout, action))):
                    return True
        return False


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
    tolerance = 0.0
    try:
        if program == "scalar":
            problem = _first_difference(ScalarLanes(task), reference, tolerance)
        else:
            tolerance = max(ROUNDING, backend_table.BACKENDS[program].tolerance)
            problem = _first_difference(VectorLanes(task, program), reference, tolerance)
    except SpecError:
        raise
    except Exception as error:  # generated code may raise anything
        return f"fails: {type(error).__name__}: {error}"
    if problem is None:
        return None
    step, words = problem
    if tolerance > SINGLE and reference.rounds(step):
        raise spec_error("E713", "in single precision, a real may decide otherwise")
    return f"differs from the interpreter: after {plural(step, 'step') if step else 'reset()'}, {words}"


def _rounding_decides(nodes: Sequence[Node], values: Sequence[Flat]) -> bool:
    """Test whether reals near a threshold that float32 does not hold decide something; children come first."""
    exact = set[int]()
    numbers = {}
    for node, flat in zip(nodes, values, strict=True):
        below = children(node)
        numbers[id(node)] = number = np.array(list(map(plain, flat)), float)
        rounded = any(child.type.kind is Kind.REAL and id(child) not in exact for child in below)
        if rounded and node.type.kind is not Kind.REAL and _is_near(node, [numbers[id(child)] for child in below]):
            return True
        with np.errstate(over="ignore"):
            is_held = np.array_equal(number.astype(np.float32), number)
        if is_held and all(id(child) in exact for child in below):
            exact.add(id(node))
    return False


def _is_near(node: Node, args: Sequence[Array]) -> bool:
    """Test whether a rounding error in its arguments may change the value; draws of known probabilities have none."""
    match node:
        case Apply(op="lt" | "le" | "eq" | "ne"):
            apart = args[0] - args[1]
        case Apply(op="floor" | "ceil" | "round"):
            apart = args[0] - np.rint(2 * args[0]) / 2
        case _:
            return not (isinstance(node, Draw) and are_constant(node.args))
    return not np.all(np.abs(apart) > NEAR * (1 + np.abs(args[0])))


def _first_difference(lanes: Lanes, reference: ReferenceRun, tolerance: float) -> tuple[int, str] | None:
    """Compare until something differs; return the step, 0 for the first reset, and what differs after it."""
    problem = _different(lanes.reset(), reference.first, tolerance)
    if problem is not None:
        return 0, problem
    for step, (actions, _, expected) in enumerate(reference.steps, 1):
        problem = _different(lanes.step(actions), expected, tolerance)
        if problem is not None:
            return step, problem
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
    return shorten(str(value), 60, placeholder="...")


# -- a few lanes of each program ----------------------------------------------------------------------------------------

Seen = dict[str, Any]
"""The values of one lane after a reset or a step, by their names in messages."""
FIRST = "the first observation"


class Lanes:
    """Some environments of a task; one whose episode ends in a step begins the next in the same step."""

    _begin: Callable[[int], Seen]
    _move: Callable[[int, Any], Seen]
    _state: Callable[[int], Sequence[Any]]
    _mask: Callable[[int], Any]

    def __init__(self, task: Task) -> None:
        self._task = task

    def reset(self) -> list[Seen]:
        """Begin an episode in every lane."""
        return [self._begin(i) | self._present(i) for i in range(LANES)]

    def step(self, actions: Array) -> list[Seen]:
        """Take a step in every lane."""
        results = []
        for i, action in enumerate(actions):
            seen = self._move(i, action)
            if seen["`terminated`"] or seen["`truncated`"]:
                seen |= self._begin(i)
            results.append(seen | self._present(i))
        return results

    def follow(self, seen: Sequence[Seen]) -> None:
        """Take over the states of other lanes, so that rounding errors of reals do not grow from step to step."""

    def _present(self, i: int) -> Seen:
        seen = {}
        for c, value in zip(self._task.state, self._state(i), strict=True):
            seen[f"'{c.name}'"] = np.array(value, DTYPES[c.type.kind]).reshape(-1)
        if self._task.mask:
            seen["the mask of legal actions"] = self._mask(i)
        return seen


def _step(observation: Any, reward: Any, terminated: Any, truncated: Any, measures: Mapping[str, Any]) -> Seen:
    seen = {"the observation": observation, "the reward": reward, "`terminated`": terminated, "`truncated`": truncated}
    for name, value in measures.items():
        seen[f"the measure '{name}'"] = value
    return seen


class ReferenceLanes(Lanes):
    """Lanes of the reference interpreter."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self.lanes = [ReferenceProgram(task, SEED + i) for i in range(LANES)]

    def _begin(self, i: int) -> Seen:
        return {FIRST: pack(self._task.observation_layout, self.lanes[i].reset())}

    def _move(self, i: int, action: Any) -> Seen:
        lane = self.lanes[i]
        states = {"old_state": lane.state}
        flats, reward, terminated, truncated = lane.step(unpack(self._task.action_layout, action))
        states["new_state"] = lane.state
        seen = _step(pack(self._task.observation_layout, flats), reward, terminated, truncated, lane.measures)
        for name in self._task.info:
            seen[name] = self._info(states[name])
        return seen

    def _state(self, i: int) -> Sequence[Any]:
        return [list(map(plain, flat)) for flat in self.lanes[i].state]

    def _mask(self, i: int) -> Any:
        return self.lanes[i].mask()

    def _info(self, state: Sequence[Flat]) -> Array:
        numbers = list(map(plain, chain.from_iterable(state)))
        if are_finite(self._task.state):
            return np.array(numbers, np.int64)
        with np.errstate(over="ignore"):
            return np.array(numbers, np.float64).astype(np.float32)


class ScalarLanes(Lanes):
    """Lanes of the scalar program, one environment each."""

    def __init__(self, task: Task) -> None:
        super().__init__(task)
        self._program = compile_scalar(task)
        refused = partial(ValueError, "the action is refused")
        ended = partial(ValueError, "the episode is over")
        self._lanes = [self._program.start(SEED + i, Clock(), refused, ended) for i in range(LANES)]

    def _begin(self, i: int) -> Seen:
        return {FIRST: self._lanes[i].reset()[0]}

    def _move(self, i: int, action: Any) -> Seen:
        observation, reward, terminated, truncated, info = self._lanes[i].step(action)
        seen = _step(observation, reward, terminated, truncated, info.get("measures", {}))
        for name in self._task.info:
            seen[name] = np.ravel(info[name])
        return seen

    def _state(self, i: int) -> Sequence[Any]:
        values, clock = self._lanes[i].get()
        if all(value is not None for value in values):
            return values
        first = self._program.replay(SEED + i, Clock(*clock))  # what the program does not keep
        return [f if v is None else v for v, f in zip(values, first, strict=True)]

    def _mask(self, i: int) -> Any:
        mask = self._lanes[i].mask
        assert mask is not None, "it has no mask of legal actions"
        return mask()


class VectorLanes(Lanes):
    """Lanes of a vector program."""

    def __init__(self, task: Task, backend: str) -> None:
        super().__init__(task)
        self._engine = backend_table.engine(task, LANES, backend, Options("same_step"))
        self._engine.seed(draws.lane_seeds(SEED, LANES))
        self._masks = Masks(task, self._engine.buffers.state) if task.mask else None

    def reset(self) -> list[Seen]:
        self._engine.reset()
        return super().reset()

    def step(self, actions: Array) -> list[Seen]:
        self._engine.step(actions)
        return super().step(actions)

    def _begin(self, i: int) -> Seen:
        return {FIRST: part_at(self._engine.buffers.seen.view(), i)}

    def _move(self, i: int, action: Any) -> Seen:
        b = self._engine.buffers
        names = self._task.process.measures
        measures = {name: values[i] for name, values in zip(names, b.measures, strict=True)}
        shown = b.final if b.ended[i] else b.seen
        return _step(part_at(shown.view(), i), b.reward[i], b.terminated[i], b.truncated[i], measures)

    def _state(self, i: int) -> Sequence[Any]:
        return [part[..., i] for part in self._engine.buffers.state]

    def _mask(self, i: int) -> Any:
        assert self._masks is not None
        return self._masks()[i]

    def follow(self, seen: Sequence[Seen]) -> None:
        if are_finite(self._task.state):
            return
        values = []
        for c in self._task.state:
            flats = [shown[f"'{c.name}'"] for shown in seen]
            values.append(np.stack(flats, axis=-1).reshape(*c.type.shape, LANES))
        self._engine.place(tuple(values), np.arange(LANES))
