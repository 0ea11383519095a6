"""How the source and its tests are laid out: what imports what, and what is called what."""

from __future__ import annotations

import ast
import tomllib
from collections import defaultdict
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
                    yield from (f"{module}.{a.name}" if f"{module}.{a.name}" in known else module for a in names)
                case ast.Import(names=names):
                    yield from (a.name for a in names)
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
    graph = {name: {i for i in module.imports(found) if i in found and i != name} for name, module in found.items()}
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
    contracts = [c for c in config["tool"]["importlinter"]["contracts"] if c["type"] == "forbidden"]
    allowed = {
        package: contract.get("ignore_imports", [])
        for contract in contracts
        for package in contract["forbidden_modules"]
    }
    asked = [(m.name, name.partition(".")[0]) for m in SOURCE.values() for name in needed(m)]
    wrong = [
        f"{module} -> {package}"
        for module, package in asked
        if package in allowed and not any(fnmatch(f"{module} -> {package}", each) for each in allowed[package])
    ]
    assert len(asked) > 20 and wrong == []


APART = ("taskspec.language", "taskspec.programs", "taskspec.exact.model", "taskspec.exact.soundness")
"""Packages that take expressions and written sections apart; all others ask `taskspec.language.task.questions`."""
NODES = "taskspec.language.expressions.ir"


def takes_apart(module: Module) -> bool:
    """Return whether a module imports the nodes of expressions or reads an attribute named `surface`."""
    names = (node.attr for node in module.nodes if isinstance(node, ast.Attribute))
    return NODES in module.imports([NODES]) or "surface" in names


def test_only_few_packages_take_expressions_apart() -> None:
    others = [module for name, module in SOURCE.items() if not name.startswith(APART)]
    assert [module.name for module in others if takes_apart(module)] == []


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
    places = defaultdict(list)
    for module in SOURCE.values():
        for node in module.nodes:
            if isinstance(node, ast.ClassDef):
                places[node.name].append(module.name)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


@both
def test_every_file_says_what_is_in_it(found: dict[str, Module]) -> None:
    assert [name for name, module in found.items() if module.text and not ast.get_docstring(module.tree)] == []
