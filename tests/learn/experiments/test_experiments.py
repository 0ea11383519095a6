"""Experiments: what a file means, instance by instance, and what is said where it is wrong."""

import itertools
import json
import shutil
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

import taskspec
from taskspec import experiments
from taskspec.base.diagnostics import SpecError
from taskspec.learn.documents.document_models import Experiment, document_schema
from taskspec.learn.experiments.experiment_file import shipped
from tests.shared.commands import Done

HEAD = "experiment: 1\nname: e\ntasks:\n"


def expanded(text: str, folder: Path) -> experiments.Expanded:
    path = folder / "e.yaml"
    path.write_text(text, encoding="utf-8")
    return experiments.expand(experiments.read(path))


def found(entry: str, folder: Path) -> list[dict[str, Any]]:
    """The values of the parameters of all instances of one entry, which is given as a flow mapping."""
    result = expanded(f"{HEAD}  - {entry}\n", folder)
    assert not result.diagnostics, result.diagnostics
    return [dict(i.parameters) for i in result.instances]


def test_lists_and_ranges_are_combined_in_the_order_written(tmp_path: Path) -> None:
    got = found("{task: Branching, parameters: {L: {range: [2, 10, 2]}, B: [2, 3]}}", tmp_path)
    assert [(g["L"], g["B"]) for g in got] == list(itertools.product(range(2, 10, 2), (2, 3)))


@pytest.mark.parametrize(
    ("written", "values"),
    [
        ("7", [7]),
        ("[5, 50]", [5, 50]),
        ("{range: [2, 5]}", [2, 3, 4]),
        ("{range: [9, 2, -3]}", [9, 6, 3]),
        ("{logrange: [1, 1000, 4]}", [1, 10, 100, 1000]),
        ("{logrange: [1, 3, 9]}", [1, 2, 3]),
        ("B + 1", [3]),
        ("[B, B * B, 2 ** 3]", [2, 4, 8]),
    ],
)
def test_values_of_an_int(written: str, values: list[int], tmp_path: Path) -> None:
    got = found(f"{{task: Branching, parameters: {{B: 2, L: {written}}}}}".replace("[B,", '["B",'), tmp_path)
    assert [g["L"] for g in got] == values and all(type(g["L"]) is int for g in got)


def test_values_of_a_real_are_the_decimals_that_are_written(tmp_path: Path) -> None:
    got = found("{task: Parabola, parameters: {dx: {range: [0.1, 0.5, 0.1]}}}", tmp_path)
    assert [g["dx"] for g in got] == [0.1, 0.2, 0.3, 0.4]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("0.1 * 6", 0.6), ("0.1 + 0.2", 0.3), ("3 * A", 0.3), ("A / 3 + 2 * A / 3", 0.1), ("1e-300 * 1e300", 1.0),
        ("0.1 ** 3", 0.001), ("sqrt(2)", 2**0.5), ("1e-320", 1e-320), ("0.1 if A == 0.1 else 2", 0.1), ("-0.7 - 0.2", -0.9),
    ],
)  # fmt: skip
def test_decimals_of_expressions_are_exact(written: str, value: float, tmp_path: Path) -> None:
    (got,) = found(f"{{task: Parabola, parameters: {{A: 0.1, dx: {written}}}}}", tmp_path)
    assert got["dx"] == value
    (instance,) = expanded(f"{HEAD}  - {{task: Parabola, parameters: {{A: 0.1, dx: {written}}}}}\n", tmp_path).instances
    assert f"dx={value}" in instance.id.replace("%2B", "+")


def test_expressions_read_the_other_values_and_defaults(tmp_path: Path) -> None:
    spec = tmp_path / "sub" / "t.yaml"
    spec.parent.mkdir()
    spec.write_text(
        "taskspec: 1\nname: T\nparameters:\n  a: {type: int, default: 4}\n  b: {type: int, default: 2 * a}\n"
        "  c: {type: real, default: 0.5}\n  d: {type: choice, values: [x, y], default: x}\n"
        "state: {s: {type: int, low: 0, high: 1}}\naction: {u: {type: bool}}\ninitial: {s: 0}\ndynamics: {s': s}\n"
        "reward: u\nhorizon: 3\n",
        encoding="utf-8",
    )
    entry = "{task: sub/t.yaml, parameters: {c: b / 4 + a, a: [4, 6], d: y}}"
    assert [(g["a"], g["b"], g["c"], g["d"]) for g in found(entry, tmp_path)] == [(4, 8, 6.0, "y"), (6, 12, 9.0, "y")]


