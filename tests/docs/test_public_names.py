"""What is public: names that modules list in `__all__`, each with a docstring, no others on pages for users; and commands."""

import ast
import importlib
import re
from itertools import chain

import taskspec
from docs.tools.commands import commands
from docs.tools.names import definition, names, public_modules, public_names
from taskspec.base.extras import is_installed
from taskspec.cli.app import COMMANDS, command_name
from tests.docs.test_snippets import PAGES, blocks
from tests.shared.commands import Done
from tests.shared.for_each import for_each

FOR_CONTRIBUTORS = ("architecture.md", "extending.md", "correctness.md")
NEEDS = {"taskspec.programs.jax": "jax", "taskspec.envs.functional": "jax", "taskspec.envs.sb3": "stable_baselines3"}


@for_each("module", public_modules())
def test_every_public_name_is_there_and_says_what_it_is(module: str) -> None:
    names = public_names(module)
    assert len(set(names)) == len(names)
    for name in names:
        _, text = definition(module, name)
        assert text and not name.startswith("_"), f"{module}.{name}"
    if module in NEEDS and not is_installed(NEEDS[module]):
        return
    found = importlib.import_module(module)
    assert tuple(found.__all__) == names
    for name in names:
        node, _ = definition(module, name)
        value = getattr(found, name)
        assert isinstance(node, ast.ClassDef) == isinstance(value, type)


def test_each_public_name_of_the_package_can_be_used() -> None:
    names = {*taskspec.__all__, "data", "envs", "exact", "exam", "experiments", "notebook"}
    assert names <= set(dir(taskspec))
    for name in names:
        assert getattr(taskspec, name).__name__.rpartition(".")[2] == name


def test_pages_for_users_use_public_names_alone() -> None:
    modules = set(public_modules())
    used = []
    for page in PAGES:
        if page.name not in FOR_CONTRIBUTORS:
            for block in blocks(page.read_text("utf-8"), language="python"):
                used += imported(block.body)
    assert len(used) > 20
    for module, name in used:
        assert f"{module}.{name}" in modules or (module in modules and name in public_names(module))


def imported(program: str) -> list[tuple[str, str]]:
    """The names of ours that a program takes: those it imports, and the attributes of `taskspec` that it uses."""
    found = []
    for node in ast.walk(ast.parse(program)):
        match node:
            case ast.ImportFrom(module=str(module), names=names) if module.partition(".")[0] == "taskspec":
                found += [(module, alias.name) for alias in names]
            case ast.Attribute(value=ast.Name(id="taskspec"), attr=name):
                found.append(("taskspec", name))
    return found


def test_the_page_has_every_public_name() -> None:
    page = names()
    for module in public_modules():
        section = page.partition(f"## {module}\n")[2].partition("\n## ")[0]
        for name in public_names(module):
            assert f"| `{name}" in section


@for_each("name", map(command_name, chain(*COMMANDS.values())))
def test_the_page_of_commands_has_the_options_that_the_help_prints(name: str) -> None:
    page = commands()
    assert f"\n### taskspec {name}\n" in page
    printed = Done(name, "--help").out
    assert f"taskspec {name}" in printed
    options = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", printed)) - {"--help"}
    assert options <= set(re.findall(r"`(--[a-z-]+)`", page))
