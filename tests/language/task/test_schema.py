"""The shape of specs: what is accepted, what is said about the rest, and the JSON Schema."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import taskspec
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.language import registry, source
from taskspec.language.task.build import attempts, build
from taskspec.language.task.schema.check import check_shape
from taskspec.language.task.schema.export import json_schema
from taskspec.language.task.schema.models import Spec
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
    return [each for each in listed(attempts(source.read_text(text))[1]) if each[0] != "E210"]


def listed(found: tuple[Diagnostic, ...]) -> list[tuple[str, str, str, str]]:
    assert all(each.span is not None for each in found)
    return [
        (each.code, f"{each.span.line}:{each.span.column}", each.message, each.hint or "")  # type: ignore[union-attr]
        for each in found
    ]


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_our_own_specs_have_the_right_shape(path: Path) -> None:
    assert check_shape(source.read_file(path)) == ()


# What is added after HEAD, and what is said about it: code, place, part of message, part of hint.
MISTAKES = [
    ("reward: {by: [s], row: {a: 1}}\n", "E202", "3:19", "`row`", "'rows'"),
    ("reward: {by: [s], row: {a: 1}}\n", "E208", "3:9", "no `rows`", ""),
    ("sumary: x\n", "E202", "3:1", "`sumary`", "'summary'"),
    ("zzz: x\n", "E202", "3:1", "`zzz`", "one of: title, summary"),
    ("dynamics:\ns': s + 1\n", "E202", "4:1", "`s'` is not indented", "part of `dynamics`"),
    ("state:\n  s: {typ: int}\n", "E202", "4:7", "`typ`", "'type'"),
    ("state:\n  s: {typ: int}\n", "E203", "4:3", "`s` has no `type`", ""),
    ("parameters: {L: {type: int, default: 1, hi: 2}}\n", "E202", "3:41", "`hi`", "'high'"),
    ("claims: [{claim: a, fro: []}]\n", "E202", "3:21", "`fro`", "'for'"),
    ("variants: {v: {sate: {}}}\n", "E202", "3:16", "`sate`", "'state'"),
    ("variants: {v: {state: {s: {tipe: int}}}}\n", "E202", "3:28", "`tipe`", "'type'"),
    ("variants: {v: {parameters: {L: {hi: 1}}}}\n", "E202", "3:33", "`hi`", "'high'"),
    ("variants: {v: {name: X}}\n", "E202", "3:16", "`name`", ""),
    ("parameters: {L: {type: int}}\n", "E203", "3:14", "`L` has no `default`", ""),
    ("state: {s: {type: choice}}\n", "E203", "3:9", "needs `values`", "[left, right]"),
    ("reward: {by: [s, a], rows: {1: {}, else: 0}}\n", "E204", "3:32", "an empty mapping", ""),
    ("reward: [{}, {else: 1}]\n", "E209", "3:10", "no `if`", ""),
    ("reward: [{if: a}, {else: 1}]\n", "E209", "3:10", "no `then`", ""),
    ("version: one\n", "E204", "3:10", "a whole number, found the text `one`", ""),
    ("version: 1.5\n", "E204", "3:10", "a whole number, found the number 1.5", ""),
    ("version: -1\n", "E204", "3:10", "too small", ""),
    ("summary: true\n", "E204", "3:10", "expected text, found `true`", "quotes"),
    ("claims: x\n", "E204", "3:9", "expected a list, found the text `x`", ""),
    ("claims: [3]\n", "E201", "3:10", "found the number 3", ""),
    ("horizon: 1.5\n", "E204", "3:10", "number of steps", ""),
    ("horizon: true\n", "E204", "3:10", "number of steps", ""),
    ("horizon: 0\n", "E204", "3:10", "cannot last 0 steps", ""),
    ("state: {s: {type: real, shape: [1.5]}}\n", "E204", "3:33", "a length", ""),
    ("state: {s: {type: real, low: true}}\n", "E204", "3:30", "found `true`", ""),
    ("state: {s: {type: choice, values: [a, 2]}}\n", "E204", "3:39", "the number 2", "words"),
    ("reward: {a: [1, 2]}\n", "E204", "3:13", "a probability, found a list", ""),
    ("state: 3\n", "E201", "3:8", "named entries", ""),
    ("state: {s: int}\n", "E201", "3:12", "named entries", ""),
    ("noise: {else: 1}\n", "E205", "3:9", "a word of the language", ""),
    ("noise: {from: 1}\n", "E205", "3:9", "a word of Python", "`from_`"),
    ("action: {a: {type: choice, symbols: [p, q]}}\n", "E203", "3:10", "needs `values`", "[left, right]"),
    ("noise: {max speed: 1}\n", "E205", "3:9", "not a name", "`max_speed`"),
    ("noise: {2x: 1}\n", "E205", "3:9", "not a name", ""),
    ("noise: {_x: 1}\n", "E205", "3:9", "starts with `_`", ""),
    ("noise: {xʹ: 1}\n", "E205", "3:9", "look like others", ""),
    ('definitions: {"f(x, 2)": 1}\n', "E205", "3:15", "`2` is not a name", ""),
    ('definitions: {"f(x, x)": 1}\n', "E205", "3:15", "same name", ""),
    ("parameters: {a-b: {type: int, default: 1}}\n", "E205", "3:14", "not a name", "`a_b`"),
    ("accept: {W999: it is meant}\n", "E206", "3:10", "`W999` is not the code of a warning", ""),
    ("accept: {E302: it is meant}\n", "E206", "3:10", "`E302` is not the code of a warning", ""),
    ("accept: {W518: ' '}\n", "E218", "3:16", "expected a reason", ""),
    ("accept: [W518]\n", "E201", "3:9", "named entries", ""),
    ("variants: {v: {accept: {W59: it is meant}}}\n", "E206", "3:25", "`W59`", "did you mean 'W5"),
    ("observation: {space: boxes}\n", "E206", "3:22", "`boxes`", "one_hot"),
    ("state: {s: {type: float}}\n", "E206", "3:19", "int, real, bool, choice", "write `type: real`"),
    ("reward: {by: [], rows: {a: 1}}\n", "E208", "3:14", "what the table looks at", "[s, a]"),
    ("reward: {by: [s], rows: {a: {b: {c: 1}}}}\n", "E208", "3:33", "deeper", ""),
    ("reward: {if: a, then: 1, else: 0}\n", "E209", "3:9", "is a list", "dash"),
    ("reward: [{else: 0}, {if: a, then: 1}]\n", "E209", "3:11", "comes last", ""),
    ("roles: {expert: Walk, learner: Wolk}\n", "E211", "3:32", "`Wolk`", "'Walk'"),
    ("parameters: {L: {type: bool, default: 1}}\n", "E213", "3:39", "not of type bool", ""),
    ("parameters: {L: {type: bool, default: yes}}\n", "E213", "3:39", "not of type bool", "`true` or `false`"),
    ("parameters: {L: {type: int, default: 1.5}}\n", "E213", "3:38", "not of type int", ""),
    ("state: {s: {type: int, values: [a]}}\n", "E214", "3:24", "no `values`", ""),
    ("state: {s: {type: choice, values: [a, a]}}\n", "E214", "3:39", "twice", ""),
    ("state: {s: {type: choice, values: [a], symbols: []}}\n", "E214", "3:49", "0 symbols", ""),
    ("reward: [{if: a, then: 1, else: 2}]\n", "E214", "3:27", "alone", "dash"),
    ("constants: {m: {grid: [], legend: {a: 1}}}\n", "E204", "3:23", "lines of letters", "block"),
    ("reward:\n", "E218", "3:1", "there is no value here", ""),
    ("initial: {s: [1, null]}\n", "E218", "3:18", "there is no value here", ""),
]


@pytest.mark.parametrize(("text", "code", "place", "message", "hint"), MISTAKES)
def test_mistakes(text: str, code: str, place: str, message: str, hint: str) -> None:
    found = all_problems(HEAD + text)
    matching = [each for each in found if each[:2] == (code, place)]
    assert len(matching) == 1, found
    assert message in matching[0][2]
    assert hint in matching[0][3]
    assert not any("Input should" in each[2] for each in found)


def test_every_problem_is_reported() -> None:
    text = HEAD + "state: {s: {type: intt}}\nreward: [{if: null}, {then: 1}]\nzzz: 1\n"
    assert [each[0] for each in all_problems(text)] == [
        "E206", "E209", "E218", "E209", "E202",
    ]  # fmt: skip


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


def of_task(text: str, variant: str | None = None) -> list[tuple[str, str, str]]:
    """Code, place and message of what building a task, or a variant of it, says."""
    with pytest.raises(SpecError) as caught:
        build(source.read_text(text), variant)
    return [(d.code, f"{d.span.line}:{d.span.column}" if d.span else "", d.message) for d in caught.value.diagnostics]


def test_what_a_task_needs() -> None:
    found = of_task(HEAD)
    sections = ["state", "action", "initial", "dynamics", "reward", "horizon"]
    assert [each[:2] for each in found] == [("E210", "2:7")] * 6
    for section, (_, _, message) in zip(sections, found, strict=True):
        assert f"`{section}:`" in message


def test_components_must_be_declared() -> None:
    text = WHOLE.replace("initial: {s: 0, v: [0, 0]}", "initial: {s: 0, w: 1}")
    text = text.replace("  s':", "  z': 1\n  s':") + "expert: {b: go}\n"
    found = {each[:2] for each in of_task(text)}
    assert found == {("E217", "11:1"), ("E216", "11:17"), ("E216", "13:3"), ("E313", "22:10")}


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
# What the variant says, and what is said about it: code, place and part of the message.
VARIANTS = [
    ("parameters: {K: {default: 3}}", "E219", "12:18", "no `K` in `parameters`"),
    ("parameters: {K: null}", "E219", "12:18", "no `K` in `parameters`"),
    ("parameters: {K: {type: int}}", "E203", "12:18", "`K` has no `default`"),
    ("parameters: {K: {type: int, default: null}}", "E203", "12:33", "`K` has no `default`"),
    ("parameters: {L: {default: null}}", "E203", "12:22", "`L` has no `default`"),
    ("parameters: {L: {type: null}}", "E203", "12:22", "`L` has no `type`"),
    ("parameters: {L: {type: bool}}", "E213", "3:38", "the number 9 is not of type bool"),
    ("parameters: {L: {values: [a]}}", "E214", "12:22", "no `values`"),
    ("state: {x: {low: 3}}", "E219", "12:13", "no `x` in `state`"),
    ("state: {x: {}}", "E219", "12:13", "no `x` in `state`"),
    ("state: {x: null}", "E219", "12:13", "no `x` in `state`"),
    ("state: {x: {type: choice}}", "E203", "12:13", "needs `values`"),
    ("state: {x: {type: int}}", "E217", "12:13", "'x' has no value in `initial`"),
    ("state: {s: {type: choice}}", "E203", "4:9", "needs `values`"),
    ("state: {s: null}", "E210", "4:1", "names no component"),
    ("action: {b: {symbol: b}}", "E219", "12:14", "no `b` in `action`"),
    ("action: {a: {symbols: [x]}}", "E214", "12:27", "1 symbols for 2 labels"),
    ("constants: {c: null}", "E219", "12:17", "no `c` in `constants`"),
    ("definitions: {c: null}", "E219", "12:19", "no `c` in `definitions`"),
    ("noise: {c: null}", "E219", "12:13", "no `c` in `noise`"),
    ("observation: {c: null}", "E219", "12:19", "no `c` in `observation`"),
    ("initial: {c: null}", "E219", "12:15", "no `c` in `initial`"),
    ("initial: {s: null}", "E217", "7:1", "'s' has no value in `initial`"),
    ("dynamics: {c': null}", "E219", "12:16", "no `c'` in `dynamics`"),
    ("state:", "E210", "12:5", "`state:`"), ("reward: null", "E210", "12:5", "`reward:`"),
    ("horizon: ~", "E210", "12:5", "`horizon:`"), ("initial:", "E210", "12:5", "`initial:`"),
    ("dynamics:", "E210", "12:5", "`dynamics:`"), ("action:", "E210", "12:5", "`action:`"),
]  # fmt: skip


@pytest.mark.parametrize("base", [False, True], ids=["", "by way of another"])
@pytest.mark.parametrize(("text", "code", "place", "message"), VARIANTS, ids=[v[0] for v in VARIANTS])
def test_variants_are_checked_as_the_tasks_that_they_are(
    text: str, code: str, place: str, message: str, base: bool
) -> None:
    found = of_task(f"{WALK}    {text}\n" + "  w: {base: v}\n" * base, "w" if base else "v")
    assert [each[:2] for each in found] == [(code, place)]
    assert message in found[0][2]


def test_a_variant_may_change_the_type_of_a_component() -> None:
    for entry in ("{type: bool}", "{type: choice, values: [off, on]}", "{type: real}"):
        first = "off" if "choice" in entry else "false" if "bool" in entry else "0"
        text = f"{WALK}    state: {{s: {entry}}}\n    initial: {{s: {first}}}\n    dynamics: {{s': s}}\n    reward: 0\n"
        assert (build(source.read_text(text), "v").state[0].high == (1,)) == ("real" not in entry)


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
        yield from ((f"{path}.{key}", value) for key, value in properties.items())
        for key, value in schema.items():
            if key not in ("if", "then"):
                yield from keys(value, f"{path}.{key}")


def test_every_key_of_the_json_schema_is_documented() -> None:
    found = dict(keys(json_schema()))
    assert len(found) > 80
    assert [path for path, value in found.items() if not value.get("description")] == []


def references(schema: Any) -> Iterator[str]:
    if isinstance(schema, list | dict):
        for item in schema.values() if isinstance(schema, dict) else schema:
            yield from references(item)
    if isinstance(schema, dict) and isinstance(schema.get("$ref"), str):
        yield schema["$ref"]


def test_every_reference_of_the_json_schema_leads_somewhere() -> None:
    schema = json_schema()
    assert {ref.removeprefix("#/$defs/") for ref in references(schema)} <= set(schema["$defs"])
    assert "x-form" not in str(schema)


def test_the_json_schema_knows_every_section() -> None:
    sections = {field.alias or key for key, field in Spec.model_fields.items()}
    schema = json_schema()
    assert set(schema["$defs"]["Spec"]["properties"]) == sections
    variant = set(schema["$defs"]["Variant"]["properties"])
    assert variant == sections - {"taskspec", "name", "variants"} | {"base", "extends"}
    assert set(schema["$defs"]["Extension"]["properties"]) == variant | sections


TINY = """\
taskspec: 1
name: Tiny
state: {s: {type: int, low: 0, high: 2}}
action: {a: {type: bool}}
horizon: 3
initial: {s: 0}
dynamics: {"s'": "min(2, s + 1) if a else s"}
reward: s == 2
"""
