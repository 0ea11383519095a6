"""Exact models, returns and claims beside brute force in fractions, beside Storm, and beside the second interpreter."""
