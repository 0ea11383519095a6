"""W5xx: a sound task that is probably not what its author meant."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "W501",
        "unreachable-states",
        "states that no episode can reach",
        """
A component of the state never takes some of its values, for any actions, draws and length of the episode, in any of
the variants under `roles`. Often a bound is too wide or a transition is missing. Combinations of values that do not
occur together are not reported. Without an exact model, and for reals, only the ends of the range are checked:
`high: 2` where interval arithmetic proves that 1 is never exceeded, or a `high` without a `low`, although no value is
below 0.
""",
    ),
    Code(
        "W502",
        "horizon-too-short",
        "an episode that ends before any reward",
        """
All steps of an episode of the declared length have the same reward, while a longer episode could reach another one.
Check whether the horizon counts steps or states: `L` steps visit `L + 1` states.
""",
    ),
    Code(
        "W503",
        "constant-reward",
        "a reward that is always the same",
        """
Every step of every possible episode has the same reward, and the number of steps makes no difference. The task cannot
distinguish a good policy from a bad one.
""",
    ),
    Code(
        "W504",
        "random-is-optimal",
        "a task that a random policy solves",
        """
The best possible return equals that of uniformly random actions, so the task cannot distinguish policies.
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
A parameter, constant, definition or noise is defined, but nothing that the task computes depends on it. Remove it, or
find the expression that should use it.
""",
    ),
    Code(
        "W507",
        "expert-not-optimal",
        "an expert below the optimum",
        """
The expert's expected return is below the best possible one; that of an expert with a `memory` is compared with the
best return given observations alone, where it is known. If this is intended, say so with a claim, such as
`expert_return < optimal_return`. Without an exact model, the warning is given when random actions return at least as
much as the expert in simulated episodes. Random actions are those of Gymnasium's `sample()`: uniform between two
bounds, standard normal without any, and with one bound an exponential of mean 1 from there.
""",
    ),
    Code(
        "W508",
        "reward-in-observation",
        "a reward that the observation gives away",
        """
A component of the observation is the reward of the step before, which a learner that has to infer the reward should
not see. Random rewards are ignored: an agent can only know them by observing them.
""",
    ),
    Code(
        "W509",
        "goal-not-observable",
        "a goal that the observation does not show",
        """
Two possible first states have the same observation, apart from noise, and no action is optimal in both. No policy of
a single observation can do well in both; this is intended if the task is to find out which state it is, by exploring
or by remembering.
""",
    ),
    Code(
        "W510",
        "index-moved",
        "an index outside its vector",
        """
In a reachable state, an index that depends on the state, the action, the time or a draw lies outside the vector, and
is moved to the nearest end; the message shows one. A negative one does not count from the end: `v[s - 1]` is `v[0]`
where `s` is 0. Branches that are not taken in that state, as in `v[s - 1] if s > 0 else 0`, are ignored; so is the
observation after the last step of an episode, on which nobody acts.

```yaml
reward: v[s - 1]                # wrong, or misleading, where s can be 0
reward: v[max(s - 1, 0)]        # right, if that is intended
```
""",
    ),
    Code(
        "W511",
        "nothing-to-accept",
        "an accepted warning that does not occur",
        """
The section `accept` has an entry for a warning that does not occur in any task with this entry. Remove the entry:
otherwise it would hide the warning when it does occur.
""",
    ),
    Code(
        "W512",
        "certain-draw",
        "a draw with only one outcome",
        """
A distribution has a single outcome, whatever the parameters: `Bernoulli(1)`, `Uniform({3})`, `UniformInt(n, n)`.
Either an argument is wrong, or the value should be written instead.
""",
    ),
    Code(
        "W513",
        "whole-real",
        "a real that only takes whole values",
        """
A component of the state is declared `type: real`, but starts as a whole number and always stays one. As an int it
would be exact, and the task might have an exact model; or a factor was forgotten.
""",
    ),
    Code(
        "W514",
        "slice-past-end",
        "a slice that goes past the end",
        """
