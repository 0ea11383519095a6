"""E6xx: claims that a spec makes about its own task, and its examples."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E601",
        "claim-false",
        "a claim that does not hold",
        """
The exact model of the task contradicts the claim. The message gives the values of both sides, for
the parameters at which it fails.

```yaml
claims:
  - optimal_return == 2    # wrong: the message says that it is 1
```
""",
    ),
    Code(
        "E602",
        "claim-not-decidable",
        "a claim that cannot be decided for this task",
        """
The claim needs an exact model, and the task has none: its state space is infinite, or too large. A
claim about returns can be tested by simulation; give it `episodes`, or an `abstraction` that makes
the task finite.

Or the numbers are too close: what is known of them, with the error that was computed, neither proves
nor contradicts the claim, as `optimal_return <= 1` where ten times 0.1 is paid, which floats add up to
a little more than 1. A `tolerance` says how closely a claim is meant.
""",
    ),
    Code(
        "E603",
        "bad-claim",
        "a claim that is not a statement",
        """
A claim is a condition over exact results, such as `optimal_return`, `random_return`, `states` or
`prefers(...)`, that is true or false. The language reference lists everything that a claim may use.

```yaml
claims: [optimal_return]           # wrong: a number
claims: [optimal_return == 1]      # right
```
""",
    ),
    Code(
        "E604",
        "simulation-contradicts",
        "a claim that simulation contradicts",
        """
The task has no exact model, so the claim was tested on simulated episodes, and they contradict it
at the stated confidence. The message gives the estimate and its interval.
""",
    ),
    Code(
        "E605",
        "not-a-symmetry",
        "a symmetry that does not keep returns",
        """
A symmetry maps what is seen, or what is done, one-to-one, so that every policy has another one that earns the same. This map is
not: two observations look alike, or two actions become one, or an action becomes something that is none; the message shows them.
Or it is not known to be: it does more than move elements about and change their signs, there are too many values to try, and
random ones do not come back when it is applied again and again.

```yaml
symmetries:
  mirror: {observation: {x: abs(x)}}    # wrong: -1 and 1 look alike
  mirror: {observation: {x: -x}}        # right
```
""",
    ),
    Code(
        "E611",
        "example-false",
        "an example that does not hold",
        """
What an example says does not follow from the equations of the task. The message gives what does. One of the two is wrong; both
were written by hand, so look at both.

```yaml
dynamics: {s': s + a}
examples:
  - {state: {s: 1}, action: {a: 2}, next: {s: 2}}    # wrong: the message says that it is 3
```
""",
    ),
    Code(
        "E612",
        "example-not-decidable",
        "an example that cannot be decided",
        """
What follows is drawn from a distribution without end (`Normal`, `Uniform` between two reals), or one with too many outcomes.
Such a distribution is compared as it is written: write it in the example as it stands in the spec, or ask for something that
does not depend on it. An expert is looked at where it is given by expressions.
""",
    ),
    Code(
        "E613",
        "bad-example",
        "an example that does not say enough, or something impossible",
        """
The state or the action of an example lies outside its range, or leaves out a component on which what follows depends; or the
example is about a step that no episode takes.

```yaml
dynamics: {s': s + a}
examples:
  - {state: {s: 1}, next: {s: 2}}                    # wrong: what is `a`?
  - {state: {s: 1}, action: {a: 1}, next: {s: 2}}    # right
```
""",
    ),
)
