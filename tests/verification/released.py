"""Estimators of released libraries beside the oracle: `python -m tests.verification.released`, with PyTorch and pip installed.

Each function is taken from the wheel of a release, without the rest of the library, and called with a small batch.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tempfile
import types
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from taskspec import oracle

GAMMA, LAM = 0.9, 0.75
B = oracle.batch(seed=1)


def source(package: str, version: str, file: str, name: str) -> Callable[..., Any]:
    """Return a function of a release, or of a class in it."""
    with tempfile.TemporaryDirectory() as folder:
        wanted = f"{package}=={version}"
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", wanted, "-d", folder]
        subprocess.run(command, check=True, capture_output=True)
        (path,) = Path(folder).iterdir()
        with zipfile.ZipFile(path) as wheel:
            tree = ast.parse(wheel.read(file))
    (node,) = (each for each in ast.walk(tree) if isinstance(each, ast.FunctionDef) and each.name == name)
    node.decorator_list = []
    module = ast.Module([ast.parse("from __future__ import annotations").body[0], node], [])
    whitening = types.SimpleNamespace(masked_whiten=lambda values, mask: values)
    names: dict[str, Any] = {
        "torch": torch, "verl_F": whitening, "SHAPE_ERR": "", "_resolve_device": lambda device: "cpu",
    }  # fmt: skip
    exec(compile(module, file, "exec"), names)
    return names[name]


def tensor(values: Any) -> torch.Tensor:
    return torch.tensor(np.asarray(values).T[..., None])


def vtrace(function: Callable[..., Any]) -> tuple[Any, Any]:
    """Compare the advantages of V-trace in a batch with truncations."""
    found, _ = function(
        GAMMA, tensor(B.log_ratios), torch.zeros_like(tensor(B.log_ratios)), tensor(B.values), tensor(B.next_values),
        tensor(B.rewards), tensor(B.dones), tensor(B.terminated),
    )  # fmt: skip
    _, expected = oracle.vtrace(B.rewards, B.values, B.next_values, B.terminated, B.truncated, B.ratios, GAMMA)
    return found[..., 0].T, expected


def deviations(function: Callable[..., Any]) -> tuple[Any, Any]:
    """Compare the advantages of two groups whose rewards differ by little beside their size."""
    rewards = np.array([[1000.0, 1000.25, 1000.5, 1000.25], [0.0, 1.0, 1.0, 0.0]])
    group = torch.tensor([0] * 4 + [1] * 4)
    mean, deviation, _ = function(torch.tensor(rewards.reshape(-1)), group)
    found = (rewards.reshape(-1) - mean.numpy()[group]) / deviation.numpy()[group]
    return found.reshape(2, 4), oracle.grpo(rewards, ddof=1)


def padded(function: Callable[..., Any]) -> tuple[Any, Any]:
    """Compare returns of a completion of three tokens, with two more of padding that the critic has values for."""
    rewards = np.array([0.0, 0.0, 1.0])
    values = np.array([0.5, 0.25, 0.75])
    ends = np.array([False, False, True])
    following = np.array([0.25, 0.75, 0.0])
    padding = torch.tensor([[1.0, 1.0, 1.0, 0.0, 0.0]])
    batch = [torch.tensor([[*rewards, 0.0, 0.0]]), torch.tensor([[*values, 5.0, 5.0]])]
    _, found = function(*batch, padding, torch.tensor(GAMMA), torch.tensor(LAM))
    advantages = oracle.gae(rewards, values, following, ends, np.zeros(3, np.bool_), GAMMA, LAM)
    return found[0, :3], advantages + values


CASES = {
    "torchrl V-trace": (
        vtrace, "torchrl", "torchrl/objectives/value/functional.py", "vtrace_advantage_estimate", ("0.13.3", "0.14.0"),
    ),
    "verl deviations": (deviations, "verl", "verl/utils/groupwise.py", "group_mean_std", ("0.6.0", "0.9.1")),
    "verl GAE": (padded, "verl", "verl/trainer/ppo/core_algos.py", "compute_gae_advantage_return", ("0.4.1", "0.5.0")),
}  # fmt: skip


def main() -> None:
    for name, (compare, package, file, function, versions) in CASES.items():
        for version in versions:
            found, expected = compare(source(package, version, file, function))
            error = float(np.abs(np.asarray(found, np.float64) - np.asarray(expected, np.float64)).max())
            print(f"{name} {version}: largest difference {error:.2g}")


if __name__ == "__main__":
    main()
