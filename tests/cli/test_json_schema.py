"""The exported JSON Schema says of every spec what `check` says of its shape, to a validator and to an editor.

`jsonschema` reads the schema here as the standard has it, and yaml-language-server (when it is installed: `npm install -g
yaml-language-server`) as editors do."""

from __future__ import annotations

import pytest
import yaml

from taskspec.language import source
from taskspec.tools.authoring.scaffold import SCAFFOLD
from tests.language.task.test_json_schema import SHIPPED, Editor, marks
from tests.language.task.test_json_schema import editor as editor


def test_what_taskspec_new_writes_is_accepted() -> None:
    assert marks(source.read_text(SCAFFOLD.format(name="Walk", title="Walk")).data) == []


@pytest.mark.parametrize(
    "text",
    [
        "parameters: {L: {type: int, default: true}}",
        "parameters: {L: {type: bool, default: 1}}",
        "parameters: {L: {type: choice, values: [a], default: 2}}",
        "state: {s: {type: int, values: [a]}}",
        "state: {s: {type: choice, values: [a], low: 0}}",
        "action: {a: {type: bool, symbols: [p, q]}}",
        "parameters: {2x: {type: int, default: 1}}",
        "observation: {a-b: s}",
        "claims: [{clam: a}]",
        "claims: [3]",
        "examples: [{state: {s: 1}, action: {a: on}, doc: nothing follows}]",
    ],
)
def test_what_a_schema_can_say_about_keys_and_types(text: str) -> None:
    whole = source.read_text(SCAFFOLD.format(name="Walk", title="Walk")).data
    assert marks({**whole, **yaml.safe_load(text)})


def test_an_editor_marks_nothing_in_our_specs(editor: Editor) -> None:
    texts = {path.stem: path.read_text(encoding="utf-8") for path in SHIPPED}
    texts["scaffold"] = SCAFFOLD.format(name="Walk", title="Walk")
    marked = {name: found for name, text in texts.items() if (found := editor.marks(name, text))}
    assert marked == {}
