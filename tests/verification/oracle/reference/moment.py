"""One step, or one beginning, of an episode: what each name means in it, and what its sections give."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from tests.verification.oracle.reference.chance import Chance
from tests.verification.oracle.reference.expressions import Place, Scope
from tests.verification.oracle.reference.forms import form
from tests.verification.oracle.reference.late import form_names_late
from tests.verification.oracle.reference.syntax import PRIME
from tests.verification.oracle.reference.task import State, Task
from tests.verification.oracle.reference.values import Choice, Value, Wrong, number, settled


@dataclass
class Moment:
    """A step from `state` by `action`, `t` steps after the beginning; without an action, an observation alone."""

    task: Task
    state: State
    action: State | None
    t: int
    chance: Chance | None
    counting: bool = False
    """Only the words of draws are counted: a next value may be any."""
    noise: dict[str, Value] = field(default_factory=dict)
    following: State = field(default_factory=dict)
    ended: bool | None = None
    busy: set[str] = field(default_factory=set)

    # -------------------------------------------------------------------------- names

    def scope(self, root: str, *, primes: bool = True, observing: bool = False) -> Scope:
        def lookup(name: str) -> Value | None:
            return self.name(name, scope, primes=primes, observing=observing)

        scope = Scope(lookup, self.task.functions, self.task.labelled, self.late, self.chance, Place(root))
        return scope

    def late(self, name: str) -> bool:
        """Whether a name is known only when the task runs."""
        task = self.task
        if name in task.definitions:
            return form_names_late(task.definitions[name], self.scope(""))
        components = {c.name for c in (*task.state, *task.action)}
        noises = task.sections.get("noise") or {}
        return name.endswith(PRIME) or name in ("t", "terminal") or name in components or name in noises

    def name(self, name: str, scope: Scope, *, primes: bool, observing: bool) -> Value | None:
        if primes and name.endswith(PRIME):
            return self.next_value(name[: -len(PRIME)])
        if name == "t":
            return settled("int", (), (self.t + observing,), fixed=False)
        if name in self.state:
            return self.following[name] if observing else self.state[name]
        if self.action is not None and not observing and name in self.action:
            return self.action[name]
        if name in (self.task.sections.get("noise") or {}):
            return self.noise_value(name)
        if name == "terminal" and scope.place.root.split()[0] in ("reward", "measure"):
            return settled("bool", (), (self.terminal(),), fixed=False)
        if name in self.task.definitions:
            return form(self.task.definitions[name], scope.outer or scope)
        return self.task._fixed_name(name)

    def noise_value(self, name: str) -> Value:
        """A noise is drawn where it is read first; all other uses see the same value."""
        if name not in self.noise:
            with self._entered(name):
                self.noise[name] = form(self.task.sections["noise"][name], self.scope("noise " + name))
        return self.noise[name]

    def next_value(self, name: str) -> Value:
        if name not in self.following:
            with self._entered(name + "'"):
                self.following[name] = self._next(name)
        return self.following[name]

    @contextmanager
    def _entered(self, name: str) -> Iterator[None]:
        if name in self.busy:
            raise Wrong(f"{name} needs itself")
        self.busy.add(name)
        try:
            yield
        finally:
            self.busy.remove(name)

    def _next(self, name: str) -> Value:
        component = next(c for c in self.task.state if c.name == name)
        rule = (self.task.sections.get("dynamics") or {}).get(name + "'")
        if rule is None:
            return self.state[name]
        value = form(rule, self.scope(name + "'"), component.choice)
        return self.state[name] if self.counting else component.hold(value)

    # -------------------------------------------------------------------------- sections

    def next_state(self) -> State:
        return {c.name: self.next_value(c.name) for c in self.task.state}

    def reward(self) -> Value:
        return number(form(self.task.sections["reward"], self.scope("reward")))

    def measures(self) -> dict[str, Value]:
        """What is measured beside the reward, by name."""
        section = self.task.sections.get("measures") or {}
        return {k: number(form(observed(v), self.scope("measure " + k))) for k, v in section.items()}

    def legal(self) -> bool:
        """Whether the action may be taken in the state."""
        data = self.task.sections.get("legal")
        return data is None or bool(form(data, self.scope("legal", primes=False)).item)

    def absorbing_reward(self) -> Value:
        """What a step pays after the end."""
        return number(form(self.task.sections.get("absorbing_reward", 0), self.scope("absorbing", primes=False)))

    def terminal(self) -> bool:
        """Whether the step ends the episode; worked out once, as the reward may ask as well."""
        if self.ended is None:
            data = self.task.sections.get("terminal")
            self.ended = False if data is None else bool(form(data, self.scope("terminal")).item)
        return self.ended

    def observation(self) -> list[tuple[str, Value]]:
        """The observed values by name, after the step (or after the beginning)."""
        section = self.task.sections.get("observation")
        if section is None:
            return list(self.following.items())
        scope = self.scope("observation", primes=False, observing=True)
        entries = [(k, v) for k, v in section.items() if k != "space"]
        return [(k, form(observed(v), scope, self._labels(observed(v)))) for k, v in entries]

    def _labels(self, data: Any) -> Choice | None:
        return self.task.choices.get(data) if isinstance(data, str) else None

    def everything(self) -> None:
        """All sections of a step in the order in which their draws take words."""
        self.next_state()
        self.following = dict(self.state)
        self.reward()
        self.terminal()
        self.observation()
        self.measures()

    # -------------------------------------------------------------------------- beginnings, experts

    @classmethod
    def begin(cls, task: Task, chance: Chance, given: State | None = None) -> Moment:
        """The beginning of an episode: initial values, line by line."""
        moment = cls(task, {}, None, -1, chance, noise={})
        components = {c.name: c for c in task.state}
        counting = not hasattr(chance, "words") and not hasattr(chance, "choices")
        for name, data in (task.sections.get("initial") or {}).items():
            c = components[name]
            drawn = form(data, moment.scope("initial " + name, primes=False), c.choice)
            held = c.of((0,) * c.size) if counting else c.hold(drawn)
            moment.state[name] = (given or {}).get(name, held)
        for c in task.state:
            if c.name not in moment.state:
                moment.state[c.name] = (given or {}).get(c.name) or only(c.only())
        moment.state = {c.name: moment.state[c.name] for c in task.state}
        moment.following = moment.state
        return moment

    def expert(self) -> State:
        """The action of the expert in this state; no next values here."""
        data = self.task.sections["expert"]
        by_name = data if isinstance(data, dict) and set(data) <= {c.name for c in self.task.action} else None
        result = {}
        for c in self.task.action:
            rule = data if by_name is None else by_name[c.name]
            result[c.name] = c.hold(form(rule, self.scope("expert", primes=False), c.choice))
        return result


def only(value: Value | None) -> Value:
    if value is None:
        raise Wrong("a component has no initial value")
    return value


def observed(data: Any) -> Any:
    """The expression of an entry of `observation`, which may have bounds beside it."""
    return data["value"] if isinstance(data, dict) and "value" in data else data
