"""A command of `taskspec`, run in this process, and what it said."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import typer.testing
from typer.testing import CliRunner

from taskspec.cli.app import app

typer.testing._get_command = cache(typer.testing._get_command)  # the commands are the same each time


class Done:
    """What a command did: its exit status, its standard output and its standard error."""

    def __init__(self, *args: object, columns: int | None = None) -> None:
        env = {"COLUMNS": str(columns) if columns else "", "NO_COLOR": None, "FORCE_COLOR": None}
        result = CliRunner().invoke(app, list(map(str, args)), env=env)
        self.status = result.exit_code
        self.out = result.stdout
        self.err = result.stderr
        assert "Traceback" not in self.out + self.err

    @property
    def data(self) -> Any:
        return json.loads(self.out)

    @property
    def codes(self) -> list[str]:
        """Codes of what `check --json` says."""
        return [each["code"] for each in self.data["diagnostics"]]


def spec(folder: Path, text: str, name: str = "x.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path
