"""Where draws take their values from: a script of outcomes, a count of words, or the words of a seed.

Every draw of an expression has a key: the expression it stands in, and its number there. A draw asks for the words of
its key; what these are is settled beforehand by `Census`, which walks a whole phase in the order of the contract.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Protocol

from tests.verification.oracle.reference import random
from tests.verification.oracle.reference.values import Number, Wrong

Key = tuple[str, int]


class Chance(Protocol):
    """How each kind of draw gets its value. `fixed`: probabilities are known before the task runs."""

    def index(self, key: Key, sizes: Sequence[int]) -> list[int]: ...

    def category(self, key: Key, shares: Sequence[Number], count: int, *, fixed: bool) -> list[int]: ...

    def flags(self, key: Key, shares: Sequence[Number], *, fixed: bool) -> list[bool]: ...

    def permutation(self, key: Key, n: int, count: int) -> list[int]: ...

    def uniform(self, key: Key, count: int) -> list[float]: ...

    def exponential(self, key: Key, count: int) -> list[float]: ...

    def normal(self, key: Key, count: int) -> list[float]: ...

    def poisson(self, key: Key, rates: Sequence[Number], *, fixed: bool) -> list[int]: ...

    def dirichlet(self, key: Key, alphas: Sequence[Number]) -> list[float]: ...

    def gamma(self, key: Key, alphas: Sequence[Number]) -> list[float]: ...


@dataclass
class Census:
    """Deals out the words of a phase: counts what each draw takes, in the order of the walk. Values mean nothing."""

    widths: dict[Key, int] = field(default_factory=dict)

    def take(self, key: Key, words: int) -> None:
        self.widths[key] = words

    def dealt(self, order: Sequence[Key] | None = None) -> dict[Key, int]:
        """The first word of each draw, in the order of the walk or in another."""
        first = {}
        count = 0
        for key in self.widths if order is None else order:
            first[key] = count
            count += self.widths[key]
        return first

    def index(self, key: Key, sizes: Sequence[int]) -> list[int]:
        self.take(key, len(sizes))
        return [0] * len(sizes)

    def category(self, key: Key, shares: Sequence[Number], count: int, *, fixed: bool) -> list[int]:
        self.take(key, count)
        return [0] * count

    def flags(self, key: Key, shares: Sequence[Number], *, fixed: bool) -> list[bool]:
        self.take(key, len(shares))
        return [False] * len(shares)

    def permutation(self, key: Key, n: int, count: int) -> list[int]:
        self.take(key, n * count)
        return list(range(n)) * count

    def uniform(self, key: Key, count: int) -> list[float]:
        self.take(key, count)
        return [0.0] * count

    def exponential(self, key: Key, count: int) -> list[float]:
        return self.uniform(key, count)

    def normal(self, key: Key, count: int) -> list[float]:
        self.take(key, count + count % 2)
        return [0.0] * count

    def poisson(self, key: Key, rates: Sequence[Number], *, fixed: bool) -> list[int]:
        self.take(key, len(rates))
        return [0] * len(rates)

    def dirichlet(self, key: Key, alphas: Sequence[Number]) -> list[float]:
        self.take(key, random.GAMMA_WORDS * len(alphas))
        return [1.0] * len(alphas)

    def gamma(self, key: Key, alphas: Sequence[Number]) -> list[float]:
        return self.dirichlet(key, alphas)


@dataclass(frozen=True)
class Seeded:
    """Draws from the words of a seed, as the contract on seeds has it."""

    words: Callable[[int, int], Sequence[int]]
    """`words(first, count)` of this phase."""
    first: dict[Key, int]

    def of(self, key: Key, count: int) -> Sequence[int]:
        return self.words(self.first[key], count)

    def index(self, key: Key, sizes: Sequence[int]) -> list[int]:
        return [w * max(n, 1) >> 32 for w, n in zip(self.of(key, len(sizes)), sizes, strict=True)]

    def category(self, key: Key, shares: Sequence[Number], count: int, *, fixed: bool) -> list[int]:
        pick = random.exact_category if fixed else random.weighted_category
        return [pick(w, shares) for w in self.of(key, count)]

    def flags(self, key: Key, shares: Sequence[Number], *, fixed: bool) -> list[bool]:
        hold = random.exact_flag if fixed else random.weighted_flag
        return [hold(w, p) for w, p in zip(self.of(key, len(shares)), shares, strict=True)]

    def permutation(self, key: Key, n: int, count: int) -> list[int]:
        words = self.of(key, n * count)
        rows = (words[i * n : (i + 1) * n] for i in range(count))
        return [i for row in rows for i in sorted(range(n), key=row.__getitem__)]

    def uniform(self, key: Key, count: int) -> list[float]:
        return [(w >> 8) * 2.0**-24 for w in self.of(key, count)]

    def exponential(self, key: Key, count: int) -> list[float]:
        return random.exponential(self.of(key, count))

    def normal(self, key: Key, count: int) -> list[float]:
        return random.normal(self.of(key, count + count % 2))[:count]

    def poisson(self, key: Key, rates: Sequence[Number], *, fixed: bool) -> list[int]:
        count = random.exact_poisson if fixed else random.weighted_poisson
        return [count(w, rate) for w, rate in zip(self.of(key, len(rates)), rates, strict=True)]

    def dirichlet(self, key: Key, alphas: Sequence[Number]) -> list[float]:
        return random.dirichlet(self.of(key, random.GAMMA_WORDS * len(alphas)), alphas)

    def gamma(self, key: Key, alphas: Sequence[Number]) -> list[float]:
        words = self.of(key, random.GAMMA_WORDS * len(alphas))
        n = random.GAMMA_WORDS
        return [random.gamma_value(words[n * i : n * i + n], alpha) for i, alpha in enumerate(alphas)]


class Endless(Wrong):
    """A draw with infinitely many outcomes, or more than anybody lists, where outcomes are listed."""


MANY = 7
"""Things whose orders are listed, at the most."""


@dataclass
class Script:
    """Plays given outcomes, and notes how likely they are; past the end of the script, the first outcome."""

    choices: list[int]
    probability: Fraction = Fraction(1)
    sizes: list[int] = field(default_factory=list)

    def pick(self, shares: Sequence[Fraction]) -> int:
        at = len(self.sizes)
        self.sizes.append(len(shares))
        chosen = self.choices[at] if at < len(self.choices) else 0
        self.probability *= shares[chosen]
        return chosen

    def index(self, key: Key, sizes: Sequence[int]) -> list[int]:
        return [self.pick([Fraction(1, n)] * n) for n in sizes]

    def category(self, key: Key, shares: Sequence[Number], count: int, *, fixed: bool) -> list[int]:
        exact = [Fraction(p) for p in shares]
        total = sum(exact)
        return [self.pick([p / total for p in exact]) for _ in range(count)]

    def flags(self, key: Key, shares: Sequence[Number], *, fixed: bool) -> list[bool]:
        return [bool(self.pick([1 - Fraction(p), Fraction(p)])) for p in shares]

    def permutation(self, key: Key, n: int, count: int) -> list[int]:
        if n > MANY:
            raise Endless("too many outcomes")
        orders = list(itertools.permutations(range(n)))
        return [i for _ in range(count) for i in orders[self.pick([Fraction(1, len(orders))] * len(orders))]]

    def endless(self, *_: Any, **__: Any) -> Any:
        raise Endless("a draw with infinitely many outcomes")

    uniform = exponential = normal = poisson = dirichlet = gamma = endless


def outcomes(run: Callable[[Script], Any], limit: int) -> Iterator[tuple[Fraction, Any]]:
    """Everything that a function of chance may give, each with its probability: all scripts, tried in order.

    `Endless`: more than `limit` of them, or infinitely many.
    """
    choices: list[int] = []
    for _ in range(limit):
        script = Script(choices)
        result = run(script)
        if script.probability:
            yield script.probability, result
        played = (choices + [0] * len(script.sizes))[: len(script.sizes)]
        while played and played[-1] == script.sizes[len(played) - 1] - 1:
            played.pop()
        if not played:
            return
        choices = [*played[:-1], played[-1] + 1]
    raise Endless("too many outcomes")
