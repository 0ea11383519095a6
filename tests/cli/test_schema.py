"""The shape of specs and the JSON Schema: mistakes beside each other, variants, and what editors mark."""

from pathlib import Path

import pytest
import yaml

from taskspec.base.diagnostics import SpecError
from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.language.task.schema.models import Spec
from taskspec.tools.authoring.checks import check_file, examine
from taskspec.tools.authoring.scaffold import SCAFFOLD
from taskspec.tools.targets import File
from tests.language.task.test_json_schema import SHIPPED, Editor, marks
from tests.language.task.test_json_schema import editor as editor
from tests.language.task.test_schema import HEAD, WALK, WHOLE
from tests.shared.commands import Done, spec


def test_a_whole_spec_loads() -> None:
    spec = Spec.model_validate(source.read_text(WHOLE).data)
    assert list(spec.parameters.entries) == ["L", "p"]
    assert spec.parameters.entries["p"].default == "1/3"
    assert spec.parameters.require[0].message == "too short"
    assert spec.state["v"].shape == [2]
    assert spec.horizon == "none"
    assert spec.dynamics["s'"]["rows"]["0"]["go"] == {"1": "p", "0": "1 - p"}
    first, second = spec.claims
    assert (first.claim, second.claim, second.for_) == ("optimal_return == 1", "states == 10", [{"L": 9}])
    assert [each.key for each in spec.sources] == ["paper", "other"]
    assert (spec.version, spec.discount, spec.absorbing_reward) == (0, 1, 0)


def checked(folder: Path, text: str) -> list[tuple[str, str]]:
    """What `taskspec check` says of a file: codes with messages, and the names of the tasks it looked at."""
    path = spec(folder, text, f"{len(list(folder.iterdir()))}.yaml")
    report = check_file(File(path, "mine"), examine)
    said = [(each.code, each.message) for each in report.diagnostics if each.severity == "error"]
    said += [("", task.name) for task in report.tasks]
    return said


def test_a_variant_that_lacks_a_section_is_an_error(tmp_path: Path) -> None:
    partial = WALK.replace("reward: s' == L\n", "")
    lacks = ("E210", "WalkV has no `reward:` section")
    assert checked(tmp_path, f"{partial}    {{}}\n  w: {{reward: 1}}\n") == [lacks, ("", "WalkV"), ("", "WalkW")]
    assert checked(tmp_path, f"{partial}    {{}}\n  w: {{reward: 1, base: v}}\n")[:1] == [lacks]
    assert checked(tmp_path, f"{WALK}    reward:\n") == [lacks, ("", "Walk"), ("", "WalkV")]
    assert checked(tmp_path, f"{partial}    reward: 1\n") == [("", "WalkV")]
    *lacking, (none, _) = checked(tmp_path, HEAD + "variants: {v: {}}\n")
    assert [code for code, _ in lacking] == ["E210"] * 6 and none == ""


WRONG_IN_MANY_WAYS = """\
taskspec: 1
name: Many
colour: red
parameters:
  L: {type: int, default: 5, low: 1}
  M: {type: int, default: L - 9, low: L}
state:
  s: {type: int, low: 0, high: L}
  p: {type: float, low: 0}
  q: {type: choice, values: [up, down], low: 0}
action:
  a: {type: choice, values: {left: -1, right: 1}}
  b: {type: int, low: 0, high: Lx}
horizon: 2 * L
initial: {s: 0, p: 1, q: up}
dynamics:
  s': clip(s + a, 0, L) + foo(2)
  p': p + zz
  q': down if q == up else up
reward: s' == L + Q
terminal: s' == T
claims: 3
expert: {a: right, b: 1, c: 2}
figure: {kind: graf}
"""


def places(done: Done) -> list[tuple[str, int]]:
    """Codes and lines of diagnostics."""
    return [(each["code"], each["line"]) for each in done.data["diagnostics"]]


def test_one_mistake_hides_no_other(tmp_path: Path) -> None:
    found = Done("check", spec(tmp_path, WRONG_IN_MANY_WAYS), "--json")
    assert places(found) == [
        ("E202", 3), ("E213", 6), ("E206", 9), ("E214", 10), ("E302", 13), ("E303", 17), ("E302", 20), ("E204", 22),
        ("E216", 23), ("E206", 24),
    ]  # fmt: skip
    with pytest.raises(SpecError) as caught:
        build(source.read_text(WRONG_IN_MANY_WAYS))
    assert len(caught.value.diagnostics) == 10


EXPERIMENT = """\
experiment: 1
name: wrong
sedes: 3
tasks:
  - task: derail/Branching
    parameters: {K: 3}
  - task: derail/Branchng
measures: [hardness]
policies: [cleverly]
"""


def test_an_unknown_key_of_an_experiment_hides_no_other_mistake(tmp_path: Path) -> None:
    found = Done("check", spec(tmp_path, EXPERIMENT), "--json")
    assert places(found) == [("E202", 3), ("E702", 6), ("E701", 7), ("E206", 8), ("E713", 9)]


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
    for path in SHIPPED:
        assert not editor.marks(path.stem, path.read_text(encoding="utf-8")), path
    assert not editor.marks("scaffold", SCAFFOLD.format(name="Walk", title="Walk"))
