"""How sure a result is, in one word, the same wherever it is told: by `check` and `solve`, on pages, in JSON.

The language reference is made from these tables.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

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
