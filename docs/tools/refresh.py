"""Measure again what pages show: run the commands of blocks marked `<!-- skip: numbers of one machine -->`, put in their output.

python -m docs.tools.refresh README.md docs/reference/benchmarks.md
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

BLOCK = re.compile(
    r"(?<=^<!-- skip: numbers of one machine -->\n```console\n\$ )python (.*)\n[^`]*(?=```)", re.MULTILINE
)


def main(pages: list[str]) -> None:
    for page in map(Path, pages):
        page.write_text(measured(page), encoding="utf-8")


def measured(page: Path) -> str:
    """Return the text of a page with new outputs."""
    text = page.read_text(encoding="utf-8")
    return BLOCK.sub(lambda m: f"python {m[1]}\n{printed(m[1])}\n", text)


@lru_cache
def printed(arguments: str) -> str:
    """Return what Python prints, in the root of the checkout."""
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "90", "PYTHONIOENCODING": "utf-8"}
    command = [sys.executable, *shlex.split(arguments)]
    done = subprocess.run(
        command, cwd=Path(__file__).parents[2], env=environment, stdout=subprocess.PIPE, encoding="utf-8", check=True
    )
    return "\n".join(line.rstrip() for line in done.stdout.strip("\n").split("\n"))


if __name__ == "__main__":
    main(sys.argv[1:])
