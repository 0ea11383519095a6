"""The exam: verdicts, flags and diagnoses of a learner from its scores on a suite of tasks."""
