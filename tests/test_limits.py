"""What a spec may cost: each limit is reached before the cost is spent, says how to raise it, and can be raised."""

import json
import os
import re
import select
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from taskspec import experiments, load, oracle
from taskspec.base import limits
from taskspec.base.diagnostics import SpecError
from taskspec.base.limits import Limits, changed, count, how_to_raise, progress_listener, table
from taskspec.exact import check
from taskspec.exact.model.extract import extract
from taskspec.exact.rollout.rollout import at_random, simulate
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from taskspec.language.task.task import Task
from taskspec.learn.experiments.experiment_file import described
from tests.shared.apart import Ended, taskspec
from tests.shared.sections import text
from tests.shared.sparse import sparse
from tests.shared.specs import spec_file
from tests.shared.work import calls

VECTOR = {"state": "{s: {type: int, low: 0, high: 9}, v: {type: bool, shape: 12}}", "initial": "{s: 0, v: false}"}
BOOLS = {
    "state": "{s: {type: bool, shape: 12}}",
    "initial": "{s: 'Bernoulli(1/2, shape=12)'}",
    "dynamics": "{}",
    "reward": "s[0]",
}


def written(**sections: str) -> Task:
    return build(read_text(text(**sections)))


def first(error: Any) -> tuple[str, str, str | None]:
    d = error.diagnostics[0]
    return d.code, d.message, d.hint


def lanes(number: int) -> Any:
    vector = pytest.importorskip("taskspec.envs.vector", exc_type=SpecError)
    return vector.VectorEnvironment(written(), number, backend="numpy")


def instances(entry: str) -> Any:
    """The instances of an experiment with one task."""
    expanded = experiments.expand(
        described(read_text(f"experiment: 1\nname: e\ntasks: [{{task: {entry}}}]\n", "e.yaml"))
    )
    expanded.raise_if_wrong()
    return expanded.instances


def compiled() -> Any:
    """Lanes of a task that was never compiled before, on Numba."""
    engine = pytest.importorskip("taskspec.programs.numba")
    vector = import_module("taskspec.envs.vector")
    engine.compile_numba.cache_clear()
    engine.load.cache_clear()
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, TASKSPEC_CACHE=folder):
        return vector.VectorEnvironment("Sort", 2, backend="numba")


# For each limit: a value that is too small for what is done, one that is not, and the code of the refusal.
REACHED: dict[str, tuple[int, int, str, Callable[[], Any]]] = {
    "file": (100, 1000, "E114", written),
    "values": (20, 100, "E114", written),
    "variants": (1, 2, "E314", lambda: written(variants="{b: {}, c: {}}")),
    "claims": (2, 3, "E314", lambda: written(claims="[actions == 2, {claim: actions == 2, for: [{}, {}]}]")),
    "characters": (10, 30, "E314", lambda: written(reward="s + s + s + s + s")),
    "expansions": (9, 10, "E314", lambda: written(reward="'sum([s + i for i in range(10)])'")),
    "expressions": (30, 300, "E314", lambda: written(reward="'sum([s + i for i in range(10)])'")),
    "operations": (10, 100, "E314", lambda: written(reward="'sum([s * i for i in range(10)])'")),
    "elements": (9, 10, "E314", lambda: written(reward="'sum(Normal(shape=10))'")),
    "width": (12, 13, "E314", lambda: written(**VECTOR)),
    "candidates": (99, 100, "E314", lambda: written(reward="'s in {p[0] for p in box(0, 9, 2)}'")),
    "unrolled": (9, 10, "E314", lambda: written(reward="'sum([s + i for i in range(10)])'")),
    "cells": (9, 10, "E410", lambda: written(reward=f"{{by: s, rows: {flow(10, 'I: I')}}}")),
    "one_hot": (9, 10, "E214", lambda: written(observation="{space: one_hot, o: s}")),
    "points": (5, 100, "", lambda: check(written(reward="1 / (s - 1/2)")).method.exact),
    "outcomes": (4095, 4096, "E712", lambda: extract(written(**BOOLS))),
    "transitions": (19, 20, "E712", lambda: extract(written())),
    "episodes": (9, 10, "E314", lambda: written(claims="[{claim: actions == 2, episodes: 10}]")),
    "enumerated": (5, 6, "E729", lambda: oracle.expectation(lambda episode: 1, "CoinToss", "random")),
    "lanes": (9, 10, "E713", lambda: lanes(10)),
    "compiling": (0, 1, "E314", compiled),
    "instances": (9, 10, "E314", lambda: instances("Branching, parameters: {L: {range: [2, 12]}}")),
    "seconds": (0, 1, "E712", lambda: extract(written())),
    "megabytes": (0, 1, "E713", lambda: lanes(10)),
}  # fmt: skip


