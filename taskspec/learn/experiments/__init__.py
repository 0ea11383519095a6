"""Experiments: instances of tasks, listed in a YAML file; sweeps, which measure them; and exams of learners on them."""
