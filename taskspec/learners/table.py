"""The learners that come with the package, by name."""

from __future__ import annotations

from dataclasses import dataclass, replace

from taskspec.learners.configurations import (
    Adversarial,
    Cloning,
    Comparing,
    Configuration,
    Experience,
    Matching,
    Novelty,
    Ppo,
    Reward,
    Trpo,
)


@dataclass(frozen=True, slots=True)
class BuiltIn:
    """A learner: what it is in a sentence, what it has to be granted, and its settings as published."""

    name: str
    summary: str
    learns_from: tuple[str, ...]
    published: Configuration


_FU = Trpo(
    Experience(lanes=2, steps=100, whole=True), hidden=(32, 32), weights="xavier", trace=1.0, accepted_kl=0.01, strict=True,
    halvings=15, shrink=0.8, damping=1e-5, fisher_every=1, critic="ridge",
)  # fmt: skip
_GAIL_IM = Adversarial(budget_factor=0.64)
_GAIL_SB = Adversarial(
    Trpo(), Reward(hidden=(100, 100), activation="tanh", standardised=True, learning_rate=3e-4),
    updates=1, batch=0, every=3, kept=0, entropy=1e-3, budget_factor=3.0,
)  # fmt: skip
_GAIL_FU = Adversarial(_FU, pay="-softplus(-l)", updates=50, batch=32, kept=0)
_AIRL_SA = replace(
    _GAIL_IM, reward=Reward(shaped=True, scaled=True), pay="l", minus_log_policy=True, deviation_as_variance=True
)
_AIRL_SO = replace(_AIRL_SA, reward=Reward(inputs="state", shaped=True, scaled=True))
_AIRL_FU = replace(_GAIL_FU, policy=replace(_FU, entropy=1.0), pay="f", minus_log_policy=True, updates=100)
_DRLHP_SA = Comparing(budget_factor=0.64)
_DRLHP_SO = replace(_DRLHP_SA, reward=Reward(inputs="state", shaped=True, scaled=True))

_REWARD, _SHOWN, _COMPARED = ("reward",), ("demonstrations",), ("preferences",)
BUILT_IN: dict[str, BuiltIn] = {
    entry.name: entry
    for entry in (
        BuiltIn("ppo", "proximal policy optimisation on the true reward", _REWARD, Ppo()),
        BuiltIn("bc", "behavioural cloning", _SHOWN, Cloning()),
        BuiltIn("gail_im", "GAIL with PPO and reward -log(1 - D) >= 0", _SHOWN, _GAIL_IM),
        BuiltIn("gail_sb", "GAIL with TRPO and reward -log(1 - D) >= 0", _SHOWN, _GAIL_SB),
        BuiltIn("gail_fu", "GAIL with TRPO and reward log D <= 0", _SHOWN, _GAIL_FU),
        BuiltIn("airl_im_sa", "AIRL with PPO and a reward of state and action", _SHOWN, _AIRL_SA),
        BuiltIn("airl_im_so", "AIRL with PPO and a reward of the state", _SHOWN, _AIRL_SO),
        BuiltIn("airl_fu", "AIRL with TRPO", _SHOWN, _AIRL_FU),
        BuiltIn("drlhp_sa", "DRLHP with PPO and a reward of state and action", _COMPARED, _DRLHP_SA),
        BuiltIn("drlhp_so", "DRLHP with PPO and a reward of the state", _COMPARED, _DRLHP_SO),
        BuiltIn("drlhp_slow", "drlhp_sa with a low learning rate of the policy", _COMPARED,
              replace(_DRLHP_SA, policy=Ppo(learning_rate=1e-4))),
        BuiltIn("drlhp_eps", "drlhp_sa with some random actions in the episodes that are compared", _COMPARED,
              replace(_DRLHP_SA, random=0.1)),
        BuiltIn("drlhp_rnd", "drlhp_sa with a bonus for novelty", _COMPARED, replace(_DRLHP_SA, novelty=Novelty())),
        BuiltIn("maxent", "maximum-entropy inverse reinforcement learning on the exact model", _SHOWN, Matching(causal=False)),
        BuiltIn("mce", "the causal version, which does not assume that it can choose random outcomes", _SHOWN, Matching()),
    )
}  # fmt: skip
"""Every learner by its name."""
