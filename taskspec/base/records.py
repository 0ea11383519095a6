"""Data classes like those of `dataclasses`, made in a fifth of the time; entries of tables by their names."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from operator import attrgetter
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(**options):
        """Make a data class, as `dataclasses.dataclass` does, for modules that the first `gym.make` imports.

        `dataclasses` compiles six methods for each class, and the ninety classes on that path took a third of its time.
        Here `__init__` is compiled when the class is first used, and classes share the other methods.
        """
        return lambda cls: _made(cls, options)


def _made(cls: type, options: dict[str, Any]) -> Any:
    methods: dict[str, Any] = {"__repr__": _repr}
    if options.get("frozen"):
        methods |= {"__setattr__": _refuse, "__delattr__": _refuse}
    if options.get("slots"):
        methods |= {"__getstate__": _values, "__setstate__": _set_state}
    if options.get("eq", True):
        methods |= {"__eq__": _equal, "__hash__": _hash if options.get("frozen") else None}
    missing = [name for name in methods if vars(cls).get(name) is None]
    if cls.__doc__ is None:
        cls.__doc__ = cls.__name__  # `dataclasses` would work out the signature for it
    made: Any = dataclasses.dataclass(**options | {"frozen": False, "init": False, "repr": False, "eq": False})(cls)
    made.__init__ = _initializer(made, "kw_only" in options)
    compared = [f.name for f in dataclasses.fields(made) if f.compare]
    made._compared = staticmethod(attrgetter("__class__", *compared))
    for name in missing:
        setattr(made, name, methods[name])
    return made


def _initializer(cls: Any, kw_only: bool) -> Any:
    """Return the `__init__` of a class, which is compiled on its first call: many classes are never used in a process."""

    def first(self: Any, *values: Any, **named: Any) -> None:
        cls.__init__ = _compiled(cls, kw_only)
        cls.__init__(self, *values, **named)

    return first


def _compiled(cls: type, kw_only: bool) -> Any:
    """Compile the `__init__` of a class."""
    arguments = ["self, *"] if kw_only else ["self"]
    lines = ["pass"]
    scope: dict[str, Any] = {"_set": object.__setattr__, "_MISSING": dataclasses.MISSING}
    for field in dataclasses.fields(cls):
        name = field.name
        argument = name
        value = name
        if field.default_factory is not dataclasses.MISSING:
            scope[f"_make_{name}"] = field.default_factory
            argument = f"{name}=_MISSING"
            value = f"_make_{name}() if {name} is _MISSING else {name}"
        elif field.default is not dataclasses.MISSING:
            scope[f"_default_{name}"] = field.default
            argument = f"{name}=_default_{name}"
        arguments.append(argument)
        lines.append(f"_set(self, {name!r}, {value})")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    body = "\n    ".join(lines)
    exec(f"def __init__({', '.join(arguments)}):\n    {body}", scope)  # noqa: S102
    return scope["__init__"]


def _equal(self: Any, other: Any) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = self._compared
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(self._compared(self))


def _repr(self: Any) -> str:
    shown = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in dataclasses.fields(self) if f.repr)
    return f"{type(self).__qualname__}({shown})"


def _refuse(self: Any, name: str, value: object = None) -> None:
    raise dataclasses.FrozenInstanceError(f"cannot change field {name!r}")


def _values(self: Any) -> list[Any]:
    return [getattr(self, f.name) for f in dataclasses.fields(self)]


def _set_state(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)


class Named(Protocol):
    """An entry of a table, or anything else that has a name."""

    @property
    def name(self) -> str: ...


Entry = TypeVar("Entry", bound=Named)


def all_names(entries: Iterable[Named]) -> list[str]:
    """Return the names of entries, in order."""
    return [entry.name for entry in entries]


def entries_by_name(entries: Iterable[Entry]) -> dict[str, Entry]:
    """Return entries by their names."""
    return {entry.name: entry for entry in entries}
