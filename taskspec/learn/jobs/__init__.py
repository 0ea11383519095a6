"""Many jobs, each done once: in parallel, with results in one file, even if a job, a process or the run itself is killed."""
