"""Soundness: whether the equations of a spec define a task."""
