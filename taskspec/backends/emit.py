"""The generated module of a scalar program: closures over the state of one environment, with `reset` and `step`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from struct import Struct
from typing import Any

from taskspec.backends.invariant import Invariants, frozen_components
from taskspec.backends.lane import UNROLLED, Lane, Value, literal, without_unused
from taskspec.backends.phase import Phase, is_filled
from taskspec.backends.spaces import Layout
from taskspec.lang.ir import Node, Role
from taskspec.lang.types import Kind, Type
from taskspec.spec.task import Component, Task

FLOAT_MAX = 3.4028234663852886e38


@dataclass(frozen=True)
class Parts:
    """What a module is generated from."""

    task: Task
    invariants: Invariants
    cold: frozenset[str]
    reset: Phase
    step: Phase
    observation: Layout
    action: Layout


def generate(parts: Parts) -> tuple[str, dict[str, Any]]:
    """Source of the module, and the constants it refers to."""
    task, constants = parts.task, dict[str, Any]()
    states = _names("s", task.state)
    # `repr`, because ids and file names are somebody's text: nothing in them may end the literal.
    head = [repr(f"{task.id}: one environment, straight-line. Generated; the spec is {task.document.origin.name}.")]
    step = _step(parts, states, constants)
    reset = _reset(parts, states, "\n".join(step), constants)
    kept = [*states, *_kept(parts)]
    lines = [f"{', '.join(kept)} = {', '.join('None' for _ in kept)}", "alive = False"]
    lines += [
        "t = 0  # steps of this episode",
        "past = 0  # steps of the episodes before it",
        "episodes = 0",
        "",
    ]
    lines += [
        *reset,
        "",
        *step,
        "",
        *_access(parts, states, constants),
        "",
        "return reset, step, get, put",
    ]
    return "\n".join(
        [
            *head,
            "",
            "",
            "def lane(next_first, next_draws, bad_action, not_running):",
            *_indent(lines),
            "",
        ]
    ), constants


def _kept(parts: Parts) -> list[str]:
    """Variables that hold what stays the same for an episode."""
    return [*parts.invariants.names, *(["kept"] if parts.invariants.observation else [])]


def _names(prefix: str, components: Sequence[Component]) -> list[str]:
    return [f"{prefix}_{c.name}" if c.name.isascii() else f"{prefix}_{i}" for i, c in enumerate(components)]


def _indent(lines: Sequence[str]) -> list[str]:
    return [f"    {line}" if line else "" for line in lines]


def _held(name: str, type_: Type) -> Value:
    """How a value is held in a variable: a number, or one flat sequence."""
    return Value([name]) if type_.is_scalar else Value(packed=name)


def _lane(
    parts: Parts,
    phase: Phase | None,
    states: Sequence[str],
    actions: Sequence[Value],
    constants: dict[str, Any],
) -> Lane:
    """An emitter that knows the state, the action, the time, what is hoisted and what is invariant."""
    task, names = parts.task, {(Role.TIME, "t"): Value(["t"])}
    for c, name in zip(task.state, states, strict=True):
        names[Role.STATE, c.name] = _held(name, c.type)
    for c, value in zip(task.action, actions, strict=False):
        names[Role.ACTION, c.name] = value
    for node, name in zip(parts.invariants.nodes, parts.invariants.names, strict=True):
        names[Role.VARIABLE, name] = _held(name, node.type)
    for node, name in zip(phase.hoisted, phase.hoisted_names, strict=True) if phase else ():
        names[Role.VARIABLE, name] = _held(name, node.type)
    return Lane(names, phase.words if phase else {}, task.builder.bounds, constants)


def _unpack(phase: Phase, call: str) -> list[str]:
    """The statement that takes the next item of the phase's stream."""
    return [f"{', '.join(phase.names)} = {call}()"] if phase.names else []


# -- reset and step -----------------------------------------------------------------------------------------------


