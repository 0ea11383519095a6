"""Policies: by name, experts, and those of users."""
