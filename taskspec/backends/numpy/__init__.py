"""The NumPy program: generated array code that steps many environments."""
