"""Small changes of the source: what is changed, how a change is named, and what becomes of it."""

from __future__ import annotations

import ast
import subprocess
from pathlib import Path

import pytest

from tests.shared.sparse import sparse
from tests.verification.mutants import __main__ as command
from tests.verification.mutants import run, table
from tests.verification.mutants.changes import mutants, mutated
from tests.verification.mutants.choose import Seen, Timed, chosen
from tests.verification.mutants.rooms import ROOMS, asked, is_own

CHANGES = {
    "x < y <= z": {"x <= y <= z", "x < y < z"},
    "x == y": {"x != y"},
    "x in y": {"x not in y"},
    "x is None": {"x is not None"},
    "x + y * z": {"x - y * z", "x + y / z"},
    "x // y": {"x / y"},
    "x & y": {"x | y"},
    "-x": {"x"},
    "not x": {"x"},
    "x and (y or z)": {"x or (y or z)", "x and (y and z)"},
    "(x, 2)": {"(x, 3)", "(x, 1)"},
    "(x, 0.5)": {"(x, 1.5)", "(x, -0.5)"},
    "(x, True)": {"(x, False)"},
    "f(x, y, z)": {"f(y, x, z)"},
    "min(x, y)": {"max(x, y)"},
    "x.floor(y)": {"x.ceil(y)"},
    "f(*x, y)": set(),
    "[z for z in x if z.ok]": {"[z for z in x]"},
    "x if y else z": {"x if not y else z"},
    "f'{x + y}'": {"f'{x - y}'"},
    "f'there are {x + y} of them'": set(),
}
STATEMENTS = {
    "return x": {"return None"},
    "return None": set(),
    "self.x = y": {"pass"},
    "x = y": set(),
    "x += y": {"x -= y", "pass"},
    "f(x)": {"pass"},
    "raise E(x + 1)": {"pass"},
    "assert x < y": set(),
    "if x:\n        f": {"if not x:", "if False:"},
    "for y in x:\n        break": {"continue"},
    "match x:\n        case [y]:\n            f\n        case _:\n            g": {
        "case [y] if False:",
        "case _ if False:",
    },
    "if TYPE_CHECKING:\n        f(x)": set(),
    "x: tuple[int, 3]": set(),
}


@pytest.mark.parametrize("text", CHANGES)
def test_expressions(text: str) -> None:
    found = mutants("a.py", f"whole = [{text}]")
    assert {ast.unparse(ast.parse(mutated(f"whole = [{text}]", m.number))) for m in found} == {
        ast.unparse(ast.parse(f"whole = [{after}]")) for after in CHANGES[text]
    }


@pytest.mark.parametrize("text", STATEMENTS)
def test_statements(text: str) -> None:
    source = f"def f(x, y):\n    {text}\n    g\n"
    found = mutants("a.py", source)
    assert {m.after for m in found} == STATEMENTS[text]
    assert len({mutated(source, m.number) for m in found} | {ast.unparse(ast.parse(source)) + "\n"}) == len(found) + 1


@pytest.mark.parametrize(
    "source",
    [
        '"""Text."""', "@cache(1 + 2)\ndef f(): ...", "def f(x: 1 + 2) -> 3: ...",
        "class A:\n    def __repr__(self): return 1 + 2",
        "Alias = int | str", "raise E(1 + 2)", "isinstance(x, A | B)", "fail(hint=1 + 2)",
    ],
)  # fmt: skip
def test_passed_over(source: str) -> None:
    assert {m.after for m in mutants("a.py", source)} <= {"pass"}


def test_a_change_keeps_its_name_when_it_moves() -> None:
    one, two = (mutants("a.py", before + "def f(x):\n    return x < 1\n") for before in ("", "import math\n\n\n"))
    assert [m.key for m in one] == [m.key for m in two]
    assert [m.line + 3 for m in one] == [m.line for m in two]
    assert [m.place for m in one] == ["f"] * len(one)


def test_changes_that_read_alike_are_counted() -> None:
    found = mutants("a.py", "def f(x):\n    x.long_name += 1\n    x.long_name += 1\n")
    assert (
        len({m.key for m in found})
        == len(found)
        == len({mutated("def f(x):\n x.b += 1\n x.b += 1", m.number) for m in found})
    )


