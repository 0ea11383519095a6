"""Soundness: do the equations define a task? Every check decided for all points, or tried on samples."""
