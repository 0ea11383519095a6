"""Specs that extend a spec of another file, variants that drop claims, and grids of parameter values."""

import os
import pickle
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from taskspec import SpecError, load
from taskspec.exact import check
from taskspec.language.registry import entries
from taskspec.language.source import read_file
from taskspec.language.task.build import build
from taskspec.language.task.schema.export import json_schema
from tests.shared.diagnostics import refusal, statuses
from tests.verification.spec_changes.mutants import mutants

WALK = """\
taskspec: 1
name: Walk
version: 3
parameters:
  L: {type: int, default: 5, low: 1, high: 100, doc: length}
state: {s: {type: int, low: 0, high: L}}
action: {a: {type: int, low: 0, high: 1}}
horizon: L
initial: {s: 0}
dynamics: {s': "min(s + a, L)"}
reward: s' == L
claims:
  - optimal_return == 1
  - {claim: "states == L + 1", for: {L: [1, 2, 5]}}
variants:
  long: {parameters: {L: {default: 9}}}
"""
RUN = """\
taskspec: 1
name: Run
extends: ../walk.yaml
base: long
reward: 2 * (s' == L)
claims: {drop: [optimal_return ==  1], add: [optimal_return == 2]}
variants:
  short: {parameters: {L: {default: 3}}}
  late:
    extends: ../walk.yaml
    initial: {s: 1}
    claims: {drop: [states == L + 1, optimal_return == 1], add: [states == L]}
    accept: {W501: it starts later}
"""


@pytest.fixture
def run(tmp_path: Path) -> Path:
    (tmp_path / "walk.yaml").write_text(WALK)
    (tmp_path / "runs").mkdir()
    path = tmp_path / "runs" / "run.yaml"
    path.write_text(RUN)
    return path


def test_a_spec_takes_from_another_file_what_it_does_not_change(run: Path) -> None:
    expected = [
        (None, "runs/Run-v0", 9, ("states == L + 1", "optimal_return == 2")),  # of the variant `long`
        ("short", "runs/RunShort-v0", 3, ("states == L + 1", "optimal_return == 2")),  # changed
        ("late", "runs/RunLate-v0", 5, ("states == L",)),  # of the spec itself
    ]
    for (variant, task_id, horizon, claims), entry in zip(expected, entries(run.parent), strict=True):
        task = load(run, variant)
        assert (task.id, task.horizon) == (entry.id, horizon) == (task_id, horizon)
        assert tuple(claim.text for claim in task.annotations.claims) == claims
        report = check(task)
        assert not report.errors and report.results.optimal.value == 2  # type: ignore[union-attr]
        assert set(statuses(report.verdicts)) == {"proved"}


def test_it_is_the_same_task_as_one_written_in_full(run: Path) -> None:
    path = run.parent / "whole.yaml"
    path.write_text(WALK.replace("default: 5", "default: 9").replace("s' == L\nclaims", "2 * (s' == L)\nclaims"))
    assert load(path).content_hash == load(run).content_hash


def test_a_grid_is_every_combination(run: Path) -> None:
    path = run.parent / "grid.yaml"
    grids = "[{claim: actions == K, for: [{K: [2, 3], L: [1, 4]}, {K: 5}]}]"
    path.write_text(
        WALK.replace("  L:", "  K: {type: int, default: 2, low: 2, high: 5}\n  L:")
        .replace("high: 1}}", "high: K - 1}}")
        .split("claims:")[0]
        + f"claims: {grids}\n"
    )
    report = check(load(path), ranges=False)
    assert [dict(v.parameters) for v in report.verdicts] == [
        {"K": 2, "L": 1}, {"K": 2, "L": 4}, {"K": 3, "L": 1}, {"K": 3, "L": 4}, {"K": 5},
    ]  # fmt: skip
    assert set(statuses(report.verdicts)) == {"proved"}
    path.write_text(path.read_text().replace("L: [1, 4]", f"L: {list(range(1, 101))}, M: {list(range(1000))}"))
    with pytest.raises(SpecError, match=r"E314.*200,001 claims"):
        load(path)


def test_messages_are_about_the_file_that_is_wrong(run: Path) -> None:
    base = run.parent.parent / "walk.yaml"
    base.write_text(WALK.replace("min(s + a, L)", "min(s + b, L)"))
    (found,) = refusal(load, run).diagnostics
    assert found.span is not None
    assert (found.code, Path(found.span.origin.name).resolve(), found.span.line) == ("E302", base, 10)
    base.write_text(WALK)
    run.write_text(RUN.replace("2 * (s'", "2 * (z'"))
    (found,) = refusal(load, run).diagnostics
    assert found.span is not None
    assert (found.code, found.span.origin.name, found.span.line) == ("E302", str(run), 5)


