"""Tables and networks of PyTorch as policies: with a stand-in for PyTorch that has the parts that are used, and with itself."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.base.extras import is_installed
from taskspec.exact.scores.returns import Results
from taskspec.learn.observed_policies import observation_rows, observed_value
from tests.exact.solve.test_legal import ring
from tests.exact.solve.test_legal import value as legal_value
from tests.shared.stand_in_torch import TORCH, Module, Tensor


@pytest.fixture
def torch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", TORCH)


def value(task: str, policy: Any) -> tuple[float, float]:
    found = observed_value(Results(load(task), 200), policy, 0)
    return found.deterministic.value, found.stochastic.value


@pytest.mark.parametrize(
    "rows",
    [[[0.0, 2.0], [1.0, -3.0], [0.5, 4.0]], [[0.2, 0.8], [0.9, 0.1], [0.4, 0.6]]],
    ids=["values", "probabilities"],
)
def test_a_network_is_the_policy_of_the_table_of_its_outputs(torch: None, rows: list[list[float]]) -> None:
    network = Module(rows)
    table = np.array(rows)
    task = "probes/SecondThought"
    assert value(task, network) == pytest.approx(value(task, table))
    expected = observation_rows(load(task), table)
    found = observation_rows(load(task), network)
    assert expected is not None and found is not None
    assert found == pytest.approx(expected)
    assert network.training and not any(network.modes)


def test_a_network_for_a_box_gives_the_action(torch: None) -> None:
    task = load("derail/Parabola")
    weights = np.full((task.observation_layout.size, task.action_layout.size), 0.3, np.float32)

    def act(seen: np.ndarray) -> np.ndarray:
        return np.asarray(np.float32(seen) @ weights)

    expected = pytest.approx(value("derail/Parabola", act))
    assert value("derail/Parabola", Module(weights)) == expected
    assert value("derail/Parabola", lambda seen: Tensor(act(seen), requires_grad=True)) == expected


def test_what_is_no_action_is_refused(torch: None) -> None:
    class Pair(Module):
        def __call__(self, seen: Any) -> Any:
            return super().__call__(seen), Tensor(0.0)

    class OneHot(Module):
        def __call__(self, seen: Any) -> Any:
            raise RuntimeError("mat1 and mat2 must have the same dtype, but got Long and Float")

    for policy, words in (
        (Pair(np.eye(3)[:, :2]), "one tensor, not tuple"),
        (OneHot(np.eye(3)), r"refuses observations as the environment gives them, \(1,\) int64: mat1"),
        (lambda seen: np.array([0.1, 0.9]), "the policy gave 2"),
    ):
        with pytest.raises(SpecError, match=words):
            value("probes/SecondThought", policy)


@pytest.mark.skipif(not is_installed("torch"), reason="PyTorch is not installed")
def test_a_network_of_pytorch_is_the_policy_of_its_outputs() -> None:
    import torch as pytorch

    pytorch.manual_seed(0)
    network = pytorch.nn.Sequential(pytorch.nn.Embedding(3, 8), pytorch.nn.Dropout(0.5), pytorch.nn.Linear(8, 2))
    network.eval()
    table = network(pytorch.arange(3)).detach().numpy()
    network.train()
    assert value("probes/SecondThought", network) == pytest.approx(value("probes/SecondThought", table))


def test_tables_of_learners_are_restricted_to_legal_actions() -> None:
    task = ring(4, 50)
    Q = np.random.default_rng(0).normal(size=(5, 4))

    def greedy(s: int, values: dict[int, float]) -> float:
        return values[max(values, key=lambda a: Q[s, a])]

    found = observed_value(Results(task), Q, 0)
    assert found.deterministic.value == found.stochastic.value == pytest.approx(legal_value(4, 50, greedy))
    pi = np.exp(Q) / np.exp(Q).sum(axis=1, keepdims=True)

    def drawn(s: int, values: dict[int, float]) -> float:
        return sum(pi[s, a] * values[a] for a in values) / sum(pi[s, a] for a in values)

    assert observed_value(Results(task), pi, 0).stochastic.value == pytest.approx(legal_value(4, 50, drawn))
