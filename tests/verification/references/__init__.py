"""Our learners beside those of other libraries, with the same settings: see `python -m tests.verification.references --help`."""
