"""Data for learners: demonstrations, preferences, and exact models as arrays."""
