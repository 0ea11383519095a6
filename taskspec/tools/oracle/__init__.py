"""Exact answers for unit tests of learners: values, estimators by definition, and expectations without sampling noise."""
