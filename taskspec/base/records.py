"""Data classes like those of `dataclasses`, made in a fifth of the time; entries of tables by their names."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from functools import cache
from operator import attrgetter
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(**options):
        """Make a data class, as `dataclasses.dataclass` does, for modules that the first `gym.make` imports.

        `dataclasses` compiles six methods for each class, and the ninety classes on that path took a third of its time.
        Here classes share the code of their methods.
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
    """Return the `__init__` of a class, which is made on its first call: many classes are never used in a process."""

    def first(self: Any, *values: Any, **named: Any) -> None:
        cls.__init__ = _named_initializer(cls, kw_only)
        cls.__init__(self, *values, **named)

    return first


def _named_initializer(cls: type, kw_only: bool) -> Any:
    """Return the `__init__` of a class: the code that classes with equally many fields share, with its own names and defaults."""
    fields = dataclasses.fields(cls)
    made = tuple(i for i, field in enumerate(fields) if field.default_factory is not dataclasses.MISSING)
    code = _initializer_code(len(fields), made, kw_only, hasattr(cls, "__post_init__"))
    names = {f"_{i}": field.name for i, field in enumerate(fields)}
    variables = tuple(names.get(name, name) for name in code.co_varnames)
    constants = tuple(names.get(value, value) for value in code.co_consts)
    scope: dict[str, Any] = {"_set": object.__setattr__, "_MISSING": dataclasses.MISSING}
    defaults: dict[str, Any] = {}
    for i, field in enumerate(fields):
        if i in made:
            scope[f"_make{i}"] = field.default_factory
        if i in made or field.default is not dataclasses.MISSING:
            defaults[field.name] = field.default
    init = FunctionType(code.replace(co_varnames=variables, co_consts=constants), scope)
    if kw_only:
        init.__kwdefaults__ = defaults
    else:
        init.__defaults__ = tuple(defaults.values())
    return init


@cache
def _initializer_code(count: int, made: tuple[int, ...], kw_only: bool, continues: bool) -> CodeType:
    """Compile the `__init__` of classes with so many fields, which are called `_0`, `_1` and so on here.

    Args:
        made: the fields whose defaults are made for each object.
        kw_only: whether all fields are given by keyword.
        continues: whether `__post_init__` is called.
    """
    arguments = ["self, *"] if kw_only else ["self"]
    lines = ["pass"]
    for i in range(count):
        value = f"_{i}"
        if i in made:
            value = f"_make{i}() if _{i} is _MISSING else _{i}"
        arguments.append(f"_{i}")
        lines.append(f"_set(self, '_{i}', {value})")
    if continues:
        lines.append("self.__post_init__()")
    body = "\n    ".join(lines)
    scope: dict[str, Any] = {}
    exec(f"def __init__({', '.join(arguments)}):\n    {body}", scope)  # noqa: S102
    code: CodeType = scope["__init__"].__code__
    return code


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
