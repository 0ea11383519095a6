"""What claims may say beyond the language itself: results, functions of results, decision models.

The language reference is made from these tables, and the evaluator knows no others.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Word:
    """A name with how it is written and what it means.

    `phrase` is what a page says for it, and `given` what it adds for a number in brackets.
    """

    name: str
    written: str
    doc: str
    phrase: str = ""
    given: str = ""


RESULTS: dict[str, Word] = {
    w.name: w
    for w in (
        Word(
            "optimal_return",
            "optimal_return",
            "Expected return of the best policy, which knows the state.",
            "optimal return",
        ),
        Word("random_return", "random_return", "Expected return of uniformly random actions.", "random return"),
        Word("worst_return", "worst_return", "Expected return of the worst policy.", "worst return"),
        Word("expert_return", "expert_return", "Expected return of the expert.", "expert return"),
        Word(
            "remembering_return",
            "remembering_return",
            "Expected return of the best policy that sees observations only, and remembers all that it saw and did.",
            "return of the best policy with memory",
        ),
        Word(
            "memoryless_return",
            "memoryless_return",
            "Expected return of the best policy that always does the same when it sees the same.",
            "return of the best memoryless policy",
        ),
        Word(
            "states",
            "states",
            "The number of reachable states, the last one of an episode included.",
            "number of states",
        ),
        Word("actions", "actions", "How many actions there are.", "number of actions"),
    )
}

RETURNS = tuple(name for name in RESULTS if name.endswith("_return"))


def holds_of_all(op: str, left: str, right: str) -> bool:
    """Whether a comparison of two returns holds of every task: none is above the optimal one, nor below the worst."""
    low, high = (left, right) if op == "<=" else (right, left)
    are_returns = op in ("<=", ">=") and {low, high} <= {*RETURNS}
    return are_returns and (high == "optimal_return" or low == "worst_return")


FUNCTIONS: dict[str, Word] = {
    w.name: w
    for w in (
        Word("reachable", "reachable(condition)", "Some episode visits a state that fulfils the condition."),
        Word(
            "probability", "probability(condition, under=model)",
            "How likely an episode visits such a state; under uniformly random actions unless `under` says otherwise.",
        ),
        Word(
            "prefers", "prefers(model, condition, at=condition)",
            "In every state that fulfils `at` and in which an action is taken, the actions that the model takes most often "
            "fulfil the condition. Times at which it is indifferent (within 10⁻⁹) are left out, such as a last action that "
            "changes nothing, but it must have a preference in each such state at some time. Both conditions may use `t`.",
        ),
        Word(
            "influences", "influences(action, state)",
            "The action component can change the next value of the state component.",
        ),
        Word("abs", "abs(number)", "Absolute value of a number made of results."),
    )
}  # fmt: skip

MODELS: dict[str, Word] = {
    w.name: w
    for w in (
        Word(
            "optimal", "optimal", "Takes the best actions, each equally often where several are best.",
            "an optimal agent",
        ),
        Word(
            "soft", "soft(beta)",
            "Causal maximum entropy: actions in proportion to exp(beta Q), where Q includes the entropy.",
            "a causal maximum-entropy agent", "with inverse temperature",
        ),
        Word(
            "maxent", "maxent, maxent(beta)",
            "Non-causal maximum entropy: whole trajectories in proportion to their probability times exp(beta return), "
            "as if the outcomes of chance could be chosen. beta is 1 unless given.",
            "a non-causal maximum-entropy learner", "with inverse temperature",
        ),
        Word(
            "zero_terminal_value", "zero_terminal_value, zero_terminal_value(shift)",
            "Optimal for the reward plus a constant, with a value of 0 after a terminal state. A learner that knows "
            "rewards up to a constant cannot tell the shifts apart.",
            "a learner that values every terminal state at zero", "with rewards shifted by",
        ),
        Word("uniform", "uniform", "Uniformly random actions.", "a random agent"),
        Word("expert", "expert", "The expert of the spec.", "the expert"),
    )
}  # fmt: skip
