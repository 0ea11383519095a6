"""The table of learners, one entry each.

Neither JAX nor SciPy is imported here: an entry names its trainer.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, ClassVar

from taskspec.base.extras import install, is_installed, missing
from taskspec.base.named import entries_by_name
from taskspec.learn.learners import paper_settings as paper
from taskspec.learn.learners.interface import LearnerCase

PACKAGES = ("jax", "optax")
"""The packages of learners with nets."""


@dataclass(frozen=True)
class Learner:
    """A learner of the package: `learner(case)` gives a policy for each of `case.seeds`, all of them trained together.

    Attributes:
        name: its name in the table.
        family: whose settings it has; those of the table are of the family `paper`.
        settings: a frozen dataclass; families and files change its fields.
        learns_from: what it has to be granted, of "reward", "demonstrations" and "preferences".
        trainer: `module:function`, called with settings and a `LearnerCase`.
        summary: what it is, in a phrase.
    """

    name: str
    family: str
    settings: Any
    learns_from: tuple[str, ...]
    trainer: str
    summary: str = field(repr=False)
    together: ClassVar[bool] = True

    def require_packages(self) -> None:
        """Check that its packages are installed, without importing them.

        Raises:
            SpecError: E705 for the first that is not.
        """
        if ".deep." in self.trainer:
            for package in PACKAGES:
                if not is_installed(package):
                    raise missing(package, install("learners"), "a learner")

    def __call__(self, case: LearnerCase) -> list[Any]:
        """Train.

        Raises:
            SpecError: E705 where JAX or optax are not installed, E713 for tasks that it cannot learn.
        """
        module, _, function = self.trainer.partition(":")
        return getattr(import_module(module), function)(self.settings, case)


_REWARD = ("reward",)
_SHOWN = ("demonstrations",)
_COMPARED = ("preferences",)
_PPO = "taskspec.learn.learners.deep.policy_training:train_ppo"
_BC = "taskspec.learn.learners.deep.bc:train_bc"
_ADVERSARIAL = "taskspec.learn.learners.deep.gail_airl:train_adversarial"
_PREFERENCES = "taskspec.learn.learners.deep.drlhp:train_from_preferences"
_GROUPED = "taskspec.learn.learners.deep.rloo_grpo_dpo:train_grouped"
_DIRECT = "taskspec.learn.learners.deep.rloo_grpo_dpo:train_direct"
_MAXENT = "taskspec.learn.learners.maxent:train_maxent"

BUILT_IN: dict[str, Learner] = entries_by_name((
    Learner("ppo", "paper", paper.Ppo(), _REWARD, _PPO, "proximal policy optimisation on the true reward"),
    Learner("bc", "paper", paper.Cloning(), _SHOWN, _BC, "behavioural cloning"),
    Learner("gail_im", "paper", paper.GAIL_IM, _SHOWN, _ADVERSARIAL, "GAIL with PPO and reward -log(1 - D) >= 0"),
    Learner("gail_sb", "paper", paper.GAIL_SB, _SHOWN, _ADVERSARIAL, "GAIL with TRPO and reward -log(1 - D) >= 0"),
    Learner("gail_fu", "paper", paper.GAIL_FU, _SHOWN, _ADVERSARIAL, "GAIL with TRPO and reward log D <= 0"),
    Learner("airl_im_sa", "paper", paper.AIRL_SA, _SHOWN, _ADVERSARIAL, "AIRL with PPO and a reward of state and action"),
    Learner("airl_im_so", "paper", paper.AIRL_SO, _SHOWN, _ADVERSARIAL, "AIRL with PPO and a reward of the state"),
    Learner("airl_fu", "paper", paper.AIRL_FU, _SHOWN, _ADVERSARIAL, "AIRL with TRPO"),
    Learner("drlhp_sa", "paper", paper.DRLHP_SA, _COMPARED, _PREFERENCES, "DRLHP with PPO and a reward of state and action"),
    Learner("drlhp_so", "paper", paper.DRLHP_SO, _COMPARED, _PREFERENCES, "DRLHP with PPO and a reward of the state"),
    Learner("drlhp_slow", "paper", paper.DRLHP_SLOW, _COMPARED, _PREFERENCES,
          "drlhp_sa with a low learning rate of the policy"),
    Learner("drlhp_eps", "paper", paper.DRLHP_EPS, _COMPARED, _PREFERENCES,
          "drlhp_sa with some random actions in the episodes that are compared"),
    Learner("drlhp_rnd", "paper", paper.DRLHP_RND, _COMPARED, _PREFERENCES,
          "drlhp_sa with a bonus for novelty"),
    Learner("rloo", "paper", paper.RLOO, _REWARD, _GROUPED, "REINFORCE with the mean of the other episodes as baseline"),
    Learner("grpo", "paper", paper.Grouped(), _REWARD, _GROUPED, "policy gradients standardised within groups of episodes"),
    Learner("dpo", "paper", paper.Direct(), _COMPARED, _DIRECT, "direct preference optimisation, without a reward in between"),
    Learner("maxent", "paper", paper.Matching(causal=False), _SHOWN, _MAXENT,
          "maximum-entropy inverse reinforcement learning on the exact model"),
    Learner("mce", "paper", paper.Matching(), _SHOWN, _MAXENT,
          "the causal version, which does not assume that it can choose random outcomes"),
))  # fmt: skip
"""Every learner by its name."""
