"""Text of a spec stays text: a spec full of markup of every language is printed, and none of it takes effect."""

from __future__ import annotations

import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import pytest
from markdown_it import MarkdownIt

import taskspec
from taskspec.language.registry import load
from taskspec.language.task.task import Task
from taskspec.show.pages.prose import is_safe
from taskspec.show.pages.write import write

SCRIPT = re.compile(r"<script\b.*?</script>", re.DOTALL)
CARDS = Path(taskspec.__file__).parent / "show" / "pages" / "templates" / "cards.html"
SPEC = r"""
taskspec: 1
name: Hostile
title: '<script>alert(1)</script> \input{/etc/passwd} & 100% #1 {x} ~ ^^5cinput $x$ _y_'
summary: '<img src=x onerror=alert(2)> \write18{touch pwned} ](javascript:alert(3)) `\input{a}` **bold**'
description: |
  <script>alert(4)</script>

  [click](javascript:alert(5)) and [data](data:text/html,<script>) and ![i](http://evil.example/x.png)
  and <b onclick="alert(6)">b</b> and $\input{secret} \write18{ls} x^2 \href{javascript:1}{y}$ and $^^5cinput$
  \immediate\write18{rm} and `code \input{b} </code><script>` and <javascript:alert(7)>

      \end{verbatim}\input{c} </pre><script>alert(8)</script>

  - item \end{itemize}\input{d}
capability: '"><script>alert(9)</script>'
sources:
  - {key: 'evil}\input{e}<script>', where: ']\input{f}{<script>'}
errata:
  - {source: '\catcode`\@=11 <i>', here: '</li><script>alert(10)</script>', because: '\def\x{}'}
parameters:
  n: {type: int, default: 3, low: 1, high: 9, symbol: '\input{g}<script>', doc: '<svg onload=alert(11)> \input{h}'}
constants:
  map:
    grid: ['<\', '&%']
    legend: {'<': 0, '\': 1, '&': 2, '%': 3}
state:
  s:
    type: choice
    values: ['</title><script>alert(12)</script>', '\input{i}', go]
    symbols: ['</text><script>alert(13)</script>', '\input{j}^^5cinput{k}', '\write18{x}']
    doc: '{{ 7 * 7 }} <% raw %> << x >>'
action:
  a: {type: choice, values: ['x"onmouseover="alert(14)', '}\input{l}', push]}
horizon: 2
initial: {s: '"</title><script>alert(12)</script>"'}
dynamics:
  s': go if a == push else s
reward: (s' == go) + n + map[0, 0]
figure: {kind: graph}
"""


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> Task:
    path = tmp_path_factory.mktemp("specs") / "hostile.yaml"
    path.write_text(SPEC, encoding="utf-8")
    return load(str(path))


@pytest.fixture(scope="module")
def folder(task: Task, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out")
    write([task], ["latex", "html", "markdown"], out)
    return out


class Elements(HTMLParser):
    """Collects tags and attributes."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs


def elements(path: Path) -> Elements:
    found = Elements()
    found.feed(path.read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("name", ["hostile.html", "index.html", "figures/hostile.svg"])
def test_html_and_svg_hold_no_script(folder: Path, name: str) -> None:
    found = elements(folder / name)
    assert not {"img", "iframe", "b", "i", "object", "embed"} & set(found.tags)
    scripts = SCRIPT.findall((folder / name).read_text(encoding="utf-8"))
    assert scripts == (
        SCRIPT.findall(CARDS.read_text(encoding="utf-8")) if name == "index.html" else []
    )  # the gallery's own
    assert found.tags.count("script") == len(scripts)
    assert not [key for key, _ in found.attributes if key.startswith("on")]
    addresses = [value or "" for key, value in found.attributes if key in ("href", "src", "xlink:href")]
    assert not [a for a in addresses if re.match(r"\s*(javascript|data|vbscript):", a, re.I)]


def test_html_is_one_document(folder: Path) -> None:
    found = elements(folder / "hostile.html")
    assert found.tags.count("html") == found.tags.count("body") == found.tags.count("h1") == 1


def test_latex_holds_no_command_of_the_spec(folder: Path) -> None:
    text = (folder / "hostile.tex").read_text(encoding="utf-8")
    assert not re.search(
        r"\\(input|write|immediate|catcode|def|csname|href|end\{verbatim\})", text.replace("\\input{}", "")
    )
    assert "^^" not in text


def test_markdown_holds_no_markup_of_the_spec(folder: Path) -> None:
    for name in ("hostile.md", "index.md"):
        text = (folder / name).read_text(encoding="utf-8")
        outside = re.sub(r"(`+).*?\1|^    .*$", "", text, flags=re.MULTILINE)
        assert not re.search(r"<(script|img|svg|b|i|li)\b", outside)
        assert not re.search(r"(?<!\\)\]\(<?\s*(javascript|data):", outside)
        inline = [token for block in MarkdownIt().parse(text) for token in block.children or ()]
        sources = [token.attrs["src"] for token in inline if token.type == "image"]
        assert all(str(source).startswith("figures/") for source in sources)  # nothing is loaded from elsewhere


def test_template_marks_are_text(folder: Path) -> None:
    assert "{{ 7 * 7 }}" in (folder / "hostile.html").read_text(encoding="utf-8")
    assert "<% raw %>".replace("<", r"\textless{}").replace(">", r"\textgreater{}").replace("%", r"\%") in (
        folder / "hostile.tex"
    ).read_text(encoding="utf-8")


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="no TeX")
def test_hostile_latex_compiles(task: Task, tmp_path: Path) -> None:
    write([task], ["pdf"], tmp_path)
    assert (tmp_path / "document.pdf").stat().st_size > 10_000
    assert not (tmp_path / "pwned").exists()


@pytest.mark.parametrize(
    ("address", "safe"),
    [("https://example.org/a:b", True), ("page.html#x", True), ("mailto:a@b.c", True), ("javascript:alert(1)", False),
     ("JaVaScript:alert(1)", False), (" javascript:alert(1)", False), ("data:text/html,x", False), ("java\nscript:x", False),
     ("vbscript:x", False), ("http://[", False)],
)  # fmt: skip
def test_addresses(address: str, safe: bool) -> None:
    assert is_safe(address) is safe
