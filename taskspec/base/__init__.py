"""The basis of all other folders: diagnostics, limits, files, ids, optional packages."""

__version__ = "0.1.0"
