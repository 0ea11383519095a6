"""Places, rendering, suggestions, and the table of codes."""

import json
import pickle
import re

import pytest

from taskspec.base.codes import codes
from taskspec.base.diagnostics import Collector, Diagnostic, Origin, Span, SpecError, TaskspecError, render, suggest
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each

TEXT = "name: x\ndynamics:\n  s': paht + a\n"
ORIGIN = Origin("tasks/x.yaml", TEXT)
PAHT = Span(ORIGIN, 3, 7, 3, 11)
UNKNOWN = Diagnostic("E302", PAHT, "'paht' is not defined here", "did you mean 'path'?")


def in_text(text: str, line: int, column: int, end: int) -> Span:
    return Span(Origin("f", text), line, column, line, end)


def test_text_shows_the_place() -> None:
    assert render([UNKNOWN]) == (
        "tasks/x.yaml:3:7: error[E302 unknown-name]: 'paht' is not defined here\n"
        "    3 |   s': paht + a\n"
        "      |       ^^^^ did you mean 'path'?"
    )


def test_long_hints_and_notes_stand_below() -> None:
    long = Diagnostic("E302", PAHT, "m", "word " * 20 + "end", ("first\nsecond",))
    lines = render([long]).split("\n")
    assert lines[2] == "      |       ^^^^"
    assert lines[3].startswith("      = hint: word word")
    assert lines[4:] == ["      = note: first", "              second"]


def test_a_hint_is_said_once_a_file() -> None:
    other = Diagnostic("E302", in_text("s': paht", 1, 5, 9), "'paht' is not defined here", UNKNOWN.hint)
    again = Diagnostic("E302", PAHT, "'paht' is not defined here either", UNKNOWN.hint)
    assert render([UNKNOWN, again, other, again]).count("did you mean") == 2
    assert render([UNKNOWN, again], "json").count("did you mean") == 2


@pytest.mark.parametrize(("folders", "count"), [(1, 3), (4, 4)])
def test_a_long_path_stands_alone(folders: int, count: int) -> None:
    origin = Origin("a_long_folder/" * folders + "x.yaml", "s': paht + a")
    lines = render([Diagnostic("E302", Span(origin, 1, 5, 1, 9), "'paht' is not defined here")], width=80).split("\n")
    assert len(lines) == count and max(map(len, lines)) <= 80
    assert lines[0].startswith(f"{origin.name}:1:5:")


def test_words_are_not_broken_where_little_room_is_left() -> None:
    origin = Origin("x" * 45 + ".yaml", "a: 1")
    shown = render([Diagnostic("E302", Span(origin, 1, 1, 1, 2), "a second document begins here")], width=80)
    assert "second" in shown and max(map(len, shown.split("\n"))) <= 80


def test_no_place() -> None:
    assert render([Diagnostic("E701", None, "no task 'Y'", "did you mean 'X'?")]) == (
        "error[E701 unknown-task]: no task 'Y'\n      = hint: did you mean 'X'?"
    )


def test_warnings_are_called_so() -> None:
    assert render([Diagnostic("W506", None, "unused")]).startswith("warning[W506 unused]")


def test_color_only_adds_escapes() -> None:
    colored = render([UNKNOWN], color=True)
    assert "\x1b[1;31m" in colored
    assert re.sub(r"\x1b\[[0-9;]*m", "", colored) == render([UNKNOWN])


@pytest.mark.parametrize(
    ("text", "column", "end", "excerpt", "carets"),
    [
        ("\tab", 2, 4, " ab", " ^^"),
        ("a\x1b[31mb", 7, 8, r"a\x1b[31mb", "         ^"),
        ("a\x1b\u202e\udcffb", 2, 5, r"a\x1b\u202e\udcffb", " ^^^^^^^^^^^^^^^^"),
        ("漢字 x", 4, 5, "漢字 x", "     ^"),
        ("e\u0301x", 3, 4, "e\u0301x", " ^"),
        ("ab", 3, 3, "ab", "  ^"),
        ("ab", 1, 99, "ab", "^^"),
    ],
)
def test_carets_stand_under_what_they_mean(text: str, column: int, end: int, excerpt: str, carets: str) -> None:
    shown = render([Diagnostic("E301", in_text(text, 1, column, end), "m")]).split("\n")
    assert shown[1:] == [f"    1 | {excerpt}", f"      | {carets}"]


def test_long_lines_are_cut_around_the_place() -> None:
    text = "a" * 500 + "HERE" + "b" * 500
    _, excerpt, carets = render([Diagnostic("E301", in_text(text, 1, 501, 505), "m")]).split("\n")
    at = carets.index("^")
    assert (excerpt[at : at + 4], carets[at:]) == ("HERE", "^^^^")
    assert len(excerpt) < 120


