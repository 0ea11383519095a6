"""Settings of learners. Defaults, and the values at the end of this file, are those of the family `paper`.

`corrected_settings.yaml` and `released_settings.yaml` say how the other families differ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

Activation = Literal["relu", "tanh"]


@dataclass(frozen=True, slots=True)
class Experience:
    """Settings of how a policy gathers steps.

    Attributes:
        lanes: environments that are stepped together.
        steps: of each lane in a round.
        whole: rounds are of whole episodes; the rest of the last one is dropped.
        absorb: terminal states last until the horizon, so that all episodes are equally long; a flag marks them.
            Tasks without a horizon stay as they are.
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
    gae_lambda: float = 0.95
    clip: float = 0.2
    value_clip: float | None = 0.2
    entropy: float = 0.01
    value_weight: float = 0.5
    gradient_norm: float = 0.5


@dataclass(frozen=True, slots=True)
class Trpo:
    """Trust-region policy optimisation.

    Attributes:
        kl, accepted_kl: the size of a step, and up to where the line search accepts it.
        strict: accept only what is better; else what is no worse.
        halvings, shrink: of the line search.
        fisher_every: the Fisher matrix is that of every so many samples.
        critic: a net, or ridge regression on what was seen in the last round.
        entropy: added to the standardised advantage of a step, without a gradient: it only sways the line search.
    """

    experience: Experience = Experience(steps=1024)
    hidden: tuple[int, ...] = (64, 64)
    weights: Literal["orthogonal", "xavier"] = "orthogonal"
    discount: float = 0.99
    gae_lambda: float = 0.98
    kl: float = 0.01
    accepted_kl: float = 0.015
    strict: bool = False
    halvings: int = 10
    shrink: float = 0.5
    cg_iterations: int = 10
    damping: float = 0.01
    fisher_every: int = 5
    critic: Literal["net", "ridge"] = "net"
    critic_learning_rate: float = 3e-4
    critic_epochs: int = 3
    critic_batch: int = 128
    ridge: float = 1e-5
    entropy: float = 0.0


