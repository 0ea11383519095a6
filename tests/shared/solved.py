"""Returns and values of models as numbers, by the solvers that scores use."""

from dataclasses import replace

from taskspec.exact import Results
from taskspec.exact.model.model import Model
from taskspec.exact.solve.backward import Uniform
from taskspec.exact.solve.bounded import Bound, Bounded
from taskspec.exact.solve.infinite_horizon import InfiniteHorizon
from taskspec.exact.solve.solve import Solvers, extreme


def optimal_return(model: Model) -> float:
    return Solvers(model).of().best().value


def random_return(model: Model) -> float:
    return Solvers(model).of().value(Uniform()).value


def worst(model: Model) -> Bound:
    """The worst values (S,) at the first time."""
    if model.horizon is None:
        found = InfiniteHorizon(model).negated().stationary_values()
        return replace(found, value=-found.value)
    value: Bound = extreme(Bounded(model), False)
    return value


def returns(results: Results) -> list[float]:
    """The optimal, the random and the worst return, which are exact."""
    values = []
    for known in (results.optimal, results.random, results.worst):
        assert known is not None and known.exact
        values.append(known.value)
    return values
