"""Expressions as source, for one environment (lane form) or for many (array form)."""
