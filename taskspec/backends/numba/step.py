"""The generated module of a Numba program: the step, and the reset, of many lanes.

`advance` is the step of n lanes and `begin` the first state of some of them: loops over lanes in which everything is a
scalar. `kernel` does either over the memory of an environment, block by block, so that what one loop leaves in the cache the
next one finds there.
"""

from __future__ import annotations

from collections.abc import Sequence

from taskspec.backends.numba.loops import (
    BAD,
    CHECK,
    CHECKED_STEP,
    RESET,
    STEP,
    WHAT,
    MemoryRow,
    Program,
    Shown,
    action_rows,
    advance,
    begin,
    check,
    indent,
)
from taskspec.backends.vector import Mode
from taskspec.lang.operators import OPERATORS
from taskspec.lang.variates import VARIATES, WordLayout
from taskspec.task.spaces import SpaceLayout
from taskspec.task.task import Task


def generate(
    task: Task, observation: SpaceLayout, action: SpaceLayout, mode: Mode, actions: str
) -> tuple[str, Program]:
    """Source of the module, and what it says about its memory; `actions` is the type code of the array of actions."""
    p = Program(task, observation, action, mode, actions)
    checking = check(p)
    advancing, advance_rows, shown = advance(p)
    beginning, begin_rows, begin_shown = begin(p)
    running = _kernel(p, advance_rows, shown, begin_rows, begin_shown)
    text = repr(f"{task.id}: a block of lanes at a time, for Numba. Generated; autoreset is {mode!r}.")
    tables = [f"{name} = np.array({array.tolist()}, np.{array.dtype})" for name, array in p.constants.items()]
    head = [text, "", "import numpy as np", "", _IMPORT, "", *tables, ""]
    return "\n".join([*head, *_blank([checking, advancing, beginning, running])]), p


_MATH = sorted({name for operator in OPERATORS.values() for name in operator.kernel.names})
_IMPORT = f"""from taskspec.backends.numba.runtime import *  # noqa: F403
from taskspec.backends.numba.draws import *  # noqa: F403
from math import {", ".join(_MATH)}"""


def _blank(functions: Sequence[Sequence[str]]) -> list[str]:
    return [line for function in functions for line in ("", *function, "")]


# -- running the loops over memory --------------------------------------------------------------------------------

_COUNTERS = {
    "k0": "u32s", "k1": "u32s", "steps": "u32s", "episodes": "u32s", "time": "i64s", "reward": "f64s",
    "terminated": "flags", "truncated": "flags", "ended": "flags",
}  # fmt: skip


def _views(p: Program, rows: Sequence[MemoryRow]) -> list[str]:
    """Return statements that name the arrays of a block."""
    lines = [f"{name} = {kind}({p.memory.at(name)}, first)" for name, kind in _COUNTERS.items()]
    for row in rows:
        scratch = row.array in ("words", "reals")
        source = row.source(p.memory, "i64(0)", str(p.width)) if scratch else row.source(p.memory)
        lines.append(f"{row.name} = {source}")
    return list(dict.fromkeys(lines))


def _kernel(
    p: Program, rows: Sequence[MemoryRow], shown: Shown, begin: Sequence[MemoryRow], begin_shown: Shown
) -> list[str]:
    """Check the actions of a range of lanes, step them, or begin episodes in those chosen, as `what` says.

    It is given two arrays as CPython passes objects, the program's memory and the actions, and gives the number of lanes
    whose episodes have ended, or `BAD`, as an int of Python's.
    """
    body = _views(p, [*rows, *begin])
    body += [f"lanes = i64s({p.memory.at('lanes')}, i64(0))", "late = 0"]
    body += [f"if what == {RESET}:", *indent(_choose(p)), "else:", *indent(_step(p, rows, shown))]
    body += ["if late > 0:", *indent(_begin_again(p, begin, begin_shown))]
    lines = [
        "m, data = u64s(numbers_of(memory), i64(0)), numbers_of(actions)",
        f"start, stop, every, what = i64(m[0]), i64(m[1]), i64(m[2]), i64(m[{WHAT}])",
        f"if what == {CHECK} or what == {CHECKED_STEP}:",
        f"    bad = check(stop - start, {_actions(p, 'start')})",
        f"    if bad > 0 or what == {CHECK}:",
        f"        return boxed(i64({BAD} if bad > 0 else 0))",
        "total, thread = 0, u64(0)",
        f"if what == {STEP}:",
        "    thread = release()",
        f"for first in range(start, stop, {p.block}):",
        *indent([f"n = min({p.block}, stop - first)", *body]),
        f"if what == {STEP}:",
        "    acquire(thread)",
        "return boxed(total)",
    ]
    return ["def kernel(memory, actions):", *indent(lines)]


