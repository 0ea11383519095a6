"""The generated module of a task: the functions that Python calls, which run loops on the memory of an environment."""

from __future__ import annotations

from taskspec.language.expressions.operators import OPERATORS
from taskspec.language.expressions.variates import VARIATES, WordLayout
from taskspec.language.task.task import Task
from taskspec.programs import indent
from taskspec.programs.numba.loops import LoopFunction, Program, action_places, advance, begin, check
from taskspec.programs.vector_program import Mode

BAD = -1
"""Result of `step` for an action outside the action space; nothing has changed then."""
_MATH = sorted({name for operator in OPERATORS.values() for name in operator.kernel.names})
_IMPORTS = [
    "import numpy as np", "",
    "from taskspec.programs.numba.runtime import *  # noqa: F403",
    "from taskspec.programs.numba.kernel_draws import *  # noqa: F403",
    f"from math import {', '.join(_MATH)}", "",
]  # fmt: skip


def generate(task: Task, mode: Mode) -> tuple[str, Program]:
    """Write the source of the module, with the layout of its memory."""
    p = Program(task, mode)
    advancing = advance(p)
    beginning = begin(p)
    functions = [check(p).lines, advancing.lines, beginning.lines, _step(p, advancing, beginning), _reset(p, beginning)]
    text = repr(f"{task.id}: a block of lanes at a time, for Numba. Generated; autoreset is {mode!r}.")
    tables = []
    for name, array in p.constants.items():
        tables.append(f"{name} = np.array({array.tolist()}, np.{array.dtype})")
    head = [text, "", *_IMPORTS, *tables, ""]
    for function in functions:
        head += ["", *function, ""]
    return "\n".join(head), p


def _step(p: Program, advancing: LoopFunction, beginning: LoopFunction) -> list[str]:
    """Check all actions, then step the lanes from `start` to `stop`; return how many episodes ended."""
    body = [
        f"given = part(actions, first * {len(action_places(p))})",
        *_fill(p, p.step_words, "step_words(n", "k0, k1, steps", "n"),
        f"count = advance({', '.join(['n', 'given', *advancing.rows])})",
    ]
    for shown in advancing.shown:
        body.append(f"show(n, r_{shown.word}, i64({p.width}), i64({shown.size}), {shown.row}, pitch)")
    again = _begin(p, beginning)
    if p.mode == "next_step":
        body = [*_LATE, *body, *_UNDO, "if late > 0:", *indent(again)]
    elif p.mode == "same_step" and not p.inline_reset:
        body += ["if count > 0:", *indent(["late = gather(n, ended, lanes)", *_keep(p), *again])]
    lines = [
        "if check(len(actions), part(actions, i64(0))) > 0:",
        f"    return {BAD}",
        "total = 0",
        *_blocks(p, [*body, "total += count"]),
        "return total",
    ]
    return ["@kernel", "def step(memory, pitch, start, stop, scratch, actions):", *indent(lines)]


def _reset(p: Program, beginning: LoopFunction) -> list[str]:
    """Begin episodes in those lanes from `start` to `stop` that are `chosen`."""
    body = _blocks(p, ["late = gather(n, chosen, lanes)", *_begin(p, beginning)])
    return ["@kernel", "def reset(memory, pitch, start, stop, scratch):", *indent(body)]


def _blocks(p: Program, body: list[str]) -> list[str]:
    rows = []
    for row in p.rows_in(body):
        rows.append(f"{row} = {p.rows[row]}")
    lines = [f"n = min({p.block}, stop - first)", *rows, *body]
    return [f"for first in range(start, stop, {p.block}):", *indent(lines)]


_LATE = ["late = gather(n, ended, lanes)", "for i in range(late):", "    time[u64(lanes[i])] = 0"]
"""The step's results for lanes that begin again are dropped; but it may look things up by the time."""
_UNDO = [
    "for i in range(late):",
    "    j = u64(lanes[i])",
    "    count -= i64(ended[j])",
    "    steps[j] = u32(steps[j] - u32(1))",
    "    reward[j] = 0.0",
    "    terminated[j] = truncated[j] = ended[j] = False",
]
"""Lanes that begin again in this step take none."""


def _keep(p: Program) -> list[str]:
    lines = []
    for rows in p.seen:
        lines.append(f"keep(late, lanes, i64({len(rows)}), {rows[0]}, {p.final[rows[0]]}, pitch)")
    return lines


def _begin(p: Program, beginning: LoopFunction) -> list[str]:
    lines = _fill(p, p.reset_words, "reset_words(late, lanes", "k0, k1, episodes", "late")
    lines.append(f"begin({', '.join(['late', *beginning.rows])})")
    for shown in beginning.shown:
        lines.append(f"show_some(late, lanes, r_{shown.word}, i64({p.width}), i64({shown.size}), {shown.row}, pitch)")
    return lines


def _fill(p: Program, words: WordLayout, call: str, keys: str, n: str) -> list[str]:
    if not words.count:
        return []
    lines = [f"{call}, w_0, i64({p.width}), i64({(words.count + 1) // 2}), {keys})"]
    for draw in words.draws:
        loop = VARIATES[draw.base].loop
        if loop is not None:
            lines.append(f"{loop}({n}, w_{words.first[draw.site]}, i64({p.width}), i64({draw.type.size}))")
    return lines
