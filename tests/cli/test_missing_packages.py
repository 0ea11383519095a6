"""What is said of packages that are missing: the command that installs them."""

from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.shared.apart import program

MISSING = [
    ("numba", "numba", "taskspec.make_vec('RiskyPath', num_envs=2, backend='numba')"),
    ("jax", "jax", "taskspec.make_vec('RiskyPath', num_envs=2, backend='jax')"),
    ("jax", "jax", "from taskspec.programs.jax import Functional"),
    ("jax", "jax", "from taskspec.envs.functional import TaskFuncEnv"),
    ("learners", "jax", "import taskspec.learn.learners.deep"),
    ("figures", "matplotlib", "taskspec.make('RiskyPath', render_mode='rgb_array')"),
    ("figures", "matplotlib", "from taskspec.show.pages import figure; figure('RiskyPath', 'a.png')"),
    ("docs", "pygments", "command('docs', 'RiskyPath')"),
    ("cluster", "distributed", "command('sweep', 'derail/noise', '--cluster', 'tcp://127.0.0.1:1')"),
    ("sb3", "stable_baselines3", "import taskspec.envs.sb3"),
    ("parquet", "pyarrow", "command('demos', 'RiskyPath', '-o', 'shown.parquet')"),
    ("minari", "minari", "command('demos', 'RiskyPath', '--format', 'minari', '-o', 'shown-v0')"),
    ("minari", "PIL", "command('demos', 'RiskyPath', '--format', 'minari', '-o', 'shown-v0')"),
    ("imitation", "imitation", "from taskspec.data import demonstrations; demonstrations('RiskyPath').imitation()"),
    ("play", "pygame", "command('play', 'RiskyPath')"),
    ("play", "pygame", "from taskspec.tools.play import play; play(taskspec.make('Sort'))"),
    ("bench", "seals", "from taskspec.data import tabular; tabular('RiskyPath').seals()"),
]
"""An extra, a package of it, and what a user does that needs it."""

WITHOUT = """
import sys
package, code = arguments
for name in [each for each in sys.modules if each.partition(".")[0] == package]:
    del sys.modules[name]
sys.modules[package] = None
import taskspec
def command(*arguments):
    from taskspec.cli import main
    sys.argv = ["taskspec", *arguments]
    main()
try:
    exec(code)
except taskspec.SpecError as error:
    print(error)
"""


@pytest.mark.parametrize(("extra", "package", "code"), MISSING)
def test_what_needs_a_missing_package_names_the_command_that_installs_it(
    extra: str, package: str, code: str, tmp_path: Path
) -> None:
    done = program(WITHOUT, tmp_path, package, code, COLUMNS="200")
    said = done.stdout + done.stderr
    assert "Traceback" not in said
    assert "E705" in said and f'pip install -e "{ROOT}[{extra}]"' in said


def test_an_exam_does_not_begin_without_the_packages_of_its_learner(tmp_path: Path) -> None:
    done = program(WITHOUT, tmp_path, "optax", "command('exam', 'bc', '--tasks', 'RiskyPath', '--seeds', '1')")
    assert "E705" in done.stderr and "trial" not in done.stdout + done.stderr
    assert list(tmp_path.iterdir()) == []
