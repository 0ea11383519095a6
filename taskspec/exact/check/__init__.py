"""Warnings about sound tasks, and the report of all checks."""
