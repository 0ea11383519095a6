"""Audits of environments: what is wrong with them, and what is true of them."""
