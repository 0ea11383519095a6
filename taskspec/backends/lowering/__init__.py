"""Transformations of a task's expressions before code generation, shared by backends."""
