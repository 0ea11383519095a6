"""The distribution as others get it: a wheel, built here and unpacked, and the checkout; what both say of missing packages."""

import ast
import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from email.message import Message
from email.parser import Parser
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement

import taskspec
from tests.conftest import ROOT
from tests.shared.for_each import for_each

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))
SOURCES = sorted((ROOT / "taskspec").rglob("*.py"))
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
INSTALLED = re.compile(r"pip install (?:-[eq] )?(?:'([^']+)'|\\?\"([^\"\\]+)\\?\"|(\S+))")
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


GIT = {"vcs": "git", "commit_id": "0a1b2c"}
FIGURES = '"{}"'.format('" "'.join(sorted(EXTRAS["figures"])))
STUDIO = f'{FIGURES} "pygls>=2" "starlette>=0.40" "uvicorn>=0.35" "websockets>=13"'
"""The extra `studio` takes in `figures` and `editor`."""


ORIGINS: tuple[tuple[dict[str, Any], str, str], ...] = (
    ({}, "figures", '"taskspec-rl[figures]"'),
    ({"url": ROOT.as_uri(), "dir_info": {}}, "figures", f'"{ROOT}[figures]"'),
    ({"url": Path(__file__).as_uri(), "archive_info": {}}, "docs", f'"{__file__}[docs]"'),
    ({"url": "file:///gone/to/dust.whl", "archive_info": {}}, "figures", FIGURES),
    ({"url": "file:///gone", "dir_info": {}}, "studio", STUDIO),
    ({"url": "https://a.org/b.whl", "archive_info": {}}, "jax", '"taskspec-rl[jax] @ https://a.org/b.whl"'),
    ({"url": "https://a.org/b", "vcs_info": GIT}, "jax", '"taskspec-rl[jax] @ git+https://a.org/b@0a1b2c"'),
)
INSTALL = """
import json, pathlib, sys
from taskspec.base.extras import install
record = pathlib.Path({record!r})
for origin, extra, _ in json.loads({origins!r}):
    if origin:
        record.write_text(json.dumps(origin))
    print(install(extra))
    record.unlink(missing_ok=True)
"""


def test_an_installed_package_names_the_place_that_it_was_installed_from(wheel: Path, tmp_path: Path) -> None:
    (folder,) = wheel.glob("*.dist-info")
    program = INSTALL.format(record=str(folder / "direct_url.json"), origins=json.dumps(ORIGINS))
    for printed, (_, _, named) in zip(python(program, wheel, tmp_path).splitlines(), ORIGINS, strict=True):
        assert printed == f"pip install {named}"


def test_a_checkout_names_its_folder(tmp_path: Path) -> None:
    assert 'pip install -e ".[figures]"' in python(WITHOUT_MATPLOTLIB, ROOT, ROOT)
    assert f'pip install -e "{ROOT}[figures]"' in python(WITHOUT_MATPLOTLIB, ROOT, tmp_path)


def test_every_extra_that_code_asks_for_is_declared() -> None:
    names = set()
    for path in SOURCES:
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            match call:
                case ast.Call(func=ast.Name(id="need"), args=[_, ast.Constant(value=name), *_]):
                    names.add(name)
                case ast.Call(func=ast.Name(id="install"), args=[ast.Constant(value=name), *_]):
                    names.add(name)
    assert {"figures", "docs"} <= names <= set(EXTRAS)


def test_extras_may_be_installed_together_with_the_newest_versions() -> None:
    """imitation 1.0.1 needs a Stable-Baselines3 of 2.2; gymnax 1.0 needs JAX 0.10."""
    versions = {"sb3": "2.2.1", "jax": "0.10.2"}
    for extra, version in versions.items():
        (requirement,) = EXTRAS[extra]
        assert Requirement(requirement).specifier.contains(version)


def test_one_module_writes_commands_that_install() -> None:
    assert [p.name for p in SOURCES if "pip install" in p.read_text(encoding="utf-8")] == ["extras.py"]


@for_each("path", PAGES + NOTEBOOKS)
def test_pages_install_the_checkout_with_extras_that_are_declared(path: Path) -> None:
    for found in INSTALLED.findall(path.read_text(encoding="utf-8")):
        name, _, extras = "".join(found).rstrip("]`").partition("[")
        if "==" in name or name == "--no-deps":  # another version of a library that is compared
            continue
        is_wheel = fnmatch(f"taskspec_rl-{taskspec.__version__}-py3-none-any.whl", Path(name).name)
        assert is_wheel or name in (".", "../taskspec", "../../..")
        assert set(extras.split(",")) - {""} <= set(EXTRAS)


def test_the_metadata_declare_every_licence_in_the_wheel(wheel: Path, metadata: Message) -> None:
    shipped = {path.relative_to(wheel).as_posix() for path in wheel.glob("taskspec/**/*licen[cs]e*")}
    assert shipped
    declared = metadata.get_all("License-File", [])
    assert set(declared) == {"LICENSE", *shipped}
    (folder,) = wheel.glob("*.dist-info")
    for name in declared:
        assert (folder / "licenses" / name).is_file()


def test_links_of_the_metadata_lead_somewhere_without_the_repository(metadata: Message) -> None:
    text = metadata.get_payload()
    assert isinstance(text, str)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)]*)\)", text)
    assert targets == re.findall(r"\]\((https://[^)]*)\)", readme) != []
    assert "your first task in ten minutes" in text


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
        "import taskspec, gymnasium; gymnasium.make('derail/Branching-v0')",
        "import taskspec.language.registry",
        "from taskspec.envs.making import register",
    ],
)
def test_tasks_are_registered_by_an_import(wheel: Path, code: str) -> None:
    assert registered(code, wheel)


def test_an_environment_imports_nothing_that_only_tools_need() -> None:
    modules = python("import sys, taskspec; taskspec.make('RiskyPath')\nprint(*sys.modules)", ROOT, ROOT).split()
    assert "taskspec.language.task.build" in modules
    assert not {"jinja2", "scipy", "taskspec.exam"} & set(modules)