def _reset(parts: Parts, states: Sequence[str], step: str, constants: dict[str, Any]) -> list[str]:
    task, phase = parts.task, parts.reset
    lane = _lane(parts, phase, states, (), constants)
    values = lane.emit((*phase.roots, *phase.observation))
    types = [*(c.type for c in task.state), *(n.type for n in parts.invariants.nodes)]
    stored = [_stored(lane, n, v) for n, v in zip(phase.roots, types, strict=True)]
    for i, c in enumerate(task.state):
        stored[i] = "None" if c.name in parts.cold else stored[i]
    observation, statements = _observation(lane, parts.observation, phase, values[len(phase.roots) :])
    inner = without_unused([*lane.lines, *statements], [*stored, observation])
    targets = [*states, *parts.invariants.names]
    body = [
        *_unpack(phase, "next_first"),
        *_unwrapped(phase, inner, dict(zip(targets, stored, strict=True)), step),
        *inner,
    ]
    body += [f"{', '.join(targets)} = {', '.join(stored)}"]
    if parts.invariants.observation:  # what is handed out may be written into, so it is always a copy
        body += [f"kept = {observation}"]
        observation = "kept.copy()"
    body += ["past += t", "t = 0", "episodes += 1", "alive = True", f"return {observation}, {{}}"]
    targets = [*states, *_kept(parts), "t", "past", "episodes", "alive"]
    return ["def reset():", *_indent([f"nonlocal {', '.join(targets)}", *body])]


def _unwrapped(phase: Phase, body: Sequence[str], stored: dict[str, str], step: str) -> list[str]:
    """Arrays turned into lists of Python numbers, where something computes with their elements."""
    inner = "\n".join(body)
    used = [h for h in phase.wide if re.search(rf"\b{h}\b", inner)]
    used += [h for name, h in stored.items() if h in phase.wide and re.search(rf"\b{name}\b", step)]
    return [f"{h} = {h}.tolist()" for h in dict.fromkeys(used)]


def _step(parts: Parts, states: Sequence[str], constants: dict[str, Any]) -> list[str]:
    task, phase = parts.task, parts.step
    reading, actions = _read_action(task, parts.action)
    lane = _lane(parts, phase, states, actions, constants)
    values = lane.emit((*phase.roots, *phase.observation))
    n, frozen = len(task.state), frozen_components(task)
    changed = [i for i in range(n) if task.state[i].name not in frozen]
    stored = {i: _stored(lane, phase.roots[i], task.state[i].type) for i in changed}
    # The reward, the end and the observation may read the state, so they are worked out before it moves on.
    reward, terminal = (lane.assign(lane.scalar(root)) for root in phase.roots[n : n + 2])
    observation, statements = _seen(lane, parts, terminal, values[n + 2 :])
    if not observation.isidentifier() and not parts.invariants.observation:
        statements.append(f"seen = {observation}")
        observation = "seen"
    end, flags = _ending(task, terminal)
    body = [*reading, "if not alive:", "    raise not_running()", *_unpack(phase, "next_draws")]
    body += without_unused([*lane.lines, *statements], [*stored.values(), observation, reward, terminal])
    if changed:
        body.append(f"{', '.join(states[i] for i in changed)} = {', '.join(stored[i] for i in changed)}")
    body += ["t += 1", *end, f"return {observation}, {reward}, {flags}, {{}}"]
    nonlocals = [*(states[i] for i in changed), "t", "alive"]
    return ["def step(action):", *_indent([f"nonlocal {', '.join(nonlocals)}", *body])]


def _seen(lane: Lane, parts: Parts, terminal: str, values: Sequence[Value]) -> tuple[str, list[str]]:
    """The observation of a step: the kept one where it stays the same, itself rather than a copy on what is always the last."""
    if not parts.invariants.observation:
        return _observation(lane, parts.observation, parts.step, values)
    return ("kept" if terminal == "True" else "kept.copy()"), []


def _ending(task: Task, terminal: str) -> tuple[list[str], str]:
    """Statements that keep `alive`, and the two flags of the result."""
    truncated = "False" if task.horizon is None else f"t >= {task.horizon}"
    if terminal == "False" and truncated == "False":
        return [], "False, False"
    if terminal == "False":
        return [
            f"if {truncated}:",
            "    alive = False",
            "    end = True",
            "else:",
            "    end = False",
        ], "False, end"
    if terminal == "True":
        return ["alive = False"], f"True, {truncated}"
    if truncated == "False":
        return [f"if {terminal}:", "    alive = False"], f"{terminal}, False"
    return [f"end = {truncated}", f"if end or {terminal}:", "    alive = False"], f"{terminal}, end"


