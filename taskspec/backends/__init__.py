"""Programs: what a task runs as, generated for one backend each."""
