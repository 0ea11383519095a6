"""Measures of difficulty in one table, those of partial observability among them, and the measures of one task."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError, suggest
from taskspec.base.display import html_table
from taskspec.base.limits import count as count_of
from taskspec.base.limits import how_to_raise, limits, tell
from taskspec.base.named import entries_by_name
from taskspec.exact.model.model import Model, misused, refuse
from taskspec.exact.model.transitions import joint_outcomes, outcome_count, picked
from taskspec.exact.scores import lookahead, measures
from taskspec.exact.scores.measures import mean_length, undiscounted
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.backward import Boltzmann
from taskspec.exact.solve.enclosure import Enclosure, NoNumber
from taskspec.exact.solve.infinite_horizon import chain_values, followed
from taskspec.exact.solve.plans import optimal_plan, uniform_plan
from taskspec.exact.solve.pomdp import BeliefSearch, ReactiveSearch, hides, observation_classes
from taskspec.exact.solve.rational import Rational
from taskspec.exact.solve.solve import occupancy, visits_by_time
from taskspec.language.expressions.types import Expression, total_size
from taskspec.language.modifiers.core import informative, sees_moving_draws
from taskspec.language.task.questions import reads_time
from taskspec.language.task.task import TaskLike

__all__ = ["MEASURES", "Difficulty", "Measure", "difficulty"]


SEARCHES = {"remembering": BeliefSearch, "memoryless": ReactiveSearch}
"""The search for the best policy of beliefs, and for the best memoryless policy."""


@dataclass(frozen=True, slots=True)
class PomdpBounds:
    """The best returns under observations that hide the state; None where they are unknown, and `why_not` gives the reason.

    Attributes:
        remembering: of policies that remember observations and actions.
        memoryless: of policies of the current observation alone.
    """

    remembering: Enclosure | None
    memoryless: Enclosure | None
    why_not: str | None = None


def pomdp_bounds(results: Results) -> PomdpBounds | None:
    """Bound the best returns of policies that see only the observations of a task.

    Args:
        results: of the task.

    Returns:
        bounds with memory and without; None where observations hide nothing, or without an exact model.
    """
    if results.task.observation.is_state or results.abstraction is not None or results.model is None:
        return None
    try:
        model = results.observing.known_model
        if not hides(model, observation_classes(model)):
            return None
        return PomdpBounds(best_observing(results, "remembering"), best_observing(results, "memoryless"))
    except SpecError as error:
        return PomdpBounds(None, None, error.diagnostics[0].message)


def best_observing(results: Results, which: str, as_written: bool = False) -> Enclosure:
    """Return the best return of policies that remember, or of memoryless ones (a key of `SEARCHES`)."""
    if results.abstraction is not None:
        refuse("observations of abstractions are unsupported")
    results = results.observing
    model = results.known_model
    if model.horizon is None:
        refuse("episodes have no horizon")
    if model.legal is not None:
        refuse("observations do not say which actions are legal")
    seen = observation_classes(model)
    solver = results.solvers.of(None, as_written)
    numbers = solver.numbers
    if not isinstance(numbers, Rational):
        refuse("the task is too large for rational arithmetic, or its probabilities are no rationals")
    key = (which, as_written)
    if key not in results.searched:
        best = SEARCHES[which](numbers, seen).value()
        results.searched[key] = Enclosure(best.low, min(best.high, solver.best().high))
    return results.searched[key]


RATE = 5_000_000
"""Numbers in observations that are listed in a second, nominally."""


def hidden_bits(model: Model) -> float:
    """Return the conditional entropy H(S | O) of the state given its observation, in bits, over the visits of random actions."""
    nodes = informative(model.task).nodes
    if sees_moving_draws(model.task):
        refuse("the observation shares a draw with the dynamics")
    is_timed = reads_time(nodes)
    if is_timed and model.horizon is None:
        refuse("the observation depends on the time, and there is no horizon")
    plan = uniform_plan(model)
    if is_timed:
        visits = list(visits_by_time(model, plan, model.horizon or 0))
    elif model.horizon is not None:
        visits = [occupancy(undiscounted(model), plan)]
    else:
        mean_length(model, plan)  # refuses where episodes may never end
        visits = [chain_values(followed(model.step(0).P, plan(0)).T.tocsr(), model.start, model.acting)]
    outcomes = outcome_count(nodes)
    if outcomes == np.inf:
        refuse("the noise on what is seen of a state has infinitely many outcomes")
    size = sum(np.count_nonzero(each) for each in visits) * outcomes * total_size(nodes)
    if size > limits().seconds * RATE:
        refuse(f"observations have {count_of(int(size))} numbers in all", how_to_raise("seconds", size / RATE))
    parts: list[tuple[Array, Array, Array]] = []
    for t, each in enumerate(visits):
        parts += _observed(model, nodes, t, each)
    state, rows, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    _, observation = np.unique(rows, axis=0, return_inverse=True)
    pairs, pair = np.unique(np.stack([observation.reshape(-1), state]), axis=1, return_inverse=True)
    joint = np.bincount(pair.reshape(-1), weight / weight.sum())
    marginal = np.bincount(pairs[0], joint)
    return max(0.0, float(-(joint * np.log2(joint / marginal[pairs[0]])).sum()))


def _observed(model: Model, nodes: Sequence[Expression], t: int, visits: Array) -> Iterator[tuple[Array, Array, Array]]:
    states = np.flatnonzero(visits)
    given = picked(model.reads(t), states)
    for values, which, weight in joint_outcomes(nodes, given, len(states)):
        rows = [np.zeros((1, len(which))), *(value.reshape(-1, len(which)) for value in values)]
        yield states[which], np.concatenate(rows).astype(np.float64).T, visits[states[which]] * weight


@dataclass(frozen=True)
class Measure:
    """A measure of difficulty.

    Attributes:
        doc: a sentence about it.
        formula: the same in TeX.
        source: the work that it comes from.
        of: its value for the results of a task; raises SpecError (E712) where it has none.
    """

    name: str
    unit: str
    doc: str
    formula: str
    source: str
    of: Callable[[Results], float]


def _on_model(function: Callable[[Model], float]) -> Callable[[Results], float]:
    return lambda results: function(results.known_model)


def _branching(model: Model) -> float:
    both: Any = sum(model.step(0).matrices)
    n = model.n_states
    shares = model.uniform
    reached: Any = sum(both[a * n : (a + 1) * n].multiply(shares[a, :, None]) for a in range(model.n_actions)).tocsr()
    reached.eliminate_zeros()
    return float(np.diff(reached.indptr)[model.acting].mean())


def _hidden_bits(results: Results) -> float:
    if results.task.observation.is_state:
        return 0.0
    if results.abstraction is not None:
        refuse("the abstraction does not say what is observed")
    return hidden_bits(results.known_model)


def _soft_gap(results: Results) -> float:
    soft = results.solvers.of(Boltzmann(1.0)).value(Boltzmann(1.0)).value
    return 1 - measures.score_of(results, soft)


def _episodes_to_reward(results: Results) -> float:
    chance = measures.reward_chance(results.known_model)
    if chance == 0:
        refuse("random actions never get a reward")
    return 1 / chance


def _best_constant(results: Results) -> float:
    if results.abstraction is not None and results.abstraction.stand_in.action_layout != results.task.action_layout:
        refuse("the abstraction has other actions")
    return measures.score_of(results, measures.best_constant(results.known_model))


def _best_state_reward(results: Results) -> float:
    if results.abstraction is not None:
        refuse("the abstraction has other states")
    return measures.score_of(results, measures.best_state_reward(results.known_model))


LAIDLAW = "Laidlaw, Russell and Dragan, “Bridging RL Theory and Practice with the Effective Horizon” (NeurIPS 2023)"
MAILLARD = "Maillard, Mann and Mannor, “How Hard Is My MDP? The Distribution-Norm to the Rescue” (NeurIPS 2014)"
SIMCHOWITZ = "Simchowitz and Jamieson, “Non-Asymptotic Gap-Dependent Regret Bounds for Tabular MDPs” (NeurIPS 2019)"
SKALSE = (
    "Skalse, Farnik, Motwani, Jenner, Gleave and Abate, “STARC: A General Framework For Quantifying "
    "Differences Between Reward Functions” (ICLR 2024)"
)
ZIEBART = "Ziebart, “Modeling Purposeful Adaptive Behavior with the Principle of Maximum Causal Entropy” (2010)"
SHANNON = "Shannon, “A Mathematical Theory of Communication” (1948)"


_MEASURES = [
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
        r"\mathbb{E}_{\text{random}}[T]", "", _on_model(lambda model: measures.mean_length(model, uniform_plan(model)))),
    Measure(
        "optimal_length", "steps", "The expected length of an episode of the optimal policy, uniform over the best actions.",
        r"\mathbb{E}_{\pi^*}[T]", "", _on_model(lambda model: measures.mean_length(model, optimal_plan(model)))),
    Measure(
        "solution_length", "steps",
        "The least expected number of steps in which an optimal policy reaches a state from which no further reward is possible.",
        r"\min_{\pi \in \Pi^*} \mathbb{E}_\pi[\min \{t : \text{no reward is possible from } s_t\}]", "",
        _on_model(measures.solution_length)),
    Measure(
        "best_at_random", "probability",
        "How likely an episode of uniformly random actions returns at least the optimal value of its first state, which is "
        "the best possible return in a deterministic task.",
        r"P_{\text{random}}(G \geq V^*(s_0))", LAIDLAW, _on_model(measures.best_chance)),
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
        "smallest_gap", "",
        "The smallest difference between the optimal value and the action value of an action that is not optimal, over the "
        "states and times at which episodes act.",
        r"\Delta_{\min} = \min \{\Delta_t(s, a) > 0\}, \; \Delta_t(s, a) = V^*_t(s) - Q^*_t(s, a)", SIMCHOWITZ,
        _on_model(lambda model: float(lookahead.action_gaps(model).min()))),
    Measure(
        "inverse_gaps", "",
        "The sum of the inverses of these differences, to which the steps of a learner that explores well are in proportion.",
        r"\sum_{t, s, a : \Delta_t(s, a) > 0} 1 / \Delta_t(s, a)", SIMCHOWITZ,
        _on_model(lambda model: float((1 / lookahead.action_gaps(model)).sum()))),
    Measure(
        "best_constant", "score",
        "The score of the best policy that always takes the same action, where random actions have 0 and optimal ones 1.",
        r"\max_a \, (J(a) - J(\text{random})) / (J(\pi^*) - J(\text{random}))", "", _best_constant),
    Measure(
        "best_state_reward", "score",
        "The same score of the optimal policy for that reward of the next state alone whose advantages for random actions are "
        "nearest to the true ones.",
        r"\operatorname{argmin}_g \sum_{t, s, a} (A^{\text{random}}_g - A^{\text{random}}_r)^2", SKALSE, _best_state_reward),
    Measure(
        "coverage", "probability",
        "How much the states that the expert (or else the optimal policy) acts in overlap with those that random actions act in, "
        "each in the variant of its role.",
        r"\textstyle\sum_s \min(d_{\text{expert}}(s), d_{\text{random}}(s))", "", measures.coverage),
    Measure(
        "lookahead", "steps",
        "The least k such that acting greedily on the action values of random actions, after k - 1 Bellman backups, is optimal.",
        r"\min \{k : \operatorname{greedy}(Q^k) \subseteq \Pi^*\}, \; Q^1 = Q^{\text{random}}, \; Q^{k+1} = \mathcal{T} Q^k",
        LAIDLAW, _on_model(lookahead.least_lookahead)),
    Measure(
        "value_norm", "",
        "The largest standard deviation of the optimal value of the next state (0 after an end), over states, actions and times: "
        "how much chance matters.",
        r"\max_{t, s, a} \sqrt{\operatorname{Var}_{s' \sim P(\cdot \mid s, a)} V^*_{t+1}(s')}", MAILLARD,
        _on_model(lookahead.value_norm)),
    Measure(
        "effective_horizon", "steps",
        "The least k + log_A m for which greedy over random policy, which judges every sequence of k actions by m random "
        "episodes, is optimal with probability 1/2, in a deterministic task.",
        r"\min \{k + \log_{\lvert A \rvert} m : P(\text{GORP}(k, m) \text{ is optimal}) \geq \tfrac12\}",
        LAIDLAW, _on_model(lookahead.effective_horizon)),
]  # fmt: skip
MEASURES: dict[str, Measure] = entries_by_name(_MEASURES)
"""Every measure by name."""


@dataclass(frozen=True, eq=False)
class Difficulty(Mapping[str, float | None]):
    """Measures of a task's difficulty by name, in the order of `MEASURES`; None where one is not known.

    `why_not` says why, by name.
    """

    id: str
    parameters: Mapping[str, Any]
    measured: Mapping[str, float | None]
    why_not: Mapping[str, str]

    def __getitem__(self, name: str) -> float | None:
        return self.measured[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.measured)

    def __len__(self) -> int:
        return len(self.measured)

    def record(self) -> dict[str, Any]:
        """Return plain data for JSON: the measures by name, and the reasons why some are None."""
        return {**self.measured, "why_not": dict(self.why_not)}

    def rows(self) -> list[tuple[str, float | None, str, str]]:
        """Name, value, unit, and what the measure is or why it is not known, of each."""
        return [(n, v, MEASURES[n].unit, self.why_not.get(n) or MEASURES[n].doc) for n, v in self.items()]

    def _repr_html_(self) -> str:
        rows = [(name, "unknown" if v is None else f"{v:.6g}", unit, said) for name, v, unit, said in self.rows()]
        return html_table(f"{self.id}: difficulty", ("measure", "value", "unit", ""), rows)


def difficulty(task: TaskLike | Results, names: Sequence[str] | None = None) -> Difficulty:
    """Compute measures of difficulty from theory on the exact model of a task.

    Args:
        task: the task, its id or its path, or `Results` of it, which spares working out what is known already.
        names: of measures (`MEASURES`); None is all of them.

    Returns:
        a number for each measure, in its own unit; None for a measure that is not known, with the reason in `why_not`.

    Source:
        the entry of each measure in `MEASURES` names the paper.

    Raises:
        SpecError: E713 for a name that is no measure's.
    """
    chosen = list(MEASURES) if names is None else names
    for name in chosen:
        if name not in MEASURES:
            misused(
                f"there is no measure '{name}'", suggest(name, list(MEASURES)) or f"there are: {', '.join(MEASURES)}"
            )
    if isinstance(task, Results):
        results = task
    else:
        results = Results(task)
    measured: dict[str, float | None] = {}
    why_not: dict[str, str] = {}
    for name in chosen:
        tell(f"difficulty: {name.replace('_', ' ')}")
        try:
            measured[name] = MEASURES[name].of(results)
        except NoNumber as error:
            why_not[name] = str(error)
        except SpecError as error:
            why_not[name] = error.diagnostics[0].message
        measured.setdefault(name, None)
    return Difficulty(results.task.id, results.task.values, measured, why_not)