def _stored(lane: Lane, node: Node, type_: Type) -> str:
    """A value as it is kept: a number of its kind, or a flat sequence."""
    return lane.scalar(node) if type_.is_scalar else lane.packed(node)


def _access(parts: Parts, states: Sequence[str], constants: dict[str, Any]) -> list[str]:
    """Functions that read the state and set it; setting works out again what stays the same for an episode."""
    everything = ", ".join(states) + "," * (len(states) == 1)
    lane = _lane(parts, None, states, (), constants)
    nodes = parts.task.observation.nodes if parts.invariants.observation else ()
    values = lane.emit((*parts.invariants.nodes, *nodes))
    fixed = [_stored(lane, n, n.type) for n in parts.invariants.nodes]
    lines = [f"{name} = {source}" for name, source in zip(parts.invariants.names, fixed, strict=True)]
    if nodes:
        flat = [f"*{lane.packed(n)}" if n.type.shape else lane.scalar(n) for n in nodes]
        lines.append(f"kept = np.array(({', '.join(flat)},), np.float32).reshape({parts.observation.shape})")
    assert len(values) == len(parts.invariants.nodes) + len(nodes)
    clock = "t, past, episodes, alive"
    body = [f"nonlocal {', '.join([*states, *_kept(parts)])}, {clock}", f"{everything} = values"]
    body += [*lane.lines, *lines, f"{clock} = clock"]
    return [
        "def get():",
        f"    return ({everything}), ({clock})",
        "",
        "def put(values, clock):",
        *_indent(body),
    ]


# -- observations -------------------------------------------------------------------------------------------------


def _observation(lane: Lane, layout: Layout, phase: Phase, values: Sequence[Value]) -> tuple[str, list[str]]:
    """The source of the observation, and the statements that fill it in."""
    nodes = phase.observation
    match layout.form:
        case "discrete":
            return _integer(lane, nodes[0]), []
        case "box" if phase.row_size:
            return _row(lane, nodes, layout)
        case "box":
            return f"np.array({lane.scalar(nodes[0])}, np.float32)", []
        case "multi_discrete":
            atoms = [_shifted(a, start) for a, start in zip(_all_atoms(lane, nodes), layout.starts, strict=True)]
            return f"np.array(({', '.join(atoms)},), np.int64)", []
        case "one_hot":
            return _one_hot(lane, nodes, layout)
        case "dict":
            return _dictionary(lane, nodes, layout), []


def _integer(lane: Lane, node: Node) -> str:
    """A finite scalar as `Discrete` has it: a condition is 0 or 1."""
    atom = lane.scalar(node)
    return f"(1 if {atom} else 0)" if node.type.kind is Kind.BOOL else atom


def _all_atoms(lane: Lane, nodes: Sequence[Node]) -> list[str]:
    return [atom for node in nodes for atom in lane.atoms(node)]


def _shifted(atom: str, start: int) -> str:
    return atom if start == 0 else f"{atom} - {start}" if start > 0 else f"{atom} + {-start}"


def _row(lane: Lane, nodes: Sequence[Node], layout: Layout) -> tuple[str, list[str]]:
    """Runs of elements written into the fresh row `o`; what the block filled in is left alone."""
    statements: list[str] = []
    run: list[Node] = []
    offset = start = 0
    sizes = [c.type.size for c in layout.components]
    for node, size in zip([*nodes, None], [*sizes, 0], strict=True):
        if node is None or is_filled(node):
            statements += _write(lane, start, run)
            run = []
        else:
            start = start if run else offset
            run.append(node)
        offset += size
    return "o", statements


def _write(lane: Lane, start: int, run: Sequence[Node]) -> list[str]:
    if not run:
        return []
    size = sum(n.type.size for n in run)
    if size == 1:
        return [f"o[{start}] = {lane.scalar(run[0])}"]
    items = [f"*{lane.packed(n)}" if n.type.size > UNROLLED else ", ".join(lane.atoms(n)) for n in run]
    writer = lane.constant(Struct(f"{size}f").pack_into)  # native floats: what overflows becomes inf
    return [f"{writer}(o, {4 * start}, {', '.join(items)})"]


