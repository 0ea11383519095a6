"""Meanings of names where an expression stands: values, functions, labels, and why some names cannot be used there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import field

from taskspec.base.records import dataclass
from taskspec.lang import syntax as s
from taskspec.lang.ir import Node
from taskspec.lang.types import Domain


@dataclass(frozen=True, slots=True)
class Value:
    """A checked expression: its core node, and its domain when it is a choice (the node is then the label's index).

    `late` is set for a name of what is known only when the task runs, even if it comes to a constant. `ends` are the bounds of
    a component as far as they are written as numbers, so that they are the same for all parameters.
    """

    node: Node
    domain: Domain | None = None
    late: bool = False
    ends: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True, slots=True)
class Lazy:
    """A name whose value is worked out on first use (definitions, next values, noise).

    `domain` is that of a component's next value, which is known before.
    """

    resolve: Callable[[s.Name], Value]
    domain: Domain | None = None


@dataclass(frozen=True, slots=True)
class FunctionDef:
    """A definition with arguments: its body is checked at every call, in the scope where it was written."""

    name: str
    arguments: tuple[str, ...]
    body: s.Expr
    scope: Scope
    enter: Callable[[s.Call], Callable[[], None]] = field(compare=False)

    @property
    def signature(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"

    def accepts(self, count: int) -> bool:
        return count == len(self.arguments)


@dataclass(frozen=True, slots=True)
class Unavailable:
    """A name that exists but not here: the message says why."""

    code: str
    message: str
    hint: str | None = None


Binding = Value | Lazy | FunctionDef | Unavailable


class Scope:
    """Names visible in one section, and the domains that labels are looked up in.

    `used` collects every name that was looked up, through all scopes that share it.
    """

    def __init__(
        self,
        bindings: dict[str, Binding],
        domains: Iterable[Domain] = (),
        parent: Scope | None = None,
        draws: str | None = None,
    ) -> None:
        """`draws` is None where random draws are allowed, else a sentence that says why they are not."""
        self.bindings = bindings
        self.domains: tuple[Domain, ...] = tuple(domains) or (parent.domains if parent else ())
        self.parent = parent
        self.draws: str | None = draws if parent is None else parent.draws
        self.used: set[str] = parent.used if parent else set()

    def child(self, bindings: dict[str, Binding]) -> Scope:
        """Return a scope that also sees the given names (arguments, variables of a comprehension)."""
        return Scope(bindings, parent=self)

    def lookup(self, written: str) -> Binding | None:
        scope: Scope | None = self
        while scope is not None:
            if written in scope.bindings:
                self.used.add(written)
                return scope.bindings[written]
            scope = scope.parent
        return None

    def names(self) -> Iterator[str]:
        """Yield every name that could have been meant, labels included."""
        scope: Scope | None = self
        while scope is not None:
            yield from scope.bindings
            scope = scope.parent
        for domain in self.domains:
            yield from domain.labels

    def is_label(self, word: str) -> bool:
        """Return whether some choice has this label, one among the parameters included."""
        bound: list[Domain] = []
        scope: Scope | None = self
        while scope is not None:
            bound += [b.domain for b in scope.bindings.values() if isinstance(b, Value) and b.domain is not None]
            scope = scope.parent
        return any(word in domain.labels for domain in (*self.domains, *bound))

    def labelled(self, label: str) -> list[Domain]:
        """Return the distinct domains that have this label."""
        return list(dict.fromkeys(d for d in self.domains if label in d.labels))
