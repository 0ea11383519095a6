"""Many jobs, each done once: in parallel, with results in one file, whatever happens to a job, a process or the run itself.

Nothing here knows what the jobs are about.
"""

from __future__ import annotations

from taskspec.runs.engine import Interrupted as Interrupted
from taskspec.runs.engine import Outcome as Outcome
from taskspec.runs.engine import Standing as Standing
from taskspec.runs.engine import run as run
from taskspec.runs.job import Job as Job
from taskspec.runs.job import JobResult as JobResult
from taskspec.runs.store import Store as Store
