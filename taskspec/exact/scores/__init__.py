"""Expected returns of policies, and measures of difficulty."""