def _one_hot(lane: Lane, nodes: Sequence[Node], layout: Layout) -> tuple[str, list[str]]:
    name = lane.name()
    statements = [f"{name} = np.zeros({layout.size}, np.float32)"]
    offset = 0
    for atom, start, count in zip(_all_atoms(lane, nodes), layout.starts, layout.counts, strict=True):
        statements.append(f"{name}[{offset} + {_shifted(atom, start)}] = 1.0")
        offset += count
    return name, statements


def _dictionary(lane: Lane, nodes: Sequence[Node], layout: Layout) -> str:
    items = []
    for node, c in zip(nodes, layout.components, strict=True):
        if c.is_finite and c.type.is_scalar:
            items.append(f"{c.name!r}: {_integer(lane, node)}")
        else:
            source = lane.scalar(node) if c.type.is_scalar else lane.packed(node)
            shape = "" if len(c.type.shape) < 2 else f".reshape({c.type.shape})"
            items.append(f"{c.name!r}: np.array({source}, np.float32){shape}")
    return "{" + ", ".join(items) + "}"


# -- actions ------------------------------------------------------------------------------------------------------


def _read_action(task: Task, layout: Layout) -> tuple[list[str], list[Value]]:
    """Statements that read and check an action, and the values of its components."""
    names = _names("a", task.action)
    match layout.form:
        case "discrete":
            return _read_discrete(names[0], task.action[0]), [Value([names[0]])]
        case "multi_discrete":
            return _read_multi(task, names)
        case _:
            return _read_box(task, layout, names)


def _read_discrete(name: str, c: Component) -> list[str]:
    low, high = int(c.low[0]), int(c.high[0])
    value = f"{name} != 0" if c.type.kind is Kind.BOOL else name
    lines = [
        "try:",
        f"    {name} = index(action)",
        "except TypeError:",
        "    raise bad_action(action) from None",
    ]
    lines += [f"if not {low} <= {name} <= {high}:", "    raise bad_action(action)"]
    return lines if value == name else [*lines, f"{name} = {value}"]


def _elements(task: Task, names: Sequence[str]) -> tuple[list[str], list[Value]]:
    """A name for every element of the action, and the components made of them."""
    flat, values = [], []
    for i, (c, name) in enumerate(zip(task.action, names, strict=True)):
        mine = [name] if c.type.is_scalar else [f"a{i}_{k}" for k in range(c.type.size)]
        flat += mine
        values.append(Value(mine))
    return flat, values


def _listed(shape: tuple[int, ...], names: Sequence[str]) -> list[str]:
    """Statements that spread an array-like action over names; anything of another shape is refused."""
    ravel = ".ravel()" if len(shape) > 1 else ""
    return [
        "try:",
        f"    if action.__class__ is not np.ndarray or action.shape != {shape}:",
        f"        action = as_array(action, {shape})",
        f"    {', '.join(names)}{',' if shape else ''} = action{ravel}.tolist()",
        "except (TypeError, ValueError):",
        "    raise bad_action(action) from None",
    ]


def _read_multi(task: Task, names: Sequence[str]) -> tuple[list[str], list[Value]]:
    flat, values = _elements(task, names)
    lines = _listed((len(flat),), flat)
    k = 0
    for c in task.action:
        for count, start in zip(c.counts, c.low, strict=True):
            name = flat[k]
            lines += [
                f"if {name}.__class__ is not int or not 0 <= {name} < {count}:",
                "    raise bad_action(action)",
            ]
            shifted = f"{name} + {int(start)}" if start else name
            shifted = f"{name} != 0" if c.type.kind is Kind.BOOL else shifted
            lines += [f"{name} = {shifted}"] if shifted != name else []
            k += 1
    return lines, values


def _read_box(task: Task, layout: Layout, names: Sequence[str]) -> tuple[list[str], list[Value]]:
    flat, values = _elements(task, names)
    lines = _listed(layout.shape, flat)
    kinds = [c.type.kind for c in task.action for _ in range(c.type.size)]
    for name, low, high, kind in zip(flat, layout.low, layout.high, kinds, strict=True):
        low, high = max(low, -FLOAT_MAX), min(high, FLOAT_MAX)
        lines += [
            f"if not {literal(low)} <= {name} <= {literal(high)}:",
            "    raise bad_action(action)",
        ]
        if kind is not Kind.REAL:
            lines += [
                f"if {name} != int({name}):",
                "    raise bad_action(action)",
                f"{name} = int({name})",
            ]
    return lines, values
