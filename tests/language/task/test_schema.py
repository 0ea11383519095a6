"""The shape of specs: what is accepted, what is said about the rest, and the JSON Schema."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import pytest

import taskspec
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language import registry, source
from taskspec.language.task.build import attempts
from taskspec.language.task.schema.check import check_shape
from taskspec.language.task.schema.export import json_schema
from taskspec.language.task.schema.models import Spec
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each
from tests.shared.sections import build_text
from tests.shared.specs import specs

ROOT = Path(__file__).parents[3]
SPECS = specs("tasks/*/*.yaml", "tests/specs/*.yaml")

HEAD = "taskspec: 1\nname: Walk\n"
WHOLE = HEAD + (
    "parameters:\n"
    "  L: {type: int, default: 9, low: 1}\n"
    "  p: {type: real, default: 1/3, low: 0, high: 1}\n"
    "  require: [{condition: L > 2, message: too short}]\n"
    "state: {s: {type: int, low: 0, high: L}, v: {type: real, shape: [2], high: .inf}}\n"
    "action: {a: {type: choice, values: [stay, go], symbols: ['0', '1']}}\n"
    "observation: {space: dict, s: s}\n"
    "horizon: none\n"
    "initial: {s: 0, v: [0, 0]}\n"
    "dynamics:\n"
    "  s':\n"
    "    by: [s, a]\n"
    "    rows: {0: {go: {1: p, 0: 1 - p}, else: 0}, else: s}\n"
    "reward:\n"
    "  - {if: s' == L, then: 1}\n"
    "  - else: 0\n"
    "claims: [optimal_return == 1, {claim: states == 10, for: [{L: 9}]}]\n"
    "sources: [paper, {key: other, where: page 3}]\n"
)


def problems(text: str) -> list[tuple[str, str, str, str]]:
    """Code, place, message and hint of everything that is wrong with the sections of a text."""
    return listed(check_shape(source.read_text(text)))


def all_problems(text: str) -> list[tuple[str, str, str, str]]:
    """The same of its expressions as well; a state and an action stand below, if it has none."""
    for section in ("state", "action"):
        if f"\n{section}:" not in text:
            text += f"{section}: {{{section[0]}: {{type: choice, values: [only]}}}}\n"
    return listed(each for each in attempts(source.read_text(text))[1] if each.code != "E210")


def listed(diagnostics: Iterable[Diagnostic]) -> list[tuple[str, str, str, str]]:
    rows = []
    for each in diagnostics:
        assert each.span is not None
        rows.append((each.code, f"{each.span.line}:{each.span.column}", each.message, each.hint or ""))
    return rows


@for_each("path", SPECS)
def test_our_own_specs_have_the_right_shape(path: Path) -> None:
    assert check_shape(source.read_file(path)) == ()


def test_every_problem_is_reported() -> None:
    text = HEAD + "state: {s: {type: intt}}\nreward: [{if: null}, {then: 1}]\nzzz: 1\n"
    codes, *_ = zip(*all_problems(text), strict=True)
    assert codes == ("E206", "E209", "E218", "E209", "E202")


@pytest.mark.parametrize(("text", "words"), [("- 1\n", "a list"), ("hello\n", "`hello`")])
def test_the_root_is_a_mapping(text: str, words: str) -> None:
    ((code, place, message, _),) = problems(text)
    assert (code, place) == ("E201", "1:1")
    assert words in message


def test_the_format_is_named() -> None:
    ((code, _, _, hint),) = problems("name: Walk\n")
    assert (code, hint) == ("E203", "start it with `taskspec: 1`")


def test_variants_may_leave_out_and_remove() -> None:
    text = WHOLE + (
        "variants:\n"
        "  short: {parameters: {L: {default: 3}, p: null}, terminal: null}\n"
        "  wide: {base: short, state: {s: {high: 2*L}}, observation: {s: null, space: box}}\n"
    )
    assert problems(text) == []


def of_task(text: str) -> list[tuple[str, str, str, str]]:
    """Code, place, message and hint of what building a task says."""
    return listed(refusal(build_text, text).diagnostics)


def test_what_a_task_needs() -> None:
    found = of_task(HEAD)
    sections = ["state", "action", "initial", "dynamics", "reward", "horizon"]
    for section, (code, place, message, _) in zip(sections, found, strict=True):
        assert (code, place) == ("E210", "2:7") and f"`{section}:`" in message


def test_components_must_be_declared() -> None:
    text = WHOLE.replace("initial: {s: 0, v: [0, 0]}", "initial: {s: 0, w: 1}")
    text = text.replace("  s':", "  z': 1\n  s':") + "expert: {b: go}\n"
    found = {each[:2] for each in of_task(text)}
    assert found == {("E217", "11:1"), ("E216", "11:17"), ("E216", "13:3"), ("E216", "22:1"), ("E216", "22:10")}


# -- variants, and what they come to ----------------------------------------------------------------------------------

WALK = """\
taskspec: 1
name: Walk
parameters: {L: {type: int, default: 9, low: 1, high: 99}}
state: {s: {type: int, low: 0, high: L}}
action: {a: {type: choice, values: [stay, go]}}
horizon: 9
initial: {s: 0}
dynamics: {s': "min(s + (a == go), L)"}
reward: s' == L
variants:
  v:
"""


def test_a_variant_may_change_the_type_of_a_component() -> None:
    for entry, first in (
        ("{type: bool}", "false"),
        ("{type: choice, values: [off, on]}", "off"),
        ("{type: real}", "0"),
    ):
        text = f"{WALK}    state: {{s: {entry}}}\n    initial: {{s: {first}}}\n    dynamics: {{s': s}}\n    reward: 0\n"
        assert (build_text(text, "v").state[0].high == (1,)) == ("real" not in entry)


def test_an_incomplete_variant_is_listed_and_says_what_it_lacks(tmp_path: Path) -> None:
    path = tmp_path / "walk.yaml"
    path.write_text(WALK.replace("reward: s' == L\n", "") + "    title: x\n", encoding="utf-8")
    (entry,) = registry.entries(tmp_path)
    assert entry.name == "WalkV"
    with pytest.raises(SpecError, match=r"E210.*WalkV has no `reward:`"):
        taskspec.make(path, "v")


def keys(schema: Any, path: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every key that the JSON Schema names, with the schema of its value; rules of `if` and `then` name no new ones."""
    if isinstance(schema, list):
        for item in schema:
            yield from keys(item, path)
    elif isinstance(schema, dict):
        properties = schema.get("properties", {})
        for key, value in properties.items():
            yield f"{path}.{key}", value
        for key, value in schema.items():
            if key not in ("if", "then"):
                yield from keys(value, f"{path}.{key}")


def test_every_key_of_the_json_schema_is_documented() -> None:
    found = dict(keys(json_schema()))
    assert len(found) > 80
    for path, value in found.items():
        assert value.get("description"), path


def references(schema: Any) -> Iterator[str]:
    if isinstance(schema, list | dict):
        for item in schema.values() if isinstance(schema, dict) else schema:
            yield from references(item)
    if isinstance(schema, dict) and isinstance(schema.get("$ref"), str):
        yield schema["$ref"]


def test_every_reference_of_the_json_schema_leads_somewhere() -> None:
    schema = json_schema()
    for reference in references(schema):
        assert reference.removeprefix("#/$defs/") in schema["$defs"]
    assert "x-form" not in str(schema)


def test_the_json_schema_knows_every_section() -> None:
    sections = {field.alias or key for key, field in Spec.model_fields.items()}
    schema = json_schema()
    assert set(schema["$defs"]["Spec"]["properties"]) == sections
    variant = set(schema["$defs"]["Variant"]["properties"])
    assert variant == sections - {"taskspec", "name", "variants"} | {"base", "extends"}
    assert set(schema["$defs"]["Extension"]["properties"]) == variant | sections


TINY = """
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: bool}}
horizon: 3
initial: {s: 0}
dynamics: {"s'": "min(2, s + 1) if a else s"}
reward: s == 2
"""
