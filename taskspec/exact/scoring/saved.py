"""Scores read back from a file, which may be damaged: every part is looked at before it is believed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NoReturn

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exact.model.failure import misused


def read(path: str | Path, returns: Iterable[str]) -> dict[str, Any]:
    """What a file of scores says, by name; `returns` are the names of returns.

    Raises:
        SpecError: E710, E711 when there is no such file, or it cannot be read; E713 when it contains no scores.
    """
    data, fits = _parsed(path), _FITS | dict.fromkeys(returns, _is_return)
    if not isinstance(data, dict):
        _damaged(path, "it is not a JSON object")
    for name, right in fits.items():
        if name not in data or not right(data[name]):
            _damaged(path, f"`{name}` is missing, or wrong")
    return {name: data[name] for name in fits}


def _parsed(path: str | Path) -> Any:
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise SpecError([Diagnostic("E710", None, f"there is no file {str(path)!r}")]) from None
    except OSError as error:
        raise SpecError([Diagnostic("E711", None, f"cannot read {str(path)!r}: {error.strerror or error}")]) from None
    except (ValueError, RecursionError):
        _damaged(path, "it is not JSON")


def _damaged(path: str | Path, why: str) -> NoReturn:
    misused(f"{str(path)!r} contains no scores: {why}", "compute them again, and save them")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def _is_return(value: Any) -> bool:
    if not isinstance(value, dict):
        return value is None
    numbers, counts = ("value", "error", "bound"), ("episodes", "tested")
    if not set(value) <= {*numbers, *counts, "status"}:
        return False
    return all(_is_number(value.get(n)) for n in numbers) and all(_is_count(value.get(n)) for n in counts)


_FITS: dict[str, Callable[[Any], bool]] = {
    "id": lambda x: isinstance(x, str), "content_hash": lambda x: isinstance(x, str),
    "parameters": lambda x: isinstance(x, dict), "why_not_exact": lambda x: x is None or isinstance(x, str),
    "modifiers": lambda x: isinstance(x, list) and all(isinstance(each, str) for each in x),
    "states": lambda x: x is None or _is_count(x), "actions": lambda x: x is None or _is_count(x),
}  # fmt: skip
