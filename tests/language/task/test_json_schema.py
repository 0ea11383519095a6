"""The exported JSON Schema says of every spec what `check` says of its shape, to a validator and to an editor.

`jsonschema` reads the schema here as the standard has it, and yaml-language-server (when it is installed: `npm install -g
yaml-language-server`) as editors do.
"""

import copy
import json
import random
import re
import shutil
import subprocess
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import yaml
from jsonschema import Draft202012Validator

from taskspec.base.diagnostics import SpecError
from taskspec.language import source
from taskspec.language.task.build import attempts
from taskspec.language.task.schema.check import check_shape
from taskspec.language.task.schema.export import json_schema
from tests.shared.for_each import for_each
from tests.shared.specs import specs

ROOT = Path(__file__).parents[3]
SHIPPED = specs("tasks/*/*.yaml", "tests/specs/**/*.yaml")
PAGES = [ROOT / "README.md", *sorted(ROOT.glob("docs/*/*.md"))]  # the site writes pages of tasks further below
BROKEN = sorted(ROOT.glob("tests/errors/E2*.yaml"))

BEYOND_A_SCHEMA = {
    "E211": "names of variants are looked up",
    "E212": "a circle of variants",
    "E213": "a default is compared with its bounds and values",
    "E216": "components are looked up",
    "E217": "components are looked up",
    "E219": "what a variant changes is looked up",
}
"""What a schema cannot say: each compares one part of a spec with another."""

OF_EXPRESSIONS = ("E202", "E204", "E208", "E209", "E214", "E218")
"""The shapes of expressions, which are reported when a task is built."""

PARTLY = {
    "E208": "the depth of rows is compared with `by`; a table of the wrong shape is marked",
    "E209": "`else` comes last; that there is one is marked",
    "E214": "labels are counted and compared; keys that a type does not have are marked",
}