def test_lists_that_go_together(tmp_path: Path) -> None:
    got = found("{task: Branching, zip: {L: [2, 3, 4], B: [4, 3, 2]}}", tmp_path)
    assert [(g["L"], g["B"]) for g in got] == [(2, 4), (3, 3), (4, 2)]


def test_a_sample_is_of_the_combinations_and_the_same_every_time(tmp_path: Path) -> None:
    entry = "{task: Branching, parameters: {L: {range: [2, 12]}, B: {range: [2, 12]}}, sample: {count: 20, seed: 3}}"
    got = found(entry, tmp_path)
    pairs = [(g["L"], g["B"]) for g in got]
    assert len(set(pairs)) == 20 and set(pairs) <= set(itertools.product(range(2, 12), repeat=2))
    assert got == found(entry, tmp_path) != found(entry.replace("seed: 3", "seed: 4"), tmp_path)


def test_values_are_drawn_from_ranges(tmp_path: Path) -> None:
    entry = "{task: NoisyObs, parameters: {L: {loguniform: [1, 1000]}, M: {uniform: [3, 9]}}, sample: 200}"
    got = found(entry, tmp_path)
    assert {g["M"] for g in got} <= set(range(3, 10)) and len({g["M"] for g in got}) == 7
    assert 0.25 < sum(g["L"] <= 30 for g in got) / len(got) < 0.75


def test_every_instance_is_a_task_that_is_loaded_by_its_id(tmp_path: Path) -> None:
    for instance in experiments.expand(experiments.read(shipped()["derail/noise"])).instances:
        task = taskspec.load(instance.id)
        assert task.instance_id == instance.id and task.values == instance.parameters
        assert task.content_hash == instance.content_hash


def test_an_instance_that_cannot_be_does_not_stop_the_others(tmp_path: Path) -> None:
    result = expanded(HEAD + "  - {task: Branching, parameters: {L: [2, -1, 3]}}\n", tmp_path)
    assert [i.problem is None for i in result.instances] == [True, False, True]
    assert "must be at least" in str(result.instances[1].problem)
    assert [(d.code, d.span.line) for d in result.refused if d.span] == [("E703", 4)]
    assert Done("check", str(tmp_path / "e.yaml")).status == 1


@pytest.mark.parametrize(
    ("entry", "code", "at", "words"),
    [
        ("{task: Brunching}", "E701", "Brunching", "Branching"),
        ("{task: nowhere.yaml}", "E710", "nowhere.yaml", "nowhere.yaml"),
        ("{task: Branching, parameters: {K: 3}}", "E702", "K", "no parameter"),
        ("{task: Branching, parameters: {L: foo + 1}}", "E302", "foo", "not defined"),
        ("{task: Branching, parameters: {L: B +}}", "E301", None, ""),
        ("{task: Branching, parameters: {L: B, B: L}}", "E310", None, "its own value"),
        ("{task: Branching, parameters: {L: {range: [5, 2]}}}", "E214", "{range: [5, 2]}", "empty"),
        ("{task: Branching, parameters: {L: {ranges: [5, 2]}}}", "E202", "ranges", "range"),
        ("{task: Branching, parameters: {L: {range: [5]}}}", "E204", "[5]", "2 or 3 numbers"),
        ("{task: Branching, parameters: {L: {logrange: [0, 2, 3]}}}", "E214", "{logrange: [0, 2, 3]}", "above 0"),
        ("{task: Branching, parameters: {L: {uniform: [2, 3]}}}", "E214", "L", "sample"),
        ("{task: Branching, parameters: {L: []}}", "E218", "[]", "a value"),
        ("{task: Branching, parameters: {L: {range: [1, 1e9]}}}", "E314", "{range: [1, 1e9]}", "too many"),
        ("{task: Branching, zip: {L: [1, 2], B: [2]}}", "E214", "B", "one length"),
        ("{task: Branching, zip: {L: [2]}, parameters: {L: 3}}", "E205", "L", "parameters"),
        ("{task: Branching, parameter: {L: 3}}", "E202", "parameter", "parameters"),
        ("{parameters: {L: 3}}", "E203", None, "task"),
    ],
)
def test_mistakes_have_a_code_and_a_place(entry: str, code: str, at: str | None, words: str, tmp_path: Path) -> None:
    text = f"{HEAD}  - {entry}\n"
    try:
        diagnostics = expanded(text, tmp_path).diagnostics
    except SpecError as error:
        diagnostics = error.diagnostics
    first = diagnostics[0]
    assert first.code == code, diagnostics
    assert words in f"{first.message} {first.hint}"
    assert first.span is not None and first.span.line == 4
    if at is not None:
        assert text.splitlines()[3][first.span.column - 1 :].startswith(at)


