"""Tasks solved through a finite stand-in, and whether that is faithful."""
