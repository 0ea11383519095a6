"""The commands that run, score, build and print tasks."""

import json
import math
import re
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from scipy import stats

import taskspec
from taskspec.base.diagnostics import Diagnostic, SpecError
from taskspec.base.limits import limits
from taskspec.show.pages import facts
from taskspec.show.terminal import rollouts
from tests.shared import commands
from tests.shared.sparse import sparse
from tests.shared.specs import varied_files

ROOT = Path(__file__).parents[2]
DERAIL = ROOT / "tasks" / "derail"
SPECS = ROOT / "tests" / "specs"

WRITE = import_module("taskspec.show.pages.write")  # its name in the package is the function

Done = partial(commands.Done, columns=100)


def test_run_is_a_function_of_its_seed() -> None:
    args = ("run", "Sort", "--json", "-n", 20)
    first = Done(*args, "--seed", 5).data
    again = Done(*args, "--seed", 5).data
    other = Done(*args, "--seed", 6).data
    assert first["returns"] == again["returns"] != other["returns"]
    assert (first["episodes"], first["steps"], first["endings"]) == (20, 160, {"truncated": 20})


def test_run_equals_the_environment() -> None:
    env = taskspec.make("derail/RiskyPath")
    env.action_space.seed(3)
    returns = []
    seed = 3
    for i in range(10):
        env.reset(seed=seed if i == 0 else None)
        total = 0.0
        over = False
        while not over:
            _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
            total = total + float(reward)
            over = terminated or truncated
        returns.append(total)
    assert Done("run", "RiskyPath", "-n", 10, "--seed", 3, "--json").data["returns"] == returns


EXPERTS = [
    ("RiskyPath", [], 4), ("Branching", ["-p", "L=4", "-p", "B=3"], 1), ("derail/EarlyTermNeg", [], -2), ("NoisyObs", [], 12),
    ("ProcGoal", [], -45), ("LargestSum", [], 1), ("derail/InitShiftExpert", [], 2),
]  # fmt: skip


@pytest.mark.parametrize(("task", "parameters", "expected"), EXPERTS)
def test_experts_earn_what_is_claimed(task: str, parameters: list[str], expected: float) -> None:
    data = Done("run", task, "--policy", "expert", "-n", 5, "--json", *parameters).data
    assert set(data["returns"]) == {expected}


PLANNED = [path for path in varied_files() if "\nexpert: optimal" in path.read_text()]


@pytest.mark.parametrize("path", sparse(PLANNED, 3), ids=lambda path: path.stem)
def test_planned_experts_act_on_the_exact_model(path: Path) -> None:
    solved = Done("solve", path, "--json").data
    rolled = Done("run", path, "--policy", "expert", "-n", 50, "--max-steps", 300, "--json").data  # 0.9**300 is nothing
    low, high = rolled["confidence_95"]
    slack = high - low + 1e-9  # twice the confidence interval: the seed is fixed, and it is not an unlucky one
    assert low - slack <= solved["optimal"]["value"] <= high + slack


def test_a_task_without_an_expert_says_so(tmp_path: Path) -> None:
    text = (DERAIL / "risky_path.yaml").read_text().replace("expert:\n  a: safe\n", "").split("claims:")[0]
    path = tmp_path / "x.yaml"
    path.write_text(text)
    done = Done("run", path, "--policy", "expert")
    assert (done.status, "gives no expert" in done.err) == (1, True)


SCRIPTS = [
    ("a.json", '["safe", "safe", "safe", "safe", "safe"]', 4.0, "truncated"),
    ("b.json", "[0, 0, 0]", 2.0, "script"),
    ("c.json", '[{"a": "safe"}, {"a": 0}]', 1.0, "script"),
    ("d.csv", "a\nsafe\nsafe\nsafe\n", 2.0, "script"),
    ("e.csv", "0\n0\n", 1.0, "script"),
    ("f.json", "[[0, 0], [0, 0]]", 1.0, "script"),
]


@pytest.mark.parametrize(("name", "text", "total", "ending"), SCRIPTS)
def test_scripts_of_labels_and_numbers(name: str, text: str, total: float, ending: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    data = Done("run", "RiskyPath", "--policy", tmp_path / name, "-n", 2, "--json").data
    assert (data["returns"], data["endings"]) == ([total, total], {ending: 2})


def test_scripts_of_several_components(tmp_path: Path) -> None:
    for text in ("[[0, 1], [2, 3]]", '[{"i": 0, "j": 1}, {"j": 3, "i": 2}]', "[[[0, 1], [2, 3]]]"):
        (tmp_path / "s.json").write_text(text)
        assert Done("run", "Sort", "--policy", tmp_path / "s.json", "-n", 1, "--json").data["steps"] == 2


@pytest.mark.parametrize(
    "text", ['["sideways"]', "[2]", '[{"b": 0}]', "[[0, 1, 2], 3]", "[null]", "{}", "[]", "nonsense"]
)
def test_a_script_that_fits_not_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "s.json").write_text(text)
    done = Done("run", "RiskyPath", "--policy", tmp_path / "s.json")
    assert (done.status, done.out) == (1, "")
    assert "s.json" in done.err or "not an action" in done.err


