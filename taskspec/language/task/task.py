"""A task: what a spec means for given parameters. Typed, closed, immutable; all that is downstream takes a Task."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from taskspec.base.display import InNotebooks
from taskspec.base.ids import InstanceId
from taskspec.base.named import all_names
from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.ir import Const, Draw, Node, Read, draws, plain, walk
from taskspec.language.expressions.types import TIME, Expression, Kind, Role
from taskspec.language.expressions.variates import WordLayout
from taskspec.language.source import Document
from taskspec.language.task import parts
from taskspec.language.task.merge import Merged
from taskspec.language.task.spaces import SpaceLayout, action_layout, observation_layout, space

if TYPE_CHECKING:
    import gymnasium

    from taskspec.language.task.schema.models import Spec


@dataclass(frozen=True, eq=False)
class TaskSource:
    """The sections of a spec as written, with the parameter values that are bound."""

    merged: Merged
    suite: str
    parameters: tuple[parts.Parameter, ...]
    surface: parts.Surface
    content_hash: str
    constants: Mapping[str, Const] = field(default_factory=dict, repr=False)
    """The values of the constants, those that are drawn as they are for this instance."""

    @property
    def document(self) -> Document:
        """The document that was read."""
        return self.merged.document

    @property
    def variant(self) -> str | None:
        """The key of the variant, or None for the spec itself."""
        return self.merged.variant

    @property
    def version(self) -> int:
        """The number after the name in the id."""
        return int(self.merged.data.get("version", 0))


@dataclass(frozen=True, eq=False)
class Process:
    """The decision process as core nodes, `initial` and `next` in the order of the state.

    `next`, `reward`, `terminal` and `measures` read STATE, ACTION and TIME, `absorbing_reward` reads STATE and TIME, `legal`
    reads STATE and ACTION; `initial` reads nothing: each component's node contains those it depends on. `reset_draws` and
    `step_draws` are the draws that the sections of a reset and of a step write, whether or not they are left in these nodes.

    A state is always in its space: an int that `raw_initial` or `raw_next` would give outside its range is moved to the nearest
    end in `initial` and `next`, which soundness reports (E403, E404).
    """

    initial: tuple[Node, ...]
    next: tuple[Node, ...]
    raw_initial: tuple[Node, ...]
    raw_next: tuple[Node, ...]
    reward: Node
    terminal: Node
    absorbing_reward: Node
    reset_draws: tuple[Draw, ...]
    step_draws: tuple[Draw, ...]
    required: tuple[tuple[Node, str], ...] = field(default=(), repr=False)
    """Conditions on parameters that are left open, each with what to say where it does not hold."""
    measures: Mapping[str, Node] = field(default_factory=dict)
    """Quantities beside the reward, by name."""
    legal: Node | None = None
    """Whether an action may be taken in a state; None: all may."""

    @property
    def never_ends(self) -> bool:
        """True where it is written that no step ends the episode."""
        return isinstance(self.terminal, Const) and not self.terminal.value

    @property
    def always_ends(self) -> bool:
        """True where it is written that every step ends the episode."""
        return isinstance(self.terminal, Const) and bool(self.terminal.value)

    @property
    def step_roots(self) -> tuple[Node, ...]:
        """All that a step works out but the observation: next states, reward, end, measures."""
        return (*self.next, self.reward, self.terminal, *self.measures.values())

    @property
    def nodes(self) -> Iterator[Node]:
        """All expressions, and the draws that the sections write."""
        yield from (*self.initial, *self.next, *self.raw_initial, *self.raw_next)
        yield from (self.reward, self.terminal, self.absorbing_reward, *self.measures.values())
        yield from (node for node, _ in self.required)
        if self.legal is not None:
            yield self.legal
        yield from (*self.reset_draws, *self.step_draws)


@dataclass(frozen=True, eq=False)
class Annotations:
    """Statements of a spec about its process: the expert, claims, examples, symmetries as written, and the figure.

    An expert that is given by nodes reads STATE and TIME; where it has a `memory`, it reads that as STATE as well.
    """

    expert: tuple[Node, ...] | Literal["optimal"] | parts.Soft | None = None
    memory: parts.ExpertMemory | None = None
    remembers: bool = False
    """Whether the expert's memory is part of the state (`Task.remembering`)."""
    claims: tuple[parts.Claim, ...] = ()
    examples: tuple[parts.Example, ...] = ()
    figure: parts.Figure | None = None
    symmetries: tuple[parts.Symmetry, ...] = ()

    @property
    def expert_nodes(self) -> tuple[Node, ...]:
        """The actions of an expert that is given by nodes; empty for another one."""
        if isinstance(self.expert, tuple):
            return self.expert
        return ()

    @property
    def nodes(self) -> Iterator[Node]:
        """All expressions that became nodes."""
        yield from self.expert_nodes
        for part in (self.memory, self.figure, *self.symmetries):
            if part is not None:
                yield from part.nodes


