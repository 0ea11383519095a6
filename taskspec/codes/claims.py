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

Or the numbers are too close: with the computed error bounds, the results neither prove nor contradict the claim, such
as `optimal_return <= 1` where a reward of 0.1 is paid ten times, because the float 0.1 is a little more than 1/10.
Give the claim a `tolerance`.
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
A symmetry maps observations, or actions, one-to-one, so that for every policy there is another one with the same
return. This map does not: two observations become equal, or two actions become one, or an action becomes something
that is not an action; the message shows them. Or it could not be shown: the map does more than permute elements and
change their signs, there are too many values to try, and random ones do not return to themselves when the map is
applied repeatedly.

```yaml
symmetries:
  mirror: {observation: {x: abs(x)}}    # wrong: -1 and 1 become equal
  mirror: {observation: {x: -x}}        # right
```
""",
    ),
    Code(
        "E611",
        "example-false",
        "an example that does not hold",
        """
An example contradicts the equations of the task. The message gives the correct result of the equations. Either the
example or the equations are wrong; check both.

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
The result is drawn from a distribution with infinitely many outcomes (`Normal`, `Uniform` between two reals), or with
too many. Such a distribution is compared as text: write it in the example exactly as in the spec, or leave out
everything that depends on it. An expert can only be checked where it is given by expressions.
""",
    ),
    Code(
        "E613",
        "bad-example",
        "an example that does not say enough, or something impossible",
        """
The state or the action of an example lies outside its range, or leaves out a component that the result depends on; or
the example is about a step that no episode takes.

```yaml
dynamics: {s': s + a}
examples:
  - {state: {s: 1}, next: {s: 2}}                    # wrong: what is `a`?
  - {state: {s: 1}, action: {a: 1}, next: {s: 2}}    # right
```
""",
    ),
)
