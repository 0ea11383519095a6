"""Finite tasks as tables: frozen at given parameter values, and written as specs of tables."""