def test_the_time_of_a_simulation_is_bounded(set_limits: Any) -> None:
    task = written(horizon="1000")
    assert simulate(task, at_random(task), 10).shape == (10,)
    set_limits(seconds=0)
    with pytest.raises(SpecError, match=r"E712.*10 episodes take more than 0 seconds"):
        simulate(task, at_random(task), 10)


@pytest.mark.parametrize(
    ("value", "words"),
    [("second=3", "did you mean 'seconds'"), ("x=3", "there are: file, values"), ("seconds", "seconds=10"),
     ("seconds=", "seconds=10"),
     ("seconds=much", "gives no number"), ("seconds=1,,candidates=-inf", "gives no number"), ("seconds=nan", "gives no number"),
     ("depth=1000", "'depth' cannot be changed"), ("=3", "no limit ''"), ("seconds=-1", "gives no number")],
)  # fmt: skip
def test_what_cannot_be_understood_is_said(value: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text())
    run = bounded(tmp_path, "check", "a.yaml", TASKSPEC_LIMITS=value)
    assert run.returncode == 1
    assert run.stderr.startswith(f"error[E713 invalid-option]: {limits.VARIABLE}: ") and words in run.stderr


def test_limits_are_read_from_the_environment() -> None:
    assert changed(Limits(), " seconds = 60 , candidates=1e7,") == Limits(seconds=60, candidates=10**7)
    assert changed(Limits(), "") == Limits()


@pytest.mark.parametrize("command", sparse(["check", "solve"], 2))
def test_an_option_sets_limits_for_one_command(command: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").write_text(text(expert="{a: true}", claims="[optimal_return == 1]"))
    assert json_of(bounded(tmp_path, command, "a.yaml", "--json"), command) is None
    skipped = json_of(bounded(tmp_path, command, "a.yaml", "--json", "--limit", "transitions=19"), command)
    assert skipped is not None and "more than 9 states can be reached, each with up to " in skipped
    both = bounded(tmp_path, command, "a.yaml", "--json", "--limit", "seconds=60", "--limit", "transitions=1e6",
                    TASKSPEC_LIMITS="transitions=19")  # fmt: skip
    assert json_of(both, command) is None
    wrong = bounded(tmp_path, command, "a.yaml", "--limit", "second=60")
    assert wrong.returncode == 1
    assert wrong.stderr.startswith("error[E713 invalid-option]: --limit: there is no limit 'second'")
    assert "did you mean 'seconds'" in wrong.stderr


def json_of(run: Ended, command: str) -> str | None:
    """Why there is no exact model, as a command says it in JSON."""
    data = json.loads(run.stdout)
    if command == "solve":
        return data["why_not_exact"]  # type: ignore[no-any-return]
    return data["tasks"][0]["claims"][0]["detail"] if data["tasks"][0]["claims_proved"] == 0 else None


def test_a_claim_that_needs_a_model_says_how_to_have_it(set_limits: Any) -> None:
    task = written(claims="[optimal_return > 0]")
    set_limits(transitions=19)
    (found,) = check(task).errors
    assert found.code == "E602"
    assert found.hint == "choose smaller parameters, or: TASKSPEC_LIMITS=transitions=190 allows it"


def test_long_analyses_tell_what_they_are_at() -> None:
    told: list[str] = []
    task = written(claims="[optimal_return > 0, 'probability(s == 9, under=soft(1)) > 0']")
    with progress_listener(lambda what, share: told.append(what)):
        check(task)
        extract(task, reachable=True)
    assert told[0] == "soundness"
    assert {"claim 1 of 2", "claim 2 of 2", "20 of 20 rows of the model", "following a policy, step 9 of 9"} <= set(
        told
    )
    assert "looking for states, step 9: 0 of 1 looked at" in told
    told.clear()
    check(task)
    assert not told  # nobody listens any more


@pytest.mark.skipif(not Path("/dev/ptmx").exists(), reason="there are no pseudo-terminals")
def test_a_terminal_shows_what_takes_long_and_clears_it(tmp_path: Path) -> None:
    (tmp_path / "mines.yaml").write_text(text(**BOMBS["mines"]), encoding="utf-8")
    ours, theirs = os.openpty()
    command = [sys.executable, "-m", "taskspec", "check", "mines.yaml", "--limit", "seconds=10,transitions=10000000000"]
    shown = b""
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=theirs, text=True) as run:
        while run.poll() is None or select.select([ours], [], [], 0)[0]:  # a terminal that nobody reads is soon full
            shown += os.read(ours, 65536) if select.select([ours], [], [], 0.1)[0] else b""
        said_so = run.communicate()[0]
    os.close(theirs)
    os.close(ours)
    assert "E602" in said_so and "\x1b" not in said_so
    lines = shown.decode().split("\r\x1b[K")
    assert re.search(r"^.*mines.yaml: looking for states, step \d+: [\d,]+ of", "\n".join(lines), re.MULTILINE)
    assert lines[-1] == ""


