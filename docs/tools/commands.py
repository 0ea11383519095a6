"""The page of commands, from the functions behind them: their docstrings, arguments and options."""

from __future__ import annotations

import inspect
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, get_type_hints

from typer.models import ArgumentInfo, OptionInfo

from docs.tools.markdown import code, entries, table
from taskspec.cli.app import COMMANDS, command_name
from taskspec.cli.options import flowed

HEAD = """# Commands

The exit status is 0 on success, 1 if a problem was found or something failed, 2 for wrong usage, and 70 for an internal error,
which is a bug in taskspec.
"""
IN_SHORT = """Generated from the program. `taskspec COMMAND --help` prints a command's arguments and options; on the site, this
page has all of them.
"""
IN_FULL = """Generated from the program; `taskspec COMMAND --help` prints the same. These options mean the same in all commands
that have them:
"""
SHARED = 4
"""Options of that many commands, in the same words, are explained once."""
Row = tuple[str, str]
MARKED = re.compile(r"\[(green|cyan|bold)\](.*?)\[/(?:\1)?\]")


def overview() -> str:
    """Return the page of the repository: each command in one sentence."""
    rows = []
    for _, group in _panels():
        for name, function in group:
            purpose = flowed(function.__doc__ or "").partition("\n\n")[0]
            rows.append((code(f"taskspec {name}"), _plain(purpose)))
    return "\n".join([HEAD, IN_SHORT, entries(rows), ""])


def commands() -> str:
    """Return the page of the site: each command with its arguments and options."""
    counted = Counter(row for functions in COMMANDS.values() for function in functions for row in _rows(function))
    shared = [row for row, count in counted.items() if count >= SHARED]
    parts = [HEAD.rstrip("\n"), IN_FULL.rstrip("\n"), table(("option", "what it is"), shared)]
    for panel, group in _panels():
        parts.append(f"## {panel}")
        for name, function in group:
            parts += _command(name, function, shared)
    return "\n\n".join(parts) + "\n"


def _panels() -> Iterator[tuple[str, list[tuple[str, Callable[..., Any]]]]]:
    """Yield the groups of commands as the help lists them, with names and functions."""
    for panel, functions in COMMANDS.items():
        yield panel, [(command_name(function), function) for function in functions]


def _command(name: str, function: Callable[..., Any], shared: Sequence[Row]) -> Iterator[str]:
    """A command's heading, what it does, its own arguments and options, and the names of those of other commands."""
    rows = _rows(function)
    own = [row for row in rows if row not in shared]
    others = [called.split(", ")[0].split("` `")[0].rstrip("`") + "`" for called, _ in rows if (called, _) in shared]
    written = [_argument(p, info) for p, info, _ in _parameters(function) if isinstance(info, ArgumentInfo)]
    yield f"### taskspec {name}"
    yield f"```text\ntaskspec {' '.join([name, *written, '[OPTIONS]'])}\n```"
    yield from (_plain(paragraph) for paragraph in flowed(function.__doc__ or "").split("\n\n"))
    if own:
        yield table(("argument or option", "what it is"), own)
    if others:
        yield f"Also {', '.join(others)}."


def _rows(function: Callable[..., Any]) -> list[Row]:
    """How each argument and option is written, and what it is."""
    return [
        (_called(p, info, kind), _plain(info.help or "") + _default(p, info)) for p, info, kind in _parameters(function)
    ]


def _parameters(function: Callable[..., Any]) -> list[tuple[inspect.Parameter, Any, Any]]:
    """The parameters of a command, with what its annotations say of each and its type."""
    hints = get_type_hints(function, include_extras=True)
    found = inspect.signature(function).parameters.values()
    return [(p, hints[p.name].__metadata__[0], hints[p.name].__origin__) for p in found]


def _argument(p: inspect.Parameter, info: ArgumentInfo) -> str:
    name = info.metavar or p.name.upper()
    return name if p.default is p.empty else f"[{name}]"


def _called(p: inspect.Parameter, info: ArgumentInfo | OptionInfo, kind: Any) -> str:
    """How it is written on the command line, in every way that there is."""
    if isinstance(info, ArgumentInfo):
        return code(info.metavar or p.name.upper())
    declared = [d for d in (info.default, *(info.param_decls or ())) if isinstance(d, str)]  # the first stands there
    names = [part for d in declared or [f"--{p.name.replace('_', '-')}"] for part in d.split("/")]
    if kind is bool:
        return ", ".join(map(code, names))
    return ", ".join(map(code, names)) + f" {code(info.metavar or p.name.upper())}"


def _default(p: inspect.Parameter, info: ArgumentInfo | OptionInfo) -> str:
    shown = info.show_default is not False and p.default not in (p.empty, None, True, False, "")
    return f" Default: {code(str(p.default))}." if shown else ""


def _plain(text: str) -> str:
    """Help without the marks of colours; what they mark is code."""
    return MARKED.sub(lambda found: code(found[2]), text).strip()