def _actions(p: Program, lane: str) -> str:
    """Return the actions from a lane on."""
    kind = {"i": "i64s", "f": "f32s", "d": "f64s"}[p.actions]
    return f"{kind}(data, {lane} * {len(action_rows(p))})"


def _choose(p: Program) -> list[str]:
    """Return the lanes of a block whose flag `chosen` is set."""
    return [
        f"chosen = flags({p.memory.at('chosen')}, first)",
        "late = gather(n, chosen, lanes)",
        "for i in range(late):",
        "    j = u64(lanes[i])",
        "    terminated[j] = truncated[j] = ended[j] = False",
    ]


def _step(p: Program, rows: Sequence[MemoryRow], shown: Shown) -> list[str]:
    """Return the step of a block; `late` becomes the number of lanes that begin again, and `lanes` has theirs."""
    body = _LATE if p.mode == "next_step" else []
    body = [*body, f"part = {_actions(p, 'first')}"]
    body += _fill(p, p.step_words, "step_words(n", "k0, k1, steps", "n")
    arguments = ["n", "part", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
    body += [f"count = advance({', '.join([*arguments, *(r.name for r in rows)])})"]
    for row, (number, size) in shown.items():
        place = f"i64({p.width}), i64({number}), i64({size}), {p.memory.at('seen0')}, i64({row})"
        body.append(f"show(n, {p.memory.at('reals')}, {place}, every, first)")
    if p.mode == "same_step" and not p.inline_reset:
        body += ["if count > 0:", *indent(["late = gather(n, ended, lanes)", *_keep(p)])]
    if p.mode == "next_step":
        body += _UNDO
    return [*body, "total += count"]


_LATE = ["late = gather(n, ended, lanes)", "for i in range(late):", "    time[u64(lanes[i])] = 0"]
"""What the step makes of lanes that begin again is dropped; but it may look things up by the time."""
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
    """Return the last observations of the episodes that have ended."""
    lines = []
    for array in dict.fromkeys(r.array for r in p.seen):
        rows = [r for r in p.seen if r.array == array]
        kind = "keep_reals" if rows[0].kind == "f32s" else "keep_ints"
        final = p.memory.at(array.replace("seen", "final"))
        lines.append(f"{kind}(late, lanes, i64({len(rows)}), every, first, n, {p.memory.at(array)}, {final})")
    return lines


def _begin_again(p: Program, rows: Sequence[MemoryRow], shown: Shown) -> list[str]:
    lines = _fill(p, p.reset_words, "reset_words(late, lanes", "k0, k1, episodes", "late")
    lines.append(f"begin({', '.join(['late', 'lanes', 'time', 'episodes', *(r.name for r in rows)])})")
    for row, (number, size) in shown.items():
        place = f"i64({p.width}), i64({number}), i64({size}), {p.memory.at('seen0')}, i64({row})"
        lines.append(f"show_some(late, lanes, {p.memory.at('reals')}, {place}, every, first, n)")
    return lines


def _fill(p: Program, words: WordLayout, call: str, keys: str, n: str) -> list[str]:
    """Return statements that work out the words of a phase, and the normals and exponentials made of them."""
    if not words.count:
        return []
    w = p.memory.at("words")
    r = p.memory.at("reals")
    lines = [f"{call}, {w}, i64({p.width}), i64({(words.count + 1) // 2}), {keys})"]
    for draw in words.draws:
        loop = VARIATES[draw.base].loop
        if loop is not None:
            place = f"i64({words.first[draw.site]}), i64({draw.type.size})"
            lines.append(f"{loop}({n}, {w}, {r}, i64({p.width}), {place})")
    return lines
