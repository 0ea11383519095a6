"""What can be set of each learner. The defaults are those of the algorithms as published."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Experience:
    """How a policy gathers steps.

    Attributes:
        lanes: environments that are stepped together.
        steps: of each lane in a round.
        whole: rounds are of whole episodes, begun anew; what is left of the last one is dropped.
        absorb: terminal states last until the horizon, so that all episodes are equally long; what is learned of them is told
            apart by a flag. Tasks without a horizon stay as they are.
        where: whose variant the policy acts in, where the roles of a task differ.
        critic_sees_time: the critic knows the time, so that it can tell that nothing follows the end of an episode.
        horizon: of the episodes that are learned in, in place of the task's own.
    """

    lanes: int = 1
    steps: int = 128
    whole: bool = False
    absorb: bool = False
    where: Literal["learner", "expert"] = "learner"
    critic_sees_time: bool = False
    horizon: int | None = None


@dataclass(frozen=True, slots=True)
class Ppo:
    """Proximal policy optimisation; `value_clip` None leaves the critic free."""

    experience: Experience = Experience()
    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 2.5e-4
    epochs: int = 4
    minibatches: int = 4
    discount: float = 0.99
    trace: float = 0.95
    clip: float = 0.2
    value_clip: float | None = 0.2
    entropy: float = 0.01
    value_weight: float = 0.5
    gradient_norm: float = 0.5


@dataclass(frozen=True, slots=True)
class Cloning:
    """Behavioural cloning.

    Attributes:
        share: of the episodes that are learned from; the others are left aside.
        updates: how many at least, whatever the number of epochs.
        loss: for real actions, the squared error of the mean (the deviation stays 1), or minus the log-likelihood.
        joint: several finite actions are one softmax over all their values, and each of its targets counts.
    """

    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 1e-4
    batch: int = 64
    epochs: int = 10
    share: float = 0.7
    updates: int = 0
    loss: Literal["squared", "likelihood"] = "squared"
    joint: bool = True


@dataclass(frozen=True, slots=True)
class Matching:
    """Maximum-entropy inverse reinforcement learning on the exact model.

    Attributes:
        causal: a step is worth the expectation over what follows; otherwise the log of the mean exponential, as if one could
            choose how chance falls.
        floor: added to the probabilities of steps before their logarithm is taken; 0 leaves out those that cannot be.
        bias: Adam's correction of its averages; without it they start too small.
        absorb: demonstrations that end early are taken to stay where they ended.
    """

    causal: bool = True
    floor: float = 1e-50
    learning_rate: float = 1e-3
    betas: tuple[float, float] = (0.9, 0.99)
    bias: bool = False
    tolerance: float = 1e-5
    iterations: int = 500_000
    absorb: bool = True


Configuration = Ppo | Cloning | Matching
