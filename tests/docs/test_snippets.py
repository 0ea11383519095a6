"""The documentation is true: generated pages are what the generators give, and every snippet does what is printed below it.

On a page, top to bottom and in a folder of its own:

- a `yaml` block with a `taskspec:` line is a spec; it is written to the file named by `<!-- file: NAME -->` above it, and
  checked. Any other `yaml` block replaces or adds sections of the last spec, in a copy; with `<!-- add: NAME -->`, in the file.
  `<!-- error: E302 -->` says which codes the check must give; none unless given.
- a `python` block is executed; all blocks of a page share their names. A `text` block directly below is what it prints. With
  `<!-- file: NAME -->` it is a file as well.
- in a `console` block, lines after `$ ` are commands. Those of taskspec and python are run; what follows is their output.
- `<!-- script: train.py -->` stands above the text of a file beside the page, which `test_howto_scripts.py` runs.
- `<!-- skip: reason -->` leaves a block alone, `<!-- needs: package -->` does so where a package is not installed.

In outputs, a line `...` stands for any lines, and durations are not compared. `pytest --update-golden` writes what comes out.
"""

import contextlib
import io
import math
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from itertools import zip_longest
from operator import attrgetter
from pathlib import Path
from typing import Any

import pytest
from gymnasium.envs.registration import registry as gym_registry

from docs.tools import pages, pictures
from taskspec.language import registry
from taskspec.learn.learners import learner
from taskspec.tools.authoring.checks import check_file, check_other, examine
from taskspec.tools.targets import files_of
from tests.conftest import needs_vectors
from tests.shared.apart import Ended, taskspec
from tests.shared.diagnostics import codes

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", DOCS / "index.md"]
for folder in ("start", "howto", "explain", "reference"):
    PAGES += sorted((DOCS / folder).glob("*.md"))

