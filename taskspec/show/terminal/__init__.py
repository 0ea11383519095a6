"""Text on the terminal: styles, tables that fit, results of `run`."""
