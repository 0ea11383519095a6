"""Networks of PyTorch as policies: with a stand-in that has the parts that are used, and with PyTorch where it is installed."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.base.extras import is_installed
from taskspec.exact.policies.values import observation_rows, observed_value
from taskspec.exact.scores.returns import Results


class Tensor:
    """An array with or without a gradient; NumPy may not read it while it has one."""

    def __init__(self, array: Any, requires_grad: bool = False) -> None:
        self.array = np.asarray(array)
        self.requires_grad = requires_grad
        self.dtype = self.array.dtype
        self.device = "cpu"

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        if self.requires_grad:
            raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")
        return self.array

    def __len__(self) -> int:
        return len(self.array)

    def detach(self) -> Tensor:
        return Tensor(self.array)

    def cpu(self) -> Tensor:
        return self

    def numpy(self) -> np.ndarray:
        return self.__array__()

    def is_floating_point(self) -> bool:
        return self.array.dtype.kind == "f"

    def to(self, where: Any) -> Tensor:
        return Tensor(self.array if where == "cpu" else self.array.astype(where))


class Module:
    """A network whose output is a row of a matrix for each whole number, or a matrix times each observation."""

    def __init__(self, weights: Any) -> None:
        self.weights = Tensor(np.float32(weights), requires_grad=True)
        self.training = True
        self.modes: list[bool] = []

    def parameters(self) -> Iterator[Tensor]:
        yield self.weights

    def state_dict(self) -> dict[str, Tensor]:
        return {"weights": self.weights}

    def train(self, mode: bool) -> None:
        self.training = mode

    def forward(self, seen: Any) -> Any:
        return self(seen)

    def __call__(self, seen: Any) -> Any:
        assert isinstance(seen, Tensor), "as torch refuses arrays"
        self.modes.append(self.training)
        if seen.is_floating_point():
            assert seen.dtype == np.float32
            return Tensor(seen.array @ self.weights.array, GRADIENTS[-1])
        return Tensor(self.weights.array[seen.array], GRADIENTS[-1])


GRADIENTS = [True]


@contextmanager
def no_grad() -> Iterator[None]:
    GRADIENTS.append(False)
    yield
    GRADIENTS.pop()


@pytest.fixture
def torch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "torch", SimpleNamespace(as_tensor=Tensor, no_grad=no_grad))


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

    for policy, words in (
        (Pair(np.eye(3)[:, :2]), "one tensor, not tuple"),
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
