"""Compiled kernels, run as Python: every look-up in a table is checked, and every int that is said to fit 32 bits.

The generated loop is the one that Numba compiles; what it calls is the source of Numba's own library, without the decorators.
"""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from taskspec.language import draws
from taskspec.language.expressions.types import INT_MAX
from taskspec.language.expressions.variates import words_of
from taskspec.language.task.task import Task
from taskspec.programs.numba import loops, runtime
from taskspec.programs.numba.loops import Program
from taskspec.programs.numba.memory import row_names

Array = Any
FOLDER = Path(runtime.__file__).parent


class OutsideError(Exception):
    """A kernel would have read beyond a table, or lost digits of an int."""


class Table:
    """A constant array that is only read where it is."""

    def __init__(self, name: str, array: Array) -> None:
        self.name = name
        self.cells = list(array) if array.dtype.kind == "f" else array.tolist()

    def __len__(self) -> int:
        return len(self.cells)

    def __getitem__(self, i: int) -> Any:
        if not 0 <= i < len(self.cells):
            raise OutsideError(f"{self.name}[{i}], of {len(self.cells)}")
        return self.cells[i]


def _narrow(x: Any) -> int:
    value = int(x)
    if not -INT_MAX - 1 <= value <= INT_MAX:
        raise OutsideError(f"{value} has no 32 bits")
    return value


def _cast(dtype: Any) -> Callable[[Any], Any]:
    return lambda x: np.asarray(x).astype(dtype)[()]


def _bits(dtype: Any) -> Callable[[Any], Any]:
    return lambda x: np.asarray(x).view(dtype)[()]


def _called_by_kernels(text: str) -> str:
    """Return the source of the run-time functions that are plain Python, and of the constant that they need."""
    kept: list[ast.stmt] = []
    for node in ast.parse(text).body:
        is_plain = isinstance(node, ast.FunctionDef) and [ast.unparse(x) for x in node.decorator_list] in (
            ["inner"],
            ["apart"],
        )
        if is_plain or (isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "INT_MAX"):
            kept.append(node)
    return ast.unparse(ast.Module(kept, []))


@cache
def _library() -> dict[str, Any]:
    """The functions of Numba's library on NumPy's scalars, whose ints and reals are as wide as those of kernels."""
    space: dict[str, Any] = {
        "inner": lambda f: f, "apart": lambda f: f, "intrinsic": lambda f: f, "select": lambda c, a, b: a if c else b,
        "f32": _cast(np.float32), "f64": _cast(np.float64), "i32": _cast(np.int32), "i64": _cast(np.int64),
        "u32": _cast(np.uint32), "u64": _cast(np.uint64), "as_f32": _bits(np.float32), "as_i32": _bits(np.int32),
        "part": None,
    }  # fmt: skip
    text = (FOLDER / "kernel_draws.py").read_text()
    lines = [x for x in text.splitlines() if not x.startswith("from taskspec.programs.numba.runtime")]
    exec("\n".join(lines), space)
    space["math"] = math
    exec(_called_by_kernels((FOLDER / "runtime.py").read_text()), space)
    space["math"] = SimpleNamespace(copysign=np.copysign, isfinite=np.isfinite, sqrt=np.sqrt, nan=np.float64(math.nan))
    total: dict[str, Any] = {
        "exp": np.exp,
        "log": np.log,
        "sqrt": np.sqrt,
        "tan": np.tan,
        "tanh": np.tanh,
        "atan2": np.arctan2,
    }
    return (
        space
        | total
        | {"pow_": lambda a, b: np.power(np.float64(a), np.float64(b)), "np": np, "nan": math.nan, "inf": math.inf}
    )


class Kernel:
    """One environment of a task, stepped by the loop of its kernel: as Python, or compiled by Numba with bounds checked."""

    def __init__(self, task: Task, seed: int, compiled: bool = False) -> None:
        self.task = task
        self.seed = seed
        self.steps = 0
        self.time = 0
        self._program = Program(task, "disabled")
        function = loops.advance(self._program)
        self._rows = function.rows
        source = "\n".join(line for line in function.lines if not line.startswith("@"))
        self._advance = (_compiled if compiled else _as_python)(source, self._program.constants)

    def step(
        self, state: Sequence[tuple[Any, ...]], actions: Sequence[int]
    ) -> tuple[list[tuple[Any, ...]], float, bool]:
        """Next state, reward and whether it terminated, of a state at the present time."""
        given = self._words()
        for name, array in self._program.memory.block(1, 1).arrays.items():
            given |= zip(row_names(name, array.shape[:-1]), array.reshape(-1, 1), strict=True)
        for rows, flat in zip(self._program.states, state, strict=True):
            for row, value in zip(rows, flat, strict=True):
                given[row][0] = value
        given["time"][0] = self.time
        with np.errstate(all="ignore"):
            self._advance(1, np.array(actions, np.int64), *(given[row] for row in self._rows))
        self.steps = self.steps + 1
        self.time = self.time + 1
        following = [tuple(given[row][0].item() for row in rows) for rows in self._program.states]
        return following, float(given["reward"][0]), bool(given["terminated"][0])

    def _words(self) -> dict[str, Array]:
        """The words of the present step, and the reals that are made of them beforehand."""
        layout = self._program.step_words
        words = np.array(draws.words(self.seed, draws.STEP, self.steps, layout.count), np.uint32)
        found = {f"w_{k}": words[k : k + 1] for k in range(len(words))}
        for draw in layout.draws:
            first = layout.first[draw.site]
            mine = words[first : first + words_of(draw)][:, None]
            if draw.base in ("normal", "exponential"):
                reals = draws.normals(mine, draw.type.size) if draw.base == "normal" else draws.exponentials(mine)
                found |= {f"r_{first + k}": real for k, real in enumerate(reals)}
        return found


def _as_python(source: str, constants: Mapping[str, Array]) -> Callable[..., Any]:
    whole = {"i32": _narrow, "i64": int, "u64": lambda x: int(x) % 2**64, "u32": lambda x: int(x) % 2**32}
    space = _library() | whole | {name: Table(name, array) for name, array in constants.items()}
    exec(compile(_Reals().visit(ast.parse(source)), "kernel", "exec"), space)
    return lambda *rows: space["advance"](*(_Row(r) if isinstance(r, np.ndarray) else r for r in rows))


class _Reals(ast.NodeTransformer):
    """Reals that are written out, as NumPy's."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if not isinstance(node.value, float):
            return node
        call = ast.Call(ast.Name("f64", ast.Load()), [node], [])
        return ast.fix_missing_locations(ast.copy_location(call, node))


class _Row:
    """An array whose ints and conditions come as Python's, which have no width, and whose reals as NumPy's, which divide by 0."""

    def __init__(self, array: Array) -> None:
        self._array = array

    def __getitem__(self, i: int) -> Any:
        value = self._array[i]
        return value if isinstance(value, np.floating | np.uint32) else value.item()

    def __setitem__(self, i: int, value: Any) -> None:
        self._array[i] = value


def _compiled(source: str, constants: Mapping[str, Array]) -> Callable[..., Any]:
    import numba

    from taskspec.programs.numba import kernel_draws, runtime

    space = {**vars(math), **vars(runtime), **vars(kernel_draws), **vars(runtime), **constants}
    exec(source, space)
    return numba.njit(error_model="numpy", boundscheck=True)(space["advance"])  # type: ignore[no-any-return]
