"""Mistakes in learners: what each does, the code that does it, and what to do.

What a learner learned shows them: its values (`operators`), its reward (`starc`), or what it does
after demonstrations (`taskspec.learn.exam.pairings`); each has a table by the same names.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class KnownMistake:
    """A mistake in a learner.

    Attributes:
        what: words that follow "a learner".
        code: what such code usually looks like.
        fix: what to do.
    """

    what: str
    code: str
    fix: str


MISTAKES = {
    "right": KnownMistake("without a known mistake", "", ""),
    "on policy": KnownMistake(
        "that learns the values of what it does, exploration included (SARSA)", "target = r + gamma * Q(s', a')",
        "Nothing, if that is meant; else take the maximum over actions.",
    ),
    "until the limit": KnownMistake(
        "that learns the mean of returns until the limit (Monte Carlo)", "target = sum of gamma**k * r[t + k]",
        "Nothing, if that is meant; else add V(s') where an episode is cut off.",
    ),
    "ends ignored": KnownMistake(
        "that bootstraps past the end of an episode", "target = r + gamma * V(s')", "Multiply V(s') by (1 - terminated).",
    ),
    "next episode": KnownMistake(
        "for which an episode continues with the first state of the next one", "next_obs taken after the environment was reset",
        "Take the last observation of the episode (final_obs), and mask its value where it is terminal.",
    ),
    "limit is an end": KnownMistake(
        "for which the time limit ends the world", "done = terminated or truncated",
        "Mask V(s') by terminated alone; truncated episodes keep their value.",
    ),
    "end at the limit": KnownMistake(
        "that bootstraps past an end that coincides with the time limit", "where truncated: target += gamma * V(s')",
        "Ask for `terminated` first: a step may be both, and its end counts.",
    ),
    "reset at the end": KnownMistake(
        "for which an episode that ended by itself continues with the next one",
        "next_obs taken after the environment was reset, where it is terminated", "Multiply V(s') by (1 - terminated).",
    ),
    "reset at the limit": KnownMistake(
        "for which an episode that was cut off continues with the next one",
        "next_obs taken after the environment was reset, masked by terminated",
        "Take the last observation of the episode (final_obs).",
    ),
    "mask inverted": KnownMistake(
        "that bootstraps at the ends of episodes alone", "gamma * terminated * V(s')", "Multiply V(s') by (1 - terminated).",
    ),
    "mask late": KnownMistake(
        "whose mask belongs to the step before", "dones[t - 1] beside obs[t]",
        "Store the flag of a step with the observation that the step left.",
    ),
    "mask early": KnownMistake(
        "whose mask belongs to the step after", "dones[t + 1] beside obs[t]",
        "Store the flag of a step with the observation that the step left.",
    ),
    "start unseen": KnownMistake(
        "that takes the last observation of an episode for the first one of the next", "env.reset() without obs = ...",
        "Take the observation that reset() returns.",
    ),
    "last reward masked": KnownMistake(
        "that masks the reward of the last step, too", "(r + gamma * V(s')) * (1 - terminated)",
        "Move the parenthesis: r + gamma * (1 - terminated) * V(s').",
    ),
    "same state": KnownMistake(
        "that takes the state it left for the one it reached", "next_obs = obs, or a buffer that shares memory",
        "Store the observation that step() returned, as a copy.",
    ),
    "mean of actions": KnownMistake(
        "that averages over the next actions instead of choosing the best", "q(s').mean(axis=-1)",
        "Take the maximum over actions.",
    ),
    "least action": KnownMistake(
        "that expects the worst of the next actions", "q(s').min(axis=-1), or a minimum over the wrong axis",
        "Take the maximum over actions.",
    ),
    "all states": KnownMistake(
        "that takes the best value of any state for the next one", "q.max() without an axis",
        "Take the maximum over the axis of actions.",
    ),
    "action before": KnownMistake(
        "that looks up the next state with the action that was just taken", "q[s', a]",
        "Update the action before the look-up, or take the maximum.",
    ),
    "reward discounted": KnownMistake(
        "that discounts the reward, too", "gamma * (r + V(s'))", "Move the parenthesis: r + gamma * V(s').",
    ),
    "discounted twice": KnownMistake("that discounts twice a step", "gamma in the buffer and in the target", "Apply gamma once."),
    "undiscounted": KnownMistake("that does not discount", "target = r + V(s')", "Multiply V(s') by gamma."),
    "immediate reward": KnownMistake(
        "that sees no further than the next reward", "target = r, gamma = 0, or a target network that stays as it was",
        "Add gamma * V(s'); copy the target network now and then.",
    ),
    "rewards clipped": KnownMistake(
        "whose rewards are clipped to [-1, 1]", "np.clip(r, -1, 1), as wrappers for Atari do, or a tanh at the end", "Remove it.",
    ),
    "signs of rewards": KnownMistake(
        "that sees the signs of rewards alone", "np.sign(r), as wrappers for Atari do", "Remove it.",
    ),
    "reward negated": KnownMistake(
        "that takes rewards for costs", "target = -r + ..., or labels of preferences that are swapped",
        "Remove the minus sign; label 1 means that the first of a pair is better.",
    ),
    "rewards centred": KnownMistake(
        "whose rewards have their mean subtracted", "r - r.mean()",
        "Divide by a deviation, if anything: the mean makes ends better or worse.",
    ),
    "reward before": KnownMistake(
        "that gets the reward of the step before", "rewards[t - 1] beside obs[t]",
        "Store each reward with the observation and the action that it was paid for.",
    ),
    "reward after": KnownMistake(
        "that gets the reward of the step after", "rewards[t + 1] beside obs[t]",
        "Store each reward with the observation and the action that it was paid for.",
    ),
    "stale action": KnownMistake(
        "that learns about the action of the step before", "actions[t - 1] beside obs[t]",
        "Store each action with the observation that it was chosen for.",
    ),
    "any action": KnownMistake(
        "that learns about all actions what it sees of one", "q[s] += rate * error",
        "Update q[s, a], of the action that was taken.",
    ),
    "advantages": KnownMistake(
        "whose critic learns advantages in place of returns", "value_loss of advantages",
        "Train the critic on returns = advantages + values.",
    ),
    "grows": KnownMistake(
        "whose values grow past everything that can be earned",
        "q -= rate * error, q[s'] += rate * error, or advantages that are not cut where an episode ends",
        "Add the error to the value of the state that was left; cut advantages; then try a smaller step.",
    ),
    "one pair": KnownMistake(
        "that learned about one state and one action alone", "buffer[0] in each batch",
        "Sample all transitions that are stored.",
    ),
    "untrained": KnownMistake(
        "whose values stay what they were at first",
        "parameters of the critic that the optimiser does not get, or a detached loss",
        "Print a value before and after an update.",
    ),
    "one outcome": KnownMistake(
        "that knows one outcome of each step instead of their mean", "reset(seed=seed) in each episode, or a step size of 1",
        "Seed the first reset alone; make the step size smaller.",
    ),
    # -- of rewards alone
    "constant": KnownMistake(
        "whose reward makes no action better than another", "a network that no gradient reaches",
        "Check that the loss falls, and that the reward is not detached or cut off.",
    ),
    "action unseen": KnownMistake(
        "whose reward does not see the action", "reward_net(obs)", "Give the action to the network, too.",
    ),
    "state unseen": KnownMistake(
        "whose reward does not see the state", "reward_net(action)", "Give the observation to the network, too.",
    ),
    # -- of policies alone
    "action after": KnownMistake(
        "that pairs observations with the action of the step after", "obs[:-1] beside acts[1:]",
        "Store each action with the observation that it was chosen for.",
    ),
    "shuffled": KnownMistake(
        "that pairs observations with the actions of other steps", "obs and acts shuffled apart",
        "Shuffle both by one permutation.",
    ),
    "order reversed": KnownMistake(
        "that has the actions of each episode in reverse order", "acts[::-1] beside obs", "Reverse neither or both.",
    ),
    "first episode": KnownMistake(
        "that saw the first episode alone", "demonstrations[0], or trajectories that end at the first `done`",
        "Join the steps of all episodes.",
    ),
    "last steps missing": KnownMistake(
        "that did not see the last step of each episode", "obs[:-1] and acts[:-1]",
        "Keep the last action: an episode has one observation more than actions.",
    ),
    "avoided": KnownMistake(
        "that avoids what was demonstrated", "a likelihood that is minimised, or labels that are swapped",
        "Remove the minus sign; let the label 1 be that of the expert.",
    ),
    "at random": KnownMistake(
        "that acts at random", "a policy that was not trained, or logits that are taken for probabilities",
        "Check that the loss falls, that the policy is the one that was trained, and that logits pass a softmax.",
    ),
}  # fmt: skip
"""Mistakes by name, and three that are none: `right`, `on policy` and `until the limit`."""
