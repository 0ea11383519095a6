"""The generated module of a Numba program: one step, and the reset, of a block of lanes.

`advance` is the step of n lanes and `begin` the first state of some of them: loops over lanes in which everything is a
scalar. `step` and `reset` run them over the memory of an environment, block by block, so that what one loop leaves in the
cache the next one finds there.
"""

from __future__ import annotations

from collections.abc import Sequence

from taskspec.backends.kernelloop import Shown, action_rows, advance, begin, check, indent
from taskspec.backends.kernelmemory import Program, Row
from taskspec.backends.vector import Mode
from taskspec.draws.layout import Layout as WordLayout
from taskspec.spec.spaces import Layout
from taskspec.spec.task import Task


def generate(task: Task, observation: Layout, action: Layout, mode: Mode) -> tuple[str, Program]:
    """Source of the module, and what it says about its memory."""
    p = Program(task, observation, action, mode)
    checking = check(p)
    advancing, advance_rows, shown = advance(p)
    beginning, begin_rows, begin_shown = begin(p)
    step = _step(p, advance_rows, shown, begin_rows, begin_shown)
    reset = _reset(p, begin_rows, begin_shown)
    text = repr(f"{task.id}: a block of lanes at a time, for Numba. Generated; autoreset is {mode!r}.")
    tables = [f"{name} = np.array({array.tolist()}, np.{array.dtype})" for name, array in p.constants.items()]
    head = [text, "", "import numpy as np", "", _IMPORT, "", *tables, ""]
    return "\n".join([*head, *_blank([checking, advancing, beginning, step, reset])]), p


_IMPORT = "\n".join(
    f"from taskspec.backends.numba.{module} import *  # noqa: F403"
    for module in ("basics", "draws", "operators", "lanes")
)


def _blank(functions: Sequence[Sequence[str]]) -> list[str]:
    return [line for function in functions for line in ("", *function, "")]


# -- running the loops over memory --------------------------------------------------------------------------------

_COUNTERS = {
    "k0": "u32s", "k1": "u32s", "steps": "u32s", "episodes": "u32s", "time": "i64s", "reward": "f64s",
    "terminated": "bools", "truncated": "bools", "ended": "bools",
}  # fmt: skip


def _views(p: Program, rows: Sequence[Row]) -> list[str]:
    """Statements that name the arrays of a block."""
    lines = [f"{name} = {kind}({p.memory.at(name)}, first, n)" for name, kind in _COUNTERS.items()]
    for row in rows:
        scratch = row.array in ("words", "reals")
        source = row.source(p.memory, "i64(0)", str(p.block)) if scratch else row.source(p.memory)
        lines.append(f"{row.name} = {source}")
    return list(dict.fromkeys(lines))


def _step(
    p: Program,
    rows: Sequence[Row],
    shown: Shown,
    begin: Sequence[Row],
    begin_shown: Shown,
) -> list[str]:
    arguments = ["n", "part", "steps", "episodes", "time", "reward", "terminated", "truncated", "ended"]
    width = len(action_rows(p))
    part = "actions[first:first + n]" if width == 1 else f"actions[first * {width}:(first + n) * {width}]"
    body = _views(p, [*rows, *begin])
    body += [f"part = {part}", f"lanes = i64s({p.memory.at('lanes')}, i64(0), i64({p.block + 1}))"]
    if p.mode == "next_step":
        body += ["late = gather(n, ended, lanes)"]
    body += _fill(p, p.step_words, "step_words(n", "k0, k1, steps", "n")
    body += [f"count = advance({', '.join([*arguments, *(r.name for r in rows)])})"]
    for row, (number, size) in shown.items():
        seen = p.memory.at("seen0")
        body.append(
            f"show(n, {p.memory.at('reals')}, i64({p.block}), i64({number}), i64({size}), {seen}, i64({row}), every, first)"
        )
    body += _restart(p, begin, begin_shown)
    flat = "actions = actions.ravel()"
    bad = [f"if check(stop - start, actions[start * {width}:stop * {width}]) > 0:", "    return -1"]
    return [
        "@outer",
        "def step(m, actions):",
        *indent([*_RANGE, flat, *bad, "total = 0", *_blocks(p, [*body, "total += count"])]),
        "    return total",
    ]


