"""Worked examples: what follows is what environments do; what does not follow is an error at its place."""

import json
from pathlib import Path
from typing import Any

import numpy as np

import taskspec
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.exact import check, wrong_examples
from taskspec.language import source
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.ir import draws
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from tests.shared.diagnostics import codes
from tests.shared.for_each import for_each
from tests.shared.sections import build_text
from tests.shared.specs import EVERY, specs, tasks_of

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
        return told(build_text(text))
    except SpecError as error:
        return list(error.diagnostics)


def told(task: Task) -> list[Diagnostic]:
    return [problem for _, problem in wrong_examples(task)]


def test_an_expert_that_is_worked_out_is_not_looked_at() -> None:
    found = problems({"state": {"s": 1}, "expert": {"a": "on"}}, expert="optimal")
    assert codes(found) == ["E612"]


def test_the_note_says_for_which_parameters() -> None:
    (found,) = problems({"for": [{"n": 4}, {"n": 1}], "state": {"s": 1}, "expert": {"a": "on"}})
    assert (found.code, found.notes) == ("E611", ("for n = 1",))


def test_what_cannot_be_enumerated_is_refused_before_it_costs() -> None:
    many = {"state": SPEC["state"] | {"p": {"type": "int", "shape": 12, "low": 0, "high": 11}}}
    start = {"initial": SPEC["initial"] | {"p": "Permutation(12)"}}
    example = {"initial": {"p": "[0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]"}, "probability": "1/479001600"}
    assert codes(problems(example, **many, **start)) == ["E612"]
    assert problems({"initial": {"p": "Permutation(12)"}}, **many, **start) == []


# -- what environments do follows -------------------------------------------------------------------------------------


def is_deterministic(task: Task) -> bool:
    return (
        not draws((*task.process.next, task.process.reward, task.process.terminal))
        and sum(c.type.size for c in task.state) <= 100
    )


@for_each("path", specs(*EVERY)[::4])
def test_steps_of_environments_are_examples(path: Path) -> None:
    for task in tasks_of(path):
        if is_deterministic(task):
            check_steps(task)


def check_steps(task: Task) -> None:
    """Compare what a few steps give with what examples of them say."""
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
    assert told(with_examples(task, examples)) == []
    for example in examples:
        example["reward"] += 1
        example["terminal"] = not example["terminal"]
    assert codes(told(with_examples(task, examples))) == ["E611"] * (2 * len(examples))


def first(env: Any) -> Any:
    env.action_space.seed(0)
    return env.action_space.sample()


def written(state: dict[str, Any]) -> dict[str, Any]:
    """A state as values of a spec."""
    values = {}
    for name, value in state.items():
        values[name] = json.dumps(value) if isinstance(value, str) else np.asarray(value).tolist()
    return values


def by_name(task: Task, action: Any) -> dict[str, Any]:
    """An action of the environment as values of a spec, by component."""
    flat = np.asarray(action, dtype=np.float64).ravel()
    values: dict[str, Any] = {}
    for c in task.action:
        own = flat[: c.type.size].astype(DTYPES[c.type.kind])
        flat = flat[c.type.size :]
        if c.domain is not None:
            values[c.name] = json.dumps(c.domain.labels[own[0]])
        else:
            values[c.name] = own.reshape(c.type.shape).tolist()
    return values


def with_examples(task: Task, examples: list[dict[str, Any]]) -> Task:
    """The same task with other examples, in its spec or in its variant."""
    data = json.loads(json.dumps(task.source.document.data))
    changed = data
    if task.source.variant is not None:
        changed = data["variants"][task.source.variant]
    changed["examples"] = examples
    return build(source.read_text(json.dumps(data), "mutant.yaml"), task.source.variant, None, task.source.suite)


def test_check_runs_examples_without_being_asked() -> None:
    text = json.dumps(SPEC | {"examples": [AT | {"next": {"s": 2}}, AT | {"reward": {"2": "3/4", "-9": "1/4"}}]})
    report = check(build_text(text))
    assert report.coverage.wrong_examples == {0}
    assert "E611" in codes(report.errors)


# -- pages ------------------------------------------------------------------------------------------------------------
