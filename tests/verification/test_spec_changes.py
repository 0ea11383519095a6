"""Changed specs: which changes there are, when two tasks are the same, and what notices a change."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from taskspec.language import source
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.specs import specs, varied_files
from tests.verification.spec_changes import __main__ as command
from tests.verification.spec_changes.judge import CLASSES, judge, judgements, same_task, tasks_of
from tests.verification.spec_changes.mutants import mutants, written
from tests.verification.spec_changes.text_changes import Replacements, changes

ROOT = Path(__file__).parents[2]
SPECS = [*specs("tasks/derail/*.yaml", "tasks/seals/*.yaml"), *varied_files()]
NAMES = Replacements({"s": ["n"], "n": ["s"], "calm": ["cross"]}, frozenset({"s"}))

# Every change of an expression, counted by hand.
CHANGES: dict[str, set[str]] = {
    "1": {"2", "0"},
    "0": {"1"},
    "0.05": {"0.06", "0.04"},
    "n": {"s"},
    "s'": {"n'", "s"},
    "mood == calm": {"mood != calm", "mood <= calm", "mood >= calm", "mood == cross"},
    "a < 2": {"a <= 2", "a > 2", "a >= 2", "a < 3", "a < 1"},
    "-a": {"a"},
    "a + 1": {"a - 1", "a * 1", "a + 2", "a + 0", "a", "1", "-a + 1"},
    "not done": {"done"},
    "p and q": {"p or q", "((q))", "((p))", "(not (p)) and q", "p and (not (q))"},
    "x if done else y": {"(x)", "(y)", "((y) if done else (x))"},
    "abs(a)": {"(a)"},
    "max(a, b)": {"min(a, b)", "max(b, a)", "(a)"},
    "v[:2]": {"v[:3]", "v[:1]", "v[:]"},
    "x in {1, 2}": {"x not in {1, 2}", "x in {2, 2}", "x in {0, 2}", "x in {1, 3}", "x in {1, 1}", "x in {2}", "x in {1}"},
    "0 <= a < b": {"1 <= a < b", "0 < a < b", "0 > a < b", "0 >= a < b", "0 <= a <= b", "0 <= a > b", "0 <= a >= b", "0 <= a",
                   "a < b"},
    "Uniform(0, b)": {"UniformInt(0, b)", "Uniform(1, b)", "Uniform(b, 0)"},
}  # fmt: skip


@pytest.mark.parametrize("text", CHANGES)
def test_changes_of_an_expression(text: str) -> None:
    assert {change.apply(text) for change in changes(text, NAMES)} == CHANGES[text]


@pytest.mark.parametrize("path", SPECS, ids=lambda p: p.stem)
def test_changes_of_whole_specs(path: Path) -> None:
    document = source.read_file(path)
    assert source.read_text(written(document.data), "x").data == document.data
    found = list(mutants(document))
    assert found
    assert len({written(m.data) for m in found}) > 0.9 * len(found)  # what is exchanged may also be renamed
    lines = document.origin.text.split("\n")
    for mutant in found:
        assert mutant.data != document.data
        assert mutant.place.line <= len(lines)
        if mutant.after not in ("(left out)", "(exchanged)") and mutant.place.line == mutant.place.end_line:
            span = mutant.place
            assert (
                mutant.before in lines[span.line - 1][span.column - 1 : span.end_column - 1]
                or "\\" in lines[span.line - 1]
            )


def test_prose_claims_and_examples_are_left_alone() -> None:
    document = source.read_file(ROOT / "tasks/derail/noisy_obs.yaml")
    kept = (
        "title",
        "summary",
        "description",
        "capability",
        "keywords",
        "sources",
        "errata",
        "claims",
        "examples",
        "figure",
        "accept",
    )
    for mutant in mutants(document):
        for data, before in [(mutant.data, document.data), *_variants(mutant.data, document.data)]:
            assert all(data.get(section) == before.get(section) for section in kept)


def _variants(data: Any, before: Any) -> list[tuple[Any, Any]]:
    return [(data["variants"][name], before["variants"][name]) for name in before.get("variants", {})]


# -- the same task ----------------------------------------------------------------------------------------------------

BASE: dict[str, Any] = {
    "taskspec": 1,
    "name": "Walk",
    "noise": {"slip": "Bernoulli(1/4)"},
    "state": {"s": {"type": "int", "low": 0, "high": 4}, "u": {"type": "int", "low": 0, "high": 1}},
    "action": {"a": {"type": "choice", "values": {"back": -1, "on": 1}}},
    "observation": {"s": "s", "z": "Normal(mean=s, std=1)"},
    "horizon": 6,
    "initial": {"s": "UniformInt(0, 1)", "u": 0},
    "dynamics": {"s'": "s if slip else clip(s + a, 0, 4)"},
    "reward": "s' == 4",
    "terminal": "s' == 4",
    "expert": {"a": "on"},
}


def task(**sections: Any) -> Task:
    return build(source.read_text(json.dumps(BASE | sections), "walk.yaml"))


SAME: dict[str, dict[str, Any]] = {
    "itself": {},
    "operands in another order": {"dynamics": {"s'": "s if slip else clip(a + s, 0, 4)"}},
    "bounds of clip in another order": {"dynamics": {"s'": "s if slip else min(4, max(0, s + a))"}},
    "a condition that equality alone fulfils": {"terminal": "s' >= 4", "reward": "4 <= s'"},
    "arithmetic": {"dynamics": {"s'": "s if slip else clip(2 * s + a - s, 0, 4)"}},
    "what happens in a state that ends episodes": {
        "dynamics": {"s'": "0 if s == 4 else s if slip else clip(s + a, 0, 4)"}
    },
    "what happens where nothing gets": {"dynamics": {"s'": "3 if u == 1 else s if slip else clip(s + a, 0, 4)"}},
    "probabilities as a fraction": {"noise": {"slip": "Bernoulli(2/8)"}},
    "a draw by weights": {"initial": {"s": {"0": "1/2", "1": "1/2"}, "u": 0}},
    "an expert that differs nowhere": {"expert": {"a": "on if s < 4 else back"}},
    "later rewards that come too late": {"reward": "(s' == 4) + 5 * (t > 5)"},
    "an observation worked out otherwise": {"observation": {"s": "min(s, 4)", "z": "Normal(mean=s, std=1)"}},
}
OTHER: dict[str, dict[str, Any]] = {
    "a probability a little off": {"noise": {"slip": "Bernoulli(0.2500000000000001)"}},
    "a wider space": {"state": {"s": {"type": "int", "low": 0, "high": 5}, "u": BASE["state"]["u"]}},
    "another name of a label": {"action": {"a": {"type": "choice", "values": {"back": -1, "go": 1}}}, "expert": {"a": "go"}},
    "labels in another order": {"action": {"a": {"type": "choice", "values": {"on": 1, "back": -1}}}},
    "another horizon": {"horizon": 7},
    "a discount": {"discount": 0.999},
    "a reward of the same mean": {"reward": "2 * (s' == 4) * Bernoulli(1/2)"},
    "a reward drawn apart from the step": {"reward": "(s' == 4) + Bernoulli(1/4)"},
    "a reward drawn with the step": {"reward": "(s' == 4) + slip"},
    "another observation": {"observation": {"s": "4 - s", "z": "Normal(mean=s, std=1)"}},
    "an observation that draws otherwise": {"observation": {"s": "s", "z": "Normal(mean=s, std=2)"}},
    "an observation that shows the noise": {"observation": {"s": "s", "z": "Normal(mean=slip, std=1)"}},
    "another space of observations": {"observation": {"space": "dict", **BASE["observation"]}},
    "another expert": {"expert": {"a": "on if s < 3 else back"}},
    "an expert of another kind": {"expert": "optimal"},
    "an absorbing reward": {"absorbing_reward": 1},
    "rewards of the last step": {"reward": "(s' == 4) + 5 * (t > 4)"},
    "another first state": {"initial": {"s": "UniformInt(0, 2)", "u": 0}},
    "a parameter": {"parameters": {"k": {"type": "int", "default": 1}}, "reward": "k * (s' == 4)"},
}  # fmt: skip


@pytest.mark.parametrize("name", SAME)
def test_tasks_that_are_the_same(name: str) -> None:
    assert same_task(task(), task(**SAME[name]))
    assert same_task(task(**SAME[name]), task())


@pytest.mark.parametrize("name", OTHER)
def test_tasks_that_are_not_proved_to_be_the_same(name: str) -> None:
    assert not same_task(task(), task(**OTHER[name]))
    assert not same_task(task(**OTHER[name]), task())


STAND_IN: dict[str, Any] = {
    "state": {"d": {"type": "int", "low": -9, "high": 9}},
    "map": {"d": "4 - s"},
    "initial": {"d": "4 - UniformInt(0, 1)"},
    "dynamics": {"d'": "d if slip else clip(d - a, 0, 4)"},
    "reward": "d' == 0",
    "terminal": "d' == 0",
    "expert": {"a": "on"},
}


@pytest.mark.parametrize(("change", "same"), [
    ({}, True),
    ({"state": {"d": {"type": "int", "low": -5, "high": 9}}}, True),  # no episode gets there
    ({"state": {"d": {"type": "int", "low": -9, "high": 3}}}, False),
    ({"reward": "d' == 1"}, False),
    ({"map": {"d": "5 - s"}}, False),
])  # fmt: skip
def test_stand_ins_are_compared_too(change: dict[str, Any], same: bool) -> None:
    infinite = {"state": BASE["state"] | {"u": {"type": "real"}}}
    one, other = (task(**infinite, abstraction=STAND_IN | c) for c in ({}, change))
    assert same_task(one, other) is same


# -- what notices -----------------------------------------------------------------------------------------------------

JUDGED = BASE | {
    "parameters": {"n": {"type": "int", "default": 4, "low": 1, "high": 9}},
    "state": {"s": {"type": "int", "low": 0, "high": "n"}, "u": {"type": "int", "low": 0, "high": 0}},
    "observation": {"s": "s", "z": "Normal(mean=s, std=1)"},
    "dynamics": {"s'": "s if slip else clip(s + a, 0, n)"},
    "reward": "s' == n",
    "terminal": "s' == n",
    "claims": ["expert_return == optimal_return"],
    "examples": [{"state": {"s": 1}, "action": {"a": "on"}, "next": {"s": {"1": "1/4", "2": "3/4"}}}],
    "variants": {"long": {"horizon": 9}},
}  # fmt: skip
NOTICED: dict[tuple[str, Any, Any], str] = {
    ("state.s.high", "n", "n - 1"): "error",
    ("parameters.n.high", 9, 8): "range",
    ("noise.slip", "Bernoulli(1/4)", "Bernoulli(1/5)"): "example",
    ("noise.slip", "Bernoulli(1/4)", "Bernoulli(2/8)"): "equivalent",
    ("dynamics.s'", "s + a", "a + s"): "equivalent",
    ("expert.a", "on", "back"): "claim",
    ("observation.z", "mean=s", "mean=0"): "silent",
    ("variants.long.horizon", 9, 8): "silent",
    ("state.s.low", 0, -1): "warning",
    ("reward", "s' == n", "s' =="): "error",
}


@pytest.mark.parametrize("change", NOTICED, ids=str)
def test_what_notices_a_change(change: tuple[str, Any, Any]) -> None:
    path, before, after = change
    document = source.read_text(json.dumps(JUDGED), "walk.yaml")
    data = json.loads(json.dumps(JUDGED))
    *parents, last = path.split(".")
    inner = data
    for step in parents:
        inner = inner[step]
    inner[last] = inner[last].replace(before, after) if isinstance(before, str) else after
    one = next(mutants(document))
    mutant = type(one)(tuple(path.split(".")), one.place, str(before), str(after), data)
    assert judge(document, tasks_of(document), mutant).kind == NOTICED[change]


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A row of counts for each spec, and each change that nothing notices."""
    path = tmp_path / "walk.yaml"
    small = {k: v for k, v in JUDGED.items() if k not in ("variants", "observation", "parameters")}
    text = json.dumps(small, indent=1).replace('"n"', "4").replace("0, n)", "0, 4)").replace("== n", "== 4")
    path.write_text(text, encoding="utf-8")
    command.main([str(path)])
    head, row, *silent = capsys.readouterr().out.splitlines()
    counts = dict(zip(head.split(), map(int, row.split()[1:]), strict=True))
    assert counts["changes"] == len(list(mutants(source.read_file(path)))) == sum(map(counts.get, CLASSES))
    assert len(silent) == counts["silent"]


@pytest.mark.slow
def test_processes_do_not_matter() -> None:
    path = ROOT / "tasks/derail/early_term.yaml"
    one, two = (list(judgements(path, jobs)) for jobs in (1, 2))
    assert [j for _, j in one] == [j for _, j in two]
    assert [m.after for m, _ in one] == [m.after for m, _ in two]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["early_term", "init_shift", "risky_path"])
def test_the_published_counts_are_those_of_the_suite(name: str) -> None:
    """Of the specs that take little time; the others were counted when the page says."""
    page = (ROOT / "docs/explain/correctness.md").read_text(encoding="utf-8")
    lines = page.partition("<!-- changes -->")[2].partition("<!-- /changes -->")[0].splitlines()
    wanted = [line for line in lines if line.startswith(("| spec", f"| `{name}"))]
    header, row = ([cell.strip() for cell in line.split("|")[2:-1]] for line in wanted)
    found = [judgement.kind for _, judgement in judgements(ROOT / f"tasks/derail/{name}.yaml", 2)]
    assert dict(zip(header, map(int, row), strict=True)) == {k: found.count(k) for k in header[1:]} | {
        "changes": len(found)
    }
