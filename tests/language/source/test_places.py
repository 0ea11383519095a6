"""Reading YAML: every character of a value has a place."""

import pytest
import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from taskspec.language import source
from tests.shared.places import written

words = st.text(alphabet="abXY01+*()'\"\\.,é😀", min_size=1, max_size=6)
gaps = st.sampled_from([" ", "  ", "\n", "\n\n", " \n", "\n  ", "\t"])
values = st.lists(st.tuples(words, gaps), min_size=1, max_size=12).map(
    lambda parts: "".join(word + gap for word, gap in parts).rstrip()
)


def check_places(text: str, value: str) -> None:
    """Every character of `x` has a place; the text there is what stands for the character."""
    document = source.read_text(text)
    assert document.data["x"] == value
    before = (0, 0)
    for i, char in enumerate(value):
        span = document.span(("x",), i, i + 1)
        there = written(span)
        assert (span.line, span.column) >= before
        before = (span.line, span.column)
        if there != char:
            assert (
                there in ("''", "\\" + char)
                or there[:2] in {"\\u", "\\U", "\\x", "\\t", "\\n"}
                or (char in " \n" and not there.strip(" \t\n\\"))
            ), (char, there)
        assert len(there) <= 12 + there.count(" ") + there.count("\n")


@given(value=values, style=st.sampled_from(["'", '"', "|", ">"]), width=st.integers(5, 40))
@example(value="0\n  0 0 0", style=">", width=5)
def test_places_in_what_the_emitter_writes(value: str, style: str, width: int) -> None:
    """PyYAML is the reference: whatever layout it chooses, places in what it then reads must be right.

    (Its emitter folds indented lines too, which are not folded back: the value that is read is not always the one given.)
    """
    text = yaml.dump({"x": value}, default_style=style, width=width, allow_unicode=True)
    check_places(text, yaml.safe_load(text)["x"])


plain_words = st.text(alphabet="abXY01+*()'é😀", min_size=1, max_size=6).map(lambda word: "w" + word)
plain_gaps = st.sampled_from([" ", "  ", "\n  ", "\n\n   ", " \n \n  ", "\r\n  "])


@given(
    parts=st.lists(st.tuples(plain_words, plain_gaps), min_size=1, max_size=10),
    quote=st.sampled_from(["", '"', "'"]),
    last=plain_words,
)
def test_places_in_folded_text(parts: list[tuple[str, str]], quote: str, last: str) -> None:
    body = "".join(word + gap for word, gap in parts) + last
    if quote == "'":
        body = body.replace("'", "''")
    text = f"y: 1\nx: {quote}{body}{quote}  # end\nz: 2\n"
    check_places(text, yaml.safe_load(text)["x"])


block_lines = st.lists(
    st.tuples(st.sampled_from(["", " ", "   ", "\t"]), st.text("ab# :'\"é😀", max_size=8)), max_size=8
)


@given(
    lines=block_lines,
    style=st.sampled_from("|>"),
    chomp=st.sampled_from(["", "-", "+"]),
    explicit=st.booleans(),
    ending=st.sampled_from(["\n", "\r\n"]),
    last=st.sampled_from(["", "\n", "\n\n", "\nz: 1\n"]),
)
def test_places_in_block_text(
    lines: list[tuple[str, str]], style: str, chomp: str, explicit: bool, ending: str, last: str
) -> None:
    first = "first" if not explicit else " first"
    body = ending.join("   " + lead + line for lead, line in [("", first), *lines])
    header = style + ("3" if explicit else "") + chomp
    text = f"x: {header}  # c{ending}{body}{last}"
    check_places(text, yaml.safe_load(text)["x"])


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ('x: "a \\\n   b\\\n\n   c\\x41\\u00e9\\U0001F600\\"\\/"\n', 'a b\ncAé😀"/'),
        ("x: >\n\n  a\n  b\n\n   more\n  c\n", "\na b\n\n more\nc\n"),
        ("x: |+\n  a\n\n\n", "a\n\n\n"),
        ("x: >-\n    a\n    b", "a b"),
        ("- y:\n  - |\n   a\n\n   b\n", None),
    ],
)
def test_places_in_corners(text: str, value: str | None) -> None:
    if value is not None:
        check_places(text, value)
    else:
        document = source.read_text(text)
        assert written(document.span((0, "y", 0), 3, 4)) == "b"
