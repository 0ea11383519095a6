"""The distribution as others get it: a wheel, built here and unpacked, and the checkout; what both say of missing packages."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT

MISSING = {
    "numba": ("numba", "taskspec.make_vec('RiskyPath', num_envs=2, backend='numba')"),
    "jax": ("jax", "taskspec.make_vec('RiskyPath', num_envs=2, backend='jax')"),
    "learners": ("jax", "import taskspec.learn.learners.deep"),
    "figures": ("matplotlib", "taskspec.make('RiskyPath', render_mode='rgb_array')"),
    "docs": ("pygments", "command('docs', 'RiskyPath')"),
    "cluster": ("distributed", "command('sweep', 'derail/noise', '--cluster', 'tcp://127.0.0.1:1')"),
    "sb3": ("stable_baselines3", "import taskspec.envs.sb3"),
    "parquet": ("pyarrow", "command('demos', 'RiskyPath', '-o', 'shown.parquet')"),
    "minari": ("minari", "command('demos', 'RiskyPath', '--format', 'minari', '-o', 'shown-v0')"),
    "imitation": ("imitation", "from taskspec.data import demonstrations; demonstrations('RiskyPath').imitation()"),
    "play": ("pygame", "command('play', 'RiskyPath')"),
    "bench": ("seals", "from taskspec.data import tabular; tabular('RiskyPath').seals()"),
}
"""For each extra a package of it, and what a user does that needs it."""


WITHOUT = """
import sys
sys.modules[{package!r}] = None
import taskspec
def command(*arguments):
    from taskspec.cli import main
    sys.argv = ["taskspec", *arguments]
    main()
try:
    {code}
except taskspec.SpecError as error:
    print(error)
"""


@pytest.mark.parametrize("extra", MISSING)
def test_what_needs_a_missing_package_names_the_command_that_installs_it(extra: str, tmp_path: Path) -> None:
    package, code = MISSING[extra]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", "COLUMNS": "200"}
    command = [sys.executable, "-c", WITHOUT.format(package=package, code=code)]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, encoding="utf-8", check=False)
    assert "Traceback" not in done.stderr
    assert f'pip install -e "{ROOT}[{extra}]"' in done.stdout + done.stderr
