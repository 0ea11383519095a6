"""A page for each mistake: what goes wrong, the smallest task that shows it with exact numbers, the repair, and public threads.

Words are those of `taskspec/learn/exam/mistakes.md`. Numbers are computed: fixed points of Bellman operators, learned rewards and
policies on exact models (`docs.tools.mistake_numbers`), expectations of estimators (`docs.tools.group_estimators`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from docs.tools.group_estimators import GROUPS
from docs.tools.markdown import entries, filled, table
from docs.tools.mistake_numbers import Evidence, by_policy, by_reward, by_values, probes_failed
from taskspec.base.files import write_text
from taskspec.learn.documents.document_models import DiagnosisEntry
from taskspec.learn.documents.rule_books import EXAM, file_of, read_exam
from taskspec.learn.exam.mistakes import MISTAKES, KnownMistake, anchor
from taskspec.learn.exam.operators import OPERATORS
from taskspec.learn.exam.pairings import PAIRINGS
from taskspec.learn.exam.starc import REWARDS
from taskspec.show.pages.page import anchor as page_anchor

DOCS = Path(__file__).parents[1]
INDEX = "reference/mistakes"
FOLDER = DOCS / INDEX
NAMES = [name for name, mistake in MISTAKES.items() if mistake.explanation]
ENTRY = re.compile(r"^- ([a-z -]+):", re.MULTILINE)


def index() -> str:
    """Return the page of all mistakes."""
    rows = [(name, _action(MISTAKES[name].what)) for name in NAMES]
    return filled(FOLDER.with_suffix(".md"), {"mistakes": entries(rows)})


def _action(what: str) -> str:
    """Return the words that follow "a learner" as a sentence about it."""
    for relative, subject in (("that ", ""), ("for which ", ""), ("whose ", "its ")):
        if what.startswith(relative):
            return subject + what.removeprefix(relative)
    return what


def linked(text: str) -> str:
    """Return the page of all mistakes with a link to the page of each."""
    return ENTRY.sub(lambda found: f"- [{found[1]}](mistakes/{anchor(found[1])}.md):", text)


def below() -> list[str]:
    """Return the pages below the page of all mistakes."""
    return [f"mistakes/{anchor(name)}" for name in NAMES]


def write_pages() -> None:
    """Write a page for each mistake; only what changed, so that a second build is fast."""
    for name in NAMES:
        path = FOLDER / f"{anchor(name)}.md"
        text = page(name)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            write_text(path, text)


def page(name: str) -> str:
    """Return the page of a mistake."""
    mistake = MISTAKES[name]
    found = evidence(name)
    why, _, change = mistake.explanation.partition("\n\n```diff")
    heading = name[0].upper() + name[1:]
    task = found.task
    suite = f"../{task.id.partition('/')[0]}"
    file = page_anchor(task.name)
    parts = [
        f"# {heading}",
        f"A learner {mistake.what}.",
        why,
        f"## Where it shows: {task.name}",
        f"[{task.name}]({suite}/{file}.md): {task.summary}",
        f"![{task.name}]({suite}/figures/{file}.svg)",
        found.about,
        table(found.header, found.rows),
        found.after,
        "## Usual code and repair",
        f"```diff{change}",
        mistake.fix,
        "## What sees it",
        "\n".join(f"- {line}" for line in seen_by(name)),
        "## Reported",
        reported(mistake),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def evidence(name: str) -> Evidence:
    """Return the smallest task that shows a mistake, with the numbers of right and of wrong learners."""
    if name in OPERATORS:
        return by_values(name)
    if name in REWARDS:
        return by_reward(name)
    if name in PAIRINGS:
        return by_policy(name)
    return GROUPS[name]()


def seen_by(name: str) -> Iterator[str]:
    """Yield the parts of the exam, and the calls of the oracle, that see a mistake."""
    tables: dict[str, Iterable[str]] = {"values": OPERATORS, "reward": REWARDS, "policy": PAIRINGS}
    kinds = [kind for kind, names in tables.items() if name in names]
    if kinds:
        yield f"an exam, by what was learned: {' and '.join(f'the flag `{kind}`' for kind in kinds)}"
    rules = [rule for rule, names in _diagnoses().items() if name in names]
    if rules:
        yield f"an exam, by its scores: the diagnosis {' and '.join(f'`{rule}`' for rule in rules)}"
    failed = probes_failed(name)
    if failed:
        yield f"at the discount of this page, scores below 0.9 on {', '.join(failed)}"
    mistake = MISTAKES[name]
    if mistake.oracle:
        yield f"a unit test: it fails against {mistake.calls} ([how](../../howto/estimators.md))"


def _diagnoses() -> dict[str, tuple[str, ...]]:
    path = file_of("probes", EXAM)
    assert path is not None
    found = {}
    for rule in read_exam(path).rules:
        assert isinstance(rule.entry, DiagnosisEntry)
        found[rule.name] = tuple(rule.entry.mistakes)
    return found


def reported(mistake: KnownMistake) -> str:
    """Return links to the public threads about a mistake."""
    if not mistake.reported:
        return "We know no public thread about it; it was rebuilt from our own code."
    links = []
    for thread in mistake.reported:
        place, _, number = thread.partition("#")
        links.append(f"[{thread}](https://github.com/{place}/issues/{number})")
    return f"Public threads in which it was reported, or asked about: {', '.join(links)}."
