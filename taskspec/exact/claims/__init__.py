"""Claims and worked examples: what a spec says of its own task, held against the task."""
