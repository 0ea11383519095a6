"""The hooks for pre-commit: what their entries do with right and wrong specs."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
import yaml

from tests.conftest import ROOT
from tests.shared.commands import Done

HOOKS = {hook["id"]: hook for hook in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))}
RIGHT = "derail/branching.yaml"


@pytest.mark.parametrize(("hook", "old", "new"), [("taskspec-check", "state:", "stat:"), ("taskspec-fmt", ", ", ",")])
def test_a_hook_passes_right_specs_and_fails_for_wrong_ones(hook: str, old: str, new: str, tmp_path: Path) -> None:
    program, *arguments = shlex.split(HOOKS[hook]["entry"])
    assert program == "taskspec"
    tasks = tmp_path / "tasks"
    shutil.copytree(ROOT / "tasks/derail", tasks / "derail")
    path = tasks / RIGHT
    assert re.search(HOOKS[hook]["files"], path.relative_to(tmp_path).as_posix())
    assert Done(*arguments, path).status == 0
    path.write_text(path.read_text(encoding="utf-8").replace(old, new), encoding="utf-8")
    assert Done(*arguments, path).status == 1


@pytest.mark.parametrize("hook", HOOKS.values(), ids=lambda hook: hook["id"])
def test_a_hook_has_the_keys_that_pre_commit_knows(hook: dict[str, object]) -> None:
    assert set(hook) == {"id", "name", "description", "entry", "language", "types", "files"}
    assert (hook["language"], hook["types"]) == ("python", ["yaml"])