def task_id(suite: str, name: str, version: int) -> str:
    """Return `suite/Name-vN`."""
    prefix = f"{suite}/" if suite else ""
    return f"{prefix}{name}-v{version}"


@dataclass(frozen=True, eq=False)
class Task(InNotebooks):
    """One task with its parameters bound: what was written, spaces, the process, and what is stated about it.

    All but the source is as the modifiers changed it; `written_as` is the task without them.
    """

    source: TaskSource
    state: tuple[parts.Component, ...]
    action: tuple[parts.Component, ...]
    observation: parts.Observation
    """Its nodes read STATE, the state that is observed, and TIME."""
    horizon: int | None
    discount: float
    process: Process
    annotations: Annotations
    modifiers: tuple[parts.Modifier, ...] = ()
    """The modifiers of the task, in order (`taskspec.modify`)."""
    written_as: Task | None = field(default=None, repr=False)

    def with_process(self, **changes: Any) -> Task:
        """Change some fields of the process."""
        return replace(self, process=replace(self.process, **changes))

    def with_annotations(self, **changes: Any) -> Task:
        """Change some of the annotations."""
        return replace(self, annotations=replace(self.annotations, **changes))

    @property
    def name(self) -> str:
        """The name of the task, or of its variant."""
        return self.source.merged.name

    @property
    def parameters(self) -> tuple[parts.Parameter, ...]:
        """The parameters with their values, in the order of the spec."""
        return self.source.parameters

    @property
    def content_hash(self) -> str:
        """A hash of what decides the behaviour: the sections that do, parameter values, and modifiers."""
        return self.source.content_hash

    @property
    def unmodified(self) -> Task:
        """The task as its spec has it."""
        return self.written_as or self

    def state_left(self, section: str) -> str | None:
        """State component that alone of the state left decides the reward or the end of a step; else None."""
        scope = self.source.surface.scopes.get(section)
        if scope is None:
            return None
        own = set(all_names(self.state))
        others = (
            {name + "'" for name in own} | set(all_names(self.action)) | set(self.source.merged.data.get("noise") or {})
        )
        if scope.used & others:
            return None
        return min(scope.used & own, default=None)

    @property
    def ending(self) -> parts.Ending:
        """The fate of terminal states: the episode ends, or they absorb."""
        if self._has("absorbing"):
            return "absorb"
        return "terminate"

    @property
    def observe_time(self) -> bool:
        """True if the number of steps taken was added to the observation."""
        return self._has("time_observed")

    def _has(self, modifier: str) -> bool:
        return any(m.name == modifier for m in self.modifiers)

    @property
    def id(self) -> str:
        """`suite/Name-vN`, the id under which a shipped task is registered with Gymnasium."""
        return task_id(self.source.suite, self.name, self.source.version)

    @property
    def instance_id(self) -> str:
        """The id with the values of all parameters by name and with the modifiers, as `load` and `gym.make` take it.

        `suite/Name-vN?L=50&M=7+sticky=0.25`.
        """
        return str(InstanceId(self.id, dict(sorted(self.values.items())), tuple(map(str, self.modifiers))))

    @cached_property
    def spec(self) -> Spec:
        """The spec, with its variant's changes, as a pydantic model."""
        from taskspec.language.task.schema.check import validated

        return validated(self.source.merged)

    @property
    def info(self) -> tuple[str, ...]:
        """The keys of infos of steps: "old_state", "new_state", both or neither."""
        return tuple(self.source.merged.data.get("info") or ())

    @property
    def title(self) -> str:
        """The heading that the spec gives it, or its name."""
        return self.spec.title or self.name

    @property
    def summary(self) -> str:
        """One sentence about the task; empty where the spec has none."""
        return self.spec.summary or ""

    @property
    def capability(self) -> str | None:
        """The capability of a learner that the task tests, such as "exploration"."""
        return self.spec.capability

    @property
    def variants(self) -> tuple[str, ...]:
        """The keys of the spec's variants: `load(task, key)` is one of them."""
        return tuple(map(str, self.source.document.data.get("variants") or ()))

    @property
    def roles(self) -> dict[str, str]:
        """The variants in which the "expert" demonstrates and the "learner" acts; empty where the spec tells none apart."""
        if self.spec.roles is None:
            return {}
        return self.spec.roles.model_dump()

    @property
    def observation_space(self) -> gymnasium.Space[Any]:
        """The Gymnasium space of observations."""
        return space(self.observation_layout)

    @property
    def action_space(self) -> gymnasium.Space[Any]:
        """The Gymnasium space of actions."""
        return space(self.action_layout)

    @cached_property
    def observation_layout(self) -> SpaceLayout:
        """Observations as Gymnasium values."""
        return observation_layout(self.observation)

    @cached_property
    def action_layout(self) -> SpaceLayout:
        """Actions as Gymnasium values."""
        is_number = all(entry.get("shape") is not None for entry in self.source.merged.data["action"].values())
        return action_layout(self.action, is_number)

    @cached_property
    def mask(self) -> tuple[Node, ...]:
        """The legal actions of a state: a vector of conditions, one for each action; empty where all are legal."""
        legal = self.process.legal
        if legal is None:
            return ()
        (c,) = self.action
        b = self.new_builder()
        conditions: list[Node] = []
        for value in range(int(c.least), int(c.most) + 1):
            action = b.scalar(bool(value) if c.type.kind is Kind.BOOL else value)
            conditions += b.substitute([legal], {(Role.ACTION, c.name): action})
        return (b.structure("vector", conditions),)

    @cached_property
    def written(self) -> dict[str, Any]:
        """The merged spec as a dict, without unset keys."""
        return self.spec.model_dump(by_alias=True, exclude_unset=True)

    @cached_property
    def constants(self) -> dict[str, Any]:
        """The constants by name, as this instance has them: numbers, and arrays of int64, float64 or bool."""
        values: dict[str, Any] = {}
        for name, node in self.source.constants.items():
            if node.type.is_scalar:
                values[name] = plain(node.value)
            else:
                kind = {Kind.BOOL: "bool", Kind.INT: "int64", Kind.REAL: "float64"}[node.type.kind]
                values[name] = np.array(list(map(plain, node.flat)), kind).reshape(node.type.shape)
                values[name].flags.writeable = False
        return values

    @property
    def values(self) -> dict[str, Any]:
        """Parameter values by name."""
        return {p.name: p.value for p in self.parameters}

    @property
    def given(self) -> dict[str, Any]:
        """The values that are not the defaults, by name: where one of them changes, defaults that depend on it do as well."""
        values = {}
        for p in self.parameters:
            if p.value != p.default:
                values[p.name] = p.value
        return values

    @property
    def is_finite(self) -> bool:
        """True if states and actions are finite in number by their declared domains."""
        return parts.are_finite((*self.state, *self.action))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Task) and self._identity == other._identity

    def __hash__(self) -> int:
        return hash(self._identity)

    @cached_property
    def _identity(self) -> tuple[str, str, str, bool]:
        return (self.id, self.content_hash, self.observation.space, self.annotations.remembers)

    def __repr__(self) -> str:
        arguments = "".join(f", {p.name}={p.value!r}" for p in self.parameters)
        return f"<Task {self.id}{arguments}{''.join(f' + {m}' for m in self.modifiers)}>"

    def __copy__(self) -> Task:
        return self  # immutable

    def __deepcopy__(self, memo: dict[int, Any]) -> Task:
        return self

    def remembering(self) -> Task:
        """Put the expert's memory into the state; the task itself without a memory."""
        memory = self.annotations.memory
        if memory is None:
            return self
        shown, memory = self._shown(memory)
        first = self.first_observation
        later = self.next_observation
        process = self.process
        changed = self.with_process(
            initial=(*process.initial, *self._seeing(memory.initial, first)),
            next=(*process.next, *self._seeing(memory.next, later)),
            raw_initial=(*process.raw_initial, *self._seeing(memory.raw_initial, first)),
            raw_next=(*process.raw_next, *self._seeing(memory.raw_next, later)),
        )
        state = (*self.state, *memory.components)
        expert = self.annotations.expert
        if isinstance(expert, tuple):
            expert = self.new_builder().substitute(expert, shown)
        return replace(changed, state=state).with_annotations(expert=expert, memory=None, remembers=True)

    def _shown(self, memory: parts.ExpertMemory) -> tuple[dict[tuple[Role, str], Node], parts.ExpertMemory]:
        shown: dict[tuple[Role, str], Node] = {}
        kept = list(range(len(memory.declared)))
        for i in range(len(kept), len(memory.components)):
            (node,) = self._seeing([memory.next[i]], self.observation.nodes)
            if draws([node]):
                kept.append(i)
            else:
                shown[memory.components[i].read] = node
        return shown, memory.only(kept)

    def _seeing(self, nodes: Iterable[Node], observed: Iterable[Node]) -> tuple[Node, ...]:
        return self.new_builder().substitute(nodes, parts.by_read(Role.NEXT, self.observation.components, observed))

    @cached_property
    def reset_words(self) -> WordLayout:
        """The random words of a reset that each of its draws takes."""
        return WordLayout.dealt(self.process.reset_draws)

    @cached_property
    def step_words(self) -> WordLayout:
        """The random words of a step that each of its draws takes."""
        return WordLayout.dealt(self.process.step_draws)

    @property
    def step_roots(self) -> tuple[Node, ...]:
        """All that a step works out: next states, reward, end, measures, observation."""
        return (*self.process.step_roots, *self.next_observation)

    @property
    def reset_roots(self) -> tuple[Node, ...]:
        """All that a reset works out: first states, observation."""
        return (*self.process.initial, *self.first_observation)

    @property
    def roots(self) -> tuple[Node, ...]:
        """All that a reset and a step work out, and the legal actions."""
        return (*self.reset_roots, *self.step_roots, *self.mask)

    @property
    def nodes(self) -> Iterator[Node]:
        """All expressions that the task is made of, and the draws that its sections write."""
        yield from (*self.process.nodes, *self.observation.nodes, *self.annotations.nodes)

    def new_builder(self, more: Iterable[Expression] = ()) -> Builder:
        """Make a builder for nodes over this task's.

        Args:
            more: nodes beside them.

        Returns:
            One that shares nodes equal to any of these.
        """
        return Builder.of((*self.nodes, *self.next_observation, *self.first_observation, *more))

    @property
    def next_observation(self) -> tuple[Node, ...]:
        """The observation after a step, over the STATE and TIME before it: what a step computes."""
        return self._observations[0]

    @property
    def first_observation(self) -> tuple[Node, ...]:
        """The observation at reset, over nothing: what a reset computes."""
        return self._observations[1]

    @cached_property
    def _observations(self) -> tuple[tuple[Node, ...], tuple[Node, ...]]:
        b = Builder.of(self.nodes)
        later = parts.by_read(Role.STATE, self.state, self.process.next)
        first = parts.by_read(Role.STATE, self.state, self.process.initial)
        first[TIME] = b.scalar(0)
        for node in walk(self.observation.nodes):
            if (
                isinstance(node, Read) and node.role is Role.TIME
            ):  # one less than at the end of the step: as in dynamics
                before = b.read(Role.TIME, node.name, node.type, node.low, node.high - 1)
                later[TIME] = b.apply("add", before, b.scalar(1))
        seen = self.observation.nodes
        return b.substitute(seen, later), b.substitute(seen, first)


def recall(
    task: Task,
    memory: parts.ExpertMemory,
    seen: Sequence[tuple[Any, ...]],
    before: Sequence[tuple[Any, ...]],
    action: Sequence[tuple[Any, ...]],
    t: int,
) -> list[tuple[Any, ...]]:
    """Remember an observation: the expert's memory after it, as flat values by component.

    Args:
        seen: what is now observed, by component.
        before, action: the memory and the action before that; not looked at when `t` is 0.
        t: steps taken.
    """
    reads: dict[tuple[Role, str], Any] = parts.by_read(Role.NEXT, task.observation.components, seen)
    if t == 0:
        return evaluate(memory.initial, reads)
    reads |= parts.by_read(Role.STATE, memory.components, before)
    reads |= parts.by_read(Role.ACTION, task.action, action)
    reads[TIME] = (t - 1,)
    return evaluate(memory.next, reads)


TaskLike: TypeAlias = Task | str | PathLike[str]
"""A task, its id, or the path of its spec: functions that need a task take any of them."""
