"""Episodes of many environments at once, and what they say of a mean."""
