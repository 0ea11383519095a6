"""What the foot of the terminal tells while commands take long."""

import sys
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import pytest

from taskspec.base.limits import tell, telling
from taskspec.cli import console
from tests.shared.commands import Done


class Terminal(StringIO):
    def isatty(self) -> bool:
        return True

    @property
    def lines(self) -> list[str]:
        return list(filter(None, self.getvalue().split("\r\x1b[K")))


def test_a_bar_says_which_part_it_is_and_how_long_the_rest_may_take(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    clock = iter(range(1_000))
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(console, "PATIENCE", 0.0)
    monkeypatch.setattr(console, "time", SimpleNamespace(monotonic=lambda: float(next(clock))))
    with console.progress("work"):
        tell("before")
        for part in telling(["a", "b", "c", "d"], "part {}".format):
            tell(f"inside {part}")
        for _ in telling(["x", "y"], "then {}".format):
            pass
    empty = "╌" * 20
    half = "━" * 10 + "╌" * 10
    three = "━" * 15 + "╌" * 5
    assert terminal.lines == [
        "work: before (1 s)",
        f"{empty} part a (2 s)", f"{empty} part a: inside a (3 s)",
        f"{'━' * 5}{'╌' * 15} 6 s left, part b (4 s)", f"{'━' * 5}{'╌' * 15} 9 s left, part b: inside b (5 s)",
        f"{half} 4 s left, part c (6 s)", f"{half} 5 s left, part c: inside c (7 s)",
        f"{three} 2 s left, part d (8 s)", f"{three} 2 s left, part d: inside d (9 s)",
        f"{empty} then x (10 s)", f"{half} 1 s left, then y (11 s)",
    ]  # fmt: skip
    assert terminal.getvalue().endswith("\r\x1b[K")


@pytest.mark.parametrize(
    ("command", "told"),
    [
        ("docs derail/RiskyPath-v0 derail/Sort-v0 -o out", ["scores of derail/Sort-v0", "page of", "figure of"]),
        ("run derail/RiskyPath-v0 -n 2 -o x.gif", ["x.gif, episode 1 of 2, step 3", "episode 2 of 2"]),
        ("check derail --quick", ["risky_path.yaml", "sort.yaml"]),
        ("build derail/RiskyPath-v0 -o out", ["risky_path.yaml", "page of"]),
    ],
)
def test_commands_that_take_long_tell_what_they_do(
    command: str, told: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    heard = ""
    show = console.ProgressLine.show

    def hear(self: console.ProgressLine, what: str, share: float | None = None, *more: object) -> None:
        nonlocal heard
        if share is not None:
            assert 0 <= share <= 1
            heard += f"{what}\n"
        show(self, what, share, *more)

    monkeypatch.setattr(console.ProgressLine, "show", hear)
    monkeypatch.setattr(console, "is_terminal", lambda: True)
    assert Done(*command.split()).status == 0
    for words in told:
        assert words in heard
