"""`python -m taskspec` is the `taskspec` command."""

from __future__ import annotations

from taskspec.cli import main

main()
