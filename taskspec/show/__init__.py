"""Figures and pages of tasks."""
