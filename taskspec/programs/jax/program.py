"""The JAX program: a task as pure functions of arrays, lanes last, and the engine of a vector environment made of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from taskspec.base.arrays import AnyArray, Array
from taskspec.base.diagnostics import spec_error
from taskspec.language import draws
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.interval import bounds, rounded, single_step
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, reads, walk
from taskspec.language.expressions.operators import Operator
from taskspec.language.expressions.types import INF, INT_MAX, TIME, Kind, Range, Role
from taskspec.language.expressions.variates import VARIATES, WordLayout, words_of
from taskspec.language.task.parts import Component
from taskspec.language.task.reach import over, reach, widest
from taskspec.language.task.spaces import Segment, SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent, names_of, run, tuple_of
from taskspec.programs.array_form import ArrayForm, arrays
from taskspec.programs.jax import library
from taskspec.programs.lowering import compared, folded, word_names
from taskspec.programs.vector_program import Buffers, Episodes, LanesNotRunningError, Mode, Options, action_reader

DTYPES: dict[Kind, Any] = {Kind.BOOL: jnp.bool_, Kind.INT: jnp.int32, Kind.REAL: jnp.float32}


def observed(layout: SpaceLayout, seen: Sequence[AnyArray]) -> Any:
    """Join components (*shape, N) to one array (*shape, N), float32 or int32; a dict for dict spaces."""
    rows: list[list[AnyArray]] = [[] for _ in layout.parts]
    for segment in layout.segments:
        if layout.parts[segment.part].is_whole:
            dtype = jnp.int32
        else:
            dtype = jnp.float32
        rows[segment.part].append(_numbers(segment, seen[segment.component]).astype(dtype))
    lanes = seen[0].shape[-1]
    made = {}
    for p, r in zip(layout.parts, rows, strict=True):
        made[p.name] = jnp.concatenate(r).reshape(*p.shape, lanes)
    if layout.is_dict:
        return made
    return made[layout.parts[0].name]


def _numbers(segment: Segment, value: AnyArray) -> AnyArray:
    flat = value.reshape(-1, value.shape[-1])
    if segment.values is not None:
        return flat[segment.element][None].astype(jnp.int32) == jnp.array(segment.values)[:, None]
    if segment.starts:
        return flat.astype(jnp.int32) - jnp.array(segment.starts, jnp.int32)[:, None]
    return flat


def acted(layout: SpaceLayout, action: AnyArray) -> tuple[AnyArray, ...]:
    """Split an action (*shape, N), as Gymnasium gives it, into components (*shape, N)."""
    parts = []
    given = jnp.asarray(action)
    given = given.reshape(-1, given.shape[-1])
    for c, segment in zip(layout.components, layout.segments, strict=True):
        rows = given[segment.first : segment.first + segment.size]
        if segment.starts:
            rows = rows.astype(jnp.int32) + jnp.array(segment.starts, jnp.int32)[:, None]
        elif c.type.kind is not Kind.REAL and not layout.parts[segment.part].is_whole:
            rows = jnp.rint(rows)
        parts.append(rows.astype(DTYPES[c.type.kind]).reshape(*c.type.shape, rows.shape[-1]))
    return tuple(parts)


LONG = 1 << 30
"""A count without bounds, and a Poisson draw, are taken to stay below this, unless they begin above."""


class State(NamedTuple):
    """Everything of the lanes: component values (*shape, N), and int32 or uint32 counters (N,).

    `key` is uint32 (2, N): the high and the low word of each lane's seed, as JAX's own keys have them. `steps` and
    `episodes` count since the lane was seeded, `time` since its episode began.
    """

    values: tuple[AnyArray, ...]
    time: AnyArray
    steps: AnyArray
    episodes: AnyArray
    key: AnyArray


class StepResult(NamedTuple):
    """The results of a step, lanes last: observation components, float32 reward, two flags, and float32 measures."""

    observation: tuple[AnyArray, ...]
    reward: AnyArray
    terminated: AnyArray
    truncated: AnyArray
    measures: tuple[AnyArray, ...]


@dataclass(frozen=True)
class JaxProgram:
    """Pure functions of a task over any number of lanes."""

    task: Task
    source: str
    observation: SpaceLayout
    action: SpaceLayout
    _start: Any
    _step: Any
    _mask: Any
    _start_words: int
    _step_words: int

    def reset(self, key: AnyArray, given: Sequence[AnyArray] = ()) -> tuple[State, tuple[AnyArray, ...]]:
        """First state of lanes with the given keys, uint32 (2, N), and its observation.

        `given` are parameters that the task leaves open, (N,) or (1,), in alphabetical order; so in all that follows.
        """
        zero = jnp.zeros(key.shape[-1], jnp.uint32)
        return self.begin(State((), zero.astype(jnp.int32), zero, zero, key), given)

    def begin(self, state: State, given: Sequence[AnyArray] = ()) -> tuple[State, tuple[AnyArray, ...]]:
        """First state of the next episode of every lane."""
        high, low = state.key
        words = library.RandomWords(low, high, state.episodes, draws.RESET, self._start_words)
        values, seen = self._start(words, *given)
        lanes = state.time.shape
        values = tuple(_full(v, c, lanes) for v, c in zip(values, self.task.state, strict=True))
        seen = tuple(_full(v, c, lanes) for v, c in zip(seen, self.observation.components, strict=True))
        return State(values, jnp.zeros_like(state.time), state.steps, state.episodes + jnp.uint32(1), state.key), seen

    def step(
        self, state: State, action: Sequence[AnyArray], given: Sequence[AnyArray] = ()
    ) -> tuple[State, StepResult]:
        """Step every lane, without autoreset. `action` has one array (*shape, N) for each component."""
        high, low = state.key
        words = library.RandomWords(low, high, state.steps, draws.STEP, self._step_words)
        values, reward, terminal, measures, seen = self._step(words, state.time, *state.values, *action, *given)
        lanes = state.time.shape
        values = tuple(_full(v, c, lanes) for v, c in zip(values, self.task.state, strict=True))
        seen = tuple(_full(v, c, lanes) for v, c in zip(seen, self.observation.components, strict=True))
        time = state.time + 1
        late = jnp.zeros(lanes, bool)
        if self.task.horizon is not None:
            late = time >= self.task.horizon
        result = StepResult(
            seen,
            jnp.broadcast_to(jnp.asarray(reward, jnp.float32), lanes),
            jnp.broadcast_to(jnp.asarray(terminal, bool), lanes),
            late,
            tuple(jnp.broadcast_to(jnp.asarray(value, jnp.float32), lanes) for value in measures),
        )
        return State(values, time, state.steps + jnp.uint32(1), state.episodes, state.key), result

    def mask(self, state: State, given: Sequence[AnyArray] = ()) -> AnyArray:
        """Legal actions of lanes, bool (n, N), for a task with `legal`."""
        (c,) = self.task.action
        (legal,) = self._mask(*state.values, *given)
        return jnp.broadcast_to(legal, (*c.counts, *state.time.shape))

    def again(
        self, state: State, result: StepResult, given: Sequence[AnyArray] = ()
    ) -> tuple[State, tuple[AnyArray, ...]]:
        """State and observation after a step, from a new episode where one has ended."""
        ended = result.terminated | result.truncated
        fresh, seen = self.begin(state, given)
        values = tuple(jnp.where(ended, a, b) for a, b in zip(fresh.values, state.values, strict=True))
        shown = tuple(jnp.where(ended, a, b) for a, b in zip(seen, result.observation, strict=True))
        time = jnp.where(ended, 0, state.time)
        episodes = state.episodes + ended.astype(jnp.uint32)
        return State(values, time, state.steps, episodes, state.key), shown


def _full(value: Any, c: Component, lanes: tuple[int, ...]) -> AnyArray:
    dtype = DTYPES[c.type.kind]
    return jnp.broadcast_to(jnp.asarray(value, dtype), (*c.type.shape, *lanes))


@lru_cache(maxsize=64)
def compile_jax(task: Task) -> JaxProgram:
    """Generate the array form of a task over `jax.numpy`.

    Raises:
        SpecError: E715, the task has ints that may leave 32 bits.
    """
    step = task.step_roots
    start = task.reset_roots
    _check_ints(task, task.roots)
    step_words = task.step_words
    start_words = task.reset_words
    n = len(task.state)
    constants: dict[str, Any] = {}
    body, values = _emit(task, step, step_words, constants)
    states = names_of("s", task.state)
    actions = names_of("a", task.action)
    given = list(open_names(task).values())
    lines = [f"def step({', '.join(['w', 't', *states, *actions, *given])}):", *indent(body)]
    first = n + 2 + len(task.process.measures)  # of the observation
    results = [
        tuple_of(values[:n]),
        values[n],
        values[n + 1],
        tuple_of(values[n + 2 : first]),
        tuple_of(values[first:]),
    ]
    lines += indent([f"return {', '.join(results)}"])
    body, values = _emit(task, start, start_words, constants)
    lines += ["", "", f"def start({', '.join(['w', *given])}):", *indent(body)]
    lines += indent([f"return {tuple_of(values[:n])}, {tuple_of(values[n:])}"])
    body, values = _emit(task, task.mask, start_words, constants)
    lines += ["", "", f"def mask({', '.join([*states, *given])}):", *indent([*body, f"return {tuple_of(values)}"])]
    source = "\n".join([repr(f"{task.id}: n environments, array code for JAX. Generated."), "", "", *lines, ""])
    namespace = {**_NAMESPACE, **arrays(constants, _array)}
    run(source, f"<taskspec {task.id} {task.content_hash[:12]} jax>", namespace)
    layouts = (task.observation_layout, task.action_layout)
    functions = (namespace["start"], namespace["step"], namespace["mask"])
    return JaxProgram(task, source, *layouts, *functions, start_words.count, step_words.count)


def compile_required(task: Task) -> Callable[..., tuple[AnyArray, ...]]:
    """Compile the conditions on open parameters, (N,) or (1,), over these parameters in alphabetical order."""
    constants: dict[str, Any] = {}
    body, values = _emit(task, [node for node, _ in task.process.required], task.reset_words, constants)
    lines = [f"def required({', '.join(open_names(task).values())}):", *indent(body)]
    source = "\n".join([*lines, *indent([f"return {tuple_of(values)}"]), ""])
    namespace = {**_NAMESPACE, **arrays(constants, _array)}
    run(source, f"<taskspec {task.id} {task.content_hash[:12]} required, jax>", namespace)
    return namespace["required"]


def _check_ints(task: Task, roots: Sequence[Node]) -> None:
    reached = reach(task.state, task.process.initial, task.process.next, task.horizon)
    for c, start in zip(task.state, task.process.initial, strict=True):
        low, high = reached[c.name]
        first, last = bounds(start, {})
        if low == -INF:
            low = min(first, -LONG)
        if high == INF:
            high = max(last, LONG)
        reached[c.name] = (low, high)
    known = over(roots, reached)
    inside: dict[int, Range] = {}
    for node in walk(roots):
        if isinstance(node, Draw) and node.type.kind is Kind.INT and bounds(node, {})[1] == INF:
            inside[id(node)] = Range(0, LONG)  # a count without a bound
        elif id(node) in known:
            inside[id(node)] = known[id(node)]
            if node.type.kind is Kind.REAL:
                inside[id(node)] = rounded(known[id(node)])
    most = widest(roots, INT_MAX, inside, single_step)
    if most:
        message = f"an int of {task.id} may be as large as {most:.4g}; ints of JAX end at {INT_MAX}"
        raise spec_error("E715", message, 'use the backend "numba" or "numpy"')


_NAMESPACE: dict[str, Any] = {
    "xp": jnp,
    "rt": library.RUNTIME,
    "nan": float("nan"),
    "inf": float("inf"),
}


def _array(node: Const) -> Any:
    dtype = {Kind.BOOL: np.bool_, Kind.INT: np.int32, Kind.REAL: np.float32}[node.type.kind]
    values = list(node.numbers)
    if node.type.kind is Kind.INT:
        values = [max(-INT_MAX - 1, min(INT_MAX, v)) for v in values]
    with np.errstate(over="ignore"):
        return np.array(values, dtype).reshape(*node.type.shape, 1)


def _emit(
    task: Task, roots: Sequence[Node], words: WordLayout, constants: dict[str, Any]
) -> tuple[list[str], list[str]]:
    b = Builder.of(roots)
    lowered = folded(b, compared(b, roots, library.BIAS))
    names = {TIME: "t"}
    for components, prefix, role in ((task.state, "s", Role.STATE), (task.action, "a", Role.ACTION)):
        for c, s in zip(components, names_of(prefix, components), strict=True):
            names[(role, c.name)] = s
    for name, source in open_names(task).items():
        names[(Role.PARAMETER, name)] = source
    for draw in (n for n in walk(roots) if isinstance(n, Draw)):
        first = words.first[draw.site]
        for k, v in enumerate(word_names(draw)):
            names[(Role.VARIABLE, v)] = f"w.signed({first + k})"
    form = JaxForm(names, lambda d, a: _drawn(d, a, words, constants), constants)
    return form.emit(lowered)


class JaxForm(ArrayForm):
    """The array form as XLA needs it: for XLA `x + 0.0` is x, which it is not where x is -0.0; quotients, see `div`."""

    def _template(self, node: Apply, entry: Operator) -> str:
        if node.op == "div":
            return "rt.div({0}, {1})"
        template = super()._template(node, entry)
        nothing = any(isinstance(a, Const) and not any(a.flat) for a in node.args)
        real = node.op == "add" and node.type.kind is Kind.REAL
        if real and nothing:
            return f"rt.without_sign({template})"
        return template


def _drawn(draw: Draw, args: Sequence[str], words: WordLayout, constants: dict[str, Any]) -> str:
    name = f"C{len(constants)}"
    form = VARIATES[draw.base].many
    assert form is not None, draw.base
    constants[name] = partial(form, library, draw)
    shape = "".join(f"{k}, " for k in draw.type.shape)
    return f"{name}({tuple_of(args)}, w.rows({words.first[draw.site]}, {words_of(draw)})).reshape({shape}-1)"


def open_names(task: Task) -> dict[str, str]:
    """Parameters that a task leaves open, in alphabetical order, and their names in the source."""
    names = sorted(name for role, name in reads(task.roots) if role is Role.PARAMETER)
    return {name: f"p{i}" for i, name in enumerate(names)}


class JaxEngine:
    """Lanes of a task; their state lives where JAX computes, results are copied to NumPy arrays."""

    def __init__(self, task: Task, lanes: int, options: Options) -> None:
        program = compile_jax(task)
        self.observation = program.observation
        self.action = program.action
        self.source = program.source
        self.buffers = Buffers.of(task, program.observation, lanes)
        self._read = action_reader(task, program.action, lanes)
        self._episodes = Episodes(self.buffers, options.mode)
        self._lanes = lanes
        self._reset, self._step = jitted(task, options.mode)
        values = tuple(jnp.zeros(v.shape, _NARROW[v.dtype.kind]) for v in self.buffers.state)
        zero = jnp.zeros(lanes, jnp.uint32)
        self._state = State(values, zero.astype(jnp.int32), zero, zero, jnp.zeros((2, lanes), jnp.uint32))

    def seed(self, seeds: Array, lanes: Array | None = None) -> None:
        self._episodes.seed(seeds, lanes)
        b = self.buffers
        key = np.stack([b.seeds >> np.uint64(32), b.seeds & np.uint64(0xFFFFFFFF)]).astype(np.uint32)
        self._state = self._state._replace(key=jnp.array(key), steps=jnp.array(b.steps), episodes=jnp.array(b.episodes))

    def reset(self, lanes: Array | None = None) -> None:
        b = self.buffers
        chosen = np.full(self._lanes, lanes is None)
        if lanes is not None:
            chosen[lanes] = True
        self._state, seen = self._reset(self._state, jnp.array(chosen))
        for part, new in zip(b.seen.parts, _parts(self.observation, seen), strict=True):
            np.copyto(part, np.asarray(new).reshape(part.shape), where=chosen, casting="unsafe")
        self._episodes.reset(chosen)
        self._keep()

    def step(self, actions: Any) -> int:
        parts = self._read(actions)
        if not self._episodes.ready:
            raise LanesNotRunningError
        b = self.buffers
        narrow = tuple(jnp.array(p.astype(_NARROW[p.dtype.kind])) for p in parts)
        self._state, out = self._step(self._state, narrow, jnp.array(b.ended))
        seen, final, reward, terminated, truncated, measures = out
        shown = (*_parts(self.observation, seen), *_parts(self.observation, final))
        for part, new in zip((*b.seen.parts, *b.final.parts), shown, strict=True):
            np.copyto(part, np.asarray(new).reshape(part.shape), casting="unsafe")
        b.reward[:], b.terminated[:], b.truncated[:] = reward, terminated, truncated
        for held, value in zip(b.measures, measures, strict=True):
            held[:] = value
        np.logical_or(b.terminated, b.truncated, b.ended)
        self._keep()
        return self._episodes.step(int(np.count_nonzero(b.ended)))

    def _keep(self) -> None:
        b = self.buffers
        state = self._state
        for held, value in zip(b.state, state.values, strict=True):
            held[...] = value
        b.time[:], b.steps[:], b.episodes[:] = state.time, state.steps, state.episodes

    def place(self, values: tuple[Array, ...], lanes: Array) -> None:
        self._episodes.place(values, lanes)
        old = self._state.values
        made = tuple(jnp.array(h.astype(o.dtype)) for h, o in zip(self.buffers.state, old, strict=True))
        self._state = self._state._replace(values=made)


_NARROW = {"b": np.bool_, "i": np.int32, "f": np.float32}


def _parts(layout: SpaceLayout, seen: Any) -> list[Any]:
    """Order a dict by the layout: JAX orders dicts by their keys."""
    if layout.is_dict:
        return [seen[part.name] for part in layout.parts]
    return [seen]


@lru_cache(maxsize=64)
def jitted(task: Task, mode: Mode) -> tuple[Any, Any]:
    program = compile_jax(task)
    layout = program.observation

    def reset(state: State, chosen: Any) -> tuple[State, Any]:
        fresh, seen = program.begin(state)
        return _chosen(chosen, fresh, state), observed(layout, seen)

    def step(state: State, action: Any, late: Any) -> tuple[State, Any]:
        after, result = program.step(state, action)
        seen = observed(layout, result.observation)
        flags = (result.reward, result.terminated, result.truncated)
        if mode == "same_step":
            following, fresh = program.again(after, result)
            return following, (observed(layout, fresh), seen, *flags, result.measures)
        if mode == "disabled":
            return after, (seen, seen, *flags, result.measures)
        fresh_state, fresh = program.begin(state)
        shown = _chosen(late, observed(layout, fresh), seen)
        reward, terminated, truncated = (jnp.where(late, jnp.zeros_like(f), f) for f in flags)
        return _chosen(late, fresh_state, after), (shown, seen, reward, terminated, truncated, result.measures)

    return jax.jit(reset), jax.jit(step)


def _chosen(flags: Any, a: Any, b: Any) -> Any:
    return jax.tree.map(lambda x, y: jnp.where(flags, x, y), a, b)
