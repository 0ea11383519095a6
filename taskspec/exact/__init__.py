"""What is known about a task without running it: soundness, sanity checks, exact models, returns, claims."""

from __future__ import annotations

from taskspec.exact.abstraction.abstraction import extract as extract
from taskspec.exact.checks.soundness import Soundness as Soundness
from taskspec.exact.checks.soundness import check_ranges as check_ranges
from taskspec.exact.checks.soundness import examine as examine
from taskspec.exact.checks.soundness import soundness as soundness
from taskspec.exact.claims.claims import Verdict as Verdict
from taskspec.exact.claims.claims import verdicts as verdicts
from taskspec.exact.claims.examples import wrong_examples as wrong_examples
from taskspec.exact.difficulty import MEASURES as MEASURES
from taskspec.exact.difficulty import Difficulty as Difficulty
from taskspec.exact.difficulty import Measure as Measure
from taskspec.exact.difficulty import difficulty as difficulty
from taskspec.exact.lint import sense as sense
from taskspec.exact.lint.accept import Accepted as Accepted
from taskspec.exact.model.model import Model as Model
from taskspec.exact.report import Report as Report
from taskspec.exact.report import Score as Score
from taskspec.exact.report import Scores as Scores
from taskspec.exact.report import StaleScores as StaleScores
from taskspec.exact.report import check as check
from taskspec.exact.report import score as score
from taskspec.exact.report import scores as scores
from taskspec.exact.scoring.experts import Expert as Expert
from taskspec.exact.scoring.returns import Results as Results
from taskspec.exact.scoring.returns import Return as Return
from taskspec.exact.scoring.returns import normalised as normalised
from taskspec.exact.scoring.yardsticks import Yardsticks as Yardsticks
from taskspec.exact.scoring.yardsticks import yardsticks as yardsticks

__all__ = [
    "Accepted", "Difficulty", "Expert", "Model", "Report", "Return", "Score", "Scores", "Soundness", "StaleScores", "Verdict",
    "Yardsticks", "check", "difficulty", "extract", "score", "scores",
]  # fmt: skip
