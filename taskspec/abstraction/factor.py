"""A task rewritten in terms of its abstraction: every expression over the mapped state alone, where that can be shown.

Two ways are known. Ints of the state that a map combines linearly (`d: g - p`) are replaced by the mapped ones; what is
left of the others has to cancel. A vector of reals whose ranks are mapped (`s: argsort(argsort(s))`) is replaced by the
ranks; every expression has to depend on the order of its elements alone, and two elements are never equal: they
are drawn independently from a continuous distribution, and only ever rearranged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from taskspec.abstraction.abstraction import Abstraction
from taskspec.abstraction.linear import How, Normal, dependence
from taskspec.lang.ir import Apply, Const, Draw, Node, Read, Role, draws, reads, rewrite
from taskspec.lang.types import Kind, Type
from taskspec.task.task import Component, Task

_MARK = "mapped "
"""Put before names of mapped components while those of the task itself are still there."""


class Unfactored(Exception):
    """Why the task could not be rewritten: a few words."""


@dataclass(frozen=True)
class Factored:
    """The task over the mapped state; `expert` says whether its expert is one as well."""

    task: Task
    has_expert: bool


def factored(found: Abstraction) -> Factored:
    """The task of an abstraction over the mapped state alone.

    Raises:
        Unfactored: where that cannot be shown.
    """
    return _Factoring(found).result()


class _Factoring:
    def __init__(self, found: Abstraction) -> None:
        self.found, self.task, self.builder = found, found.task, found.task.builder
        self.normal = Normal(self.builder)
        self.ranked: dict[str, Component] = {}
        self.replaced: dict[str, Node] = {}

    def result(self) -> Factored:
        for c, node in zip(self.found.stand_in.state, self.found.nodes, strict=True):
            self._take(c, node)
        following = {c.name: node for c, node in zip(self.task.state, self.task.next, strict=True)}
        first = {c.name: node for c, node in zip(self.task.state, self.task.initial, strict=True)}
        self._check_rearranged(following)
        mapped = [self._over(node, following) for node in self.found.nodes]
        step = self._final([*mapped, self.task.reward, self.task.terminal])
        initial, moved = tuple(self._initial(first)), step[:-2]
        result = replace(self.found.stand_in, initial=initial, raw_initial=initial, next=moved, raw_next=moved,
                         reward=step[-2], terminal=step[-1], builder=self.builder, expert=None)  # fmt: skip
        expert = self._expert()
        return Factored(result if expert is None else replace(result, expert=expert), expert is not None)

    def _expert(self) -> tuple[Node, ...] | None:
        nodes = self.task.expert
        if not isinstance(nodes, tuple):
            return None
        try:
            return self._final(nodes)
        except Unfactored:
            return None

    # -- maps ---------------------------------------------------------------------------------------------------------

    def _take(self, c: Component, node: Node) -> None:
        """Take one mapped component: note what of the task's own state it stands for."""
        own = self.builder.read(Role.STATE, _MARK + c.name, c.type, c.least, c.most)
        match node:
            case Apply(op="argsort", args=(Apply(op="argsort", args=(Read(role=Role.STATE, name=name) as vector,)),)):
                if vector.type.kind is not Kind.REAL or name in self.replaced:
                    raise Unfactored(f"'{name}' is ranked, and is not a vector of reals")
                self.ranked[name] = c
                self._stand_for(name, self.builder.cast(own, Kind.REAL))
            case _:
                self._solve(c, node, own)

    def _solve(self, c: Component, node: Node, own: Node) -> None:
        """Solve a linear map for a component that nothing stands for yet."""
        if isinstance(node, Read) and node.type == own.type and node.name not in self.replaced:
            return self._stand_for(node.name, own)
        if node.type.kind is not Kind.INT:
            raise Unfactored(f"'{c.name}' is mapped to a value that is not a whole number")
        b, (form,) = self.builder, self.normal.form([self._over(node, self.replaced)])
        for term, factor in self.normal.terms(form)[0].values():
            match term:
                case Read(role=Role.STATE, name=name) if abs(factor) == 1 and not name.startswith(_MARK):
                    signed = b.scalar(factor)
                    rest = b.apply("sub", form, b.apply("mul", signed, term))
                    return self._stand_for(name, b.apply("mul", signed, b.apply("sub", own, rest)))
        raise Unfactored(f"the map of '{c.name}' is neither linear in whole numbers nor the ranks of a vector")

    def _stand_for(self, name: str, node: Node) -> None:
        """Let an expression stand for a component, here and in what stands for others."""
        (form,) = self.normal.form([node])
        self.replaced = {k: self._over(v, {name: form}) for k, v in self.replaced.items()} | {name: form}

    # -- expressions --------------------------------------------------------------------------------------------------

    def _over(self, node: Node, values: Mapping[str, Node]) -> Node:
        """An expression with state components replaced."""

        def leaf(each: Node) -> Node | None:
            if isinstance(each, Read) and each.role is Role.STATE:
                return values.get(each.name)
            return None

        return rewrite([node], leaf, self.builder.remake)[0]

    def _final(self, nodes: Sequence[Node]) -> tuple[Node, ...]:
        """Expressions over the mapped state, under the names of the stand-in.

        Raises:
            Unfactored: where one still depends on something else of the state.
        """
        for name in self.ranked:
            if any(how is not How.INVARIANT for how in dependence(nodes, name)):
                raise Unfactored(f"something depends on more of '{name}' than the order of its elements")
        found = self.normal.form([self._over(node, self.replaced) for node in nodes])
        own = {_MARK + c.name: c for c in self.found.stand_in.state}
        left = {name for role, name in reads(found) if role is Role.STATE and name not in own}
        if left:
            raise Unfactored(f"something depends on {', '.join(sorted(left))} besides")
        b = self.builder
        named = {k: b.read(Role.STATE, c.name, c.type, c.least, c.most) for k, c in own.items()}
        return tuple(self._over(node, named) for node in found)

    # -- ranks --------------------------------------------------------------------------------------------------------

    def _check_rearranged(self, following: Mapping[str, Node]) -> None:
        for name in self.ranked:
            (how,) = dependence([following[name]], name)
            if how is not How.REARRANGEMENT:
                raise Unfactored(f"the next {name} does more than rearrange its elements")

    def _initial(self, first: Mapping[str, Node]) -> list[Node]:
        """Initial values of the mapped state: uniform ranks, and what is left of the maps."""
        b, found = self.builder, []
        sites: set[int] = set()
        for name in self.ranked:
            draw = _continuous(first[name])
            if draw is None or draw.site in sites:
                raise Unfactored(f"'{name}' does not start as independent draws from one continuous distribution")
            sites.add(draw.site)
        for c, node in zip(self.found.stand_in.state, self.found.nodes, strict=True):
            if c in self.ranked.values():
                found.append(b.draw("permutation", (), Type(Kind.INT, c.type.shape)))
                continue
            (start,) = self.normal.form([self._over(node, first)])
            if sites & {d.site for d in draws([start])}:
                raise Unfactored(f"'{c.name}' starts from what its ranks are drawn from")
            found.append(start)
        return found


def _continuous(node: Node) -> Draw | None:
    """The draw behind a vector of independent numbers of one continuous distribution, which no two are equal of."""
    match node:
        case Draw(args=(), type=type) if type.kind is Kind.REAL and len(type.shape) == 1:
            return node  # elements of draws without arguments are independent
        case Apply(op="add" | "mul", args=(Const() as factor, inner)) if _is_moderate(factor):
            return _continuous(inner)
        case Apply(op="add" | "sub" | "mul" | "div", args=(inner, Const() as factor)) if _is_moderate(factor):
            return _continuous(inner)
        case _:
            return None


def _is_moderate(factor: Const) -> bool:
    """Whether sums and products with a number keep numbers of 24 bits apart."""
    return factor.type.is_scalar and 2**-12 <= abs(factor.value) <= 2**12
