"""Small changes of the source, one at a time, and whether some test notices: `python -m tests.mutants`."""
