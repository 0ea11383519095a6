"""Functions, keys and types of other libraries: the message says how the same is written here, and what it says is the same."""

import json
import re
from typing import Any

import numpy as np
import pytest
from scipy import stats

from taskspec.base.diagnostics import Diagnostic
from taskspec.envs.vector import VectorEnvironment
from taskspec.language import source
from taskspec.language.expressions.parse import FOREIGN
from taskspec.language.task.build import build
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each

X = (3, -1, 2)
Y = (0.5, 4.0, 2.0)
NAMES: dict[str, Any] = {
    "p": 0.3, "rate": 2.5, "mean": 0.4, "std": 0.8, "scale": 0.7, "low": -2, "high": 5, "n": 6, "k": 3, "a": 2, "b": 3, "c": True,
    "d": False, "alpha": [0.5, 1, 2],
}  # fmt: skip
DRAWN: dict[str, Any] = {
    "beta": stats.beta(2, 3),
    "binomial": stats.binom(6, 0.3),
    "gamma": stats.gamma(2, scale=1 / 2.5),
    "erlang": stats.gamma(3, scale=1 / 2.5),
    "geometric": stats.geom(0.3),
    "truncnorm": stats.truncnorm(-2.4 / 0.8, 4.6 / 0.8, 0.4, 0.8),
    "LogNormal": stats.lognorm(0.8, scale=np.exp(0.4)),
    "Laplace": stats.laplace(0.4, 0.7),
    "choice": stats.randint(2, 4),
    "choices": stats.rv_discrete(values=([2, 3], [0.3, 0.7])),
    "randint": stats.randint(-2, 6),
    "rand": stats.uniform(),
    "gauss": stats.norm(0.4, 0.8),
    "expovariate": stats.expon(scale=1 / 2.5),
}
VALUES: dict[str, Any] = {
    "int": [3, -1, 2], "bool": [True, True, True], "mod": np.mod(X, Y), "pow": np.power([3.0, -1, 2], [0.5, 4, 2]),
    "square": np.square(X), "sigmoid": 1 / (1 + np.exp(-np.array(X))), "hypot": np.hypot(X, Y), "average": np.mean(X),
    "norm": np.linalg.norm(X),
    "length": 3, "maximum": np.maximum(X, Y), "concatenate": [*X, *Y], "zeros": np.zeros(6), "arange": np.arange(6),
    "linspace": np.linspace(-2, 5, 6), "xor": True, "ifelse": X,
    "expm1": np.expm1(X), "factorial": 720, "comb": 20, "relu": np.maximum(X, 0),
    "softmax": np.exp(X) / np.exp(X).sum(), "var": np.var(X), "Std": np.std(X), "sorted": sorted(X), "reversed": X[::-1],
    "zip": np.add(X, Y), "enumerate": [0, X[1], 2 * X[2]],
}  # fmt: skip


def spec(expression: str, **sections: Any) -> source.Document:
    data: dict[str, Any] = {
        "taskspec": 1, "name": "Foreign", "constants": {**NAMES, "x": list(X), "y": list(Y)},
        "state": {"s": {"type": "int", "low": 0, "high": 1}}, "action": {"u": {"type": "bool"}}, "horizon": 1,
        "initial": {"s": 0}, "dynamics": {"s'": "s"}, "reward": expression,
    }  # fmt: skip
    return source.read_text(json.dumps(data | sections), "foreign.yaml")


def problem(expression: str) -> Diagnostic:
    (found,) = refusal(build, spec(expression)).diagnostics
    return found


def advised(name: str) -> str:
    """What the message about a function says to write."""
    found = problem(f"{name}(x)")
    assert found.code == "E303" and found.hint is not None
    return re.findall("`(.*)`", found.hint)[0]


@pytest.mark.parametrize("name", DRAWN)
def test_draws_have_the_distribution_that_is_named(name: str) -> None:
    task = build(spec(advised(name)))
    rewards = _rewards(task)
    mean, variance = DRAWN[name].stats(moments="mv")
    assert abs(rewards.mean() - mean) < 4.5 * np.sqrt(variance / len(rewards))
    assert rewards.var() == pytest.approx(variance, rel=0.25)
    points = np.unique(np.quantile(rewards, [0.1, 0.3, 0.5, 0.7, 0.9]))
    found = (rewards <= points[:, None] + 1e-9).mean(axis=1)
    assert np.abs(found - DRAWN[name].cdf(points + 1e-9)).max() < 0.035


