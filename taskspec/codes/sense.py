"""W5xx: a sound task that can hardly be what its author meant."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "W501",
        "unreachable-states",
        "states that no episode can reach",
        """
A component of the state never takes some of its values, whatever the actions and the draws, however
long an episode lasts, and in whichever of the variants under `roles`. Often a bound is too wide or a
transition is missing. Combinations of values that do not occur together are not reported.
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
On every episode that can occur the reward is the same in each step, and it makes no difference how
many steps there are. The task cannot tell a good policy from a bad one.
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
claim, such as `expert_return < optimal_return`. Where there is no exact model, the warning is given
when random actions return more than the expert does, in simulated episodes.
""",
    ),
    Code(
        "W508",
        "reward-in-observation",
        "a reward that the observation gives away",
        """
A component of the observation is the reward of the step before, which a learner that is to infer the
reward should not see. Rewards that chance decides are passed over: they can only be known by being shown.
""",
    ),
    Code(
        "W509",
        "goal-not-observable",
        "a goal that the observation does not show",
        """
Two states that both begin episodes look the same to the agent, noise apart, and no action is best in
both. No policy of a single observation can do well in both; where the task is to find out which it is, by
looking or by remembering, that is how it should be.
""",
    ),
    Code(
        "W511",
        "nothing-to-accept",
        "an accepted warning that is not given",
        """
The section `accept` gives a reason for a warning that no task which has the entry is given. Remove the
entry: kept, it would hide the warning once there is cause for it.
""",
    ),
)
