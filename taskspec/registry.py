"""Finds the task specs that are shipped, gives them ids, and registers them with Gymnasium.

Gymnasium is imported inside functions only: Gymnasium 0.29 loads this module through its plugin
entry point while `import gymnasium` is still running, so neither may need the other to be complete.
"""

from __future__ import annotations

from pathlib import Path


def tasks_root() -> Path:
    """The folder of the shipped suites, one sub-folder of YAML specs per suite.

    A wheel carries the folder inside the package; an editable install finds it beside the package.
    """
    package = Path(__file__).parent
    inside = package / "tasks"
    return inside if inside.is_dir() else package.parent / "tasks"
