"""Verdicts and statuses of results, from which the language reference is made; and scores read back from files, validated."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.model.model import misused

OfClaim = Literal["proved", "tested", "undecided", "false", "contradicted", "broken"]
OfNumber = Literal["exact", "tested", "estimated"]


@dataclass(frozen=True, slots=True)
class Status:
    """A word with what it means, the words for it on a page, and the code of the error that it is (None: it is none)."""

    word: str
    doc: str
    shown: str
    code: str | None = None


CLAIMS: dict[OfClaim, Status] = {
    "proved": Status(
        "proved", "It holds by exact results whose error is computed, or by the form of the equations.", "proved"),
    "tested": Status(
        "tested", "Simulated episodes do not contradict it; or it is proved of an abstraction that was tested on episodes.",
        "tested in {episodes} episodes"),
    "undecided": Status(
        "undecided", "It is neither proved nor contradicted: the task has no exact model, or error bounds leave it open.",
        "not decided", "E602"),
    "false": Status("false", "Exact results contradict it.", "does not hold", "E601"),
    "contradicted": Status(
        "contradicted", "Simulated episodes contradict it at 99.9 % confidence, whatever the distribution of their returns.",
        "does not hold", "E604"),
    "broken": Status("broken", "It is not a valid claim.", "does not hold", "E603"),
}  # fmt: skip

NUMBERS: dict[OfNumber, Status] = {
    "exact": Status("exact", "Computed from an exact model, with a computed error bound.", ""),
    "tested": Status(
        "tested", "Computed from the exact model of an abstraction that was tested on episodes, and not proved.",
        "tested in {episodes} episodes"),
    "estimated": Status("estimated", "The mean of simulated episodes, with a 95 % confidence interval.",
                        "from {episodes} episodes"),
}  # fmt: skip


# -- scores in files --------------------------------------------------------------------------------------------------


def read(path: str | Path, returns: Iterable[str]) -> dict[str, Any]:
    """Read a file of scores, by name; `returns` are the names of returns.

    Raises:
        SpecError: E710, E711 when there is no such file, or it cannot be read; E713 when it contains no scores.
    """
    data = _parsed(path)
    fits = _FITS | dict.fromkeys(returns, _is_return)
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
    numbers = ("value", "error", "bound")
    counts = ("episodes", "tested")
    if not set(value) <= {*numbers, *counts, "status"}:
        return False
    return all(_is_number(value.get(n)) for n in numbers) and all(_is_count(value.get(n)) for n in counts)


_FITS: dict[str, Callable[[Any], bool]] = {
    "id": lambda x: isinstance(x, str), "content_hash": lambda x: isinstance(x, str),
    "parameters": lambda x: isinstance(x, dict), "why_not_exact": lambda x: x is None or isinstance(x, str),
    "modifiers": lambda x: isinstance(x, list) and all(isinstance(each, str) for each in x),
    "states": lambda x: x is None or _is_count(x), "actions": lambda x: x is None or _is_count(x),
}  # fmt: skip