PLOTTED = """experiment: 1
name: e
tasks:
  - {task: Branching, parameters: {L: [2, 3], B: 2}, modifiers: [{sticky: [0, 0.5]}]}
  - {task: NoisyObs, parameters: {M: [4, 5]}}
measures: [soft_gap]
plot: PLOT
"""


@pytest.mark.parametrize(
    ("plot", "at", "words"),
    [
        ("{x: Z}", "Z", "no instance has a parameter 'Z'"),
        ("{x: stiky}", "stiky", "did you mean 'sticky'"),
        ("{x: L, y: Q}", "Q", "no instance has a parameter 'Q'"),
        ("{x: L, y: L}", "L}", "both axes"),
        ("{x: B}", "B", "one value in all instances"),
        ("{show: [randum]}", "randum", "did you mean 'random'"),
        ("{show: [solution_length]}", "solution_length", "add 'solution_length' to `measures`"),
        ("{show: [steps_per_second]}", "steps_per_second", "speed: true"),
        ("{show: [random_status]}", "random_status", "no column"),
        ("{log: [L, valu]}", "valu", "did you mean 'value'"),
    ],
)
def test_a_plot_shows_what_there_is(plot: str, at: str, words: str, tmp_path: Path) -> None:
    text = PLOTTED.replace("PLOT", plot)
    (first,) = expanded(text, tmp_path).diagnostics
    assert (first.code, first.span and first.span.line) == ("E206", 7)
    assert words in f"{first.message} {first.hint}"
    assert first.span is not None and text.splitlines()[6][first.span.column - 1 :].startswith(at)
    assert Done("sweep", tmp_path / "e.yaml", "-o", tmp_path / "out").status == 1 and not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "plot", ["{x: M, log: [M, value]}", "{x: sticky, y: L}", "{show: [random, soft_gap, states, expert_half]}"]
)
def test_a_plot_of_what_there_is(plot: str, tmp_path: Path) -> None:
    assert expanded(PLOTTED.replace("PLOT", plot), tmp_path).diagnostics == ()


def test_an_axis_may_be_fixed_by_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "e.yaml"
    path.write_text(PLOTTED.replace("PLOT", "{x: M}"))
    assert experiments.expand(experiments.read(path), [{"M": 3}]).diagnostics == ()


@pytest.mark.parametrize(
    ("asked", "at"),
    [("episodes: 100000000000", "1"), ("policies: [random]\nseeds: 90000", "9"), ("seeds: 90000", None)],
)
def test_episodes_have_a_limit(asked: str, at: str | None, tmp_path: Path) -> None:
    text = f"{HEAD}  - {{task: Branching}}\n{asked}\n"
    found = expanded(text, tmp_path).diagnostics
    assert [d.code for d in found] == ["E314"] * (at is not None)
    for each in found:
        assert "too many; the limit is 1,000,000" in each.message and "TASKSPEC_LIMITS=episodes=" in str(each.hint)
        assert each.span is not None
        assert text.splitlines()[each.span.line - 1][each.span.column - 1 :].startswith(str(at))