def _rewards(task: Any) -> np.ndarray:
    lanes = VectorEnvironment(task, 4000, backend="numpy")
    lanes.reset(seed=3)
    return np.asarray(lanes.step(np.zeros(4000, np.int64))[1], np.float64)


@for_each("name", VALUES)
def test_values_are_those_of_the_library(name: str) -> None:
    value = np.asarray(VALUES[name], np.float64)
    shape = {} if value.shape == () else {"shape": list(value.shape)}
    task = build(spec("0", state={"s": {"type": "real", **shape}}, initial={"s": f"1.0 * ({advised(name)})"}))
    state = VectorEnvironment(task, 1, backend="numpy").reset(seed=0)[0]
    np.testing.assert_allclose(np.asarray(state)[0], value, rtol=1e-6)


@for_each("name", FOREIGN)
def test_everything_that_is_advised_can_be_written(name: str) -> None:
    build(spec("0", noise={"z": FOREIGN[name]}))


@pytest.mark.parametrize(("written", "message", "hint"), [
    ("np.clip(x, 0, 2)", "methods and functions of modules (`x.f()`) are not part of the language", "write `clip(x, low, high)`"),
    ("np.random.normal(0, 1)", "methods and functions of modules (`x.f()`) are not part of the language",
     "write `Normal(mean, std)`"),
    ("x.shape", "attributes (`a.b`) are not part of the language", None),
    ("x.mean()", "methods and functions of modules (`x.f()`) are not part of the language", "write `sum(x) / len(x)`"),
])  # fmt: skip
def test_modules_and_methods(written: str, message: str, hint: str | None) -> None:
    found = problem(written)
    assert (found.code, found.message, found.hint) == ("E316", message, hint)


@pytest.mark.parametrize(("section", "entry", "message", "hint"), [
    ("done", "s", "unknown key `done`", "write `terminal`"),
    ("max_steps", 9, "unknown key `max_steps`", "write `horizon`"),
    ("transitions", {}, "unknown key `transitions`", "write `dynamics`"),
    ("state", {"s": {"type": "int", "max": 9}}, "unknown key `max`", "write `high`"),
    ("state", {"s": {"type": "int", "n": 9}}, "unknown key `n`", "write `low: 0, high: n - 1`"),
    ("state", {"s": {"type": "int", "low": 0, "high": 1, "length": 9}}, "unknown key `length`", "write `shape`"),
    ("parameters", {"L": {"type": "int", "default": 1, "maximum": 9}}, "unknown key `maximum`", "write `high`"),
    ("state", {"s": {"type": "list"}}, "the text `list` is not one of int, real, bool, choice", "write `type: int, shape: [n]`"),
    ("parameters", {"L": {"default": 3}}, "`L` has no `type`", "one of `type: int`, `real`, `bool` and `choice`"),
    ("dynamics", {"s'": {"table": {"by": "s", "rows": {"0": "1", "else": "0"}}}},
     "rows are nested deeper than `by` is long, or a probability is a mapping",
     "a table stands by itself, not below `table`"),
])  # fmt: skip
def test_keys_and_types_of_others(section: str, entry: Any, message: str, hint: str) -> None:
    (found,) = refusal(build, spec("0", **{section: entry})).diagnostics
    assert (found.message, found.hint) == (message, hint)


@pytest.mark.parametrize(("entry", "said"), [
    ({"value": "s", "type": "int"}, [("E202", "unknown key `type`", "its type follows from its expression")]),
    ({"value": "s", "space": "box"}, [("E202", "unknown key `space`", "it stands under `observation`, beside the names")]),
    ({"type": "int", "low": 0, "high": 3}, [
        ("E203", "this observation has no `value`", "an expression over the state"),
        ("E202", "unknown key `type`", "its type follows from its expression"),
    ]),
])  # fmt: skip
def test_an_observation_is_declared_as_in_gymnasium(entry: dict[str, Any], said: list[tuple[str, str, str]]) -> None:
    refused = refusal(build, spec("0", observation={"seen": entry}))
    for problem, (code, message, words) in zip(refused.diagnostics, said, strict=True):
        assert (problem.code, problem.message) == (code, message)
        assert words in str(problem.hint)
