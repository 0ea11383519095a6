"""Follow the tutorial literally with an installed taskspec, and compare what commands and programs print with the page.

python .ci/tutorial.py PAGE PYTHON: the page, and the interpreter of an environment with taskspec. Works in a new folder `mine`.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

BLOCK = re.compile(r"(?:^<!-- (\w+): (.*?) -->\n+)?^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
TIME = re.compile(r"\d+(\.\d+)? m?s\b")


def section(text: str, name: str, changed: str) -> str:
    """Return a spec with one section replaced, as a reader does it."""
    return re.sub(rf"(?m)^{name}:.*\n(?:[ ].*\n)*", changed, text, count=1)


def is_shown(came: str, shown: str) -> bool:
    """Return whether an output is the one of the page, where a line `...` stands for any lines; durations are not compared."""
    lines = []
    for line in TIME.sub("…", shown).strip().splitlines():
        if line == "...":
            lines.append(r"(?:.*\n)*")
        else:
            lines.append(re.escape(line) + r"\n")
    return re.fullmatch("".join(lines), TIME.sub("…", came).strip() + "\n") is not None


def main(page: Path, python: Path) -> int:
    """Print each difference, and return 1 if there is one."""
    compared = 0
    wrong = 0
    program = ""
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "90", "PYTHONIOENCODING": "utf-8"}
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "mine"
        folder.mkdir()
        spec = folder / "recall.yaml"
        copy = folder / "changed.yaml"

        def printed(command: list[str]) -> str:
            done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
            return done.stdout + done.stderr

        for key, _, language, body in BLOCK.findall(page.read_text(encoding="utf-8")):
            shown, came = body, body
            if language == "yaml" and key == "file":
                spec.write_text(body, encoding="utf-8")
            elif language == "yaml" and key == "add":
                spec.write_text(spec.read_text(encoding="utf-8") + body, encoding="utf-8")
            elif language == "yaml":
                copy.write_text(
                    section(spec.read_text(encoding="utf-8"), body.partition(":")[0], body), encoding="utf-8"
                )
            elif language == "console":
                command, _, shown = body.removeprefix("$ taskspec ").partition("\n")
                came = printed([str(python), "-m", "taskspec", *command.split()])
            elif language == "python":
                program += body
            elif language == "text":
                everything = printed([str(python), "-c", program])
                came = everything[-len(shown) :]
            compared += language in ("console", "text")
            if not is_shown(came, shown):
                wrong += 1
                print(f"the page prints\n{shown}\nbut this came\n{came}")
    print(f"{page.name}: {compared} outputs compared, {wrong} differ")
    return int(wrong > 0 or compared == 0)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
