"""What everything else rests on: diagnostics, limits, files, ids, optional packages."""
