"""Smaller specs with the same fault: parts are left out or replaced by simpler ones as long as it stays."""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Callable, Iterator
from typing import Any

from tests.verification.oracle.reference.syntax import PRIME, parse

Data = dict[str, Any]
Path = tuple[Any, ...]
OPTIONAL = ("variants", "expert", "observation", "terminal", "discount", "absorbing_reward", "measures", "legal", "noise",
            "definitions", "constants", "parameters")  # fmt: skip
DECLARED = ("parameters", "state", "action", "taskspec", "name")
SIMPLE = (0, 1, "true", "false", 0.5)


def minimised(spec: Data, still: Callable[[Data], bool], tries: int = 400) -> Data:
    """The smallest spec found within so many tries that still has the fault."""
    best = spec
    while tries > 0:
        for candidate in candidates(best):
            tries -= 1
            if tries <= 0 or still(candidate):
                break
        else:
            return best
        if tries > 0:
            best = candidate
    return best


def candidates(spec: Data) -> Iterator[Data]:
    """Specs that are a little simpler: whole sections first, single numbers last."""
    for section in OPTIONAL:
        if section in spec:
            yield without(spec, (section,))
    for path, value in list(parts(spec)):
        if len(path) > 1 and isinstance(path[-1], str) and len(at(spec, path[:-1])) > 1 and not is_declared(path):
            yield without(spec, path)
        if path[0] in DECLARED:
            continue
        for simpler in simplifications(value):
            yield replaced(spec, path, simpler)


def is_declared(path: Path) -> bool:
    """Whether this is a part of a declaration, which means something else without it."""
    return path[0] in DECLARED and len(path) > 2


def parts(data: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """All places of a spec, from the outermost."""
    if path:
        yield path, data
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in items:
        yield from parts(value, (*path, key))


def at(data: Any, path: Path) -> Any:
    for key in path:
        data = data[key]
    return data


def without(spec: Data, path: Path) -> Data:
    made = copy.deepcopy(spec)
    del at(made, path[:-1])[path[-1]]
    return made


def replaced(spec: Data, path: Path, value: Any) -> Data:
    made = copy.deepcopy(spec)
    at(made, path[:-1])[path[-1]] = value
    return made


def simplifications(value: Any) -> Iterator[Any]:
    match value:
        case str():
            yield from simpler_texts(value)
        case [{"if": _, "then": _}, *_]:
            yield from (v for entry in value for k, v in entry.items() if k != "if")
        case {"by": _, "rows": dict(rows)}:
            yield from rows.values()
        case dict() | list():
            yield from (v for v in (value.values() if isinstance(value, dict) else value) if isinstance(v, str | int))


def simpler_texts(text: str) -> Iterator[Any]:
    """An expression with one part replaced by one of its own parts, or by a constant."""
    try:
        tree = parse(text)
    except SyntaxError:
        return
    size = len(text)
    yield from (s for s in SIMPLE if len(str(s)) < size)
    nodes = [n for n in ast.walk(tree) if isinstance(n, ast.expr)]
    for node in nodes:
        inside = [child for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]
        for other in [*inside, ast.Constant(0), ast.Constant(1), ast.Constant(True)]:
            shorter = written(tree, node, other)
            if len(shorter) < size:
                yield shorter


def written(tree: ast.expr, old: ast.expr, new: ast.expr) -> str:
    """The text of a tree with one node replaced by another."""

    class Swap(ast.NodeTransformer):
        def visit(self, node: ast.AST) -> ast.AST:
            return new if node is old else self.generic_visit(node)

    text = ast.unparse(Swap().visit(_copy(tree, old, new)))
    return re.sub(rf"(\w+){PRIME}\b", r"\1'", text)


def _copy(tree: ast.expr, *kept: ast.expr) -> ast.expr:
    """A copy that shares the nodes that are to be found in it."""
    return copy.deepcopy(tree, {id(node): node for node in kept})
