"""What everything else rests on: diagnostics, limits, files, ids, optional packages."""

__version__ = "0.1.0"
