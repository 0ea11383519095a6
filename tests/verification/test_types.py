"""The examples of the documentation pass the type checkers in their strict modes, as the programs of users should."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.test_snippets import PAGES, ROOT, blocks

UNTYPED = ("jax", "stable_baselines3", "imitation", "torch", "minari", "popgym", "bsuite", "ai_safety_gridworlds")
"""Packages whose own types are incomplete, so that pyright knows nothing of what they give."""


def programs(folder: Path, *, without: tuple[str, ...] = ()) -> list[Path]:
    """The Python of every page as one program, and every script as another, but for what needs some packages."""
    texts: dict[str, str] = {}
    for page in PAGES:
        name = "_".join(page.relative_to(ROOT).with_suffix("").parts) + ".py"
        for block in blocks(page.read_text(encoding="utf-8")):
            if (
                block.language == "python"
                and block.key != "skip"
                and "/" not in str(block.value)
                and not _imports(block.body, without)
            ):
                own = block.value if block.key == "script" else name
                texts[own] = texts.get(own, "") + block.body + "\n"
    texts.pop("docs_explain_extending.py")  # it extends tables whose names types list
    texts.pop("docs_howto_estimators.py")  # it tests functions without types, as learners have them
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


def _imports(program: str, packages: tuple[str, ...]) -> bool:
    return any(line.startswith((f"import {p}", f"from {p}")) for line in program.splitlines() for p in packages)


def test_the_examples_pass_mypy_in_its_strict_mode(tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    assert len(programs(tmp_path)) > 10
    (tmp_path / "bad.py").write_text('import taskspec\n\ntaskspec.make("RiskyPath", ending="stop").walk()\n')
    done = subprocess.run(  # with the options of the project, which are stricter still, and what it knows of the package already
        [sys.executable, "-m", "mypy", *map(str, tmp_path.glob("*.py"))],
        cwd=ROOT, capture_output=True, text=True, check=False, env={**os.environ, "MYPYPATH": "."},
    )  # fmt: skip
    *found, _ = done.stdout.splitlines()
    wrong = [line for line in found if "error:" in line]
    assert all("/bad.py:3:" in line for line in wrong), done.stdout
    assert any("[arg-type]" in line for line in wrong) and any("[attr-defined]" in line for line in wrong), done.stdout


@pytest.mark.skipif(shutil.which("pyright") is None, reason="pyright is not installed")
def test_the_examples_pass_pyright_in_its_strict_mode(tmp_path: Path) -> None:
    programs(tmp_path, without=UNTYPED)
    (tmp_path / "bad.py").write_text('import taskspec\n\ntaskspec.make("RiskyPath", ending="stop")\n')
    # `import taskspec` registers ids, and a page's examples are one program: imports may be unused, or repeated.
    options = {
        "typeCheckingMode": "strict", "extraPaths": [str(ROOT)], "pythonVersion": "3.11", "reportUnusedImport": False,
    }  # fmt: skip
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(options))
    done = subprocess.run(
        ["pyright", "--outputjson", "--pythonpath", sys.executable, "."],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = json.loads(done.stdout)["generalDiagnostics"]
    found = [d for d in found if "imported more than once" not in d["message"]]
    wrong = [(Path(d["file"]).name, d["range"]["start"]["line"], d["message"]) for d in found]
    assert {name for name, _, _ in wrong} == {"bad.py"}, wrong