def test_all_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    """A key that is not known, or a value of another kind, hides none of the others."""
    text = (
        "experiment: 1\nname: e\nsedes: 3\ntasks:\n  - {task: Branching, parameter: {L: 3}, parameters: {K: 3, L: foo}}\n"
        "measures: [soft_gab]\npolicies: [exprt]\nepisodes: many\nplot: {x: Z, shaw: [random]}\n"
    )
    found = expanded(text, tmp_path).diagnostics
    told = sorted((d.span.line, d.code) for d in found if d.span)
    assert told == [
        (3, "E202"), (5, "E202"), (5, "E302"), (5, "E702"), (6, "E206"), (7, "E713"), (8, "E204"), (9, "E202"), (9, "E206"),
    ]  # fmt: skip
    assert Done("sweep", tmp_path / "e.yaml", "-o", tmp_path / "out").status == 1 and not (tmp_path / "out").exists()
    assert Done("check", tmp_path / "e.yaml").err.count("error[") in (0, len(found))


def test_an_experiment_has_a_name(tmp_path: Path) -> None:
    text = HEAD.replace("name: e", 'name: " "') + "  - {task: Branching}\n"
    with pytest.raises(SpecError) as error:
        expanded(text, tmp_path)
    (first,) = error.value.diagnostics
    assert first.span is not None and (first.code, first.span.line) == ("E205", 2)


def test_an_experiment_is_no_spec_and_a_spec_no_experiment(tmp_path: Path) -> None:
    shutil.copy(shipped()["derail/noise"], tmp_path / "e.yaml")
    assert "taskspec sweep" in Done("solve", str(tmp_path / "e.yaml")).err
    spec = taskspec.load("Branching").source.document.origin.name
    assert Done("sweep", spec, "-o", str(tmp_path)).status != 0
    assert taskspec.register(tmp_path) == []


def test_check_takes_files_folders_and_suites(tmp_path: Path) -> None:
    (tmp_path / "experiments").mkdir()
    shutil.copy(shipped()["derail/noise"], tmp_path / "experiments" / "e.yaml")
    for target in (tmp_path, tmp_path / "experiments", tmp_path / "experiments" / "e.yaml"):
        done = Done("check", str(target), "--json")
        assert json.loads(done.out)["experiments"] == [
            {"path": str(tmp_path / "experiments" / "e.yaml"), "instances": 3}
        ]
    assert (
        f", {sum(name.startswith('derail/') for name in shipped())} experiments, 1 exam and 1 findings file: no errors"
        in Done("check", "derail", "--quick").out
    )


def test_the_schema_for_editors_takes_what_is_read(tmp_path: Path) -> None:
    schema = json.loads(Done("schema", "--experiment").out)
    assert schema == document_schema(Experiment)
    validator = jsonschema.Draft202012Validator(schema)
    for path in shipped().values():
        validator.validate(yaml.safe_load(path.read_text(encoding="utf-8")))
    for wrong in ("{task: B, parameter: {}}", "{task: B, parameters: {L: {ranges: [1]}}}", "{parameters: {}}"):
        assert not validator.is_valid(yaml.safe_load(f"{HEAD}  - {wrong}\n"))


def test_policies_are_looked_at_before_anything_runs(tmp_path: Path) -> None:
    text = HEAD + "  - {task: Branching}\npolicies: [random, exprt]\n"
    (first, *_) = expanded(text, tmp_path).diagnostics
    assert first.span is not None and (first.code, first.span.line, first.span.column) == ("E713", 5, 20)


def test_a_sample_of_more_combinations_than_can_be_listed(tmp_path: Path) -> None:
    many = "{range: [1, 1000]}"
    entry = f"{{task: Parabola, parameters: {{h: {many}, A: {many}, dx: {{range: [0.001, 1, 0.001]}}}}, sample: 7}}"
    assert len(found(entry, tmp_path)) == 7
