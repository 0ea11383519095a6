"""E4xx: whether the equations define a task, shown by a counterexample when they do not."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E401",
        "probabilities-sum",
        "probabilities that do not sum to 1",
        """
The probabilities of a distribution sum to 1 in every state and for every action. Fractions such as
`1/3` are added exactly.

```yaml
s': {goal: 1/2, trap: 1/3}    # wrong: 5/6
s': {goal: 2/3, trap: 1/3}    # right
```
""",
    ),
    Code(
        "E402",
        "negative-probability",
        "a probability below 0 or above 1",
        """
A probability became negative, greater than 1, or not a number, in the state that the message shows.

```yaml
hit: Bernoulli(s/5)               # wrong when s can be 6
hit: Bernoulli(min(s/5, 1))       # right, if that is what is meant
```
""",
    ),
    Code(
        "E403",
        "next-state-outside",
        "a next state outside the state space",
        """
The dynamics lead from an allowed state, by an allowed action, to a value that the component cannot have. The message
shows one such step. Widen the bounds, stop at them with `clip`, or end the episode earlier. (If the environment is
run anyway, it moves an int to the nearest bound.)

```yaml
state: {s: {type: int, low: 0, high: 9}}
dynamics: {s': s + 1}               # wrong: from 9 to 10
dynamics: {s': "min(s + 1, 9)"}     # right
```
""",
    ),
    Code(
        "E404",
        "initial-state-outside",
        "an initial state outside the state space",
        """
An initial value is not one that its component can have.

```yaml
state: {s: {type: int, low: 1, high: 9}}
initial: {s: 0}    # wrong
initial: {s: 1}    # right
```
""",
    ),
    Code(
        "E405",
        "observation-outside",
        "an observation outside its space",
        """
An observed value is not inside the space that the environment declares. The space is derived from the bounds of the
observed values; the message shows a state in which they do not hold.
""",
    ),
    Code(
        "E406",
        "reward-not-finite",
        "a reward that is not a finite number",
        """
The reward of some step is infinite or not a number, for example after a division by zero or the logarithm of a
negative number. Returns and values are then undefined.

```yaml
reward: 1/d             # wrong when d can be 0
reward: 1/max(d, 1)     # right, if that is what is meant
```
""",
    ),
    Code(
        "E407",
        "empty-domain",
        "a component without any possible value",
        """
For these parameters the low end of a component is above its high end, or a finite set has no
element, so that no value can be chosen.

```yaml
s: {type: int, low: 0, high: L - 1}    # wrong for L = 0: require L to be at least 1
```
""",
    ),
    Code(
        "E408",
        "distribution-parameter",
        "a distribution with an impossible parameter",
        """
A standard deviation is not negative, a rate is positive, the low end of a range is not above its
high end, and all of them are finite. The message shows a state in which this fails.

```yaml
x': Normal(mean=x, std=x)         # wrong when x can be negative
x': Normal(mean=x, std=abs(x))    # right
```
""",
    ),
    Code(
        "E409",
        "expert-outside",
        "an expert action outside the action space",
        """
The expert chooses, in the state that the message shows, an action that does not exist.

```yaml
action: {a: {type: int, low: 0, high: 1}}
expert: {a: s + 1}             # wrong when s can be 1 or more
expert: {a: "min(s, 1)"}       # right
```
""",
    ),
    Code(
        "E410",
        "table-gap",
        "a table without a row for a value that occurs",
        """
A decision table must have a cell for every combination of values that occurs. Add the missing rows, or one row
`else`.

```yaml
reward: {by: [s], rows: {goal: 1}}             # wrong: what about other states?
reward: {by: [s], rows: {goal: 1, else: 0}}    # right
```
""",
    ),
    Code(
        "E411",
        "number-outside-domain",
        "a number that is too large, or too close to 0",
        """
The numbers of which rewards are made are 0, or between 1e-100 and 1e100 in size, and probabilities are 0, 1, or at least
1e-100 from both. Products of others may be too small for a float, so that nothing could be proved of them.

```yaml
reward: 1e-200 * (s' == goal)     # wrong
reward: 1e-9 * (s' == goal)       # right
```
""",
    ),
)
