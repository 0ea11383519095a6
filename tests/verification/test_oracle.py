"""Random specs beside a second interpreter: some hundreds here, any number by `python -m tests.verification.oracle`."""

from __future__ import annotations

import ast
import sys
from pathlib import Path

import pytest

from tests.conftest import VECTORS
from tests.verification.oracle import found
from tests.verification.oracle.worker import examined

FOLDER = Path(__file__).parents[1] / "oracle"
SPECS = 80
CHUNK = 20
BACKENDS = ["numpy"] if VECTORS else []


@pytest.mark.parametrize("path", sorted([*FOLDER.glob("reference/*.py"), *FOLDER.glob("generator/*.py")]), ids=str)
def test_second_interpreter_shares_no_code(path: Path) -> None:
    """It imports the standard library, NumPy, the YAML reader and itself."""
    allowed = {*sys.stdlib_module_names, "numpy", "yaml"}
    own = f"tests.verification.oracle.{path.parent.name}"
    for node in ast.walk(ast.parse(path.read_text())):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        assert all(name.split(".")[0] in allowed or name.startswith(own) for name in names), names


@pytest.mark.parametrize("first", range(0, SPECS, CHUNK))
def test_random_specs(first: int) -> None:
    """Trajectories, exact models, returns, claims and printed text agree, and `check` has nothing to say."""
    outcomes = {number: examined(number, BACKENDS) for number in range(first, first + CHUNK)}
    assert sum(len(outcome.made) for outcome in outcomes.values()) > 2 * CHUNK
    faults = [(number, f) for number, outcome in outcomes.items() for f in outcome.findings]
    assert not [(number, f.signature, f.detail) for number, f in faults]


@pytest.mark.parametrize("kept", found.kept(), ids=lambda kept: kept.path.stem)
def test_found(kept: found.Found) -> None:
    """What was wrong once, in its smallest form."""
    assert not kept.findings()