@dataclass(frozen=True, slots=True)
class Cloning:
    """Behavioural cloning.

    Attributes:
        share: of the episodes that are learned from; the others are left aside.
        updates: how many at least, for any number of epochs.
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
class Reward:
    """A net that says how good a step is: theta, and where `shaped`, + discount phi(s') - phi(s).

    Attributes:
        inputs: what theta sees.
        scaled: boxes whose bounds are all finite, and declared in the spec, are scaled to [0, 1].
        standardised: observations by a running mean and deviation of what was seen.
        weights: first ones: by Glorot and Bengio, as TensorFlow has them, or uniform up to 1 / sqrt(inputs), as PyTorch has them.
    """

    hidden: tuple[int, ...] = (32, 32)
    activation: Activation = "relu"
    inputs: Literal["state, action", "state"] = "state, action"
    shaped: bool = False
    scaled: bool = False
    standardised: bool = False
    weights: Literal["xavier", "fan in"] = "xavier"
    learning_rate: float = 1e-3


@dataclass(frozen=True, slots=True)
class Adversarial:
    """GAIL and AIRL: a discriminator of learner and expert, and a policy that is paid for confusing it.

    With l = log D - log(1 - D), D being how much a step looks like the expert's, pay is `softplus(l)` = -log(1 - D) >= 0,
    `-softplus(-l)` = log D <= 0, `l`, or `f`, what the net says.

    Attributes:
        minus_log_policy: l = f - log pi (AIRL); otherwise l = f.
        deviation_as_variance: a mistake in the density of real actions in log pi.
        updates, batch: gradient steps of the discriminator at a time, on so many steps of each kind; 0 for all there are.
        every: so many rounds of the policy.
        kept: recent steps of the learner that are drawn from; 0 for those of the round alone.
        entropy: the weight of the entropy of D in its loss.
        budget_factor: the steps that are taken, over those that are granted.
    """

    policy: Ppo | Trpo = Ppo()
    reward: Reward = Reward()
    pay: Literal["softplus(l)", "-softplus(-l)", "l", "f"] = "softplus(l)"
    minus_log_policy: bool = False
    deviation_as_variance: bool = False
    updates: int = 2
    batch: int = 25
    every: int = 1
    kept: int = 4000
    entropy: float = 0.0
    budget_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Novelty:
    """Random network distillation: the standardised error of a net that learns what a random one says is added to the reward."""

    weight: float = 0.5
    hidden: tuple[int, ...] = (32, 32, 32)
    outputs: int = 50
    learning_rate: float = 1e-3
    rate: float = 0.01


@dataclass(frozen=True, slots=True)
class Comparing:
    """Deep reinforcement learning from human preferences.

    Attributes:
        episodes: asked about in a round; neighbours are compared.
        random: the probability of a uniform action in these.
        total: the loss is summed over pairs, and ties count nothing; else it is a mean, and ties are halves.
        kept: pairs that are kept to learn from; 0 for those of the round alone.
        updates, batch: gradient steps of a round, on so many pairs; 0 for all there are.
        stale: the first action of a round is taken for what was seen last, though the environment was reset since.
        noise_ties: nobody is preferred on tasks whose observations have noise, as if these hid the rewards.
        budget_factor: the steps that are taken, over those that are granted; those asked about come on top.
    """

    policy: Ppo = Ppo(learning_rate=1e-3)
    reward: Reward = Reward(shaped=True, scaled=True)
    episodes: int = 100
    random: float = 0.0
    total: bool = True
    kept: int = 0
    updates: int = 1
    batch: int = 0
    stale: bool = True
    noise_ties: bool = False
    novelty: Novelty | None = None
    budget_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Grouped:
    """RLOO and GRPO: the baseline of an episode is what other episodes from the same start return.

    Attributes:
        groups, group: starts in a round, and episodes from each.
        baseline: the mean of the other episodes of the group, or of all of them.
        standardised: advantages are divided by the deviation of the group.
        average: the loss is the mean over episodes of the mean over their steps, the mean over all steps, or the mean over
            episodes of the sum over their steps.
        epochs: gradient steps on a round.
        kl, kl_in: the weight of the divergence from the reference policy, and whether it lowers returns or is part of the loss.
    """

    experience: Experience = Experience()
    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 1e-3
    groups: int = 4
    group: int = 8
    baseline: Literal["others", "group"] = "group"
    standardised: bool = True
    average: Literal["episode", "step", "sum"] = "episode"
    epochs: int = 1
    clip: float = 0.2
    kl: float = 0.04
    kl_in: Literal["return", "loss"] = "loss"
    gradient_norm: float = 1.0


@dataclass(frozen=True, slots=True)
class Direct:
    """Direct preference optimisation, on pairs of episodes of the reference policy.

    Attributes:
        pairs: compared in a round, each from one start; a gradient step follows.
        beta: the weight of the divergence from the reference policy.
    """

    experience: Experience = Experience()
    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 1e-3
    pairs: int = 16
    beta: float = 0.1
    gradient_norm: float = 1.0


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


# -- the learners of the paper ------------------------------------------------------------------------------------

FU = Trpo(
    Experience(lanes=2, steps=100, whole=True), hidden=(32, 32), weights="xavier", gae_lambda=1.0, accepted_kl=0.01, strict=True,
    halvings=15, shrink=0.8, damping=1e-5, fisher_every=1, critic="ridge",
)  # fmt: skip
GAIL_IM = Adversarial(budget_factor=0.64)
GAIL_SB = Adversarial(
    Trpo(), Reward(hidden=(100, 100), activation="tanh", standardised=True, learning_rate=3e-4),
    updates=1, batch=0, every=3, kept=0, entropy=1e-3, budget_factor=3.0,
)  # fmt: skip
GAIL_FU = Adversarial(FU, pay="-softplus(-l)", updates=50, batch=32, kept=0)
AIRL_SA = replace(
    GAIL_IM, reward=Reward(shaped=True, scaled=True), pay="l", minus_log_policy=True, deviation_as_variance=True
)
AIRL_SO = replace(AIRL_SA, reward=Reward(inputs="state", shaped=True, scaled=True))
AIRL_FU = replace(GAIL_FU, policy=replace(FU, entropy=1.0), pay="f", minus_log_policy=True, updates=100)
DRLHP_SA = Comparing(budget_factor=0.64)
DRLHP_SO = replace(DRLHP_SA, reward=Reward(inputs="state", shaped=True, scaled=True))
DRLHP_SLOW = replace(DRLHP_SA, policy=Ppo(learning_rate=1e-4))
DRLHP_EPS = replace(DRLHP_SA, random=0.1)
DRLHP_RND = replace(DRLHP_SA, novelty=Novelty())
RLOO = Grouped(baseline="others", standardised=False, average="sum", kl=0.05, kl_in="return")