BLOCK = re.compile(
    r"(?:^<!-- (?P<key>file|add|error|skip|needs|script): (?P<value>.*?) -->\n+)?"
    r"^```(?P<language>\w+)\n(?P<body>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
SECTION = re.compile(r"^(?=[A-Za-z_]\w*:)", re.MULTILINE)
DURATION = re.compile(r"\d+(\.\d+)? m?s\b")


@dataclass(frozen=True)
class Block:
    language: str
    body: str
    key: str | None
    value: str
    start: int  # of the body, in the page
    end: int

    @property
    def skipped(self) -> bool:
        return self.key in ("skip", "script") or (self.key == "needs" and find_spec(self.value) is None)


@dataclass
class Page:
    """A page that is being read: its folder, the names of its Python, its last spec, and changes to its outputs."""

    path: Path
    folder: Path
    names: dict[str, Any] = field(default_factory=lambda: {"__name__": "__main__"})
    spec: Path | None = None
    changes: list[tuple[int, int, str]] = field(default_factory=list)


def blocks(text: str, key: str = "", language: str = "") -> list[Block]:
    """The blocks of a page: all, or those with this key, or in this language."""
    found = []
    for match in BLOCK.finditer(text):
        start, end = match.span("body")
        if key in ("", match["key"]) and language in ("", match["language"]):
            found.append(Block(match["language"], match["body"], match["key"], match["value"] or "", start, end))
    return found


TRAINED = "explain/probes"
"""A page that is made by training learners, in about 20 s."""


@pytest.mark.parametrize(
    "name", [*sorted(pages.PAGES.keys() - {TRAINED}), pytest.param(TRAINED, marks=pytest.mark.slow)]
)
def test_generated_pages_are_up_to_date(name: str, update_golden: bool) -> None:
    path = DOCS / f"{name}.md"
    text = pages.PAGES[name]()
    if update_golden:
        path.write_text(text, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == text


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_scripts_on_pages_are_the_files_beside_them(path: Path, update_golden: bool) -> None:
    text = path.read_text(encoding="utf-8")
    now = text
    for block in reversed(blocks(text, key="script")):
        script = (path.parent / block.value).read_text(encoding="utf-8")
        now = now[: block.start] + script + now[block.end :]
    if update_golden:
        path.write_text(now, encoding="utf-8")
    assert path.read_text(encoding="utf-8") == now


def test_the_first_page_prints_what_its_spec_prints(tmp_path: Path) -> None:
    text = (DOCS / "index.md").read_text(encoding="utf-8")
    quoted = text.partition("<!-- printed -->\n")[2].partition("<!-- /printed -->")[0].splitlines()
    spec = blocks(text, language="yaml")[0]
    (tmp_path / "risky_path.yaml").write_text(spec.body, encoding="utf-8")
    done = taskspec(tmp_path, "docs", "risky_path.yaml", "-f", "markdown", "--no-results", "-o", "printed")
    assert done.returncode == 0, done.stderr
    page = "\n".join(map(Path.read_text, (tmp_path / "printed").glob("*.md")))
    assert quoted
    for line in quoted:
        assert line.removeprefix("> ") in page.splitlines()


def test_pictures_show_what_commands_print(update_golden: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The pictures of the README: of the spec of the first page, and of the report of an exam."""
    monkeypatch.setattr(pictures, "run", lambda arguments, folder: run("taskspec", arguments, folder).stdout)
    if update_golden:
        pictures.main()
    digest = pictures.example().digest
    for name in ("first-light", "first-dark"):
        drawn = (pictures.PICTURES / f"{name}.svg").read_text(encoding="utf-8")
        assert digest in drawn, "python -m docs.tools.pictures"
    assert (pictures.PICTURES / "card-light.svg").read_text(encoding="utf-8") == pictures.card()


def test_the_documentation_is_short() -> None:
    limits = {ROOT / "README.md": 600, DOCS / "reference" / "language.md": math.inf}
    total = 0
    for path in PAGES:
        words = len(path.read_text(encoding="utf-8").split())
        assert words <= limits.get(path, 3_000), path
        total += words
    assert total <= 40_000


@pytest.fixture
def page(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Page]:
    folder = tmp_path / "mine"  # the name of the suite that specs in it belong to
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setattr(registry, "_registered", dict(registry._registered))
    known = dict(gym_registry)
    yield Page(request.param, folder)
    gym_registry.clear()
    gym_registry.update(known)


@needs_vectors("pages show what happens with a Gymnasium that has vector environments")
@pytest.mark.parametrize("page", PAGES, indirect=True, ids=lambda path: str(path.relative_to(ROOT)))
def test_snippets_do_what_the_page_says(page: Page, update_golden: bool) -> None:
    text = page.path.read_text(encoding="utf-8")
    found = blocks(text)
    for block, after in zip_longest(found, found[1:]):
        if block.skipped:
            continue
        if block.language == "yaml":
            read_spec(block, page)
        elif block.language == "console":
            run_commands(block, page)
        elif block.language == "python":
            if block.key == "file":
                (page.folder / block.value).write_text(block.body, encoding="utf-8")
            printed = after if after and after.language == "text" and after.start - block.end < 16 else None
            execute(block, printed, page)
    for start, end, new in reversed(page.changes):
        text = text[:start] + new + text[end:]
    if update_golden and page.changes:
        page.path.write_text(text, encoding="utf-8")
    else:
        assert not page.changes, "\n".join(new for _, _, new in page.changes)


def read_spec(block: Block, page: Page) -> None:
    """Write a spec, an experiment, settings of a learner, or a change of a spec, and check it."""
    if re.search(r"^learner:", block.body, re.MULTILINE):
        path = page.folder / "learner.yaml"
        path.write_text(block.body, encoding="utf-8")
        assert learner(path).settings != learner("paper/gail_im").settings
        return
    if re.search(r"^experiment:", block.body, re.MULTILINE):
        path = page.folder / (block.value if block.key == "file" else "experiment.yaml")
        path.write_text(block.body, encoding="utf-8")
        assert not check_other(path, "experiment").diagnostics
        return
    if re.search(r"^taskspec:", block.body, re.MULTILINE):
        path = page.folder / (block.value if block.key == "file" else "spec.yaml")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(block.body, encoding="utf-8")
        page.spec = path
    else:
        base = page.folder / block.value if block.key == "add" else page.spec
        assert base is not None, "a change of no spec"
        path = base if block.key == "add" else page.folder / "changed.yaml"
        path.write_text(changed(base.read_text(encoding="utf-8"), block.body), encoding="utf-8")
    (file,) = files_of([str(path)])
    report = check_file(file, examine)
    wanted = block.value.split(", ") if block.key == "error" else []
    assert [code for code in codes(report.diagnostics) if code.startswith("E")] == wanted, report.diagnostics


def changed(text: str, changes: str) -> str:
    """A spec with the sections of a snippet in place of its own, on the lines that a reader's copy has."""
    sections = sections_of(text)
    for name, part in sections_of(changes).items():
        before = sections.get(name, "\n")
        blank_lines = before[len(before.rstrip("\n")) :]
        sections[name] = part.rstrip("\n") + blank_lines
    return "".join(sections.values())


def sections_of(text: str) -> dict[str, str]:
    return {part.split(":")[0]: part for part in SECTION.split(text) if part.strip()}


def execute(block: Block, printed: Block | None, page: Page) -> None:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        exec(compile(block.body, str(page.path), "exec"), page.names)
    if printed is not None and not printed.skipped:
        compare(printed.body, out.getvalue(), printed.start, printed.end, page)


def run_commands(block: Block, page: Page) -> None:
    """Run the commands of a console block; a command without output below it must succeed."""
    parts = re.split(r"^\$ (.*)\n", block.body, flags=re.MULTILINE)
    assert not parts[0].strip(), "output of no command"
    offset = block.start + len(parts[0])
    for command, shown in zip(parts[1::2], parts[2::2], strict=True):
        start = offset + len(command) + 3
        offset = start + len(shown)
        program, *arguments = shlex.split(command)
        if program not in ("taskspec", "python"):
            continue
        done = run(program, arguments, page.folder)
        if shown.strip():
            separator = "\n" if shown.endswith("\n\n") else ""
            compare(shown, done.stdout + done.stderr + separator, start, offset, page)
        else:
            assert done.returncode == 0, done.stderr


def run(program: str, arguments: list[str], folder: Path) -> Ended:
    if program == "taskspec":
        return taskspec(folder, *arguments, COLUMNS="90")
    environment = {**os.environ, "NO_COLOR": "1", "COLUMNS": "90", "PYTHONIOENCODING": "utf-8"}
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, encoding="utf-8", check=False
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def compare(shown: str, came: str, start: int, end: int, page: Page) -> None:
    """Note a change where an output is not what the page shows."""
    came = re.sub(r"[^\S\n]+$", "", came, flags=re.MULTILINE)
    pattern = ".*\n".join(map(re.escape, re.split(r"^\.\.\.\n", plain(shown), flags=re.MULTILINE)))
    if not re.fullmatch(pattern, plain(came), re.DOTALL):
        page.changes.append((start, end, came))


def plain(text: str) -> str:
    return DURATION.sub("0 s", text)


def test_the_files_that_the_architecture_names_are_there() -> None:
    page = (DOCS / "explain/architecture.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([a-z_]+(?:/[a-z_]+)+\.(?:py|md))`", page))
    assert len(named) > 15
    for name in named:
        assert (ROOT / "taskspec" / name).exists(), name


def test_the_attributes_of_tasks_that_the_page_names_are_there() -> None:
    section = (DOCS / "reference/api.md").read_text(encoding="utf-8").partition("\n## Tasks\n")[2].partition("\n## ")[0]
    listed = " ".join(re.findall(r"^- (.*?): ", section, re.MULTILINE))
    named = re.findall(r"`([\w.]+)`", listed)
    assert len(named) > 20
    for name in named:
        attrgetter(name)(registry.load("derail/RiskyPath-v0"))
