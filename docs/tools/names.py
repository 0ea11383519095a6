"""The page of public names, read from the source: what modules list in `__all__`, and what their docstrings say.

Nothing is imported, so that the page is the same with any extras.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import taskspec
from docs.tools.markdown import code, table

PACKAGE = Path(taskspec.__file__).parent
HEAD = """# Public names

Generated from the source. These names, under these modules, are the public interface: what changes of them is in the
changelog. A module without `__all__` is private, and so is a name that is not in it.
[The Python API](api.md) shows how they are used; `help(taskspec.load)` prints arguments, results and errors.
"""


def names() -> str:
    """The page."""
    modules = public_modules()
    return "\n\n".join([HEAD.rstrip("\n"), _contents(modules), *map(_section, modules)]) + "\n"


def _contents(modules: list[str]) -> str:
    """A link to each module, with its names."""
    lines = []
    for module in modules:
        names = ", ".join(code(name) for name in sorted(public_names(module), key=str.lower))
        lines.append(f"- [{module}](#{module.replace('.', '')}): {names}")
    return "\n".join(lines)


def public_modules() -> list[str]:
    """The modules that have `__all__`."""
    paths = (path.relative_to(PACKAGE.parent).with_suffix("") for path in sorted(PACKAGE.rglob("*.py")))
    names = (".".join(path.parts).removesuffix(".__init__") for path in paths)
    return sorted(name for name in names if public_names(name))


@lru_cache
def public_names(module: str) -> tuple[str, ...]:
    """What a module lists in `__all__`; nothing for a module that has none."""
    for node in _tree(module).body if "__all__" in _source(module) else ():
        match node:
            case ast.Assign(targets=[ast.Name(id="__all__")], value=value):
                return tuple(ast.literal_eval(value))
    return ()


def _section(module: str) -> str:
    """What a module offers."""
    rows = (_row(module, name) for name in sorted(public_names(module), key=str.lower))
    about = _first_paragraph(ast.get_docstring(_tree(module)))
    return "\n\n".join([f"## {module}", about, table(("name", "what it is"), rows).rstrip("\n")])


def _row(module: str, name: str) -> tuple[str, str]:
    node, text = definition(module, name)
    called = f"{name}({_arguments(node)})" if isinstance(node, ast.FunctionDef) else name
    return code(called), _first_paragraph(text)


def _arguments(function: ast.FunctionDef) -> str:
    """The parameters of a function, without their types."""
    found = function.args
    for each in (*found.posonlyargs, *found.args, *found.kwonlyargs, found.vararg, found.kwarg):
        if each is not None:
            each.annotation = None
    return ast.unparse(found)


def definition(module: str, name: str) -> tuple[ast.stmt, str | None]:
    """Where a name is defined, through the imports of modules that hand it on, and its docstring."""
    for node, after in _statements(module):
        match node:
            case ast.ImportFrom(module=str(source), names=names):
                found = next((alias.name for alias in names if (alias.asname or alias.name) == name), None)
                if found is not None:
                    return definition(source, found)
            case ast.ClassDef() | ast.FunctionDef() if node.name == name:
                return node, ast.get_docstring(node)
            case ast.Assign(targets=[ast.Name(id=target)]) | ast.AnnAssign(target=ast.Name(id=target)) if (
                target == name
            ):
                return node, _text(after)
    raise KeyError(f"{module} lists {name!r} and does not define it")


def _statements(module: str) -> Iterator[tuple[ast.stmt, ast.stmt | None]]:
    """The statements of a module, those under a condition included, each with the one after it."""
    bodies = [_tree(module).body]
    while bodies:
        body = bodies.pop(0)
        bodies += [node.body for node in body if isinstance(node, ast.If)]
        yield from zip(body, [*body[1:], None], strict=True)


def _text(node: ast.stmt | None) -> str | None:
    match node:
        case ast.Expr(value=ast.Constant(value=str(text))):
            return text
    return None


def _first_paragraph(text: str | None) -> str:
    return "" if text is None else " ".join(text.partition("\n\n")[0].split())


@lru_cache
def _tree(module: str) -> ast.Module:
    return ast.parse(_source(module))


def _source(module: str) -> str:
    path = PACKAGE.parent.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return file.read_text(encoding="utf-8")
