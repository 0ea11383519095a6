"""The shape of a spec, before any expression is read: the one package that imports pydantic."""
