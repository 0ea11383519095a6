"""A spec bound to values of its parameters, and what follows from it: initial states, steps, observations."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from tests.verification.oracle.reference import random
from tests.verification.oracle.reference.chance import Census, Chance, Key, Seeded
from tests.verification.oracle.reference.components import Component, as_choice, component, label_value
from tests.verification.oracle.reference.expressions import Function, Place, Scope
from tests.verification.oracle.reference.forms import form
from tests.verification.oracle.reference.syntax import PRIME
from tests.verification.oracle.reference.values import Choice, Value, Wrong, number, scalar, settled

State = dict[str, Value]
Data = dict[str, Any]


class Unmet(Exception):
    """Parameters that the spec does not allow."""


@dataclass
class Task:
    """A task for given parameters. `sections`: those of the spec, variants merged."""

    sections: Data
    given: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.fixed: dict[str, Value] = {}
        self.functions: dict[str, Function] = {}
        self.definitions: Data = {}
        self.choices: dict[str, Choice] = {}
        self._constants: Data = self.sections.get("constants") or {}
        self._read_definitions()
        self._bind_parameters()
        self._busy: set[str] = set()
        for name in self._constants:
            self.constant(name)
        self.state = self._components("state")
        self.action = self._components("action")
        self.horizon = self._horizon()
        if self.horizon is not None:
            self.fixed["T"] = scalar(self.horizon)
        self.discount = number(self.value(self.sections.get("discount", 1))).item

    # -------------------------------------------------------------------------- what is fixed

    def value(self, data: Any, chance: Chance | None = None, root: str = "", expected: Choice | None = None) -> Value:
        """The value of a form over parameters and constants."""
        scope = Scope(self._fixed_name, self.functions, self.labelled, chance=chance, place=Place(root))
        return form(data, scope, expected)

    def labelled(self, name: str) -> Choice | None:
        """The choice that a component, a parameter or a definition of this name is of."""
        bare = name.removesuffix(PRIME)
        if bare in self.choices:
            return self.choices[bare]
        if name in self.fixed:
            return self.fixed[name].choice
        body = self.definitions.get(name)
        return self.labelled(body) if isinstance(body, str) and body.isidentifier() else None

    def _fixed_name(self, name: str) -> Value | None:
        if name in self.fixed:
            return self.fixed[name]
        if name in self._constants:
            return self.constant(name)
        if name in self.definitions:
            return self.value(self.definitions[name])
        return None

    def _read_definitions(self) -> None:
        for key, body in (self.sections.get("definitions") or {}).items():
            name, _, arguments = key.partition("(")
            if arguments:
                self.functions[name.strip()] = Function(
                    tuple(a.strip() for a in arguments.rstrip(" )").split(",")), body
                )
            else:
                self.definitions[name] = body

    def _bind_parameters(self) -> None:
        for name, data in (self.sections.get("parameters") or {}).items():
            if name == "require":
                continue
            self.fixed[name] = self._parameter(name, data)
        for rule in (self.sections.get("parameters") or {}).get("require") or ():
            if not self.value(rule["condition"]).item:
                raise Unmet(rule["message"])

    def _parameter(self, name: str, data: Data) -> Value:
        given = self.given.get(name, data["default"])
        choice = as_choice(data, self.value)
        if choice is not None:
            return label_value(choice, given)
        value = self.value(given)
        for bound, outside in (("low", lambda x, b: x < b), ("high", lambda x, b: x > b)):
            if data.get(bound) is not None and outside(value.item, self.value(data[bound]).item):
                raise Unmet(f"{name} = {given}")
        return settled(data["type"], (), value.data, fixed=True)

    def constant(self, name: str) -> Value:
        """A constant; drawn from the words of `instance_seed` and its own name where it draws."""
        if name not in self.fixed:
            if name in self._busy:
                raise Wrong(f"{name} needs itself")
            self._busy.add(name)
            data = self._constants[name]
            made = self._grid(data) if isinstance(data, dict) and "grid" in data else self._drawn(name, data)
            self.fixed[name] = Value(made.kind, made.shape, made.data, True, made.rough, made.choice)
        return self.fixed[name]

    def _grid(self, data: Data) -> Value:
        legend = {str(k): v for k, v in data["legend"].items()}
        return self.value([[legend[letter] for letter in line] for line in data["grid"]])

    def _drawn(self, name: str, data: Any) -> Value:
        if "instance_seed" not in self.fixed:
            return self.value(data)
        census = Census()
        self.value(data, census, name)
        seed = self.fixed["instance_seed"].item
        words = random.words(seed, random.INSTANCE, zlib.crc32(name.encode()))
        return self.value(data, Seeded(words, census.dealt()), name)

    def _components(self, section: str) -> list[Component]:
        found = [component(name, data, self.value) for name, data in self.sections[section].items()]
        self.choices.update({c.name: c.choice for c in found if c.choice is not None})
        return found

    def _horizon(self) -> int | None:
        data = self.sections["horizon"]
        return None if data == "none" else int(self.value(data).item)

    # -------------------------------------------------------------------------- what happens

    def words(self, phase: str, seed: int, n: int) -> Seeded:
        """The chance of step number n, or of reset number n, since the seed was set."""
        first = self.layout(phase)
        return Seeded(random.words(seed, random.STEP if phase == "step" else random.RESET, n), first)

    def layout(self, phase: str) -> dict[Key, int]:
        """The first word of each draw of a phase."""
        cached: dict[Key, int] | None = self.__dict__.get("_" + phase)
        if cached is None:
            census = Census()
            first = self._walk(phase, census)  # what `initial` names stands first, in a step as well
            rest = list(self.layout("step")) if phase == "reset" else list(census.widths)
            order = [key for key in (*first, *(k for k in rest if k not in first)) if key in census.widths]
            cached = self.__dict__["_" + phase] = census.dealt(order)
        return cached

    def _walk(self, phase: str, census: Census) -> list[Key]:
        """Evaluate a phase on states and actions that stand for all others, in the order in which draws are written.

        The draws that `initial` names are given, those of noises included.
        """
        from tests.verification.oracle.reference.moment import Moment

        somewhere = {c.name: c.of((0,) * c.size) for c in self.state}
        beginning = census if phase == "reset" else Census()
        begun = Moment.begin(self, beginning)
        first = list(beginning.widths)
        if phase == "reset":
            begun.observation()
            return first
        anything = {c.name: c.of((0,) * c.size) for c in self.action}
        Moment(self, somewhere, anything, 0, census, counting=True).everything()
        return first


def primed(name: str) -> str:
    return name + PRIME
