"""The difference in meaning between two tasks."""
