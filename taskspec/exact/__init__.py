"""What is known about a task without running it: soundness, sense, exact models, returns, claims."""

from __future__ import annotations

from taskspec.exact.accept import Accepted as Accepted
from taskspec.exact.claims import Verdict as Verdict
from taskspec.exact.claims import verdicts as verdicts
from taskspec.exact.examples import wrong_examples as wrong_examples
from taskspec.exact.extract import extract as extract
from taskspec.exact.lint import sense as sense
from taskspec.exact.model import Model as Model
from taskspec.exact.policies import Expert as Expert
from taskspec.exact.report import Report as Report
from taskspec.exact.report import Score as Score
from taskspec.exact.report import Scores as Scores
from taskspec.exact.report import StaleScores as StaleScores
from taskspec.exact.report import check as check
from taskspec.exact.report import score as score
from taskspec.exact.report import scores as scores
from taskspec.exact.returns import Results as Results
from taskspec.exact.returns import Return as Return
from taskspec.exact.returns import normalised as normalised
from taskspec.exact.soundness import Soundness as Soundness
from taskspec.exact.soundness import check_ranges as check_ranges
from taskspec.exact.soundness import examine as examine
from taskspec.exact.soundness import soundness as soundness
