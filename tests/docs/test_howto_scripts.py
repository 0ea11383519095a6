"""The scripts of the how-to pages do what users of other libraries want: short, whole, and run with the real packages."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.test_snippets import DOCS, ROOT, blocks

HOWTO = DOCS / "howto" / "scripts"
PAGES = [*(DOCS / "howto").glob("*.md"), *(DOCS / "start").glob("*.md")]
SCRIPTS = {
    "train_sb3": (("stable_baselines3",), {"PPO": 1.0}),
    "train_torch": (("torch",), {"REINFORCE": 0.95}),
    "train_jax": (("jax",), {"REINFORCE": 0.95}),
    "imitate": (("imitation",), {"cloned": 0.95, "DAgger": 0.95}),
    "clone": (("imitation",), {"cloned": 0.98}),
    "maxent": (("imitation",), {"learnt": 0.98}),
    "exam_sb3": (("stable_baselines3",), {"PPO": 0.99}),
    "exam_imitation": (("imitation",), {"cloned": 0.98}),
    "exam_adversarial": (("imitation",), {"GAIL": 0.98, "AIRL": 0.98}),
    "exam_preferences": (("imitation",), {"compared": 0.98}),
    "demonstrations": (("minari", "h5py"), {}),
}
"""The packages that each needs, and the scores that it prints and at least reaches."""
OLDEST = {"stable_baselines3": "2.3"}
"""As `pyproject.toml` has it; imitation comes with an older one, which trains otherwise."""
LONGER = {"exam_preferences": 25}
"""Lines of a script whose library takes more to put together."""


def test_every_script_is_short_and_on_a_page() -> None:
    named = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        named |= set(re.findall(r"\]\((?:\.\./howto/)?scripts/(\w+)\.py\)", text))
        for block in blocks(text, key="script"):
            if "learners/" not in block.value:
                named.add(Path(block.value).stem)
    assert named == {path.stem for path in HOWTO.glob("*.py")} == SCRIPTS.keys()
    for name in named:
        lines = re.findall(r"^.*\S", (HOWTO / f"{name}.py").read_text(encoding="utf-8"), re.MULTILINE)
        assert len(lines) <= LONGER.get(name, 20)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_reach_their_scores(name: str, tmp_path: Path) -> None:
    packages, scores = SCRIPTS[name]
    for package in packages:
        pytest.importorskip(package, minversion=OLDEST.get(package))
    done = run(name, tmp_path)
    assert done.returncode == 0, done.stderr
    printed = dict(re.findall(r"^(\w+) (-?[\d.e-]+)$", done.stdout, re.MULTILINE))
    assert printed.keys() == scores.keys(), done.stdout
    for what, least in scores.items():
        assert float(printed[what]) >= least, done.stdout
    if name == "demonstrations":
        assert "returns {1.0} 200" in done.stdout


def run(name: str, folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "OMP_NUM_THREADS": "1",
        "MINARI_DATASETS_PATH": str(folder / "minari"),
    }
    command = [sys.executable, str(HOWTO / f"{name}.py")]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
