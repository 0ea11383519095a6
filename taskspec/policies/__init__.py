"""Policies: by name, experts, and whatever a user hands in."""
