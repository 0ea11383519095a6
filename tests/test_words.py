"""The words of docstrings and the changelog: the field's own, as docs/reference/glossary.md lists them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PHRASES = re.compile(
    r"\b(told|laid over|comes? of|chances|anew|besides|of which|are alike|as it comes|is said|whatever|"
    r"comes? to the same|stands? for|what is left|as far as)\b"
)
OPENINGS = re.compile(r"(What|Whether|How|Where|Which|Of|As|By|From)\b")


def docstrings(text: str) -> Iterator[str]:
    """Yield the docstrings of a module, its classes and its functions."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text_of_node = ast.get_docstring(node)
            if text_of_node:
                yield text_of_node


def phrases(text: str) -> int:
    """Return how many phrases of the older style a docstring has, its opening included."""
    return len(PHRASES.findall(text)) + bool(OPENINGS.match(text))


def counted() -> dict[str, int]:
    """Return the number of such phrases for each file that has some."""
    found = {}
    for path in sorted(ROOT.glob("taskspec/**/*.py")):
        number = sum(phrases(text) for text in docstrings(path.read_text(encoding="utf-8")))
        if number:
            found[path.relative_to(ROOT).as_posix()] = number
    return found


def test_docstrings_are_free_of_phrases_of_the_older_style() -> None:
    assert counted() == {}, "write these docstrings with the words of docs/reference/glossary.md"


def test_the_changelog_is_short_and_plain() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 60
    assert PHRASES.findall(text) == []


@pytest.mark.parametrize(("text", "number"), [
    ("Return the value function.", 0), ("What a net says of inputs", 1), ("Return what is told of it, and anew", 2),
])  # fmt: skip
def test_phrases_are_counted(text: str, number: int) -> None:
    assert phrases(text) == number
