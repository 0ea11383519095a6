"""How well a spec is pinned down: every small change of it, and what notices the change."""

from __future__ import annotations

from taskspec.mutation.judge import CLASSES as CLASSES
from taskspec.mutation.judge import Judgement as Judgement
from taskspec.mutation.judge import Original as Original
from taskspec.mutation.judge import has_timers as has_timers
from taskspec.mutation.judge import judge as judge
from taskspec.mutation.judge import judgements as judgements
from taskspec.mutation.mutants import Mutant as Mutant
from taskspec.mutation.mutants import mutants as mutants
from taskspec.mutation.same import same_task as same_task
