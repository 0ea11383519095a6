"""The distribution as others get it: a wheel, built here and unpacked, and the checkout; what both say of missing packages."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from email.message import Message
from email.parser import Parser
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from tests.conftest import ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOURCES = sorted((ROOT / "taskspec").rglob("*.py"))
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
INSTALLED = re.compile(r"pip install (?:-e )?(?:'([^']+)'|\"([^\"]+)\"|(\S+))")
BUILD = "import sys, hatchling.build; hatchling.build.build_wheel(sys.argv[1])"
WITHOUT_MATPLOTLIB = """
import sys
sys.modules["matplotlib"] = None
import taskspec
try:
    taskspec.make("RiskyPath", render_mode="rgb_array")
except taskspec.SpecError as error:
    print(error)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that the wheel of this checkout is unpacked in, as an installation does it."""
    pytest.importorskip("hatchling", reason="what builds the wheel is not installed: it comes with the extra test")
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, "-c", BUILD, str(folder)], cwd=ROOT, check=True, capture_output=True)
    (built,) = folder.glob("*.whl")
    with zipfile.ZipFile(built) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


@pytest.fixture(scope="module")
def metadata(wheel: Path) -> Message:
    (path,) = wheel.glob("*.dist-info/METADATA")
    return Parser().parsestr(path.read_text(encoding="utf-8"))


def python(code: str, package: Path, folder: Path) -> str:
    """What a program prints that runs in a folder and finds the package in another; no `.pth` file is read."""
    path = os.pathsep.join([str(package), sysconfig.get_path("purelib")])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-S", "-c", code]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.stderr == ""
    return done.stdout


# -- what to install ----------------------------------------------------------------------------------------------


def test_a_wheel_names_the_distribution_to_install(wheel: Path, metadata: Message, tmp_path: Path) -> None:
    assert "figures" in metadata.get_all("Provides-Extra", [])
    assert f'pip install "{metadata["Name"]}[figures]"' in python(WITHOUT_MATPLOTLIB, wheel, tmp_path)


def test_a_checkout_names_its_folder(tmp_path: Path) -> None:
    assert 'pip install -e ".[figures]"' in python(WITHOUT_MATPLOTLIB, ROOT, ROOT)
    assert f'pip install -e "{ROOT}[figures]"' in python(WITHOUT_MATPLOTLIB, ROOT, tmp_path)


def test_every_extra_that_code_asks_for_is_declared() -> None:
    places = {"need": 1, "install": 0}
    asked = {
        call.args[places[call.func.id]]
        for path in SOURCES
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id in places
        if len(call.args) > places[call.func.id]
    }
    names = {node.value for node in asked if isinstance(node, ast.Constant)}
    assert {"figures", "docs"} <= names <= set(EXTRAS)


def test_extras_may_be_installed_together_with_the_newest_versions() -> None:
    """imitation 1.0.1 needs a Stable-Baselines3 of 2.2; gymnax 1.0 needs JAX 0.10."""
    versions = {"sb3": "2.2.1", "jax": "0.10.2"}
    for extra, version in versions.items():
        (requirement,) = EXTRAS[extra]
        assert Requirement(requirement).specifier.contains(version)


def test_one_module_writes_commands_that_install() -> None:
    assert [p.name for p in SOURCES if "pip install" in p.read_text(encoding="utf-8")] == ["extras.py"]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_pages_install_the_checkout_with_extras_that_are_declared(path: Path) -> None:
    for found in INSTALLED.findall(path.read_text(encoding="utf-8")):
        name, _, extras = "".join(found).rstrip("]`").partition("[")
        if "==" in name or name == "--no-deps":  # another version of a library that is compared
            continue
        assert name == "."
        assert set(extras.split(",")) - {""} <= set(EXTRAS)


# -- metadata, and registration -----------------------------------------------------------------------------------


def test_links_of_the_metadata_lead_somewhere_without_the_repository(metadata: Message) -> None:
    text = metadata.get_payload()
    assert isinstance(text, str)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)]*)\)", text)
    assert targets == [t for t in re.findall(r"\]\(([^)]*)\)", readme) if t.startswith("https://")] != []
    assert "Your first task in ten minutes" in text


def registered(code: str, package: Path) -> bool:
    """Whether Gymnasium knows a shipped task after a program; no `.pth` file is read at the start of Python."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(package), sysconfig.get_path("purelib")])}
    code = f"{code}; import gymnasium; print('derail/Sort-v0' in gymnasium.registry)"
    done = subprocess.run(
        [sys.executable, "-S", "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout == "True\n"


@pytest.mark.parametrize(
    "code",
    [
        "import gymnasium, taskspec",
        "import gymnasium; gymnasium.make('taskspec:derail/Branching-v0')",
        "import taskspec, gymnasium",
        "import taskspec, gymnasium; gymnasium.make('derail/Branching-v0')",
        "import taskspec, gymnasium; gymnasium.make('taskspec:derail/Branching-v0')",
        "import taskspec.language.registry",
        "from taskspec.envs import making",
        "from taskspec.envs.making import register",
    ],
)
def test_tasks_are_registered_by_an_import(wheel: Path, code: str) -> None:
    assert registered(code, wheel)


def test_an_environment_imports_nothing_that_only_tools_need() -> None:
    modules = python("import sys, taskspec; taskspec.make('RiskyPath')\nprint(*sys.modules)", ROOT, ROOT).split()
    assert "taskspec.language.task.build" in modules
    assert not {"jinja2", "scipy", "taskspec.exam"} & set(modules)
