"""Analysis of a task without running it: soundness, sanity checks, exact models, returns, claims."""

from __future__ import annotations

from taskspec.abstraction.abstraction import extract as extract
from taskspec.check.report import Accepted as Accepted
from taskspec.check.report import Report as Report
from taskspec.check.report import check as check
from taskspec.check.report import warnings as warnings
from taskspec.model.model import Model as Model
from taskspec.policies.experts import Expert as Expert
from taskspec.policies.values import Score as Score
from taskspec.policies.values import score as score
from taskspec.rules.claim_verdicts import Verdict as Verdict
from taskspec.rules.claim_verdicts import verdicts as verdicts
from taskspec.rules.examples import wrong_examples as wrong_examples
from taskspec.scores.difficulty import MEASURES as MEASURES
from taskspec.scores.difficulty import Difficulty as Difficulty
from taskspec.scores.difficulty import Measure as Measure
from taskspec.scores.difficulty import difficulty as difficulty
from taskspec.scores.partial_observability import PomdpBounds as PomdpBounds
from taskspec.scores.partial_observability import pomdp_bounds as pomdp_bounds
from taskspec.scores.returns import Results as Results
from taskspec.scores.returns import Return as Return
from taskspec.scores.returns import normalised as normalised
from taskspec.scores.scores import Scores as Scores
from taskspec.scores.scores import StaleScores as StaleScores
from taskspec.scores.scores import scores as scores
from taskspec.solve.constrained import Expectations as Expectations
from taskspec.solve.constrained import Limit as Limit
from taskspec.solve.constrained import constrained_optimum as constrained_optimum
from taskspec.solve.constrained import pareto_front as pareto_front
from taskspec.soundness.soundness import Soundness as Soundness
from taskspec.soundness.soundness import check_ranges as check_ranges
from taskspec.soundness.soundness import examine as examine
from taskspec.soundness.soundness import soundness as soundness

__all__ = [
    "Accepted", "Difficulty", "Expectations", "Expert", "Limit", "Model", "PomdpBounds", "Report", "Return", "Score",
    "Scores", "Soundness", "StaleScores", "Verdict", "check", "constrained_optimum", "difficulty", "extract",
    "pareto_front", "pomdp_bounds", "score", "scores",
]  # fmt: skip