def test_a_change_of_the_other_file_is_noticed(run: Path) -> None:
    assert load(run).horizon == 9
    base = run.parent.parent / "walk.yaml"
    base.write_text(WALK.replace("default: 9", "default: 12"))
    os.utime(base, ns=(1, 1))
    assert load(run).horizon == 12


def test_a_task_travels_with_the_files_that_it_extends(run: Path) -> None:
    task = load(run)
    packed = pickle.dumps(task)
    (run.parent.parent / "walk.yaml").unlink()
    assert pickle.loads(packed).content_hash == task.content_hash


def test_mutants_keep_what_is_extended(run: Path) -> None:
    document = read_file(run)
    horizons = {build(mutant.document()).horizon for mutant in mutants(document) if mutant.section == "reward"}
    assert horizons == {9}


@pytest.mark.parametrize(
    ("before", "after", "code", "where", "words"),
    [
        ("extends: ../walk.yaml\nbase", "extends: ../wald.yaml\nbase", "E710", (3, 10), "wald.yaml"),
        ("extends: ../walk.yaml\nbase", "extends: /etc/passwd\nbase", "E711", (3, 10), "ends in .yaml"),
        ("extends: ../walk.yaml\nbase", "extends: run.yaml\nbase", "E212", (3, 10), "run.yaml -> run.yaml"),
        ("extends: ../walk.yaml\nbase", "extends: [1]\nbase", "E204", (3, 10), "text"),
        ("extends: ../walk.yaml\n", "", "E202", (3, 1), "base"),
        ("base: long", "base: lung", "E211", (4, 7), "did you mean 'long'"),
        ("drop: [states ==", "drop: [statues ==", "E219", (12, 21), "states == L + 1"),
        ("add: [opt", "plus: [opt", "E202", (6, 40), "add"),
        ("add: [optimal_return == 2]", "add: [{claim: x, fro: []}]", "E202", (6, 57), "for"),
    ],
)
def test_what_cannot_be_extended_is_said_where_it_is(
    run: Path, before: str, after: str, code: str, where: tuple[int, int], words: str
) -> None:
    run.write_text(RUN.replace(before, after, 1))
    first = refusal(load, run, "late").diagnostics[0]
    assert first.code == code
    assert first.span is not None
    assert (first.span.line, first.span.column) == where
    assert words in f"{first.message} {first.hint}"


def test_circles_through_several_files_end(run: Path) -> None:
    (run.parent.parent / "walk.yaml").write_text(WALK + "  back: {extends: runs/run.yaml, base: late}\n")
    with pytest.raises(
        SpecError, match=r"E212.*walk.yaml -> run.yaml -> walk.yaml|E212.*run.yaml -> walk.yaml -> run.yaml"
    ):
        load(run)


def test_a_file_that_many_lead_to_is_read_once(tmp_path: Path) -> None:
    (tmp_path / "w0.yaml").write_text(WALK)
    head = "taskspec: 1\nname: Walk\n"
    for i in range(1, 30):
        extends = f"extends: w{i - 1}.yaml"
        variants = f"{{v0: {{{extends}}}, v1: {{{extends}}}, v2: {{{extends}}}, v3: {{{extends}}}, v4: {{{extends}}}}}"
        (tmp_path / f"w{i}.yaml").write_text(f"{head}{extends}\nvariants: {variants}\n")
    assert load(tmp_path / "w29.yaml").horizon == 5


def test_editors_take_what_the_compiler_takes() -> None:
    validator = Draft202012Validator(json_schema())
    good: dict[str, Any] = {
        "taskspec": 1, "name": "Run", "extends": "../walk.yaml", "base": "long", "parameters": {"L": {"default": 3}},
        "claims": {"drop": ["a"], "add": [{"claim": "b", "for": {"L": [1, 2]}}]},
        "variants": {"x": {"extends": "a.yaml", "claims": {"drop": ["b"]}}},
    }  # fmt: skip
    assert validator.is_valid(good)
    for bad in (
        {"extends": 3},
        {"rewards": 1},
        {"claims": {"remove": []}},
        {"claims": [{"claim": "a", "for": {"L": []}}]},
    ):
        assert not validator.is_valid(good | bad)
    del good["extends"]
    assert not validator.is_valid(good)
