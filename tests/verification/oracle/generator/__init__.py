"""Random specs that mean something: every operator, function, distribution and form of the documentation's tables."""
