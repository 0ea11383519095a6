"""Learners, exams of learners, and experiments."""
