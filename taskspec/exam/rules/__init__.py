"""Rules: conditions over scores, in the syntax of the language; read, checked, and judged on bootstrap intervals."""

from __future__ import annotations

from taskspec.exam.rules.judge import Compared as Compared
from taskspec.exam.rules.judge import Judge as Judge
from taskspec.exam.rules.judge import Judged as Judged
from taskspec.exam.rules.judge import SeedScores as SeedScores
from taskspec.exam.rules.reading import Book as Book
from taskspec.exam.rules.reading import ScoreRule as ScoreRule
from taskspec.exam.rules.reading import read_exam as read_exam
from taskspec.exam.rules.reading import read_findings as read_findings
