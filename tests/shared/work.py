"""How much a program does, told without a clock: the same on every machine, however busy."""

import sys
from collections.abc import Callable
from typing import Any


def calls(act: Callable[[], Any]) -> int:
    """The number of calls, of functions in Python and in C, that an act comes to."""
    count = 0

    def noticed(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event in ("call", "c_call")

    before = sys.getprofile()
    sys.setprofile(noticed)
    try:
        act()
    finally:
        sys.setprofile(before)
    return count