def test_a_range_of_lines_is_marked_to_the_end_of_its_first() -> None:
    span = Span(Origin("f", "one two\nthree"), 1, 5, 2, 3)
    assert render([Diagnostic("E301", span, "m")]).endswith("    1 | one two\n      |     ^^^")


@pytest.mark.parametrize("ending", ["\n", "\r\n", "\r"])
def test_line_ends(ending: str) -> None:
    assert Origin("f", f"a{ending}b{ending}").line(2) == "b"
    assert Origin("f", "a").line(7) == ""


def test_json() -> None:
    (record,) = json.loads(render([UNKNOWN], "json"))
    assert record == {
        "code": "E302",
        "slug": "unknown-name",
        "severity": "error",
        "message": "'paht' is not defined here",
        "hint": "did you mean 'path'?",
        "notes": [],
        "file": "tasks/x.yaml",
        "line": 3,
        "column": 7,
        "end_line": 3,
        "end_column": 11,
    }
    assert json.loads(render([], "json")) == []


def test_github() -> None:
    odd = Span(Origin("a,b:c.yaml", "x"), 1, 1, 1, 2)
    assert render([Diagnostic("W506", odd, "50%\nmore")], "github") == (
        "::warning file=a%2Cb%3Ac.yaml,line=1,endLine=1,col=1,endColumn=2,title=W506 unused::50%25%0Amore"
    )


def test_unknown_format() -> None:
    with pytest.raises(ValueError, match="json"):
        render([], "xml")  # type: ignore[arg-type]


def test_collector_sorts_and_drops_duplicates() -> None:
    collector = Collector()
    collector.add("E301", Span(ORIGIN, 3, 7, 3, 8), "late")
    collector.add("E301", Span(ORIGIN, 2, 1, 2, 2), "early")
    collector.add("E301", Span(ORIGIN, 3, 7, 3, 8), "late")
    collector.add("E701", None, "nowhere")
    assert [each.message for each in collector.diagnostics] == ["nowhere", "early", "late"]
    caught = refusal(collector.raise_if_errors)
    assert caught.diagnostics == collector.diagnostics
    assert str(caught) == render(collector.diagnostics)


def test_warnings_do_not_raise() -> None:
    collector = Collector()
    collector.add("W506", None, "unused")
    collector.raise_if_errors()
    assert not collector.has_errors


def test_collector_refuses_codes_outside_the_table() -> None:
    with pytest.raises(KeyError, match="E999"):
        Collector().add("E999", None, "m")


def test_spec_errors_are_value_errors_and_can_be_pickled() -> None:
    error = SpecError([UNKNOWN])
    assert isinstance(error, ValueError)
    assert isinstance(error, TaskspecError)
    assert pickle.loads(pickle.dumps(error)).diagnostics == (UNKNOWN,)


@pytest.mark.parametrize(
    ("name", "candidates", "expected"),
    [
        ("paht", ["path", "a"], "did you mean 'path'?"),
        ("ABS", ["abs", "max"], "did you mean 'abs'?"),
        ("hihg", ["low", "high"], "did you mean 'high'?"),
        ("zzz", ["low", "high"], None),
        ("x", [], None),
        ("name", ["examples", "zebra"], None),
        ("act", ["action", "zebra"], "did you mean 'action'?"),
        ("Branchng", ["derail/Branching"], "did you mean 'derail/Branching'?"),
    ],
)
def test_suggest(name: str, candidates: list[str], expected: str | None) -> None:
    assert suggest(name, candidates) == expected


@for_each("code", codes().values())
def test_every_code_is_explained(code: object) -> None:
    entry = codes()[code.code]  # type: ignore[attr-defined]
    assert re.fullmatch(r"[EW][1-8]\d\d", entry.code)
    assert re.fullmatch(r"[a-z]+(-[a-z0-9]+)*", entry.slug)
    assert entry.severity == ("warning" if entry.code[1] == "5" else "error")
    assert (entry.code[0] == "W") == (entry.code[1] == "5")
    assert not entry.title.endswith(".")
    assert len(entry.explanation.split()) >= 12
    assert entry.explanation.strip().endswith((".", "```"))
    assert entry.explanation.count("```") % 2 == 0


def test_slugs_are_unique() -> None:
    assert len({code.slug for code in codes().values()}) == len(codes())


@pytest.mark.parametrize("width", [70, 80, 120])
def test_text_is_broken_for_a_terminal(width: int) -> None:
    line = "reward: " + " + ".join(f"term{i}" for i in range(40))
    origin = Origin("a/file/in/some/folder.yaml", line)
    found = Diagnostic(
        "E302", Span(origin, 1, 150, 1, 156), "a message of many words " * 8, "a hint " * 20, ("a note " * 30,)
    )
    text = render([found], width=width)
    assert max(map(len, text.splitlines())) <= width
    assert " ".join(text.split()).count("message of many words") >= 1
    assert text.replace("\n", " ").count("hint") >= 20
    assert render([found]).splitlines()[0].endswith("a message of many words ")
