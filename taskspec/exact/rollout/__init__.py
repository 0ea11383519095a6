"""Episodes of many environments at once, and what they say about a mean."""
