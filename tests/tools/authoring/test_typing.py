"""Specs at the points where an author pauses: each line cut in a word, the rest of it not yet written."""

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from taskspec.tools.authoring.analysis import analyse, own
from taskspec.tools.authoring.completion import complete
from taskspec.tools.authoring.formatting import fixed
from taskspec.tools.authoring.meanings import definition, hover, rename, signature_at, tokens
from taskspec.tools.authoring.repair import cursor
from tests.shared.diagnostics import codes
from tests.shared.sparse import sparse

ROOT = Path(__file__).parents[3]
SPECS = sorted(
    path
    for path in (ROOT / "tasks").glob("*/*.yaml")
    if path.read_text(encoding="utf-8").startswith("taskspec:") and "experiments" not in path.parts
)
WORD = re.compile(r"(?<!\w)[A-Za-z_]\w*'?")
PROSE = {
    "title", "summary", "description", "capability", "keywords", "sources", "source", "errata", "here", "because", "where",
    "doc", "accept",
    "symbol", "symbols", "alias", "note", "message", "values", "grid", "legend", "objects", "name", "version",
}  # fmt: skip
DECLARING = {
    "parameters", "constants", "definitions", "noise", "state", "action", "observation", "measures", "memory", "symmetries",
    "variants",
}  # fmt: skip


