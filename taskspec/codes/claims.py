"""E6xx: claims that a spec makes about its own task."""

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
)