@pytest.mark.parametrize("room", sparse(ROOMS, 4))
def test_a_sample_is_drawn_from_the_whole_room(room: str) -> None:
    found = command.sample(room, 20, seed=0)
    assert found == command.sample(room, 20, seed=0)
    assert {m.key for m in found} != {m.key for m in command.sample(room, 20, seed=1)}
    assert len({m.file for m in found}) > 2
    for m in found:
        compile(mutated(Path(run.ROOT, m.file).read_text(), m.number), m.file, "exec")


def test_tests_that_run_the_line_are_asked() -> None:
    room = ROOMS["draws"]
    (below, *_) = mutants("taskspec/language/draws/a.py", "def f(x):\n    y = x\n    return x < y\n")
    of_room = Seen(
        Path("tests/language/draws/test_draws.py"),
        [Timed("slow", 2), Timed("fast", 1), Timed("no", 0)],
        {below.file: {3: [0, 1], 2: [2]}},
    )
    of_others = Seen(
        Path("tests/verification/test_oracle.py"), [Timed("other", 1), Timed("endless", 1e9)], {below.file: {3: [0, 1]}}
    )
    of_line = chosen(below, room, [of_others, of_room])
    assert [test.name for test in of_line] == ["fast", "slow", "other"]


def test_a_line_of_a_table_is_asked_of_what_runs_the_file() -> None:
    (_, *_, row) = mutants("taskspec/language/draws/a.py", "def f(x):\n    return x < 1\n\nTABLE = (1, 2)\n")
    seen = Seen(Path("tests/language/draws/test_draws.py"), [Timed("one", 1)], {row.file: {2: [0], 4: []}})
    assert [test.name for test in chosen(row, ROOMS["draws"], [seen])] == ["one"]


# -- what no test can notice --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("key", table.equivalent())
def test_what_is_called_equivalent_can_still_be_changed(key: str) -> None:
    file = key.partition("::")[0]
    assert key in {m.key for m in mutants(file, Path(run.ROOT, file).read_text())}


def test_a_room_is_counted() -> None:
    every = mutants("a.py", "def f(x):\n    return x < 1\n")
    known = {
        m.key: {"became": what} for m, what in zip(every, ("killed", "timeout", "survived", "killed"), strict=True)
    }
    assert table.row("lang", every, every, known) == "| `lang` | 4 | 4 | 2 | 1 | 1 | 0 |"


# -- what becomes of a change ---------------------------------------------------------------------------------------------

FILE = "taskspec/__init__.py"
SOURCE = """
def down(x):
    while x > 0:
        x -= 1
    return x


def twice(x):
    return max(x, x) * 2
"""
TESTS = """
import taskspec


def test_down():
    assert taskspec.down(2) == 0


def test_twice():
    assert taskspec.twice(2) == 4
"""


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> run.Copy:
    original = tmp_path / "original"
    (original / "taskspec").mkdir(parents=True)
    (original / FILE).write_text(SOURCE)
    (original / "test_thing.py").write_text(TESTS)
    subprocess.run(["git", "init", "-q"], cwd=original, check=True)
    monkeypatch.setattr(run, "ROOT", original)
    monkeypatch.setattr(run, "PATIENCE", 4)
    return run.Copy(tmp_path / "copy")


@pytest.mark.parametrize(
    ("after", "test", "became"),
    [
        ("x >= 0", "test_down", "killed"), ("x += 1", "test_down", "timeout"), ("min(x, x) * 2", "test_twice", "survived"),
        ("max(x, x) * 3", "test_down", "survived"), ("max(x, x) * 3", "test_twice", "killed"),
    ],
)  # fmt: skip
def test_what_becomes_of_a_change(copy: run.Copy, after: str, test: str, became: str) -> None:
    (number,) = (m.number for m in mutants(FILE, SOURCE) if after in m.after)
    timed = Timed(f"test_thing.py::{test}", 0.0)
    assert copy.ask(FILE, number, [timed]) == (became, timed.name if became == "killed" else "")
    assert (copy.folder / FILE).read_text() == SOURCE


@pytest.mark.parametrize("name", ROOMS)
def test_every_room_has_tests_of_its_own(name: str) -> None:
    room = ROOMS[name]
    own = {path.parent.name for path in asked(room) if is_own(room, path)}
    assert own == set(room.tests)