_RANGE = ["start, stop, every = i64(m[0]), i64(m[1]), i64(m[2])"]


def _blocks(p: Program, body: Sequence[str]) -> list[str]:
    """A loop over the blocks of the range."""
    return [f"for first in range(start, stop, {p.block}):", *indent([f"n = min({p.block}, stop - first)", *body])]


def _restart(p: Program, begin: Sequence[Row], shown: Shown) -> list[str]:
    """What follows the step of a block: lanes that have ended begin again."""
    if p.mode == "disabled" or p.inline_reset:
        return []
    if p.mode == "same_step":
        return [
            "if count > 0:",
            *indent(["late = gather(n, ended, lanes)", *_keep(p), *_begin_again(p, begin, shown)]),
        ]
    undo = [
        "for i in range(late):",
        "    j = u64(lanes[i])",
        "    count -= i64(ended[j])",
        "    steps[j] = u32(steps[j] - u32(1))",
        "    reward[j] = 0.0",
        "    terminated[j] = truncated[j] = ended[j] = False",
    ]
    return ["if late > 0:", *indent([*undo, *_begin_again(p, begin, shown)])]


def _keep(p: Program) -> list[str]:
    lines = []
    for array in dict.fromkeys(r.array for r in p.seen):
        rows = [r for r in p.seen if r.array == array]
        kind = "keep_reals" if rows[0].kind == "f32s" else "keep_ints"
        final = p.memory.at(array.replace("seen", "final"))
        lines.append(f"{kind}(late, lanes, i64({len(rows)}), every, first, n, {p.memory.at(array)}, {final})")
    return lines


def _begin_again(p: Program, rows: Sequence[Row], shown: Shown) -> list[str]:
    lines = _fill(p, p.reset_words, "reset_words(late, lanes", "k0, k1, episodes", "late")
    lines.append(f"begin({', '.join(['late', 'lanes', 'time', 'episodes', *(r.name for r in rows)])})")
    for row, (number, size) in shown.items():
        seen, reals = p.memory.at("seen0"), p.memory.at("reals")
        lines.append(
            f"show_some(late, lanes, {reals}, i64({p.block}), i64({number}), i64({size}), {seen}, i64({row}), every, first, n)"
        )
    return lines


def _fill(p: Program, words: WordLayout, call: str, keys: str, n: str) -> list[str]:
    """Statements that work out the words of a phase, and the normals and exponentials made of them."""
    if not words.count:
        return []
    w, r = p.memory.at("words"), p.memory.at("reals")
    lines = [f"{call}, {w}, i64({p.block}), i64({(words.count + 1) // 2}), {keys})"]
    for draw in words.draws:
        if draw.base in ("normal", "exponential"):
            place = f"i64({words.first[draw.site]}), i64({draw.type.size})"
            lines.append(f"{draw.base}s({n}, {w}, {r}, i64({p.block}), {place})")
    return lines


def _reset(p: Program, rows: Sequence[Row], shown: Shown) -> list[str]:
    """Begin an episode in the lanes of a range whose flag `chosen` is set."""
    body = _views(p, rows)
    body += [
        f"lanes = i64s({p.memory.at('lanes')}, i64(0), i64({p.block + 1}))",
        "late = gather(n, chosen[first:first + n], lanes)",
        "for i in range(late):",
        "    j = u64(lanes[i])",
        "    terminated[j] = truncated[j] = ended[j] = False",
        *_begin_again(p, rows, shown),
    ]
    return ["@outer", "def reset(m, chosen):", *indent([*_RANGE, *_blocks(p, body)])]
