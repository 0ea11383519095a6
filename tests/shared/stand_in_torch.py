"""A stand-in for PyTorch, with the parts that are used: tensors with gradients, networks, and categorical distributions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np


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

    def double(self) -> Tensor:
        return Tensor(self.array.astype(np.float64), self.requires_grad)

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


class Categorical:
    """A distribution by its logits."""

    def __init__(self, logits: Any) -> None:
        weights = np.exp(np.asarray(logits))
        self.probs = Tensor(weights / weights.sum(axis=-1, keepdims=True))


TORCH = SimpleNamespace(as_tensor=Tensor, no_grad=no_grad, distributions=SimpleNamespace(Categorical=Categorical))
"""What stands for the module `torch`."""