def test_render_shows_every_state() -> None:
    text = Done("run", "RiskyPath", "--policy", "expert", "--render", "ansi").out
    assert re.findall(r"step (\d) of 5", text) == ["0", "1", "2", "3", "4", "5"]
    assert "action safe, reward 1" in text


def test_episodes_without_an_end_are_cut(tmp_path: Path) -> None:
    path = tmp_path / "x.yaml"
    path.write_text((DERAIL / "risky_path.yaml").read_text().replace("horizon: 5", "horizon: none"))
    done = Done("run", path, "--max-steps", 7, "-n", 3)
    assert "7 steps" in done.out
    assert "3 were cut by --max-steps" in done.out


def test_solve_says_what_bounds_of_the_reward_prove() -> None:
    rows = Done("solve", "derail/LargestSum").out.splitlines()
    assert rows[1].split() == ["optimal", "≤", "1", "by", "the", "bounds", "of", "the", "reward"]
    assert "in all of 1,000 episodes" in rows[2]
    assert "≤ 0" in Done("solve", "derail/Parabola").out.splitlines()[1]
    unknown = Done("solve", "classic_control/Acrobot").out.splitlines()[2]
    assert unknown.split() == ["expert", "unknown", "the", "spec", "gives", "no", "expert"]


def test_summary_in_words() -> None:
    done = Done("run", "derail/EarlyTermNeg", "-n", 50)
    assert "95 % CI" in done.out
    assert "reached a terminal state" in done.out
    assert "4  in every episode" in Done("run", "RiskyPath", "--policy", "expert").out


def test_interval_of_the_mean() -> None:
    totals = [0.0, 1.0, 1.0, 4.0]
    episodes = [rollouts.Episode(total, total, 1, "terminated") for total in totals]
    half = rollouts.summarize(episodes, 0.0).half
    low, high = stats.ttest_1samp(totals, 0.0).confidence_interval(0.95)
    assert half is not None
    assert math.isclose(2 * half, high - low)


def test_solve_is_exact_where_it_can_be() -> None:
    data = Done("solve", "RiskyPath", "--json").data
    for name, value in (("optimal", 4), ("expert", 4), ("random", -122.21875), ("worst", -247.5)):
        assert data[name]["value"] == value
    assert "from an exact model of 4 states" in Done("solve", "RiskyPath").out
    assert "no exact model" in Done("solve", "Parabola", "-n", 50).out


def test_score_of_a_run_with_kept_scores(tmp_path: Path) -> None:
    kept = tmp_path / "scores.json"
    returns = tmp_path / "returns.json"
    assert Done("solve", "RiskyPath", "-o", kept).status == 0
    returns.write_text(Done("run", "RiskyPath", "--policy", "expert", "--json").out)
    assert Done("score", "RiskyPath", returns, "--scores", kept, "--json").data["score"] == pytest.approx(1)
    assert "score 1" in Done("score", "RiskyPath", returns).out
    stale = Done("score", "RiskyPathSeals", returns, "--scores", kept)
    assert (stale.status, "scores of derail/RiskyPath-v0, not of" in " ".join(stale.err.split())) == (1, True)
    edited = Done("score", "RiskyPath", returns, "--scores", kept, "-m", "sticky=0.5")
    assert (edited.status, "the task has changed" in edited.err) == (1, True)


def test_where_nothing_can_be_compared_the_score_is_unknown(tmp_path: Path) -> None:
    returns = tmp_path / "returns.csv"
    returns.write_text("1.5\n2.5\n")
    for action, reason in (
        ("real, low: 0, high: 1", "neither the expert's return nor"),
        ("bool", "random actions are as good as"),
    ):
        path = tmp_path / f"{action[:4]}.yaml"
        path.write_text(NO_EXPERT.replace("TYPE", action))
        shown = " ".join(Done("score", path, returns).out.split())
        assert f"score unknown {reason}" in shown
        assert "nan" not in shown


NO_EXPERT = """
taskspec: 1
name: Even
state: {s: {type: int, low: 0, high: 1}}
action: {a: {type: TYPE}}
horizon: 2
initial: {s: 0}
dynamics: {s': s}
reward: 1
"""