@pytest.mark.parametrize(
    ("number", "said"),
    [(999, "999"), (10**14, "100,000,000,000,000"), (10**20, "about 10^20"), (1000**20, "about 10^60")],
    ids=str,
)
def test_large_numbers_are_said_in_words(number: int, said: str) -> None:
    assert count(number) == said
    assert count(10**5000) == "about 10^5000"


@pytest.mark.parametrize(
    ("needed", "said"), [(7, "7"), (999.5, "1000"), (12345, "13e3"), (10**6, "10e5"), (10**6 + 1, "11e5")]
)
def test_hints_round_up(needed: float, said: str) -> None:
    assert how_to_raise("seconds", needed) == f"TASKSPEC_LIMITS=seconds={said} allows it"
    assert how_to_raise("seconds", 10**40) is None


def flow(count: int, entry: str) -> str:
    """A mapping in YAML of so many entries, each with its number for I, and the one before for J."""
    entries = [entry.replace("I", str(i)).replace("J", str(i - 1)) for i in range(count)]
    return "{" + ", ".join(entries) + "}"


ROWS = f"{{by: [s, r], rows: {flow(256, 'I: {else: I}')}}}"
PAIR = "{s: {type: int, low: 0, high: 255}, r: {type: int, low: 0, high: 255}}"
BOMBS: dict[str, dict[str, str]] = {
    "episodes": {"claims": "[{claim: optimal_return == 1, episodes: 1000000000}]"},
    "large state": {"state": "{s: {type: bool, shape: 1000000}}", "initial": "{s: false}", "dynamics": "{}", "reward": "s[0]"},
    "wide state": {"state": "{s: {type: bool, shape: 20000}}", "initial": "{s: 'Bernoulli(1/2, shape=20000)'}", "dynamics": "{}",
                   "reward": "s[0]"},
    "many components": {"state": flow(19, "sI: {type: int, low: 0, high: 9, shape: 1000}"), "initial": flow(19, "sI: 0"),
                        "dynamics": "{}", "reward": "s0[0]"},
    "many values": {"state": flow(20, "sI: {type: int, low: 0, high: 999}"), "initial": flow(20, "sI: 0"),
                    "dynamics": "{s0': 'min(s0 + a, 999)'}", "reward": "s0"},
    "variants": {"variants": flow(3000, "vI: {title: x}")},
    "chain": {"variants": flow(200, "vI: {base: vJ}").replace("{base: v-1}", "{}")},
    "circle": {"variants": flow(200, "vI: {base: vJ}").replace("v-1", "v199")},
    "permutation": {"state": "{s: {type: int, low: 0, high: 9}, p: {type: int, low: 0, high: 99999, shape: 100000}}",
                    "initial": "{s: 0, p: Permutation(100000)}"},
    "permutations": {"dynamics": "{s': 'min(Permutation(100000)[0], 9)'}"},
    "permutations at the start": {"initial": "{s: 'min(Permutation(100000)[0], 9)'}", "noise": "{n: Normal()}",
                                  "dynamics": "{s': 'clip(s + floor(n), 0, 9)'}"},
    "set": {"state": "{s: {type: int, low: 0, high: 999999}}", "initial": "{s: 'Uniform({i for i in range(1000000)})'}",
            "dynamics": "{}"},
    "points": {"initial": "{s: 'Uniform({clip(p[0], 0, 9) for p in box(0, 999, 2)})'}"},
    "members": {"reward": "'(s, s) in {p for p in box(0, 900, 2)}'"},
    "long expressions": {"reward": f"'sum([{' + '.join(['1'] * 2000)} + s for i in range(10000)])'"},
    "outcomes": {"noise": "{n: 'UniformInt(0, 1000000, shape=100)'}", "dynamics": "{s': clip(sum(n), 0, 9)}"},
    "rows": {"state": PAIR, "initial": "{s: 0, r: 0}", "dynamics": "{}", "reward": ROWS},
    "claims": {"claims": "[" + ", ".join(["'prefers(soft(1), a == true)'"] * 5000) + "]"},
    "mines": {"state": "{m: {type: bool, shape: 16}, o: {type: bool, shape: 16}}", "action": "{a: {type: int, low: 0, high: 15}}",
              "initial": "{m: 'Bernoulli(1/5, shape=16)', o: false}", "dynamics": "{o': 'put(o, a, True)'}", "horizon": "16",
              "reward": "'-1 if m[a] else not o[a]'", "terminal": "m[a]", "claims": "[optimal_return > 1]"},
}  # fmt: skip


