"""Claims and worked examples: statements of a spec about its own task, and their verdicts."""
