"""Worked examples: what follows is what environments do; what does not follow is an error at its place."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import taskspec
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact import check, wrong_examples
from taskspec.language import source
from taskspec.language.expressions.ir import draws
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.specs import EVERY, tasks

ROOT = Path(__file__).parents[3]
SPEC: dict[str, Any] = {
    "taskspec": 1,
    "name": "Walk",
    "parameters": {"n": {"type": "int", "default": 4, "low": 1, "high": 9}},
    "noise": {"slip": "Bernoulli(1/4)"},
    "state": {
        "s": {"type": "int", "low": 0, "high": "n"},
        "mood": {"type": "choice", "values": ["calm", "very cross"]},
        "v": {"type": "real", "shape": "n"},
    },
    "action": {"a": {"type": "choice", "values": {"back": -1, "on": 1}}, "b": {"type": "bool"}},
    "observation": {"s": "s", "late": "t > 2", "z": "Normal(mean=s, std=2)"},
    "horizon": 5,
    "initial": {"s": {"0": "1/3", "n": "2/3"}, "mood": "calm", "v": "Uniform(0, 1, shape=n)"},
    "dynamics": {
        "s'": "s if slip else clip(s + a, 0, n)",
        "mood'": {"by": ["mood", "b"], "rows": {
            "calm": {"true": "very cross", "false": "calm"}, "else": {"else": {"calm": "1/2", "very cross": "1/2"}},
        }},
        "v'": "v / 3",
    },
    "reward": "s' - 10 * slip + 0 * sum(v) + t",
    "terminal": "s' == n and mood == 'very cross'",
    "expert": {"a": "on if s < n else back", "b": "Bernoulli(1/2)"},
}  # fmt: skip
V = [0.5, 0.25, 0, 1]
AT = {"state": {"s": 1, "mood": "calm", "v": V}, "action": {"a": "on", "b": True}}


def problems(*examples: dict[str, Any], **sections: Any) -> list[Diagnostic]:
    text = json.dumps(SPEC | sections | {"examples": list(examples)}, indent=1)
    try:
        return [d for _, d in wrong_examples(build(source.read_text(text, "walk.yaml")))]
    except SpecError as error:
        return list(error.diagnostics)


HOLD: list[dict[str, Any]] = [
    AT | {"next": {"s": {"1": "1/4", "2": "3/4"}, "mood": "very cross", "v": [1 / 6, 1 / 12, 0, 1 / 3]}},
    AT | {"next": {"s": 2}, "reward": 2, "probability": "3/4"},
    AT | {"next": {"s": 1}, "reward": -9, "probability": "1/4"},
    AT | {"next": {"s": 1}, "reward": 2, "probability": 0},  # the same slip moves and pays
    AT | {"reward": {"2": "3/4", "-9": "1/4"}},
    AT | {"t": 3, "reward": {"5": 0.75, "-6": 0.25}, "truncated": False},
    AT | {"t": 4, "truncated": True, "terminal": False},
    {"state": {"s": 3, "mood": "very cross"}, "action": {"a": "on"}, "terminal": {"true": "3/4", "false": "1/4"}},
    {"state": {"mood": "very cross"}, "action": {"b": False}, "next": {"mood": "Uniform({calm, 'very cross'})"}},
    {"state": {"s": "n - 1"}, "action": {"a": "back"}, "next": {"s": {"n-2": "3/4", "n-1": "1/4"}}},
    {"state": {"s": 0}, "action": {"a": "back"}, "next": {"s": 0}},  # the slip makes no difference
    {"state": {"s": 1}, "action": {"a": "on"}, "observation": {"s": {"1": "1/4", "2": "3/4"}}, "t": 2},
    {"state": {"s": 1}, "action": {"a": "on"}, "observation": {"late": True}, "t": 2},
    {"state": {"s": 1}, "observation": {"s": 1, "late": False, "z": "Normal(mean=1, std=2)"}, "t": 2},
    {"state": {"s": 1}, "observation": {"late": True}, "t": 5},
    {"state": {"s": 4}, "expert": {"a": "back", "b": "Bernoulli(1/2)"}},
    {"initial": {"s": {"0": "1/3", "4": "2/3"}, "mood": "calm", "v": "Uniform(0, 1, shape=4)"}},
    {"initial": {"s": 0}, "observation": {"late": False}, "probability": "1/3"},
    {"for": [{"n": 1}, {"n": 7}], "state": {"s": 0}, "action": {"a": "on"}, "next": {"s": {"0": "1/4", "1": "3/4"}}},
    {"for": [{"n": 2}], "state": {"v": [3, 6]}, "next": {"v": [1, 2]}, "doc": "a third of each"},
]


@pytest.mark.parametrize("number", range(len(HOLD)))
def test_examples_that_hold(number: int) -> None:
    assert problems(HOLD[number]) == []


# An example, the code, the path of the value that is pointed at, and words of the message.
FAIL: list[tuple[dict[str, Any], str, tuple[str | int, ...], str]] = [
    (AT | {"next": {"s": 2}}, "E611", ("next", "s"), "the next s is 2 (3/4), 1 (1/4), not 2"),
    (AT | {"next": {"s": {"1": "1/3", "2": "2/3"}}}, "E611", ("next", "s"), "is 2 (3/4), 1 (1/4), not 2 (2/3), 1 (1/3)"),
    (AT | {"next": {"mood": "calm"}}, "E611", ("next", "mood"), "the next mood is very cross, not calm"),
    (AT | {"next": {"v": [1, 2, 3, 4]}}, "E611", ("next", "v"), "the next v is [0.166667, 0.0833333, 0, 0.333333], not"),
    (AT | {"next": {"s": 1}, "reward": 2, "probability": "1/4"}, "E611", ("probability",), "a probability of 0, not 1/4"),
    (AT | {"next": {"s": 1}, "reward": 2, "probability": "1/10000000000"}, "E611", ("probability",), "a probability of 0, not"),
    (AT | {"t": 4, "truncated": False}, "E611", ("truncated",), "`truncated` is true, not false"),
    (AT | {"next": {"s": 2}, "probability": 0.7500000001}, "E611", ("probability",), "a probability of 3/4, not"),
    (AT | {"terminal": True}, "E611", ("terminal",), "`terminal` is false, not true"),
    ({"state": {"s": 4}, "expert": {"a": "on"}}, "E611", ("expert", "a"), "the expert's a is back, not on"),
    ({"state": {"s": 1}, "observation": {"s": 2}}, "E611", ("observation", "s"), "'s' in the observation is 1, not 2"),
    ({"state": {"s": 1}, "observation": {"z": 1}}, "E611", ("observation", "z"), "infinitely many outcomes"),
    ({"initial": {"s": {"0": "1/2", "4": "1/2"}}}, "E611", ("initial", "s"), "the first s is 4 (2/3), 0 (1/3), not"),
    ({"state": {"s": 1}, "observation": {"z": "Normal(mean=1, std=3)"}}, "E612", ("observation", "z"), "in another way"),
    ({"initial": {"v": "Uniform(0, 2, shape=4)"}}, "E612", ("initial", "v"), "in another way"),
    ({"initial": {"v": [0, 0, 0, 0]}, "probability": 0}, "E612", (), "the probability cannot be computed"),
    ({"state": {"s": 1}, "next": {"s": 2}}, "E613", (), "depends on 'a', which this example does not give"),
    ({"state": {"s": 5}, "observation": {"s": 5}}, "E613", ("state", "s"), "s cannot be 5; it must be between 0 and 4"),
    ({"t": 5, "state": {"s": 1}, "action": {"a": "on"}, "next": {"s": 1}}, "E613", (), "the horizon is 5"),
    ({"t": 5, "truncated": True}, "E613", (), "the horizon is 5"),
    (AT | {"reward": {"2": "3/4", "-9": "1/4"}, "probability": 1}, "E613", (), "give one value for each name"),
    ({"for": [{"n": 3}, {"n": 99}], "state": {"s": 1}, "observation": {"s": 1}}, "E613", ("for", 1, "n"),
     "parameter n must be at most 9"),
    (AT | {"reward": 2, "probability": 2}, "E402", ("probability",), "not between 0 and 1"),
    ({"state": {"s": 1.5}, "observation": {"s": 1}}, "E306", ("state", "s"), "'s' is an int, but this is a real"),
    ({"state": {"s": "UniformInt(0, 1)"}, "observation": {"s": 1}}, "E311", ("state", "s"), "begins with are fixed"),
    ({"state": {"s": 1}, "observation": {"s": "s"}}, "E302", ("observation", "s"), "'s' is not defined here"),
    ({"state": {"v": [1, 2]}, "next": {"v": [1, 2]}}, "E307", ("state", "v"), "has shape [4], but this has [2]"),
    ({"state": {"mood": "clam"}, "action": {"b": True}, "next": {"mood": "calm"}}, "E313", ("state", "mood"), "'clam'"),
    ({"state": {"S": 1}, "observation": {"s": 1}}, "E216", ("state", "S"), "no state component 'S'"),
    ({"state": {"s": 1}, "observation": {"x": 1}}, "E216", ("observation", "x"), "no observation 'x'"),
    ({"state": {"s": 1}, "expert": {"c": "on"}}, "E216", ("expert", "c"), "no action component 'c'"),
    ({"state": {"s": 1}, "action": {"a": "on"}}, "E203", (), "does not say what follows"),
    ({"initial": {}, "probability": "1/2"}, "E203", (), "does not say what follows"),
    ({"state": {"s": 1}, "action": {"a": "on"}, "next": {}}, "E203", (), "does not say what follows"),
    ({"state": {"s": 1}, "initial": {"s": 1}}, "E214", ("state",), "an example of the first state has no `state`"),
    ({"state": {"s": 1}, "nxt": {"s": 1}}, "E202", ("nxt",), "unknown key `nxt`"),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(FAIL)))
def test_examples_that_do_not_hold(number: int) -> None:
    example, code, path, words = FAIL[number]
    text = json.dumps(SPEC | {"examples": [example]}, indent=1)
    document = source.read_text(text, "walk.yaml")
    found = [d for d in problems(example) if d.code == code]
    assert found, problems(example)
    assert words in found[0].message
    place = document.key_span if code in ("E202", "E214", "E216") else document.span
    at = found[0].span
    wanted = place(("examples", 0, *path))
    assert at is not None
    assert (at.line, at.column) in {(wanted.line, wanted.column), (wanted.line, wanted.column + 1)}  # inside of quotes


def test_an_expert_that_is_worked_out_is_not_looked_at() -> None:
    found = problems({"state": {"s": 1}, "expert": {"a": "on"}}, expert="optimal")
    assert [d.code for d in found] == ["E612"]


def test_the_note_says_for_which_parameters() -> None:
    (found,) = problems({"for": [{"n": 4}, {"n": 1}], "state": {"s": 1}, "expert": {"a": "on"}})
    assert (found.code, found.notes) == ("E611", ("for n = 1",))


def test_what_cannot_be_enumerated_is_refused_before_it_costs() -> None:
    many = {"state": SPEC["state"] | {"p": {"type": "int", "shape": 12, "low": 0, "high": 11}}}
    start = {"initial": SPEC["initial"] | {"p": "Permutation(12)"}}
    example = {"initial": {"p": "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]"}, "probability": "1/479001600"}
    assert [d.code for d in problems(example, **many, **start)] == ["E612"]
    assert problems({"initial": {"p": "Permutation(12)"}}, **many, **start) == []


# -- what environments do follows -------------------------------------------------------------------------------------


def is_deterministic(task: Task) -> bool:
    return (
        not draws((*task.process.next, task.process.reward, task.process.terminal))
        and sum(c.type.size for c in task.state) <= 100
    )


@pytest.mark.parametrize("task", [t for t in tasks(*EVERY) if is_deterministic(t)], ids=lambda t: t.id)
def test_steps_of_environments_are_examples(task: Task) -> None:
    env = taskspec.make(task)
    rng = np.random.default_rng(1)
    env.reset(seed=1)
    examples: list[dict[str, Any]] = []
    for t in range(6):
        state = written(env.state)
        action = env.action_space.sample() if t else first(env)
        env.action_space.seed(int(rng.integers(1000)))
        _, reward, terminal, truncated, _ = env.step(action)
        examples.append({
            "t": t, "state": state, "action": by_name(task, action), "next": written(env.state), "reward": reward,
            "terminal": bool(terminal), "truncated": bool(truncated),
        })  # fmt: skip
        if terminal or truncated:
            break
    right = with_examples(task, examples)
    assert [d for _, d in wrong_examples(right)] == []
    for example in examples:
        example["reward"] += 1
        example["terminal"] = not example["terminal"]
    codes = [d.code for _, d in wrong_examples(with_examples(task, examples))]
    assert codes == ["E611"] * (2 * len(examples))


def first(env: Any) -> Any:
    env.action_space.seed(0)
    return env.action_space.sample()


def written(state: dict[str, Any]) -> dict[str, Any]:
    """A state as values of a spec."""
    return {name: np.asarray(v).tolist() if not isinstance(v, str) else json.dumps(v) for name, v in state.items()}


def by_name(task: Task, action: Any) -> dict[str, Any]:
    """An action of the environment as values of a spec, by component."""
    flat = iter(np.asarray(action, dtype=np.float64).ravel().tolist())
    found: dict[str, Any] = {}
    for c in task.action:
        values = [next(flat) for _ in range(c.type.size)]
        if c.domain is not None:
            found[c.name] = json.dumps(c.domain.labels[int(values[0])])
        else:
            whole = [v if int(c.type.kind) == 2 else bool(v) if int(c.type.kind) == 0 else int(v) for v in values]
            found[c.name] = whole if c.type.shape else whole[0]
    return found


def with_examples(task: Task, examples: list[dict[str, Any]]) -> Task:
    """The same task with other examples, in its spec or in its variant."""
    data = json.loads(json.dumps(task.source.document.data))
    (data if task.source.variant is None else data["variants"][task.source.variant])["examples"] = examples
    return build(source.read_text(json.dumps(data), "mutant.yaml"), task.source.variant, None, task.source.suite)


def test_check_runs_examples_without_being_asked() -> None:
    text = json.dumps(SPEC | {"examples": [FAIL[0][0], HOLD[0]]})
    report = check(build(source.read_text(text, "walk.yaml")))
    assert report.coverage.wrong_examples == {0}
    assert "E611" in [d.code for d in report.errors]


# -- pages ------------------------------------------------------------------------------------------------------------
