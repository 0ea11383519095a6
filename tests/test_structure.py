"""How the source and its tests are laid out: what imports what, and what is called what."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cached_property
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import taskspec

FOLDER = Path(taskspec.__file__).parent


@dataclass(frozen=True)
class Module:
    """One source file."""

    name: str
    path: Path

    @cached_property
    def text(self) -> str:
        return self.path.read_text(encoding="utf-8")

    @cached_property
    def tree(self) -> ast.Module:
        return ast.parse(self.text)

    @cached_property
    def nodes(self) -> list[ast.AST]:
        return list(ast.walk(self.tree))

    def imports(self, known: Iterable[str]) -> Iterator[str]:
        """The modules that it names: in imports, those for types included, and in strings that are the name of a module.

        That a module's package is imported before it does not count, as Python itself puts up with that.
        """
        for node in self.nodes:
            match node:
                case ast.ImportFrom(module=str(module), names=names):
                    for alias in names:
                        whole = f"{module}.{alias.name}"
                        yield whole if whole in known else module
                case ast.Import(names=names):
                    for alias in names:
                        yield alias.name
                case ast.Constant(value=str(text)) if "." in text:
                    yield text


def modules(folder: Path, package: str) -> dict[str, Module]:
    """The modules of a package by their full names."""
    found = {}
    for path in sorted(folder.rglob("*.py")):
        parts = path.relative_to(folder).with_suffix("").parts
        name = ".".join((package, *parts)).removesuffix(".__init__")
        found[name] = Module(name, path)
    return found


def circle(found: dict[str, Module]) -> list[str]:
    """Modules each of which imports the next, the last one being the first again; empty if there are none."""
    graph = {name: found.keys() & set(module.imports(found)) - {name} for name, module in found.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []


SOURCE = modules(FOLDER, "taskspec")
TESTS = modules(Path(__file__).parent, "tests")
both = pytest.mark.parametrize("found", [SOURCE, TESTS], ids=["taskspec", "tests"])


def test_no_file_imports_itself_by_way_of_others() -> None:
    assert circle(SOURCE) == []


@pytest.mark.parametrize(
    "back",
    [
        "import package.a",
        "from package import a",
        "from package.a import thing",
        "def later():\n    from package.a import thing",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from package.a import thing",
        "import importlib\nthing = importlib.import_module('package.a')",
        "PLACES = {'thing': 'package.a'}",
    ],
)
def test_every_way_to_import_is_seen(tmp_path: Path, back: str) -> None:
    for name, text in {"__init__": "", "a": "from package import b", "b": "import package.c as c", "c": back}.items():
        (tmp_path / f"{name}.py").write_text(text)
    assert set(circle(modules(tmp_path, "package"))) == {"package.a", "package.b", "package.c"}
    (tmp_path / "c.py").write_text("import package.d\nthing = 'package'")
    assert circle(modules(tmp_path, "package")) == []


def needed(module: Module) -> Iterator[str]:
    """The modules of optional packages that it asks `need` for, by their names as texts."""
    for node in module.nodes:
        match node:
            case ast.Call(func=ast.Name(id="need"), args=[ast.Constant(value=str(name)), *_]):
                yield name


def test_optional_packages_are_imported_where_the_contracts_say() -> None:
    config = tomllib.loads((FOLDER.parent / "pyproject.toml").read_text(encoding="utf-8"))
    allowed = {}
    for contract in config["tool"]["importlinter"]["contracts"]:
        if contract["type"] == "forbidden":
            allowed |= dict.fromkeys(contract["forbidden_modules"], contract.get("ignore_imports", ()))
    count = 0
    for module in SOURCE.values():
        for name in needed(module):
            package = name.partition(".")[0]
            asked = f"{module.name} -> {package}"
            count += 1
            assert package not in allowed or any(fnmatch(asked, pattern) for pattern in allowed[package]), asked
    assert count > 20


APART = ("taskspec.language", "taskspec.programs", "taskspec.exact.model", "taskspec.exact.soundness")
"""Packages that take expressions and written sections apart; all others ask `taskspec.language.task.questions`."""
NODES = "taskspec.language.expressions.ir"


def takes_apart(module: Module) -> bool:
    """Return whether a module imports the nodes of expressions or reads an attribute named `surface`."""
    reads_surface = any(isinstance(node, ast.Attribute) and node.attr == "surface" for node in module.nodes)
    return NODES in module.imports([NODES]) or reads_surface


def test_only_few_packages_take_expressions_apart() -> None:
    for name, module in SOURCE.items():
        assert name.startswith(APART) or not takes_apart(module), name


@pytest.mark.parametrize(
    "text",
    [
        f"from {NODES} import Const",
        "from taskspec.language.expressions import ir",
        f"def later():\n    import {NODES} as nodes",
        "written = task.source.surface.sections",
    ],
)
def test_every_way_to_take_expressions_apart_is_seen(tmp_path: Path, text: str) -> None:
    (tmp_path / "a.py").write_text(text)
    assert takes_apart(Module("a", tmp_path / "a.py"))


def test_a_class_name_means_one_thing() -> None:
    places: dict[str, str] = {}
    for module in SOURCE.values():
        for node in module.nodes:
            if isinstance(node, ast.ClassDef):
                assert node.name not in places, (node.name, module.name, places[node.name])
                places[node.name] = module.name


@both
def test_every_file_says_what_is_in_it(found: dict[str, Module]) -> None:
    for name, module in found.items():
        assert not module.text or ast.get_docstring(module.tree), name