def pauses(text: str, name: str, number: int) -> Iterator[tuple[int, str, str]]:
    """Yield offsets in the middle of words that can be known before they are written, the texts so far, and the words."""
    places = list(WORD.finditer(text))
    for place in random.Random(Path(name).name).sample(places, min(number, len(places))):
        start = place.start()
        word = place.group()
        end = text.find("\n", place.end())
        at = cursor(text, start + len(word), name)
        path = own(at.path)
        is_declared = at.kind == "key" and len(path) == 2 and path[0] in DECLARING
        is_variable = re.search(rf"\bfor [\w, ]*\b{re.escape(word)}\b[\w, ]* in\b", text) is not None
        if at.kind == "text" or not path or PROSE & set(map(str, path)) or is_declared or is_variable:
            continue
        here = start + max(1, len(word) // 2)
        yield here, text[:here] + text[end:], word


def test_the_word_that_follows_is_offered() -> None:
    missed = []
    number = 0
    for path in SPECS[::7]:
        name = str(path)
        for at, text, word in pauses(path.read_text(encoding="utf-8"), name, 6):
            offered, _ = complete(analyse(text, name), at)
            labels = {each.label for each in offered}
            number += 1
            if not labels & {word, word.rstrip("'"), word + "'"}:
                missed.append((path.name, text[:at].rpartition("\n")[2], word))
    assert number > 40
    assert len(missed) <= 0.02 * number, missed


@pytest.mark.parametrize("path", sparse(SPECS[::7], 4), ids=lambda path: path.stem)
def test_nothing_that_is_typed_raises_and_what_is_above_keeps_its_meaning(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    whole = analyse(text, str(path))
    assert whole.diagnostics == ()
    for end in random.Random(path.name).sample(range(len(text)), 8):
        typed = text[:end] + text[text.find("\n", end) :]
        found = analyse(typed, str(path))
        complete(found, end)
        assert found.document is not None, typed[max(0, end - 60) : end]


@pytest.mark.parametrize("path", SPECS[::36], ids=lambda path: path.stem)
def test_what_is_kept_between_keystrokes_is_what_would_be_worked_out_again(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    last = analyse(text, str(path))
    for end in random.Random(path.name).sample(range(len(text)), 4):
        typed = "# a line more\n" + text[:end] + text[text.find("\n", end) :]
        last = analyse(typed, str(path), last)
        alone = analyse(typed, str(path))
        assert last.diagnostics == alone.diagnostics
        assert last.declarations == alone.declarations
        assert tokens(last) == tokens(alone)


def test_a_half_written_line_is_one_mistake() -> None:
    text = (ROOT / "tasks" / "derail" / "risky_path.yaml").read_text(encoding="utf-8")
    typed = text.replace("rows: {goal: 1, trap: -100, else: 0}", "rows: {goal: 1, trap: ", 1)
    found = analyse(typed, "typed.yaml")
    assert set(codes(found.diagnostics)) == {"E111"}
    assert [attempt.merged.name for attempt in found.attempts] == ["RiskyPath", "RiskyPathSeals"]
    assert found.declarations["trap"].noun == "label"


def test_a_key_that_is_begun_hides_nothing_below_it() -> None:
    text = (ROOT / "tasks" / "derail" / "noisy_obs.yaml").read_text(encoding="utf-8")
    start = text.index("summary:", text.index("variants:"))
    typed = text[: start + 2] + text[text.index("\n", start) :]
    seals = analyse(text, "typed.yaml").document.data["variants"]["seals"]
    found = analyse(typed, "typed.yaml").document.data["variants"]["seals"]
    assert len(seals) > 4
    (begun, _), *others = found.items()
    assert begun == "su" and others == list(seals.items())[1:]


def test_all_mistakes_are_found_and_fixed_in_their_places(tmp_path: Path) -> None:
    from taskspec.tools.authoring.formatting import fix_files

    text = (ROOT / "tasks" / "derail" / "branching.yaml").read_text(encoding="utf-8")
    wrong = text.replace("horizon:", "horzon:", 1).replace("reward:", "rewrd:", 1)
    path = tmp_path / "wrong.yaml"
    path.write_text(wrong, encoding="utf-8")
    found = analyse(wrong, str(path))
    assert fix_files(found.diagnostics) == 2
    assert path.read_text(encoding="utf-8") == text


SMALL = """taskspec: 1
name: Small
state:
  s: {type: int, low: 0, high: 9}
action:
  a: {type: choice, values: [left, right]}
horizon: 3
initial: {s: 0}
dynamics:
  s': clip(s + 1, 0, 9)
reward: 1
terminal: false
"""
WRITTEN_ELSEWHERE = (
    ("reward: 1", "reward: s == 1&&s == 2", "reward: s == 1 and s == 2"),
    ("reward: 1", "reward: s == 1 || s == 2", "reward: s == 1 or s == 2"),
    ("reward: 1", "reward: s = 1", "reward: s == 1"),
    ("terminal: false", "terminal: s == 1 or !(s == 2)", "terminal: s == 1 or not (s == 2)"),
    ("reward: 1", "reward: s ≤ 3", "reward: s <= 3"),
    ("reward: 1", "reward: 2×s", "reward: 2*s"),
    ("reward: 1", "reward: s == 1∧s == 2", "reward: s == 1 and s == 2"),
    ("reward: 1", "reward: 2s + 1", "reward: 2 * s + 1"),
    ("reward: 1", "reward: s^2", "reward: s**2"),
    ("terminal: false", "terminal: (s == 1) & (s == 2)", "terminal: (s == 1) and (s == 2)"),
    ("terminal: false", "terminal: (s == 1) | (s == 2)", "terminal: (s == 1) or (s == 2)"),
    ("reward: 1", "reward: maximum(s, 2)", "reward: max(s, 2)"),
    ("  s': clip", "  s: clip", "  s': clip"),
    ("low: 0", "min: 0", "low: 0"),
    ("taskspec: 1", "taskspec: 2", "taskspec: 1"),
)


@pytest.mark.parametrize(("right", "wrong", "fix"), WRITTEN_ELSEWHERE, ids=lambda text: text)
def test_what_a_hint_says_to_write_is_written(right: str, wrong: str, fix: str) -> None:
    mistaken = SMALL.replace(right, wrong, 1)
    found = analyse(mistaken, "small.yaml")
    fixes = [each.fix for each in found.diagnostics if each.fix is not None]
    assert fixed(mistaken, fixes) == SMALL.replace(right, fix, 1)
    assert analyse(SMALL.replace(right, fix, 1), "small.yaml").diagnostics == ()


EDITS = 24
EDITED = ("families/tree.yaml", "probes/sizes.yaml", "memory/n_back.yaml", "families/experiments/trees.yaml")
"""Specs, and an experiment."""


def edited(text: str, rng: random.Random) -> tuple[str, int]:
    """A text after a random edit, as of someone who is not done, and the place of the edit."""
    at = rng.randrange(len(text))
    end = min(len(text), at + rng.choice((1, 3, 20, 200)))
    match rng.randrange(5):
        case 0:
            return text[:at] + text[end:], at
        case 1:
            return text[:at], at
        case 2:
            return text[:at] + text[at:end] + text[at:], end
        case 3:
            other = rng.randrange(len(text))
            return text[:at] + text[other : other + end - at] + text[at:], at
    return text[:at] + rng.choice("{}[]:'\"#-|,\n\t&*!%") + text[at:], at + 1


def test_no_edit_makes_a_question_fail() -> None:
    rng = random.Random(0)
    texts = [(ROOT / "tasks" / name).read_text(encoding="utf-8") for name in EDITED]
    for number in range(EDITS):
        text, at = edited(texts[number % len(texts)], rng)
        for _ in range(rng.randrange(3)):
            text, at = edited(text or "x", rng)
        found = analyse(text, "edited.yaml")
        try:
            complete(found, at)
            hover(found, at)
            signature_at(found, at)
            definition(found, at)
            for name in list(found.declarations)[:3]:
                rename(found, name, "other")
            list(tokens(found))
        except Exception as error:
            raise AssertionError(f"at {at} of {text!r}") from error


BOUNDED = """
taskspec: 1
name: Bounded
state:
  x: {type: real, low: 0.001, high: 0.0625}
  n: {type: int, low: -3, high: 4, shape: [2]}
action: {a: {type: bool}}
horizon: 1
initial: {x: 0.05, n: 0}
dynamics: {n': "clip(n + 1, -3, 4)"}
reward: x + n[0]
"""


def test_bounds_are_told_as_they_are() -> None:
    found = analyse(BOUNDED, "bounded.yaml")
    assert hover(found, BOUNDED.index("x + n")) == "`x`: state component, real in [0.001, 0.0625]"
    assert hover(found, BOUNDED.index("n[0]")) == "`n`: state component, int vector [2] in [−3, 4]"
