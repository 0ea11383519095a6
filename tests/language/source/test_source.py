"""Reading YAML: values, places, traps, and bounds."""

import math
from pathlib import Path

import pytest
import yaml

from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language import source
from tests.shared.diagnostics import codes, refusal
from tests.shared.for_each import for_each
from tests.shared.places import written


def problems(text: str) -> tuple[Diagnostic, ...]:
    return refusal(source.read_text, text, "x.yaml").diagnostics


def only(text: str) -> tuple[str, str, str, str]:
    """Code, place, excerpt under the carets, and hint of the only problem with a text."""
    (problem,) = problems(text)
    assert problem.span is not None
    place = f"{problem.span.line}:{problem.span.column}"
    return problem.code, place, written(problem.span), problem.hint or ""


@for_each(
    ("text", "value"),
    [
        ("1", 1),
        ("-12", -12),
        ("007", 7),
        ("0o17", 15),
        ("0xfF", 255),
        ("1e-3", 0.001),
        ("1.5", 1.5),
        (".5", 0.5),
        ("5.", 5.0),
        ("+1E3", 1000.0),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("-.inf", -math.inf),
        ("no", "no"),
        ("on", "on"),
        ("y", "y"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("2020-01-01", "2020-01-01"),
        ("1/2", "1/2"),
        ("0b1", "0b1"),
        ("=", "="),
        ('"1"', "1"),
        ("'true'", "true"),
        ("s' == 1", "s' == 1"),
        ("-x", "-x"),
    ],
)
def test_scalars_follow_the_core_schema(text: str, value: object) -> None:
    data = source.read_text(f"x: {text}\n").data["x"]
    assert (type(data), data) == (type(value), value)


def test_nan_is_a_number() -> None:
    assert math.isnan(source.read_text("x: .nan\n").data["x"])


def test_keys_are_text_as_written() -> None:
    document = source.read_text("s': 1\n\"p(x)\": 2\n0: 3\ntrue: 4\n1e-3: 5\n'a b': 6\n")
    assert document.data == {"s'": 1, "p(x)": 2, "0": 3, "true": 4, "1e-3": 5, "a b": 6}


def test_spans_of_values_and_keys() -> None:
    text = "a:\n  b: {c: 'x y', d: [1, 22]}\ne: |\n  one\n  two\n\nf:\n"
    document = source.read_text(text, "x.yaml")
    assert str(document.span(("a", "b", "d", 1))) == "x.yaml:2:24"
    assert written(document.span(("a", "b", "d", 1))) == "22"
    assert written(document.span(("a", "b", "c"))) == "'x y'"
    assert written(document.key_span(("a", "b", "d"))) == "d"
    assert written(document.key_span(("a", "b", "d", 0))) == "1"
    assert written(document.span(("a",))) == "b: {c: 'x y', d: [1, 22]}"
    assert written(document.span(("f",))) == "f"
    assert written(document.span(("a", "b", "nowhere", 3))) == "{c: 'x y', d: [1, 22]}"
    assert str(document.span(("e",), 4, 7)) == "x.yaml:5:3"
    assert written(document.span(("e",), 4, 7)) == "two"


def test_text_is_as_written() -> None:
    document = source.read_text("a: 0.10\nb: 1e-3\nc: 'it''s'\nd: [1]\n")
    assert [document.text((key,)) for key in "abc"] == ["0.10", "1e-3", "it's"]
    with pytest.raises(KeyError):
        document.text(("d",))
    with pytest.raises(KeyError):
        document.text(("nowhere",))


def test_an_empty_range_is_a_point() -> None:
    document = source.read_text("a: 'xyz'\n", "f")
    span = document.span(("a",), 3, 3)
    assert (span.line, span.column, span.end_column) == (1, 8, 8)


@pytest.mark.skipif(not hasattr(yaml, "CSafeLoader"), reason="PyYAML itself reads a key `a:`")
def test_a_colon_glued_to_a_comma() -> None:
    assert only("d: {a:, b: 1}\n")[:3] == ("E112", "1:6", ":")


def test_every_problem_is_reported() -> None:
    found = problems("a: 1\na: 2\nd: {x: f(1, 2)}\ne: {y}\nf: *g\n")
    assert codes(found) == ["E101", "E106", "E103", "E102"]


def test_a_spec_copied_with_its_fences() -> None:
    found = problems("```yaml\na: 1\n```\n")
    assert [(each.code, each.span and each.span.line, each.hint) for each in found] == [
        ("E102", 1, "remove it"), ("E102", 3, "remove it"),
    ]  # fmt: skip


def test_quoted_values_are_no_traps() -> None:
    text = "a: {x: \"clip(a, 0, 1)\", y: 'p[0]', z: {}, w: []}\nb: \"{1, 2}\"\nc: '\\beta'\n"
    assert source.read_text(text).data["a"]["x"] == "clip(a, 0, 1)"


@pytest.mark.parametrize(
    "text", ["[" * 10_000, "{" * 10_000, "a: " + "[\n" * 10_000, "- " * 10_000, "x: " + "{a: " * 10_000]
)
def test_deep_texts_are_refused_at_once(text: str) -> None:
    assert problems(text)[-1].code == "E114"


def test_wide_and_large_texts_are_refused() -> None:
    assert problems("x: [" + "1," * 200_000 + "]\n")[-1].code == "E114"
    assert problems("x: " + "a" * 1_000_001)[-1].code == "E114"


def test_alias_bombs_are_refused_before_they_expand() -> None:
    levels = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)]
    assert problems("a0: &a0 [x]\n" + "\n".join(levels))[0].code == "E102"


def test_many_mistakes_are_cut_short() -> None:
    assert len(problems("a: 1\n" * 5000)) == 50


def test_files(tmp_path: Path) -> None:
    good = tmp_path / "good.yaml"
    good.write_bytes("\ufeffa: é\r\nb: 2\r\n".encode())
    document = source.read_file(good)
    assert document.data == {"a": "é", "b": 2}
    assert str(document.span(("b",))) == f"{good}:2:4"
    assert str(source.read_file(str(good), "named.yaml").origin.name) == "named.yaml"


@pytest.mark.parametrize(
    ("content", "code", "place", "words"),
    [
        (b"a: 1\nb: \xe9\n", "E113", "2:4", "0xE9"),
        ("a: 1\n".encode("utf-16"), "E113", "1:1", "UTF-16"),
        (b"a" * 1_000_001, "E114", None, "larger"),
        (None, "E710", None, "no file"),
    ],
)
def test_bad_files(tmp_path: Path, content: bytes | None, code: str, place: str | None, words: str) -> None:
    path = tmp_path / "bad.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SpecError, match=words) as caught:
        source.read_file(path)
    (problem,) = caught.value.diagnostics
    assert problem.code == code
    assert place is None or str(problem.span).endswith(f":{place}")


def test_a_folder_is_not_a_file(tmp_path: Path) -> None:
    with pytest.raises(SpecError, match="E711"):
        source.read_file(tmp_path)
