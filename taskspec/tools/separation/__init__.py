"""The smallest task on which two learners differ: races, the search, smaller versions of a task."""
