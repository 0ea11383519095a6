"""The generated module of a scalar program: closures over the state of one environment, with `reset` and `step`."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.types import TIME, Role, Type
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent, names_of
from taskspec.programs.lane_form import LaneEmitter, LaneValue
from taskspec.programs.lowering import Invariants, frozen_components
from taskspec.programs.scalar import interface
from taskspec.programs.scalar.phase import Phase


@dataclass(frozen=True)
class Parts:
    """The parts from which a module is generated."""

    task: Task
    invariants: Invariants
    cold: frozenset[str]
    reset: Phase
    step: Phase
    observation: SpaceLayout
    action: SpaceLayout


def generate(parts: Parts) -> tuple[str, dict[str, Any]]:
    """Source of the module, and the constants it refers to."""
    task = parts.task
    constants = dict[str, Any]()
    states = names_of("s", task.state)
    # `repr`, because ids and file names are somebody's text: nothing in them may end the literal.
    head = [
        repr(f"{task.id}: one environment, straight-line. Generated; the spec is {task.source.document.origin.name}.")
    ]
    restored = _restored(parts, states, constants)
    step = _step(parts, states, restored, constants)
    reset = _reset(parts, states, [*step, *restored], constants)
    kept = [*states, *_kept(parts)]
    lines = [f"{', '.join(kept)} = {', '.join('None' for _ in kept)}", "alive = False"]
    lines += ["t = 0  # steps of this episode", "past = 0  # steps of the episodes before it", "episodes = 0"]
    if interface.has_rows(task):
        lines.append("next_row = rows()")
    access = _access(parts, states, restored)
    legal = interface.mask(task, _lane(parts, None, states, (), constants))
    lines += ["", *legal, "", *reset, "", *step, "", *access, "", "return reset, step, get, put, mask"]
    text = [*head, "", "", "def lane(next_first, next_draws, bad_action, not_running):", *indent(lines), ""]
    return "\n".join(text), constants


def _kept(parts: Parts) -> list[str]:
    names = list(parts.invariants.names)
    if parts.invariants.observation:
        names.append("kept")
    if interface.is_kept(parts.task):
        names.append("told")
    return names


def _held(name: str, type_: Type) -> LaneValue:
    if type_.is_scalar:
        return LaneValue([name])
    return LaneValue(packed=name)


def _lane(
    parts: Parts, phase: Phase | None, states: Sequence[str], actions: Sequence[LaneValue],
    constants: dict[str, Any],
) -> LaneEmitter:  # fmt: skip
    task = parts.task
    names = {TIME: LaneValue(["t"])}
    for c, name in zip(task.state, states, strict=True):
        names[Role.STATE, c.name] = _held(name, c.type)
    for c, value in zip(task.action, actions, strict=False):
        names[Role.ACTION, c.name] = value
    for node, name in zip(parts.invariants.nodes, parts.invariants.names, strict=True):
        names[Role.VARIABLE, name] = _held(name, node.type)
    if phase is None:
        return LaneEmitter(names, {}, Builder().certain, constants=constants)
    for node, name in zip(phase.hoisted, phase.hoisted_names, strict=True):
        names[Role.VARIABLE, name] = _held(name, node.type)
    return LaneEmitter(names, phase.words, Builder().certain, constants=constants)


def _unpack(phase: Phase, call: str) -> list[str]:
    if phase.names:
        return [f"{', '.join(phase.names)} = {call}()"]
    return []


def _reset(parts: Parts, states: Sequence[str], others: Sequence[str], constants: dict[str, Any]) -> list[str]:
    """Write the function `reset`; `others` are the statements that compute with the values it keeps."""
    task = parts.task
    phase = parts.reset
    lane = _lane(parts, phase, states, (), constants)
    values = lane.emit((*phase.roots, *phase.observation))
    types = [*(c.type for c in task.state), *(n.type for n in parts.invariants.nodes)]
    stored = [_stored(lane, n, v) for n, v in zip(phase.roots, types, strict=True)]
    for i, c in enumerate(task.state):
        if c.name in parts.cold:
            stored[i] = "None"
    observation, statements = interface.observe(lane, parts.observation, phase, values[len(phase.roots) :])
    inner = lane.finish(statements, [*stored, observation])
    targets = [*states, *parts.invariants.names]
    body = [*_unpack(phase, "next_first"), *_unwrapped(phase, inner, zip(targets, stored, strict=True), others), *inner]
    body += [f"{', '.join(targets)} = {', '.join(stored)}"]
    if parts.invariants.observation:  # what is handed out may be written into, so it is always a copy
        body += [f"kept = {observation}"]
        observation = "kept.copy()"
        if phase.row_count > 1:
            observation = phase.row_names[1]
    if phase.row_count > 2:
        body += [f"told = {phase.row_names[2]}"]
    else:
        body += interface.told_state(task, parts.observation, states, observation)
    told = "{}"
    if task.mask:
        told = f"{{{interface.MASKED}}}"
    body += ["past += t", "t = 0", "episodes += 1", "alive = True", f"return {observation}, {told}"]
    targets = [*states, *_kept(parts), "t", "past", "episodes", "alive"]
    return ["def reset():", *indent([f"nonlocal {', '.join(targets)}", *body])]


def _unwrapped(phase: Phase, body: Iterable[str], kept: Iterable[tuple[str, str]], others: Iterable[str]) -> list[str]:
    read = _names_in(others)
    sources = []
    for name, source in kept:
        if name in read:
            sources.append(source)
    used = _names_in([*body, *sources])
    lines = []
    for h in phase.wide:
        if h in used:
            lines.append(f"{h} = {h}.tolist()")
    return lines


def _names_in(lines: Iterable[str]) -> set[str]:
    return set(_NAMES.findall("\n".join(lines)))


def _step(parts: Parts, states: Sequence[str], others: Sequence[str], constants: dict[str, Any]) -> list[str]:
    """Write the function `step`: it works everything out, and fixes its results, before the state moves on."""
    task = parts.task
    phase = parts.step
    reading, actions = interface.read_action(task, parts.action)
    lane = _lane(parts, phase, states, actions, constants)
    values = lane.emit((*phase.roots, *phase.observation))
    n = len(task.state)
    frozen = frozen_components(task)
    changed = []
    for i in range(n):
        if task.state[i].name not in frozen:
            changed.append(i)
    stored = {}
    for i in changed:
        stored[i] = _stored(lane, phase.roots[i], task.state[i].type)
    own = {"True", "False", "nan", "inf", *phase.names, *_kept(parts)}
    reward, terminal, *measures = (_fixed(lane, lane.scalar(root), own) for root in phase.roots[n:])
    observation, statements = _seen(lane, parts, terminal, values[len(phase.roots) :], own)
    end, flags = _ending(task, terminal)
    inner = lane.finish(statements, [*stored.values(), observation, reward, terminal, *measures])
    kept = [(states[i], source) for i, source in stored.items()]
    body = [*_unpack(phase, "next_draws"), *_unwrapped(phase, inner, kept, [*inner, *others]), *inner]
    body += interface.old_state(task, states)
    nonlocals = [states[i] for i in changed]
    if changed:
        body.append(f"{', '.join(nonlocals)} = {', '.join(stored.values())}")
        told = interface.told_state(task, parts.observation, states, observation)
        body += told
        if told:
            nonlocals.append("told")
    body += ["t += 1", *end, f"return {observation}, {reward}, {flags}, {interface.info(task, states, measures)}"]
    nonlocals += ["t", "alive"]
    running = ["if not alive:", "    raise not_running()"]
    return ["def step(action):", *indent([f"nonlocal {', '.join(nonlocals)}", *reading, *running, *body])]


def _fixed(lane: LaneEmitter, source: str, own: Container[str]) -> str:
    names = _NAMES.findall(source)
    if not names or (_ATOM.fullmatch(source) and (names[0] in own or _MADE.fullmatch(names[0]))):
        return source
    return lane.named(source)


_NAMES = re.compile(r"\b[A-Za-z_]\w*")
_MADE = re.compile(r"v\d+")
_ATOM = re.compile(r"\w+(\[\d+\])?")


def _seen(
    lane: LaneEmitter, parts: Parts, terminal: str, values: Sequence[LaneValue], own: Container[str]
) -> tuple[str, list[str]]:
    if parts.invariants.observation:
        return ("kept" if terminal == "True" else "kept.copy()"), []
    observation, statements = interface.observe(lane, parts.observation, parts.step, values)
    if statements:
        return observation, statements
    return _fixed(lane, observation, own), []


def _ending(task: Task, terminal: str) -> tuple[list[str], str]:
    truncated = "False"
    if task.horizon is not None:
        truncated = f"t >= {task.horizon}"
    if terminal == "False" and truncated == "False":
        return [], "False, False"
    if terminal == "False":
        lines = [f"if {truncated}:", "    alive = False", "    end = True", "else:", "    end = False"]
        return lines, "False, end"
    if terminal == "True":
        return ["alive = False"], f"True, {truncated}"
    if truncated == "False":
        return [f"if {terminal}:", "    alive = False"], f"{terminal}, False"
    return [f"end = {truncated}", f"if end or {terminal}:", "    alive = False"], f"{terminal}, end"


def _stored(lane: LaneEmitter, node: Node, type_: Type) -> str:
    if type_.is_scalar:
        return lane.scalar(node)
    return lane.packed(node)


def _restored(parts: Parts, states: Sequence[str], constants: dict[str, Any]) -> list[str]:
    lane = _lane(parts, None, states, (), constants)
    if parts.invariants.observation:
        nodes = parts.task.next_observation
    else:
        nodes = ()
    lane.emit((*parts.invariants.nodes, *nodes))
    fixed = [_stored(lane, n, n.type) for n in parts.invariants.nodes]
    lines = []
    for name, source in zip(parts.invariants.names, fixed, strict=True):
        lines.append(f"{name} = {source}")
    if nodes:
        flat = []
        for n in nodes:
            flat.append(f"*{lane.packed(n)}" if n.type.shape else lane.scalar(n))
        lines.append(f"kept = singles(({', '.join(flat)},), {parts.observation.shape})")
    return lane.finish(lines)


def _access(parts: Parts, states: Sequence[str], restored: Sequence[str]) -> list[str]:
    everything = ", ".join(states) + "," * (len(states) == 1)
    clock = "t, past, episodes, alive"
    body = [f"nonlocal {', '.join([*states, *_kept(parts)])}, {clock}", f"{everything} = values"]
    told = []
    if interface.is_kept(parts.task):
        told = [f"told = {interface.flat_state(parts.task, states)}"]
    body += [*restored, *told, f"{clock} = clock"]
    put = ["", "def put(values, clock):", *indent(body)]
    return ["def get():", f"    return ({everything}), ({clock})", *put]