@pytest.mark.parametrize("text", ["1.5\n2.5\n", "return\n1.5\n2.5\n", '#{"t": 0}\nr,l,t\n1.5,5,0.1\n2.5,5,0.2\n'])
def test_returns_from_csv(text: str, tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(text)
    data = Done("score", "RiskyPath", tmp_path / "r.csv", "--json").data
    assert (data["mean_return"], data["episodes"]) == (2.0, 2)


@pytest.mark.parametrize("text", ["", "{}", '["a"]', "nothing"])
def test_files_without_returns_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "r.json").write_text(text)
    assert "contains no returns" in " ".join(Done("score", "RiskyPath", tmp_path / "r.json").err.split())
    (tmp_path / "r.json").write_text("[1, NaN]")
    assert "return number 2 of" in " ".join(Done("score", "RiskyPath", tmp_path / "r.json").err.split())


def test_build_writes_everything(tmp_path: Path) -> None:
    done = Done("build", DERAIL / "sort.yaml", "derail/RiskyPath", "-o", tmp_path)
    assert done.status == 0, done.out
    index = json.loads((tmp_path / "tasks.json").read_text())
    for task, name in zip(index["tasks"], ("Sort", "SortSeals", "RiskyPath"), strict=True):
        assert task["name"] == name and len(task["content_hash"]) == 64
    assert "def step(action):" in (tmp_path / "source" / "derail" / "RiskyPath.py").read_text()
    assert json.loads((tmp_path / "scores.json").read_text())["derail/RiskyPath-v0"]["optimal"]["value"] == 4
    for name in ("schema.json", "html/index.html", "latex/appendix.tex", "markdown/sort.md"):
        assert (tmp_path / name).is_file()


def test_build_writes_nothing_while_a_spec_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "x.yaml").write_text("taskspec: 1\nname: X\n")
    done = Done("build", tmp_path / "x.yaml", "-o", tmp_path / "build")
    assert (done.status, (tmp_path / "build").exists()) == (1, False)
    assert "nothing was written" in done.err


def test_docs_in_the_formats_asked_for(tmp_path: Path) -> None:
    files = Done("docs", "Branching", "-f", "markdown,svg", "-o", tmp_path, "-p", "L=3,B=2", "--json").data
    assert {Path(file).suffix for file in files} == {".md", ".svg"}
    assert Done("docs", "Branching", "-f", "word", "-o", tmp_path).status == 2
    assert Done("figure", "RiskyPath", "-o", tmp_path / "deep" / "r.svg").status == 0
    assert "<svg" in (tmp_path / "deep" / "r.svg").read_text()


def test_docs_go_on_after_a_broken_spec(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text("taskspec: 1\nname: A\n")
    (tmp_path / "b.yaml").write_text((DERAIL / "risky_path.yaml").read_text())
    done = Done("docs", tmp_path, "-f", "markdown", "-o", tmp_path / "docs")
    assert done.status == 1
    assert "a.yaml:2:7:" in done.err and "error[E210" in done.err
    assert (tmp_path / "docs" / "risky-path.md").is_file()


@pytest.mark.parametrize(("command", "place"), [(["docs", "-f", "markdown"], ""), (["build"], "markdown")])
def test_a_task_whose_scores_fail_keeps_nobody_waiting(
    command: list[str], place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gather = facts.gather

    def failing(given: Any) -> Any:
        task = given.task if hasattr(given, "task") else given
        if task.name == "RiskyPath":
            raise SpecError([Diagnostic("E712", None, "no more")])
        return gather(given)

    for module in (facts, WRITE):
        monkeypatch.setattr(module, "gather", failing)
    done = Done(*command, "derail/RiskyPath", "derail/Sort", "-o", tmp_path)
    assert done.status == 1
    assert "E712" in done.err
    assert "no more" in done.err
    assert "Exact scores" in (tmp_path / place / "sort.md").read_text()
    assert "Exact scores" not in (tmp_path / place / "risky-path.md").read_text()


@pytest.mark.parametrize("command", [["docs", "-f", "markdown"], ["build"]])
def test_analyses_of_pages_take_limits(command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[int] = []
    gather = facts.gather

    def kept_limit(given: Any) -> Any:
        kept.append(limits().seconds)
        return gather(given)

    for module in (facts, WRITE):
        monkeypatch.setattr(module, "gather", kept_limit)
    assert Done(*command, "derail/RiskyPath", "-o", tmp_path, "--limit", "seconds=3").status == 0
    assert kept == [3]


def test_a_figure_without_a_file_is_named_after_its_task(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = Done("figure", "RiskyPath")
    assert done.status == 0 and done.out == "wrote risky-path.svg\n"
    assert (tmp_path / "risky-path.svg").is_file()