SNIPPET = re.compile(r"(<!-- .*? -->\n+)?^```yaml\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@cache
def validator() -> Draft202012Validator:
    return Draft202012Validator(json_schema())


def marks(data: Any) -> list[str]:
    return [f"{each.json_path}: {each.message}" for each in validator().iter_errors(data)]


def test_the_schema_is_one() -> None:
    Draft202012Validator.check_schema(json_schema())


@for_each("path", SHIPPED)
def test_our_own_specs_are_accepted(path: Path) -> None:
    assert marks(source.read_file(path).data) == []


@for_each("page", PAGES)
def test_specs_on_the_pages_are_accepted(page: Path) -> None:
    """Whole specs, and those that a block of sections makes of the last one."""
    last: dict[str, Any] = {}
    for comment, body in SNIPPET.findall(page.read_text(encoding="utf-8")):
        if "error:" in comment or "skip:" in comment or page.stem == "errors":
            continue
        data = yaml.safe_load(body)
        if "experiment" in data or "learner" in data:
            continue
        if "taskspec" in data:
            last = data
        assert marks({**last, **data}) == [], body


@for_each("path", BROKEN)
def test_broken_shapes_are_marked(path: Path) -> None:
    marked = bool(marks(source.read_file(path).data))
    assert marked is (path.stem[:4] not in BEYOND_A_SCHEMA)


# -- mutants of real specs ----------------------------------------------------------------------------------------


def places(data: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items: Iterable[tuple[Any, Any]] = ()
    if isinstance(data, dict):
        items = data.items()
    elif isinstance(data, list):
        items = enumerate(data)
    for key, value in items:
        yield (*path, key)
        yield from places(value, (*path, key))


OTHERS = [None, True, 3, -1, 0.5, "x", "2 * L", [], ["a"], [1, 2], {}, {"x": 1}, {"type": "int"}, "stay"]


def mutant(data: dict[str, Any], rng: random.Random) -> dict[str, Any]:
    """A spec with one entry deleted, renamed, doubled under another name, or replaced."""
    changed = copy.deepcopy(data)
    *path, key = rng.choice(list(places(changed)))
    parent = changed
    for step in path:
        parent = parent[step]
    value = parent.pop(key)
    match rng.choice(("delete", "rename", "replace", "replace")):
        case "rename" if isinstance(parent, dict):
            parent[rng.choice((f"{key}_", f"{key}'", f"2{key}", "values", "type", "low", "else", "θ"))] = value
        case "replace" if isinstance(parent, dict):
            parent[key] = copy.deepcopy(rng.choice(OTHERS))
        case "replace":
            parent.insert(key, copy.deepcopy(rng.choice(OTHERS)))
        case _:
            pass
    return changed


def disagreement(data: dict[str, Any]) -> str | None:
    """How the schema and the check of shapes differ on a spec, in words."""
    try:
        document = source.read_text(yaml.safe_dump(data, sort_keys=False, allow_unicode=True))
    except SpecError:
        return None
    marked = [each for each in marks(document.data) if "abstraction" not in each]  # which is built when it is needed
    found = [*check_shape(document), *attempts(document)[1]]
    if marked and not found and not lacks_sections(document.data):
        return f"the schema marks {marked}"
    # what is a cell and what a probability depends on how long `by` is
    shapes = (each for each in found if each.code in OF_EXPRESSIONS or each in check_shape(document))
    codes = {each.code for each in shapes if "probability" not in each.message}
    if not marked and codes - (BEYOND_A_SCHEMA | PARTLY).keys():
        return f"the schema passes {codes}"
    return None


def lacks_sections(data: dict[str, Any]) -> bool:
    return "variants" not in data and not {"state", "action", "initial", "dynamics", "reward", "horizon"} <= data.keys()


def search(count: int) -> None:
    specs = [source.read_file(path).data for path in SHIPPED]
    for seed in range(count):
        rng = random.Random(seed)
        changed = mutant(rng.choice(specs), rng)
        assert disagreement(changed) is None, f"seed {seed}: {disagreement(changed)}\n{yaml.safe_dump(changed)}"


def test_the_schema_agrees_with_check_on_mutants() -> None:
    search(30)


@pytest.mark.slow
def test_the_schema_agrees_with_check_on_many_mutants() -> None:
    search(4000)


# -- a real editor's server ---------------------------------------------------------------------------------------

SERVER = shutil.which("yaml-language-server")


class Editor:
    """A client of a language server, with our schema for every file: opens a text, gets what is marked.

    Messages are JSON-RPC over standard input and output, each after a header with its length (Language Server Protocol 3.17).
    """

    def __init__(self, server: str, schema: Path) -> None:
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([server, "--stdio"], stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL)
        self.settings = {"schemas": {schema.as_uri(): "*.yaml"}, "validate": True, "schemaStore": {"enable": False}}
        capabilities = {"workspace": {"configuration": True}, "textDocument": {"publishDiagnostics": {}}}
        self.send("initialize", {"processId": None, "rootUri": None, "capabilities": capabilities}, number=1)
        self.wait(lambda message: message.get("id") == 1)
        self.send("initialized", {})
        self.send("workspace/didChangeConfiguration", {"settings": {"yaml": self.settings}})

    def send(self, method: str | None, content: Any, number: int | None = None) -> None:
        message: dict[str, Any] = {"jsonrpc": "2.0"}
        message |= {"result": content} if method is None else {"method": method, "params": content}
        body = json.dumps(message if number is None else message | {"id": number}).encode()
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.process.stdin.flush()

    def read(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        length = 0
        while line := self.process.stdout.readline().strip():
            name, _, value = line.partition(b":")
            length = int(value) if name.lower() == b"content-length" else length
        assert length, "the server has ended"
        return dict(json.loads(self.process.stdout.read(length)))

    def wait(self, wanted: Any) -> dict[str, Any]:
        """The next message that is wanted; on the way, the server's questions are answered."""
        while True:
            message = self.read()
            if wanted(message):
                return message
            if "id" in message and "method" in message:
                items = message.get("params", {}).get("items", ())
                known = {"yaml": self.settings}
                self.send(None, [known.get(item["section"]) for item in items], message["id"])

    def marks(self, name: str, text: str) -> list[str]:
        uri = f"file:///{name}.yaml"
        document = {"uri": uri, "languageId": "yaml", "version": 1, "text": text}
        self.send("textDocument/didOpen", {"textDocument": document})
        found = self.wait(lambda m: m.get("method") == "textDocument/publishDiagnostics" and m["params"]["uri"] == uri)
        return [f"{each['range']['start']['line'] + 1}: {each['message']}" for each in found["params"]["diagnostics"]]

    def close(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture(scope="module")
def editor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Editor]:
    if SERVER is None:
        pytest.skip("yaml-language-server is not installed")
    path = tmp_path_factory.mktemp("schema") / "taskspec.schema.json"
    path.write_text(json.dumps(json_schema()), encoding="utf-8")
    running = Editor(SERVER, path)
    yield running
    running.close()


def test_an_editor_marks_broken_specs(editor: Editor) -> None:
    for path in BROKEN:
        marked = editor.marks(path.stem, path.read_text(encoding="utf-8"))
        assert bool(marked) is (path.stem[:4] not in BEYOND_A_SCHEMA), (path.stem, marked)
