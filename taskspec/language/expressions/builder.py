"""Make core nodes: interning, promotion of kinds, constant folding, and a few identities."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from fractions import Fraction
from itertools import chain
from typing import Any, TypeVar, cast

from taskspec.base.limits import Limits, count, how_to_raise, limits
from taskspec.language.expressions import interval
from taskspec.language.expressions.evaluate import Flat, apply_flat
from taskspec.language.expressions.ir import Apply, Const, Draw, Node, Read, are_constant, exact, plain, rewrite, walk
from taskspec.language.expressions.operators import OPERATORS, STRUCTURES, Elements, Operator, entry_of
from taskspec.language.expressions.types import (
    BOOL,
    INF,
    INT,
    INT_MAX,
    REAL,
    Expression,
    Interval,
    Kind,
    NoElement,
    Range,
    Refused,
    Role,
    Shape,
    Type,
    join,
)


def _has_float(flats: Iterable[Flat]) -> bool:
    return any(isinstance(v, float) for v in chain.from_iterable(flats))


def folded(name: str, args: Sequence[Node], static: tuple[int, ...], result: Type) -> Flat:
    """Compute an operation on constants. Fractions that are compared with floats are floats: 0.1 is 1 / 10."""
    constants = [a for a in args if isinstance(a, Const)]
    flats = [c.flat for c in constants]
    reals = []
    for c in constants:
        if c.type.kind is Kind.REAL:
            reals.append(c.flat)
    if result.kind is not Kind.REAL and _has_float(reals):
        flats = [tuple(map(plain, flat)) for flat in flats]
    return apply_flat(name, flats, tuple(c.type for c in constants), static, result)


def fold_rational(op: Operator, args: Sequence[Node], result: Type) -> Flat | None:
    """Arithmetic on whole numbers and fractions, which stay exact until they meet a float; None for other operations."""
    if not op.rational or result.kind is not Kind.REAL or not are_constant(args):
        return None
    flats = [a.flat for a in args if isinstance(a, Const)]
    if _has_float(flats) or (op.name == "div" and not all(flats[1])):
        return None
    fractions = [tuple(map(Fraction, flat)) for flat in flats]
    values = apply_flat(op.name, fractions, tuple(a.type for a in args), (), result)
    if any(max(v.numerator.bit_length(), v.denominator.bit_length()) > Limits.bits for v in values):
        return None
    return values


def power(base: Const, exponent: Const) -> tuple[Any, Type] | None:
    """Return `base ** exponent` of single numbers where it is exact; None where it is for the run time's reals.

    Raises:
        Refused: (E314) for one too large to write out.
    """
    b = base.value
    e = exponent.value
    if exponent.type.kind is Kind.REAL or (base.type.kind is Kind.REAL and not isinstance(b, Fraction)):
        return None
    if b == 0 and e < 0:
        return float("inf"), REAL
    if max(abs(Fraction(b).numerator), Fraction(b).denominator).bit_length() * abs(e) > Limits.bits * 4:
        raise Refused("this power is too large to write out", "E314")
    value = Fraction(b) ** int(e)
    integral = base.type.kind is not Kind.REAL and e >= 0
    if integral:
        return (int(value), INT)
    return (value, REAL)


# Folding uses the references of the operator table, so a constant means what it means at run time. Cost is bounded
# here: sizes of vectors, bits of integers and the number of nodes.

N = TypeVar("N", bound=Node)


def _key(node: Node) -> tuple[Any, ...]:
    match node:
        case Const(type=type) if type.kind is Kind.REAL:
            return (Const, type, *map(repr, node.flat))
        case Const(value=value, type=type):
            return (Const, type, value)
        case Read(role, name, type, low, high):
            return (Read, role, name, type, low, high)
        case Draw(base=base, args=args, site=site):
            return (Draw, base, site, *map(id, args))
        case Apply(op, args, type, static):
            return (op, static, type, *map(id, args))


class Builder:
    """Interning factory of nodes: one for each build of a task, and one for each change of it (`Task.new_builder`)."""

    def __init__(self) -> None:
        self._nodes: dict[Any, Node] = {}
        self._ranges: dict[int, Range] = {}
        self._certain: dict[int, Range] = {}
        self._folded: dict[Any, Const] = {}  # by operator, static values and ids of constants, which `_nodes` keeps
        self._ints: dict[int, Const] = {}
        self._most = limits().operations
        self._sites = 0
        self._written: list[dict[int, Draw]] = []

    @classmethod
    def of(cls, roots: Iterable[Expression]) -> Builder:
        """Make a builder that knows the nodes below some roots: equal nodes are shared, new draws come later.

        The limit on operations of a build does not hold for what is made from a task.
        """
        made = cls()
        made._most = sys.maxsize
        for node in walk(roots):
            made._nodes.setdefault(_key(node), node)
            if isinstance(node, Draw):
                made._sites = max(made._sites, node.site)
        return made

    # -- leaves ---------------------------------------------------------------------------------------------------

    def const(self, value: Any, type: Type) -> Const:
        """Make a constant; `value` is a scalar, or a flat row-major sequence for a vector."""
        flat = value
        if type.is_scalar:
            flat = (value,)
        self.check_size(type.shape)
        # A set may have a hundred thousand elements, and they are ints: a task's tables are built here.
        if type.kind is Kind.INT:
            items = tuple(map(int, flat))
        else:
            items = tuple(exact(v, type.kind) for v in flat)
        if type.kind is Kind.INT and items and max(max(items), -min(items)).bit_length() > Limits.bits:
            raise Refused(f"this integer has more than {Limits.bits} bits", "E314")
        return self._intern(Const(items[0] if type.is_scalar else items, type))

    def constant(self, flat: Sequence[Any], type: Type) -> Const:
        """Make a constant from its elements, a single one for a scalar."""
        return self.const(flat[0] if type.is_scalar else flat, type)

    def scalar(self, value: Any) -> Const:
        """Make a constant of a Python number, of its own kind."""
        if isinstance(value, int) and not isinstance(value, bool):
            if value not in self._ints:
                self._ints[value] = self.const(value, INT)
            return self._ints[value]
        return self.const(value, BOOL if isinstance(value, bool) else REAL)

    def read(self, role: Role, name: str, type: Type, low: float = -INF, high: float = INF) -> Node:
        """Make a read of the present value of something; without elements there is nothing to read."""
        if not type.size:
            return self.const((), type)
        return self._intern(Read(role, name, type, low, high))

    def draw(self, base: str, args: Sequence[Node], type: Type) -> Node:
        """Make a new draw, never shared with another."""
        self.check_size(type.shape)
        if not type.size:
            return self.const((), type)  # which takes no words
        self._sites += 1
        # Kept, as all nodes are: what is known of a node is filed under its id, which must not be given to another.
        made = self._intern(Draw(base, tuple(args), type, self._sites))
        self.name_draws([made])
        return made

    @contextmanager
    def written(self, apart: bool = False) -> Iterator[dict[int, Draw]]:
        """Collect the draws that are written or named inside, by site, whether or not their values turn out to matter.

        They count in enclosing blocks as well, unless they stand `apart`.
        """
        draws: dict[int, Draw] = {}
        self._written.append(draws)
        try:
            yield draws
        finally:
            self._written.pop()
            if not apart:
                self.name_draws(draws.values())

    def name_draws(self, draws: Iterable[Draw]) -> None:
        """Count draws as written here: new ones, and draws of a noise that is named."""
        if self._written:
            self._written[-1].update((d.site, d) for d in draws)

    # -- operators ------------------------------------------------------------------------------------------------

    def apply(self, name: str, *args: Node) -> Node:
        """Apply an operator of the table to arguments of any kind that promotes."""
        key = (name, (), *map(id, args))
        if key in self._folded:
            return self._folded[key]
        return self._kept(key, args, self._applied(name, *args))

    def _applied(self, name: str, *args: Node) -> Node:
        op = OPERATORS[name]
        if op.rounds and args[0].type.kind is not Kind.REAL:
            return self.cast(args[0], Kind.INT)
        result = op.rule(tuple(a.type for a in args))
        if isinstance(result, str):
            raise Refused(result, "E307" if "shape" in result else "E306")
        self.check_size(result.shape)
        if not result.size:
            return self.const((), result)
        rational = fold_rational(op, args, result)
        if rational is not None:
            return self.constant(rational, result)
        kinds = op.promote([a.type.kind for a in args], result.kind)
        args = tuple(map(self._operand, args, kinds))
        if are_constant(args):
            return self.constant(folded(name, args, (), result), result)
        return self._identity(name, args, result) or self._intern(Apply(name, args, result))

    def structure(self, name: str, args: Sequence[Node], static: tuple[int, ...] = ()) -> Node:
        """Apply an operator that only moves elements; elements of mixed kinds are promoted."""
        key = (name, static, *map(id, args))
        if key in self._folded:
            return self._folded[key]
        return self._kept(key, args, self._arranged(name, args, static))

    def _arranged(self, name: str, args: Sequence[Node], static: tuple[int, ...]) -> Node:
        if not args:  # the kind that all others are promoted from
            return self.const((), Type(Kind.BOOL, (0,)))
        if name in ("vector", "concat"):
            kind = join(*(a.type.kind for a in args))
            args = [self._operand(a, kind) for a in args]
        result = STRUCTURES[name].rule(tuple(a.type for a in args), static)
        self.check_size(result.shape)
        if not result.size:
            return self.const((), result)
        if are_constant(args):
            return self.constant(folded(name, args, static, result), result)
        return self._rearranged(name, args, static) or self._intern(Apply(name, tuple(args), result, static))

    def cast(self, node: Node, kind: Kind) -> Node:
        """Promote a node to a kind; never demote it."""
        if node.type.kind >= kind:
            return node
        if isinstance(node, Const):
            return self.constant(node.flat, Type(kind, node.type.shape))
        return self._intern(Apply(f"to_{kind}", (node,), Type(kind, node.type.shape)))

    def _operand(self, node: Node, kind: Kind) -> Node:
        """Promote an operand: a whole number among reals stays exact, as a fraction does."""
        if isinstance(node, Const) and kind is Kind.REAL > node.type.kind:
            return self.constant(tuple(map(Fraction, node.flat)), Type(kind, node.type.shape))
        return self.cast(node, kind)

    def held(self, node: Node) -> Node:
        """Convert a node to the value that a component holds: fractions in it become floats."""
        replacements: dict[int, Node] = {}
        for part in walk([node]):
            if isinstance(part, Const) and part.type.kind is Kind.REAL:
                replacements[id(part)] = self.constant(part.numbers, part.type)
            elif not (isinstance(part, Apply) and entry_of(part.op).elements is Elements.MOVED):
                replacements[id(part)] = part
        return rewrite([node], replacements, self.remake)[0]

    def stretch(self, node: Node, shape: Shape) -> Node:
        """Fill a scalar to a shape; leave anything else as it is."""
        if node.type.shape == shape or not node.type.is_scalar:
            return node
        return self.structure("fill", [node], shape)

    def within(self, node: Node, low: float, high: float) -> Node:
        """Clamp an int to low, ..., high, if it might be none of them; refused where there are none."""
        if low > high and node.type.size:
            raise NoElement
        least, most = self.certain(node)
        if least < low:
            node = self.apply("max2", node, self.scalar(int(low)))
        if most > high:
            return self.apply("min2", node, self.scalar(int(high)))
        return node

    def position(self, index: Node, length: int) -> Node:
        """Bring an index (int) into range(length): a negative constant counts from the end."""
        if isinstance(index, Const):
            index = self.constant([i + length * (i < 0) for i in index.flat], index.type)
        return self.within(index, 0, length - 1)

    def power(self, base: Node, exponent: Node) -> Node:
        """Return `base ** exponent`: exact for ints with a constant exponent >= 0, products for small ones, else C's pow."""
        if isinstance(base, Const) and isinstance(exponent, Const) and base.type.is_scalar and exponent.type.is_scalar:
            folded = power(base, exponent)
            if folded is not None:
                return self.const(*folded)
        if not isinstance(exponent, Const) or exponent.type != INT or abs(exponent.value) > 16:
            return self.apply("pow", base, exponent)
        product = self._repeated(base, abs(exponent.value))
        if exponent.value >= 0:
            return product
        return self.apply("div", self.scalar(1), product)

    def bounds(self, node: Node) -> Interval:
        """Interval that holds every element of the node's value, in float64."""
        return interval.bounds(node, self._ranges)

    def finite(self, node: Node) -> bool:
        return interval.ranges(node, self._ranges).finite

    def certain(self, node: Node) -> Interval:
        """Interval that holds on every backend, however reals are rounded: index clamps outside of it may be dropped."""
        return interval.certain(node, self._certain)

    def remake(self, node: Node, args: tuple[Node, ...]) -> Node:
        """Rebuild a node over other arguments (`ir.rewrite`)."""
        match node:
            case Apply(op=op, static=static):
                if op in OPERATORS:
                    return self.apply(op, *args)
                return self.structure(op, args, static)
            case Draw(base=base, type=type, site=site):
                return self._intern(Draw(base, args, type, site))
            case _:
                return node

    def substitute(
        self, roots: Iterable[Expression], values: Mapping[tuple[Role, str], Expression], late: bool = True
    ) -> tuple[Node, ...]:
        """Replace reads by values, by role and name.

        The values are `late` where they are only known at run time, as values of a step are (`remake_late`).
        """
        roots = tuple(roots)
        replacements: dict[int, Node] = {}
        for node in walk(roots):
            if isinstance(node, Read) and (node.role, node.name) in values:
                replacements[id(node)] = cast("Node", values[node.role, node.name])
        return rewrite(roots, replacements, self.remake_late if late else self.remake)

    def remake_late(self, node: Node, args: tuple[Node, ...]) -> Node:
        """Remake a node where values replace what is only known at run time: fractions beside these stay floats, as in a step."""
        if isinstance(node, Apply) and not are_constant(node.args):
            held = []
            for a in args:
                if isinstance(a, Const):
                    held.append(self.held(a))
                else:
                    held.append(a)
            args = tuple(held)
        return self.remake(node, args)

    # -- how ------------------------------------------------------------------------------------------------------

    def _kept(self, key: Any, args: Sequence[Node], result: Node) -> Node:
        """Remember the result of an operation on constants: comprehensions ask for the same over and over."""
        if isinstance(result, Const) and are_constant(args):
            self._folded[key] = result
        return result

    def _intern(self, node: N) -> N:
        key = _key(node)
        known = self._nodes.get(key)
        if known is None:
            if len(self._nodes) >= self._most:
                message = f"the task expands to more than {self._most:,} operations"
                raise Refused(message, "E314", how_to_raise("operations", 2 * self._most))
            self._nodes[key] = known = node
        return cast("N", known)

    def check_size(self, shape: Shape) -> None:
        """Refuse (E314) a vector too large to hold, before it is made."""
        size = Type(Kind.INT, shape).size
        most = limits().elements
        if size > most:
            message = f"a vector of {count(size)} elements is too large; the limit is {most:,}"
            raise Refused(message, "E314", how_to_raise("elements", size))

    def _repeated(self, base: Node, count: int) -> Node:
        if count == 0:
            one = self.const(1, Type(join(Kind.INT, base.type.kind)))
            return self.stretch(one, base.type.shape)
        if count == 1:
            return self.cast(base, Kind.INT)
        half = self._repeated(base, count // 2)
        square = self.apply("mul", half, half)
        if count % 2:
            return self.apply("mul", square, base)
        return square

    def _identity(self, name: str, args: tuple[Node, ...], type: Type) -> Node | None:  # noqa: C901, PLR0912
        match name, args:
            case "where", (Const(value=bool(c)), a, b):
                return self.stretch(a if c else b, type.shape)
            case "where", (_, a, b) if a is b and a.type == type:
                return a
            case ("add", (a, Const(value=0))) | ("add", (Const(value=0), a)) | ("sub", (a, Const(value=0))):
                if a.type == type and type.kind is not Kind.REAL:  # -0.0 + 0.0 is 0.0
                    return a
            case ("mul", (a, Const(value=1))) | ("mul", (Const(value=1), a)) | ("div", (a, Const(value=1))):
                if a.type == type:
                    return a
            case ("and", (Const(value=True), a)) | ("and", (a, Const(value=True))):
                if a.type == type:
                    return a
            case ("or", (Const(value=False), a)) | ("or", (a, Const(value=False))):
                if a.type == type:
                    return a
            case ("and", (Const(value=False), _)) | ("and", (_, Const(value=False))) if type == BOOL:
                return self.scalar(False)
            case ("or", (Const(value=True), _)) | ("or", (_, Const(value=True))) if type == BOOL:
                return self.scalar(True)
            case _, (Apply(op="to_real", args=(inner,)),) if OPERATORS[name].rounds:
                low, high = self.certain(inner)
                if low >= -INT_MAX and high <= INT_MAX:  # rounding moves other reals to the nearest such int
                    return self.cast(inner, Kind.INT)
            case "lt" | "le", _ if all(a.type.kind is not Kind.REAL for a in args) and type == BOOL:
                return self._decided(name == "lt", *args)
        return None

    def _decided(self, strict: bool, a: Node, b: Node) -> Node | None:
        """Decide `a < b`, or `a <= b`, where the bounds of both settle it."""
        a_low, a_high = self.certain(a)
        b_low, b_high = self.certain(b)
        if a_high < b_low or (a_high == b_low and not strict):
            return self.scalar(True)
        if a_low > b_high or (a_low == b_high and strict):
            return self.scalar(False)
        return None

    def _rearranged(self, name: str, args: Sequence[Node], static: tuple[int, ...]) -> Node | None:
        first = args[0]
        match name, first:
            case "element", Apply(op="vector"):
                return first.args[static[0]]
            case "element", Apply(op="fill") if len(first.type.shape) == 1:
                return first.args[0]
            case "slice", _ if static == (0, first.type.shape[0], 1):
                return first
            case "reshape", _ if static == first.type.shape:
                return first
            case "concat", _ if len(filled := [a for a in args if a.type.size]) < len(args):
                return self.structure("concat", filled)
            case "concat", _ if len(args) == 1:
                return first
            case "index", _ if isinstance(args[1], Const) and args[1].type.is_scalar:
                return self.structure("element", [first], (args[1].value,))
            case _:
                return None
