"""Exact answers for unit tests of learners: values, estimators by definition, and expectations without sampling noise."""

from __future__ import annotations

from taskspec.tools.oracle.episodes import EnumeratedEpisode as EnumeratedEpisode
from taskspec.tools.oracle.episodes import Expectation as Expectation
from taskspec.tools.oracle.episodes import expectation as expectation
from taskspec.tools.oracle.estimators import RolloutBatch as RolloutBatch
from taskspec.tools.oracle.estimators import batch as batch
from taskspec.tools.oracle.estimators import gae as gae
from taskspec.tools.oracle.estimators import lambda_returns as lambda_returns
from taskspec.tools.oracle.estimators import monte_carlo as monte_carlo
from taskspec.tools.oracle.estimators import n_step_returns as n_step_returns
from taskspec.tools.oracle.estimators import next_values as next_values
from taskspec.tools.oracle.estimators import td_errors as td_errors
from taskspec.tools.oracle.estimators import vtrace as vtrace
from taskspec.tools.oracle.losses import bradley_terry_loss as bradley_terry_loss
from taskspec.tools.oracle.losses import dpo_loss as dpo_loss
from taskspec.tools.oracle.losses import grpo as grpo
from taskspec.tools.oracle.losses import grpo_loss as grpo_loss
from taskspec.tools.oracle.losses import ppo_loss as ppo_loss
from taskspec.tools.oracle.losses import rloo as rloo
from taskspec.tools.oracle.maximum_entropy import SoftValues as SoftValues
from taskspec.tools.oracle.maximum_entropy import feature_expectations as feature_expectations
from taskspec.tools.oracle.maximum_entropy import soft_values as soft_values
from taskspec.tools.oracle.values import ObservedValues as ObservedValues
from taskspec.tools.oracle.values import PolicyEvaluation as PolicyEvaluation
from taskspec.tools.oracle.values import evaluate as evaluate
from taskspec.tools.oracle.values import policy_gradient as policy_gradient

__all__ = [
    "EnumeratedEpisode",
    "Expectation",
    "ObservedValues",
    "PolicyEvaluation",
    "RolloutBatch",
    "SoftValues",
    "batch",
    "bradley_terry_loss",
    "dpo_loss",
    "evaluate",
    "expectation",
    "feature_expectations",
    "gae",
    "grpo",
    "grpo_loss",
    "lambda_returns",
    "monte_carlo",
    "n_step_returns",
    "next_values",
    "policy_gradient",
    "ppo_loss",
    "rloo",
    "soft_values",
    "td_errors",
    "vtrace",
]  # fmt: skip