def bounded(folder: Path, *arguments: str, **environment: str) -> Ended:
    """A command with a gigabyte and twenty seconds."""
    return taskspec(folder, *arguments, resources={"RLIMIT_DATA": 10**9, "RLIMIT_CPU": 20}, **environment)


PRINTED = ("many components", "many values", "permutation", "set", "chain")


@pytest.mark.parametrize(
    ("bomb", "command"), [*sparse(product(BOMBS, ["check"]), 5), *sparse(product(PRINTED, ["docs"]), 5)]
)
def test_bombs_end(bomb: str, command: str, tmp_path: Path) -> None:
    (tmp_path / "walk.yaml").write_text(text(**BOMBS[bomb]), encoding="utf-8")
    run = bounded(tmp_path, command, "walk.yaml")
    assert run.returncode in (0, 1), run.stdout + run.stderr
    assert "internal error" not in run.stderr
    if run.returncode:
        assert "error[E" in run.stdout + run.stderr


def test_a_map_is_read_in_time_that_grows_with_its_cells() -> None:
    """Four times the cells take four times as many calls, give or take; they took sixteen times as many."""

    def steps(n: int) -> int:
        rows = ", ".join(["'" + "S.#G" * (n // 4) + "'"] * n)
        grid = f"m: {{grid: [{rows}], legend: {{S: 0, .: 1, '#': 2, G: 3}}}}"
        grid = f"{{{grid}, o: '[[m[i, j] == 1 for j in range({n})] for i in range({n})]'}}"
        document = read_text(text(constants=grid))
        return calls(lambda: build(document))

    assert steps(64) < 5 * steps(32)


def test_numba_says_that_it_takes_long_and_refuses_what_takes_too_long(caplog: Any, set_limits: Any) -> None:
    kept = pytest.importorskip("taskspec.programs.numba.module")
    large = load(spec_file("catch"), rows=50, columns=50)
    vector = pytest.importorskip("taskspec.envs.vector", exc_type=SpecError)
    assert vector.VectorEnvironment(large, 2).backend == "numpy"
    with pytest.raises(SpecError, match="E314") as caught:
        vector.VectorEnvironment(large, 2, backend="numba")
    assert 'backend="numpy"' in (caught.value.diagnostics[0].hint or "")
    assert not caplog.records
    with patch.object(kept, "LONG", 0):
        compiled()
    assert "takes about 1 seconds" in caplog.text or "takes about 2 seconds" in caplog.text


def test_a_model_of_many_times_is_refused_before_it_is_built() -> None:
    task = written(horizon="100000", reward="s * t")
    with pytest.raises(SpecError, match=r"E712.*the exact model would take about 50 seconds; the limit is 10"):
        extract(task)
    assert not extract(written(horizon="100000", reward="s")).is_timed


def test_every_limit_is_reached() -> None:
    assert REACHED.keys() == {row.name for row in table() if not row.fixed}


@pytest.mark.parametrize("name", REACHED)
def test_a_limit_refuses_says_how_to_raise_it_and_can_be_raised(name: str, set_limits: Any) -> None:
    little, enough, code, act = REACHED[name]
    set_limits(**{name: enough})
    assert act() is not False
    set_limits(**{name: little})
    if not code:  # samples stand in
        assert act() is False
        return
    with pytest.raises(SpecError) as caught:
        act()
    assert set(caught.value.codes) == {code}
    if code != "E410":  # a table that is too large is no look-up, and needs its `else`
        assert f"{limits.VARIABLE}={name}=" in (caught.value.diagnostics[0].hint or "")


def test_what_the_hint_says_is_enough(set_limits: Any) -> None:
    for name in (
        "variants",
        "claims",
        "candidates",
        "unrolled",
        "width",
        "one_hot",
        "transitions",
        "lanes",
        "episodes",
    ):
        little, _, _, act = REACHED[name]
        set_limits(**{name: little})
        with pytest.raises(SpecError) as caught:
            act()
        hint = caught.value.diagnostics[0].hint or ""
        said = changed(Limits(), hint[hint.index("=") + 1 : hint.index(" allows")])
        set_limits(**{name: getattr(said, name)})
        act()


def test_values_of_a_modifier_are_counted_before_they_are_written_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskspec.learn.experiments.instances.modifier", lambda *_: pytest.fail("written out"))
    with pytest.raises(SpecError, match="1,000,000 instances are too many"):
        instances("Branching, modifiers: [{delay: {range: [1, 1000001]}}]")
    with pytest.raises(SpecError, match="1,000,000 instances are too many"):
        instances("Branching, modifiers: [{distractors: {count: {range: [0, 1000]}, scale: {range: [0, 1000]}}}]")
