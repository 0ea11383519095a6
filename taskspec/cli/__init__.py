"""The command line: `taskspec COMMAND`. Everything heavy is imported by the command that needs it."""

from __future__ import annotations


def main() -> None:
    """Run the command line on `sys.argv`."""
    from taskspec.cli.app import main as run

    run()
