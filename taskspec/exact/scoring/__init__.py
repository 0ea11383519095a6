"""Expected returns of policies: exact, or estimated; and how sure a result is."""
