"""Whatever a spec or a file is called and says, people see it: no output holds a character that a screen would obey or hide."""

import ast
import json
import re
import unicodedata
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from taskspec.base.diagnostics import Diagnostic, Origin, Span, render
from taskspec.base.display import ON_PAGES, visible, visible_json

ROOT = Path(__file__).parents[2]
HIDDEN = {"Cc", "Cf", "Cs", "Zl", "Zp"}
NASTY = "\x1b[2J\x9b\u202e\u2066\u2069\u200e\u200f\u061c\x07\u2028\x7f\ufeff"
text_of_any_kind = st.text(st.characters(exclude_categories=())) | st.text(st.sampled_from(NASTY + "a\\\n\udcff"))


def hidden(text: str, keep: str = "\n") -> set[str]:
    return {c for c in text if unicodedata.category(c) in HIDDEN and c not in keep}


# ------------------------------------------------------------------------------ the function


@given(text_of_any_kind, st.sampled_from(["", "\n", ON_PAGES]))
def test_visible(text: str, keep: str) -> None:
    shown = visible(text, keep)
    assert not hidden(shown, keep)
    assert visible(shown, keep) == shown
    shown.encode()


def test_escapes_say_which_character_it_is() -> None:
    assert visible("a\tb\r\u202e\x1b\udcff\U000e0041") == "a\\tb\\r\\u202e\\x1b\\udcff\\U000e0041"
    assert visible("日本 é ∀ \u00a0 👍 \\x1b\n") == "日本 é ∀ \u00a0 👍 \\x1b\n"


@given(st.recursive(text_of_any_kind, lambda x: st.lists(x) | st.dictionaries(text_of_any_kind, x)))
def test_json_means_the_same(data: object) -> None:
    text = visible_json(data)
    assert json.loads(text) == data
    assert not hidden(text)
    text.encode()


@given(text_of_any_kind, text_of_any_kind, text_of_any_kind, st.integers(1, 30), st.integers(1, 30))
def test_carets_stand_below_what_is_shown(name: str, line: str, message: str, column: int, size: int) -> None:
    line = re.sub(r"[\r\n]", "", line)[:10]  # ten escapes are as many columns as an excerpt has
    span = Span(Origin(name, line), 1, column, 1, column + size)
    assert not hidden(render([Diagnostic("E301", span, message, message, (message,))], width=40))
    _, excerpt, carets = render([Diagnostic("E301", span, "m")]).split("\n")
    excerpt = excerpt.removeprefix("    1 |")
    carets = carets.removeprefix("      |")
    marked = visible(line[column - 1 : column - 1 + size].replace("\t", " "), keep="")
    assert carets.strip() == "^" * max(1, columns(marked))
    before = columns(" " + visible(line[: column - 1].replace("\t", " "), keep=""))
    assert carets.index("^") == before
    assert excerpt.rstrip() == (" " + visible(line.replace("\t", " "), keep="")).rstrip()


def columns(text: str) -> int:
    count = 0
    for c in text:
        if not unicodedata.combining(c):
            count += 2 if unicodedata.east_asian_width(c) in "WF" else 1
    return count


@given(text_of_any_kind, text_of_any_kind)
def test_workflow_commands_are_one_line(name: str, message: str) -> None:
    span = Span(Origin(name, "x"), 1, 1, 1, 2)
    shown = render([Diagnostic("E301", span, message)], "github")
    head = "::error file="
    assert shown.startswith(head)
    assert "\n" not in shown
    assert "\r" not in shown
    assert not hidden(shown)
    file, data = shown[len(head) :].split(",line=1,endLine=1,col=1,endColumn=2,title=E301 syntax::", 1)
    assert not set(file) & set(":,")
    assert unescaped(data) == visible(message, "\r\n")
    assert unescaped(file.replace("%3A", ":").replace("%2C", ",")) == visible(name, "\r\n")


def unescaped(text: str) -> str:
    """As GitHub reads the data of a command."""
    return text.replace("%0D", "\r").replace("%0A", "\n").replace("%25", "%")


# ------------------------------------------------------------------------------ commands


def test_nothing_is_printed_by_another_way() -> None:
    """Every print goes through `console.say`, `terminal.Console`, or `diagnostics.render`."""
    doors = {"console.py": {"echo"}, "failures.py": {"echo"}, "app.py": {"echo"}, "terminal.py": {"write", "print"}}
    for path in sorted((ROOT / "taskspec" / "cli").glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        printed = set()
        for node in ast.walk(tree):
            match node:
                case ast.Call(func=ast.Attribute(attr="echo" | "secho" as name) | ast.Name(id="print" as name)):
                    printed.add(name)
                case ast.ImportFrom(module="rich.text"):
                    assert path.name in ("tables.py", "terminal.py"), path
        assert printed <= doors.get(path.name, set()), path
