"""Many jobs, each done once: in parallel, with results in one file, whatever happens to a job, a process or the run itself.

Nothing here knows what the jobs are about.
"""

from __future__ import annotations

from taskspec.jobs.engine import Interrupted as Interrupted
from taskspec.jobs.engine import Outcome as Outcome
from taskspec.jobs.engine import Standing as Standing
from taskspec.jobs.engine import run as run
from taskspec.jobs.store import Job as Job
from taskspec.jobs.store import JobResult as JobResult
from taskspec.jobs.store import Store as Store