A slice asks for more elements than the vector has, and silently gets fewer: `v[:9]` of a vector of 5 is all of `v`.
Or its range is empty: `v[3:1]`.
""",
    ),
    Code(
        "W515",
        "uneven-parts",
        "two parts of a vector that do not fit together",
        """
An expression uses a first and a last part of one vector, `v[:i]` and `v[j:]`, and the two overlap or leave elements
out. Adjacent elements (`v[1:] - v[:-1]`) and parts joined by `concat` are assumed to be intended.
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
The reward uses a component of the state that the observation does not show. If the task is to find it out, accept the
warning with that reason.
""",
    ),
    Code(
        "W519",
        "component-without-effect",
        "a component of the state that makes no difference",
        """
Neither rewards nor the end of episodes ever depend on a component of the state, and the agent does not see it; or the
agent sees it as part of the state, but it is only random noise. An intended distractor is better drawn in the
observation. Or it is a component of the expert's `memory` on which no action of the expert depends.
""",
    ),
    Code(
        "W520",
        "equal-actions",
        "two actions that do the same",
        """
Two values of an action lead to the same next states, rewards and ends from every state. Often a label's value was
copied and not changed, or a range is one too long.
""",
    ),
    Code(
        "W521",
        "idle-erratum",
        "an erratum about a section that does not change",
        """
An erratum of a variant lists a section in `about` that the variant does not change.
""",
    ),
    Code(
        "W522",
        "endless-abstraction",
        "an abstraction that is not finite",
        """
The purpose of an abstraction is to solve a task exactly, so it must be finite: every component of its state is a
bool, a choice, or an int with a lowest and a highest value.
""",
    ),
    Code(
        "W523",
        "figure-not-drawn",
        "a figure that cannot be drawn",
        """
The spec asks for a figure that cannot be drawn: a graph with too many states or arrows, a grid with negative columns,
bars of something that is not a vector. Pages then have no figure. Choose another `kind`, or leave the section out.
""",
    ),
    Code(
        "W524",
        "printed-alike",
        "two names with the same symbol",
        """
On pages two names look the same, or a name and a label: a parameter `D` and a move whose symbol is `D`. Give one of
them another `symbol`. Labels of different components may have the same symbol.
""",
    ),
    Code(
        "W525",
        "idle-symmetry",
        "a symmetry whose twin has the same solution as the task",
        """
In the twin of a task by a symmetry, a fixed solution of the task as printed should fail, so that learners can be
distinguished from hard-coded solutions. Here the expert of the task, applied unchanged to the observations of the
twin, earns at least nine tenths of what it earns in the task. Often the two maps cancel each other: a mirror that
exchanges left and right in the observation and in the moves as well. Leave one of the two maps out.

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
        "equations that fail in a state that no tested episode visits",
        """
A next state, an observation, an expert's action or a parameter of a distribution is not allowed in a declared state.
Without an exact model it is unknown whether episodes get there: none of the tested ones did, and bounds do not
exclude it. If none can, make the bounds of the state say so, or accept the warning with that reason; if some can, it
is the error that the hint names.

```yaml
state: {x: {type: real, low: 0, high: 1000000}}
horizon: 1000
initial: {x: 0}
dynamics: {x': x + a}                     # warning: 1000 steps may not reach 1000000
dynamics: {x': "min(x + a, 1000000)"}     # right
```
""",
    ),
    Code(
        "W527",
        "foreign-letters",
        "a name that looks like another because of letters of another alphabet",
        """
A name consists of letters that are drawn like Latin ones, but some belong to another alphabet: a Cyrillic `\u0430` is
not the Latin `a`. People who read the spec cannot tell it from the name that it looks like. Names that are visibly
in another alphabet, such as `\u03b1`, are fine.

```yaml
parameters: {\u0430: {type: int, default: 1}}    # warning: Cyrillic
parameters: {a: {type: int, default: 1}}    # right
```
""",
    ),
)
