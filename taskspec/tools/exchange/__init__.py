"""Finite tasks in the formats of other tools: written, solved again by Storm, and read back as specs."""
