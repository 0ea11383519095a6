"""W5xx: a sound task that can hardly be what its author meant."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "W501",
        "unreachable-states",
        "states that no episode can reach",
        """
Some states of the declared space are never entered, whatever the actions and the draws. Often a
bound is too wide or a transition is missing. Harmless when the state space is a box of which only a
part is used.
""",
    ),
    Code(
        "W502",
        "horizon-too-short",
        "an episode that ends before any reward",
        """
No episode of the declared length reaches a reward other than the usual one, while a longer one
would. Check whether the horizon counts steps or states: `L` steps visit `L + 1` states.
""",
    ),
    Code(
        "W503",
        "constant-reward",
        "a reward that is the same whatever happens",
        """
On every episode that can occur the reward is the same in each step. The task cannot tell a good
policy from a bad one.
""",
    ),
    Code(
        "W504",
        "random-is-optimal",
        "a task that a random policy solves",
        """
The best possible return equals that of uniformly random actions, so the task cannot tell policies
apart.
""",
    ),
    Code(
        "W505",
        "action-without-effect",
        "an action that changes nothing",
        """
A component of the action changes neither the next state nor the reward, in any state.
""",
    ),
    Code(
        "W506",
        "unused",
        "a name that nothing uses",
        """
A parameter, constant, definition or noise is defined, and nothing that the task computes depends on
it. Remove it, or find the expression that forgot it.
""",
    ),
    Code(
        "W507",
        "expert-not-optimal",
        "an expert below the optimum",
        """
The expert's expected return is below the best possible one. If that is intended, say so with a
claim, such as `expert_return < optimal_return`.
""",
    ),
    Code(
        "W508",
        "reward-in-observation",
        "a reward that the observation gives away",
        """
The reward can be read off the next observation, in a task that is meant to hide it.
""",
    ),
    Code(
        "W509",
        "goal-not-observable",
        "a goal that the observation does not show",
        """
Two states that look the same to the agent, and that both begin episodes, need different actions to
succeed. No policy of the observation can do well in both.
""",
    ),
)
