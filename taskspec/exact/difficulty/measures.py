"""The measures of difficulty in one table: what each is, in which unit, after whom, and how it is worked out."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from taskspec.exact.difficulty.greedy import effective_horizon, least_lookahead
from taskspec.exact.difficulty.hidden import hidden_bits
from taskspec.exact.difficulty.lengths import mean_length, solution_length
from taskspec.exact.difficulty.luck import best_chance, reward_chance
from taskspec.exact.model.failure import refuse
from taskspec.exact.model.model import Model
from taskspec.exact.planning.plans import Boltzmann, optimal_plan, uniform_plan
from taskspec.exact.scoring.returns import Results


@dataclass(frozen=True)
class Measure:
    """A measure of difficulty. `of` gives its value for the results of a task, and raises SpecError (E712) where it has none.

    `doc` is what it is, in a sentence; `formula` says the same in TeX; `source` is the work that it comes from.
    """

    name: str
    unit: str
    doc: str
    formula: str
    source: str
    of: Callable[[Results], float]


def _model(results: Results) -> Model:
    """The exact model. SpecError (E712): there is none, or the abstraction that it is of is not faithful."""
    if results.model is None:
        refuse(results.why_not or "there is no exact model", results.remedy)
    if results.faith is not None and results.faith.problem is not None:
        refuse("the abstraction is not faithful")
    return results.model


def _return(results: Results, which: str) -> float:
    """The optimal or random return. SpecError (E712): it is not known exactly."""
    _model(results)
    found = results.enclosure(which)
    if found is None:
        refuse(results.unsettled or f"the {which} return is not known")
    return found.value


def _on_model(function: Callable[[Model], float]) -> Callable[[Results], float]:
    return lambda results: function(_model(results))


def _branching(model: Model) -> float:
    """The mean number of states that one of the actions may lead to, from the states in which episodes act."""
    step = model.step(0)
    both = step.going if step.ending is None else step.going + step.ending
    reached = both[: model.n_states]
    for a in range(1, model.n_actions):
        reached = reached + both[a * model.n_states : (a + 1) * model.n_states]
    reached.eliminate_zeros()
    return float(np.diff(reached.indptr)[model.acting].mean())


def _hidden_bits(results: Results) -> float:
    if results.abstraction is not None and not results.task.observation.is_state:
        refuse("the abstraction does not say what is observed")
    return 0.0 if results.task.observation.is_state else hidden_bits(_model(results))


def _soft_gap(results: Results) -> float:
    optimal, random = _return(results, "optimal"), _return(results, "random")
    if optimal == random:
        refuse("random actions are optimal")
    soft = results.solvers.of(Boltzmann(1.0)).value(Boltzmann(1.0)).value
    return (optimal - soft) / (optimal - random)


def _episodes_to_reward(results: Results) -> float:
    chance = reward_chance(_model(results))
    if chance == 0:
        refuse("random actions never get a reward")
    return 1 / chance


LAIDLAW = (
    "C. Laidlaw, S. Russell and A. Dragan, “Bridging RL Theory and Practice with the Effective Horizon” (NeurIPS 2023)"
)
ZIEBART = "B. Ziebart, “Modeling Purposeful Adaptive Behavior with the Principle of Maximum Causal Entropy” (2010)"
SHANNON = "C. Shannon, “A Mathematical Theory of Communication” (1948)"


def _table(measures: Iterable[Measure]) -> dict[str, Measure]:
    return {measure.name: measure for measure in measures}


MEASURES: dict[str, Measure] = _table([
    Measure(
        "states", "", "The number of reachable states.",
        r"\lvert S \rvert", "", _on_model(lambda model: int(model.entered.sum()))),
    Measure(
        "actions", "", "How many actions there are.",
        r"\lvert A \rvert", "", _on_model(lambda model: model.n_actions)),
    Measure(
        "entries", "", "How many transitions have a positive probability, counted separately where they depend on the time.",
        r"\lvert \{(s, a, s') : P(s' \mid s, a) > 0\} \rvert", "", _on_model(lambda model: model.entries)),
    Measure(
        "branching", "states",
        "How many next states are possible at the first step's dynamics, on average over the states in which actions are taken.",
        r"\operatorname{mean}_s \lvert \{s' : \exists a\, P(s' \mid s, a) > 0\} \rvert", "", _on_model(_branching)),
    Measure(
        "random_length", "steps", "The expected length of an episode of uniformly random actions.",
        r"\mathbb{E}_{\text{random}}[T]", "", _on_model(lambda model: mean_length(model, uniform_plan(model)))),
    Measure(
        "optimal_length", "steps", "The expected length of an episode of the optimal policy, uniform over the best actions.",
        r"\mathbb{E}_{\pi^*}[T]", "", _on_model(lambda model: mean_length(model, optimal_plan(model)))),
    Measure(
        "solution_length", "steps",
        "The least expected number of steps in which an optimal policy reaches a state from which no further reward is possible.",
        r"\min_{\pi \in \Pi^*} \mathbb{E}_\pi[\min \{t : \text{no reward is possible from } s_t\}]", "",
        _on_model(solution_length)),
    Measure(
        "best_at_random", "probability",
        "How likely an episode of uniformly random actions returns at least the optimal value of its first state, which is "
        "the best possible return in a deterministic task.",
        r"P_{\text{random}}(G \geq V^*(s_0))", LAIDLAW, _on_model(best_chance)),
    Measure(
        "episodes_to_reward", "episodes",
        "The expected number of episodes of uniformly random actions up to the first with a reward other than 0.",
        r"1 / P_{\text{random}}(\exists t\, r_t \neq 0)", "", _episodes_to_reward),
    Measure(
        "soft_gap", "",
        "How far the soft-optimal policy at inverse temperature 1 is below the optimal return; random actions have a gap of 1.",
        r"(J(\pi^*) - J(\pi_{\text{soft}})) / (J(\pi^*) - J(\text{random}))", ZIEBART, _soft_gap),
    Measure(
        "hidden_bits", "bits",
        "The information about the state that the observation does not contain, in the states that random actions visit: "
        "0 where observations identify the state.",
        r"H(S) - I(S; O)", SHANNON, _hidden_bits),
    Measure(
        "lookahead", "steps",
        "The least k such that acting greedily on the action values of random actions, after k - 1 Bellman backups, is optimal.",
        r"\min \{k : \operatorname{greedy}(Q^k) \subseteq \Pi^*\}, \; Q^1 = Q^{\text{random}}, \; Q^{k+1} = \mathcal{T} Q^k",
        LAIDLAW, _on_model(least_lookahead)),
    Measure(
        "effective_horizon", "steps",
        "A bound on the effective horizon of a deterministic task: exhaustive search over this many steps takes as many episodes "
        "as looking k steps ahead, with enough random episodes each time to choose correctly.",
        r"\min_k k + \log_{\lvert A \rvert} \max_{t, s}"
        r" \lceil \tfrac{28}{3} v_{t,s} d_{t,s}^{-2} \log(2 T \lvert A \rvert^k) \rceil",
        LAIDLAW, _on_model(effective_horizon)),
])  # fmt: skip
"""Every measure by name."""
