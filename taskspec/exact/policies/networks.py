"""Networks of PyTorch as functions of arrays. PyTorch is no dependency: whoever hands over a network has it."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.exact.model.model import misused
from taskspec.exact.policies.python_files import plain


def is_network(given: Any) -> bool:
    """Return whether something is a network of PyTorch, `torch.nn.Module`, that has no `predict` of its own."""
    has_parts = all(callable(getattr(given, name, None)) for name in ("forward", "parameters", "state_dict"))
    return has_parts and not hasattr(given, "predict")


def outputs_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function of arrays that gives arrays: a network is evaluated without gradients, in its mode for evaluation.

    Args:
        function: a network, or a function that may give tensors.
    """
    if is_network(function):
        return _Evaluated(function)
    return lambda *arguments: plain(function(*arguments))


@contextmanager
def evaluating(network: Any) -> Iterator[Any]:
    """Evaluate a network without gradients, in its mode for evaluation, within a block; PyTorch is what it gives."""
    torch = importlib.import_module("torch")
    was_training = network.training
    network.train(False)
    try:
        with torch.no_grad():
            yield torch
    finally:
        network.train(was_training)


class _Evaluated:
    """A network as a function of arrays (N, *shape): real numbers in its own precision, whole ones as they are."""

    def __init__(self, network: Any) -> None:
        self.network = network

    def __call__(self, *arguments: Any) -> Array:
        first = next(iter(self.network.parameters()), None)
        with evaluating(self.network) as torch:
            tensors = []
            for argument in arguments:
                tensor = torch.as_tensor(np.asarray(argument))
                if first is not None and tensor.is_floating_point():
                    tensor = tensor.to(first.dtype)
                if first is not None:
                    tensor = tensor.to(first.device)
                tensors.append(tensor)
            try:
                output = self.network(*tensors)
            except RuntimeError as error:
                given = ", ".join(f"{np.shape(argument)} {np.asarray(argument).dtype}" for argument in arguments)
                hint = "a function of one observation, or an object with `probabilities(observations)`, can encode them first"
                misused(f"the network refuses observations as the environment gives them, {given}: {error}", hint)
        if not hasattr(output, "detach"):
            hint = "wrap it in a function of one observation that gives the action"
            misused(f"a network that is a policy gives one tensor, not {type(output).__name__}", hint)
        return np.asarray(plain(output))
