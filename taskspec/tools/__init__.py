"""Tools around the language: exchange, audits, editors, the studio, notebooks."""
