"""Rewrite a task in terms of its abstraction: every expression over the mapped state alone, where that can be shown.

Two kinds of maps are supported. Integer components of the state that a map combines linearly (`d: g - p`) are replaced by
the mapped ones; the others have to cancel. A vector of reals whose ranks are mapped (`s: argsort(argsort(s))`) is replaced
by the ranks; every expression has to depend on the order of its elements alone, and no two elements are equal: they are
drawn independently from a continuous distribution, and only ever rearranged.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping, Sequence

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, children, draw_sites, reads, walk
from taskspec.language.expressions.operators import Elements, entry_of
from taskspec.language.expressions.types import Expression, Kind, Role, Type
from taskspec.language.task.parts import Component, by_name
from taskspec.language.task.task import Task

_MARK = "mapped "
"""Prefix of the names of mapped components while those of the task itself are still there."""


class Unfactored(Exception):
    """The task could not be rewritten: a few words that say why."""


def factored(task: Task, stand_in: Task, mapped: Sequence[Expression]) -> Task:
    """Return the stand-in of a task with the task's equations over the mapped state alone.

    An expert that depends on more is left out.

    Args:
        mapped: each component of the stand-in's state, as an expression over the state of the task.
    """
    return _Factoring(task, stand_in, mapped).result()


class _Factoring:
    def __init__(self, task: Task, stand_in: Task, mapped: Sequence[Expression]) -> None:
        self.task = task
        self.stand_in = stand_in
        self.builder = task.new_builder(mapped)
        self.mapped = self.builder.substitute(mapped, {})
        self.normal = LinearForms(self.builder)
        self.ranked: dict[str, Component] = {}
        self.replaced: dict[str, Node] = {}

    def result(self) -> Task:
        task = self.task
        for c, node in zip(self.stand_in.state, self.mapped, strict=True):
            self._replace_component(c, node)
        following = by_name(task.state, task.process.next)
        for name in self.ranked:
            if dependence([following[name]], name) != [Dependence.REARRANGEMENT]:
                raise Unfactored(f"the next {name} does more than rearrange its elements")
        mapped = [self._over(node, following) for node in self.mapped]
        *moved, reward, terminal = self._final([*mapped, task.process.reward, task.process.terminal])
        initial = tuple(self._initial())
        expert = None
        if isinstance(task.annotations.expert, tuple):
            try:
                expert = self._final(task.annotations.expert)
            except Unfactored:
                expert = None
        rebuilt = self.stand_in.with_process(
            initial=initial, raw_initial=initial, next=tuple(moved), raw_next=tuple(moved), reward=reward,
            terminal=terminal,
        )  # fmt: skip
        return rebuilt.with_annotations(expert=expert)

    def _replace_component(self, c: Component, node: Node) -> None:
        own = self.builder.read(Role.STATE, _MARK + c.name, c.type, c.least, c.most)
        match node:
            case Apply(op="argsort", args=(Apply(op="argsort", args=(Read(role=Role.STATE, name=name) as vector,)),)):
                if vector.type.kind is not Kind.REAL or name in self.replaced:
                    raise Unfactored(f"'{name}' is ranked, and is not a vector of reals")
                self.ranked[name] = c
                self._substitute(name, self.builder.cast(own, Kind.REAL))
            case _:
                self._solve_linear(c, node, own)

    def _solve_linear(self, c: Component, node: Node, own: Node) -> None:
        if isinstance(node, Read) and node.type == own.type and node.name not in self.replaced:
            return self._substitute(node.name, own)
        if node.type.kind is not Kind.INT:
            raise Unfactored(f"'{c.name}' is mapped to a value that is not a whole number")
        b = self.builder
        (form,) = self.normal.form([self._over(node, self.replaced)])
        for term, factor in self.normal.terms(form)[0].values():
            match term:
                case Read(role=Role.STATE, name=name) if abs(factor) == 1 and not name.startswith(_MARK):
                    signed = b.scalar(factor)
                    rest = b.apply("sub", form, b.apply("mul", signed, term))
                    return self._substitute(name, b.apply("mul", signed, b.apply("sub", own, rest)))
        raise Unfactored(f"the map of '{c.name}' is neither linear in whole numbers nor the ranks of a vector")

    def _substitute(self, name: str, node: Node) -> None:
        (form,) = self.normal.form([node])
        self.replaced = {k: self._over(v, {name: form}) for k, v in self.replaced.items()} | {name: form}

    def _over(self, node: Node, values: Mapping[str, Node]) -> Node:
        replaced = {(Role.STATE, name): value for name, value in values.items()}
        return self.builder.substitute([node], replaced, late=False)[0]

    def _final(self, nodes: Sequence[Node]) -> tuple[Node, ...]:
        for name in self.ranked:
            if any(how is not Dependence.INVARIANT for how in dependence(nodes, name)):
                raise Unfactored(f"something depends on more of '{name}' than the order of its elements")
        forms = self.normal.form([self._over(node, self.replaced) for node in nodes])
        own = {_MARK + c.name: c for c in self.stand_in.state}
        left = {name for role, name in reads(forms) if role is Role.STATE and name not in own}
        if left:
            raise Unfactored(f"something depends on {', '.join(sorted(left))} besides")
        b = self.builder
        named = {k: b.read(Role.STATE, c.name, c.type, c.least, c.most) for k, c in own.items()}
        return tuple(self._over(node, named) for node in forms)

    def _initial(self) -> list[Node]:
        """Return initial values of the mapped state: uniform ranks, and the mapped initial values of the others."""
        b = self.builder
        first = by_name(self.task.state, self.task.process.initial)
        values = []
        sites: set[int] = set()
        for name in self.ranked:
            draw = _continuous(first[name])
            if draw is None or draw.site in sites:
                raise Unfactored(f"'{name}' does not start as independent draws from one continuous distribution")
            sites.add(draw.site)
        for c, node in zip(self.stand_in.state, self.mapped, strict=True):
            if c in self.ranked.values():
                values.append(b.draw("permutation", (), Type(Kind.INT, c.type.shape)))
                continue
            (start,) = self.normal.form([self._over(node, first)])
            if sites & draw_sites([start]):
                raise Unfactored(f"'{c.name}' starts from what its ranks are drawn from")
            values.append(start)
        return values


def _continuous(node: Node) -> Draw | None:
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
    return factor.type.is_scalar and 2**-12 <= abs(factor.value) <= 2**12


# -- linear normal form -----------------------------------------------------------------------------------------------

Terms = dict[int, tuple[Node, int]]
"""Terms of a sum by identity, with their integer factors."""


class LinearForms:
    """Normal forms of integer expressions of one task, in which `g - (p + m)` is `(g - p) - m`; equal forms are one node.

    Sums become one sum with its terms in a fixed order, and comparisons do not depend on the side on which a term stands. Sums
    of reals, which round, are left as they are.
    """

    def __init__(self, builder: Builder) -> None:
        self.builder = builder
        self._known: dict[int, Node] = {}
        self._order: dict[int, int] = {}

    def form(self, roots: Iterable[Node]) -> tuple[Node, ...]:
        roots = tuple(roots)
        for node in walk(roots):
            if id(node) not in self._known:
                args = tuple(self._known[id(c)] for c in children(node))
                remade = node
                if args != children(node):
                    remade = self.builder.remake(node, args)
                self._known[id(node)] = self._simplified(remade)
        return tuple(self._known[id(root)] for root in roots)

    def terms(self, node: Node) -> tuple[Terms, Node]:
        """Return an integer as a sum of terms and a constant, all of one shape."""
        b = self.builder
        shape = node.type.shape
        match node:
            case Const():
                return {}, node
            case Apply(op="add" | "sub" as op, args=(left, right)):
                mine, own = self.terms(b.stretch(left, shape))
                others, other = self.terms(b.stretch(right, shape))
                return _added(mine, others, 1 if op == "add" else -1), b.apply(op, own, other)
            case Apply(op="neg", args=(inner,)):
                mine, own = self.terms(inner)
                return _added({}, mine, -1), b.apply("neg", own)
            case Apply(op="mul", args=(Const(value=int(factor)), inner) | (inner, Const(value=int(factor)))):
                mine, own = self.terms(b.stretch(inner, shape))
                return _added({}, mine, factor), b.apply("mul", b.scalar(factor), own)
            case _:
                zero = b.stretch(b.scalar(0), shape)
                return {id(node): (node, 1)}, zero

    def _simplified(self, node: Node) -> Node:
        if not isinstance(node, Apply):
            return node
        whole = all(a.type.kind is not Kind.REAL for a in node.args)
        match node:
            case Apply(op="add" | "sub" | "neg" | "mul") if node.type.kind is Kind.INT:
                return self._sum(*self.terms(node))
            case Apply(op="eq" | "ne" | "lt" | "le" as op, args=(left, right)) if whole:
                difference = self._difference(right, left)
                return self.builder.apply(op, self._zero(difference), difference)
            case Apply(op="where" | "min2" | "max2") if node.type.kind is Kind.INT:
                return self._choice(node)
            case Apply(op=op, args=(inner, *_)) if inner.type.kind is Kind.INT:
                entry = entry_of(op)
                if entry.elements is Elements.MOVED and entry.indices == tuple(range(1, len(node.args))):
                    return self._moved(node)
        return node

    def _difference(self, left: Node, right: Node) -> Node:
        b = self.builder
        return self._sum(*self.terms(b.apply("sub", b.cast(left, Kind.INT), b.cast(right, Kind.INT))))

    def _zero(self, node: Node) -> Node:
        return self.builder.stretch(self.builder.scalar(0), node.type.shape)

    def _choice(self, node: Apply) -> Node:
        b = self.builder
        *condition, one, other = node.args
        one = b.stretch(b.cast(one, Kind.INT), node.type.shape)
        other = b.stretch(b.cast(other, Kind.INT), node.type.shape)
        terms, rest = self.terms(one)
        if not terms:
            return node
        chosen = b.apply(node.op, *condition, self._zero(node), self._difference(other, one))
        return self._sum(_added(terms, {id(chosen): (chosen, 1)}, 1), rest)

    def _moved(self, node: Apply) -> Node:
        b = self.builder
        inner, *rest = node.args
        terms, constant = self.terms(inner)
        if list(terms) == [id(inner)]:
            return node
        terms_moved: Terms = {}
        for term, factor in terms.values():
            part = b.structure(node.op, [term, *rest], node.static)
            terms_moved = _added(terms_moved, {id(part): (part, 1)}, factor)
        return self._sum(terms_moved, b.structure(node.op, [constant, *rest], node.static))

    def _sum(self, terms: Terms, constant: Node) -> Node:
        b = self.builder
        total = None
        for key in sorted(terms, key=self._place):
            node, factor = terms[key]
            if factor != 1:
                node = b.apply("mul", b.scalar(factor), node)
            if total:
                total = b.apply("add", total, node)
            else:
                total = node
        if total is None:
            return constant
        if isinstance(constant, Const) and not any(constant.flat):
            return total
        return b.apply("add", total, constant)

    def _place(self, key: int) -> int:
        return self._order.setdefault(key, len(self._order))


def _added(terms: Terms, others: Terms, factor: int) -> Terms:
    summed = dict(terms)
    for key, (node, count) in others.items():
        total = summed.get(key, (node, 0))[1] + factor * count
        if total:
            summed[key] = (node, total)
        else:
            summed.pop(key, None)
    return summed


# -- dependence on the order of elements ------------------------------------------------------------------------------


class Dependence(enum.IntEnum):
    """Dependence of an expression on a vector of reals.

    Let h be any increasing function, applied to every element. An expression is *invariant* if it has the same value for x
    and for h(x), and a *selection* if its value for h(x) is h of its value for x: elements of x, chosen by their order. A
    selection that has every element of x once is a *rearrangement*. Ranks are such an h if no two elements are equal, so
    an invariant expression depends on the ranks alone.
    """

    INVARIANT = 0
    SELECTION = 1
    REARRANGEMENT = 2


def dependence(roots: Sequence[Node], name: str) -> list[Dependence | None]:
    """Return the dependence of expressions on a state component, a vector of reals; None if it is none of the kinds."""
    known: dict[int, Dependence | None] = {}
    for node in walk(roots):
        args = [known[id(c)] for c in children(node)]
        if isinstance(node, Read) and (node.role, node.name) == (Role.STATE, name):
            known[id(node)] = Dependence.REARRANGEMENT
        elif all(a is Dependence.INVARIANT for a in args):
            known[id(node)] = Dependence.INVARIANT
        elif isinstance(node, Apply):
            known[id(node)] = _of_operator(node, [a for a in args if a is not None])
        else:
            known[id(node)] = None
    return [known[id(root)] for root in roots]


def _of_operator(node: Apply, args: list[Dependence]) -> Dependence | None:
    entry = entry_of(node.op)
    elements = [a for i, a in enumerate(args) if i not in entry.indices]
    if len(args) < len(node.args) or any(args[i] is not Dependence.INVARIANT for i in entry.indices):
        return None
    if Dependence.INVARIANT in elements:
        return None  # an element is compared with, or mixed with, something else
    if entry.elements is Elements.RANKED:
        return Dependence.INVARIANT
    if entry.elements is Elements.COMPUTED or node.type.kind is not Kind.REAL:
        return None
    if min(elements) is not Dependence.REARRANGEMENT:
        return Dependence.SELECTION
    match node:  # operators that keep every element of their arguments
        case Apply(op="sort" | "swap"):
            return Dependence.REARRANGEMENT
        case Apply(op="slice", static=(start, count, -1), args=(whole,)) if start == count - 1:
            if count == whole.type.shape[0]:
                return Dependence.REARRANGEMENT
        case Apply(op="where", args=(condition, *_)) if condition.type.is_scalar:
            return Dependence.REARRANGEMENT
    return Dependence.SELECTION
