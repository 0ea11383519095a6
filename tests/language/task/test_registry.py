"""Which files of a folder are tasks, and what registration says about the others."""

from pathlib import Path

import pytest
import yaml

import taskspec
from taskspec.language import registry
from tests.shared.diagnostics import refusal

SECTIONS = (
    "state: {s: {type: bool}}\naction: {a: {type: bool}}\ninitial: {s: true}\ndynamics: {}\nreward: 0\nhorizon: 2\n"
)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (f"name: Walk\n{SECTIONS}", ["Walk-v0"]),
        (
            f"name: Walk\nversion: 3\n{SECTIONS}variants: {{far: {{}}, WalkNear: {{}}}}\n",
            ["Walk-v3", "WalkFar-v3", "WalkNear-v3"],
        ),
        ("name: Walk\nextends: walk.yaml\nvariants: {}\n", ["Walk-v0"]),
        ("name: Walk\nstate: {}\nvariants: {far: {}}\n", ["WalkFar-v0"]),
        ("name: Walk\nversion: -1\nvariants: {far: {}}\n", ["WalkFar-v0"]),
        ("services: {web: {image: nginx}}\n", []),
        ("- a list\n", []),
        ("exam: Mine\nrules: {}\n", []),
        ("", []),
    ],
)
def test_a_file_registers_its_tasks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, names: list[str]
) -> None:
    monkeypatch.setattr(registry, "_registered", {})
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "walk.yaml").write_text(text, encoding="utf-8")
    (tmp_path / "mine" / "folder.yaml").mkdir()
    assert taskspec.register(tmp_path) == [f"mine/{name}" for name in names]


def test_a_file_that_is_no_yaml_is_an_error_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "walk.yaml").write_text("name: Walk\nreward: {\n", encoding="utf-8")
    span = refusal(taskspec.register, tmp_path).diagnostics[0].span
    assert span is not None
    assert span.origin.name == str(tmp_path / "walk.yaml")


def test_shipped_ids_are_those_of_the_files() -> None:
    expected = set()
    for path in registry.tasks_root().glob("*/*.yaml"):
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
        if "taskspec" not in data:
            continue
        names = [data["name"]]
        if not data.keys() >= {"state", "action", "initial", "dynamics", "reward", "horizon"}:
            names = []
        for key in data.get("variants", {}):
            if key.startswith(data["name"]):
                names.append(key)
            else:
                names.append(data["name"] + key[0].upper() + key[1:])
        expected |= {f"{path.parent.name}/{name}-v{data.get('version', 0)}" for name in names}
    assert set(registry.shipped()) == expected
