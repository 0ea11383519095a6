"""Results with a computed error: every number is enclosed between two rationals, and nothing is claimed beyond them."""
