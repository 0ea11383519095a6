"""The exam: what is wrong with a learner, told from its scores on a suite of tasks."""
