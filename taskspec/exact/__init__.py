"""Analysis of a task without running it: soundness, sanity checks, exact models, returns, claims."""

from __future__ import annotations

from taskspec.exact.abstraction.abstraction import extract as extract
from taskspec.exact.check.report import Accepted as Accepted
from taskspec.exact.check.report import Report as Report
from taskspec.exact.check.report import check as check
from taskspec.exact.check.report import warnings as warnings
from taskspec.exact.model.model import Model as Model
from taskspec.exact.policies.experts import Expert as Expert
from taskspec.exact.policies.values import Score as Score
from taskspec.exact.policies.values import score as score
from taskspec.exact.rules.claim_verdicts import Verdict as Verdict
from taskspec.exact.rules.claim_verdicts import verdicts as verdicts
from taskspec.exact.rules.examples import wrong_examples as wrong_examples
from taskspec.exact.scores.difficulty import MEASURES as MEASURES
from taskspec.exact.scores.difficulty import Difficulty as Difficulty
from taskspec.exact.scores.difficulty import Measure as Measure
from taskspec.exact.scores.difficulty import PomdpBounds as PomdpBounds
from taskspec.exact.scores.difficulty import difficulty as difficulty
from taskspec.exact.scores.difficulty import pomdp_bounds as pomdp_bounds
from taskspec.exact.scores.returns import Results as Results
from taskspec.exact.scores.returns import Return as Return
from taskspec.exact.scores.returns import normalised as normalised
from taskspec.exact.scores.scores import Scores as Scores
from taskspec.exact.scores.scores import StaleScores as StaleScores
from taskspec.exact.scores.scores import scores as scores
from taskspec.exact.solve.constrained import Expectations as Expectations
from taskspec.exact.solve.constrained import Limit as Limit
from taskspec.exact.solve.constrained import constrained_optimum as constrained_optimum
from taskspec.exact.solve.constrained import pareto_front as pareto_front
from taskspec.exact.soundness.soundness import Soundness as Soundness
from taskspec.exact.soundness.soundness import check_ranges as check_ranges
from taskspec.exact.soundness.soundness import examine as examine
from taskspec.exact.soundness.soundness import soundness as soundness

__all__ = [
    "Accepted", "Difficulty", "Expectations", "Expert", "Limit", "Model", "PomdpBounds", "Report", "Return", "Score",
    "Scores", "Soundness", "StaleScores", "Verdict", "check", "constrained_optimum", "difficulty", "extract",
    "pareto_front", "pomdp_bounds", "score", "scores",
]  # fmt: skip
