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
transition is missing. Combinations of values that do not occur together are not reported. Where there is no exact
model, and for reals, it is the ends of the range that are looked at: `high: 2` where intervals prove that 1 is never
passed, or no `low` beside a `high`, though nothing goes below 0.
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
The expert's expected return is below the best possible one; that of an expert with a `memory` is compared with the best one of
those who see observations alone, where that is known. If it is intended, say so with a claim, such as
`expert_return < optimal_return`. Where there is no exact model, the warning is given when random actions return as much as the
expert does, or more, in simulated episodes. Random actions are those of Gymnasium's `sample()`: uniform between two bounds,
standard normal without any, and with one bound an exponential of mean 1 from there.
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
        "W510",
        "index-moved",
        "an index outside its vector",
        """
In a state where episodes act, an index that depends on the state, the action, the time or a draw lies
outside the vector, and is moved to the nearest end; the message shows one. A negative one does not
count from the end: `v[s - 1]` is `v[0]` where `s` is 0. Branches that are not taken there, as
`v[s - 1] if s > 0 else 0` has one, are passed over.

```yaml
reward: v[s - 1]                # wrong, or not what it seems, where s can be 0
reward: v[max(s - 1, 0)]        # right, if that is meant
```
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
    Code(
        "W512",
        "certain-draw",
        "a draw that can only come out one way",
        """
A distribution has a single outcome, whatever the parameters: `Bernoulli(1)`, `Uniform({3})`, `UniformInt(n, n)`. Either
an argument is wrong, or the value itself should stand there.
""",
    ),
    Code(
        "W513",
        "whole-real",
        "a real that only takes whole values",
        """
A component of the state is declared `type: real`, starts as a whole number, and all that happens to it keeps it one. As an
int it would be exact, and the task might have an exact model; or a factor has been forgotten.
""",
    ),
    Code(
        "W514",
        "slice-past-end",
        "a slice that goes past the end",
        """
A slice asks for more elements than the vector has, and silently gets fewer: `v[:9]` of a vector of 5 is all of `v`. Or its ends
are numbers between which there is nothing: `v[3:1]`.
""",
    ),
    Code(
        "W515",
        "uneven-parts",
        "two parts of a vector that do not fit together",
        """
An expression uses a first and a last part of one vector, `v[:i]` and `v[j:]`, and the two overlap or leave elements out.
Neighbours side by side (`v[1:] - v[:-1]`) and pieces put together by `concat` are taken to be meant.
""",
    ),
    Code(
        "W516",
        "constant-observation",
        "an observation that never changes",
        """
A part of the observation has the same value in every state of every episode, so it tells the agent nothing.
""",
    ),
    Code(
        "W517",
        "duplicate-observation",
        "an observation that is shown twice",
        """
Two parts of the observation are the same expression. One of them was probably meant to show something else.
""",
    ),
    Code(
        "W518",
        "hidden-from-observation",
        "a reward that depends on what is hidden",
        """
The reward names a component of the state, and the observation does not. Where the task is to find out about it, accept the
warning and say so.
""",
    ),
    Code(
        "W519",
        "component-without-effect",
        "a component of the state that makes no difference",
        """
Neither rewards nor the end of episodes ever depend on a component of the state, and the agent does not see it; or it sees it, as
part of the state, but it is drawn for nothing. A distraction that is meant is better made by the observation. Or it is something
that the expert remembers (`memory`), and nothing that the expert does depends on it.
""",
    ),
    Code(
        "W520",
        "equal-actions",
        "two actions that do the same",
        """
Two values of an action lead to the same next states, rewards and ends from every state. Often a label's value was copied and not
changed, or a range goes one too far.
""",
    ),
    Code(
        "W521",
        "idle-erratum",
        "an erratum about a section that is unchanged",
        """
An erratum of a variant says in `about` which sections it is about, and the variant does not change one of them.
""",
    ),
    Code(
        "W522",
        "endless-abstraction",
        "an abstraction that is not finite",
        """
An abstraction is there to solve a task exactly, which takes a finite one: every component of its state is a bool, a choice, or an
int with a lowest and a highest value.
""",
    ),
    Code(
        "W523",
        "figure-not-drawn",
        "a figure that cannot be drawn",
        """
The spec asks for a figure, and none can be drawn: a graph with too many states or arrows to be read, a grid with columns
below 0, bars of what is no vector. Pages have no figure then. Ask for another `kind`, or leave the section out.
""",
    ),
    Code(
        "W524",
        "printed-alike",
        "two things with one symbol",
        """
On pages two names look the same, or a name and a label: a parameter `D` and a move whose symbol is `D`. Give one of them another
`symbol`. Labels of different components may share theirs.
""",
    ),
    Code(
        "W525",
        "idle-symmetry",
        "a symmetry whose twin is solved as the task is",
        """
In the twin of a task by a symmetry, what solves the task as it is printed is to fail, so that learners can be told from
solutions that were written down. Here the expert of the task earns in episodes of the twin at least nine tenths of what it earns
in the task, though it takes what the twin shows for what the task shows. Often one map undoes the other: a mirror that exchanges
left and right in what is seen, and in the moves as well. Leave one of the two maps out.

```yaml
symmetries:
  mirror: {observation: {x: -x}, action: {move: -move}}    # the same task again
  mirror: {observation: {x: -x}}                           # right
```
""",
    ),
    Code(
        "W526",
        "unsound-elsewhere",
        "equations that fail in a state in which no episode was seen",
        """
A next state, an observation, an expert's action or a parameter of a distribution is not allowed in a declared state, and where
there is no exact model it is not known whether episodes get there: none that was tried did, and bounds do not exclude it. If none
does, let the bounds of the state say so, or accept the warning with that reason; if some do, it is the error that the hint names.

```yaml
state: {x: {type: real, low: 0, high: 1000000}}
horizon: 1000
initial: {x: 0}
dynamics: {x': x + a}                     # warned of: 1000000 may lie beyond what 1000 steps reach
dynamics: {x': "min(x + a, 1000000)"}     # right
```
""",
    ),
)
