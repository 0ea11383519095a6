"""The command line: what is read, checked and explained; its messages and exit statuses."""

import json
import re
from pathlib import Path

import pytest
from rich.cells import cell_len

from taskspec.base.codes import classes, codes
from taskspec.language.registry import shipped, task_ids
from taskspec.learn.exam.mistakes import MISTAKES, anchor
from taskspec.show.record import SUITES
from tests.language.task.test_extends import run as run
from tests.shared.apart import taskspec
from tests.shared.commands import Done, spec
from tests.shared.folders import names
from tests.shared.for_each import for_each
from tests.shared.sparse import sparse
from tests.shared.specs import paper_ids, suite_ids, varied_files

ROOT = Path(__file__).parents[2]
DERAIL = ROOT / "tasks" / "derail"
SPECS = ROOT / "tests" / "specs"
ERRORS = ROOT / "tests" / "errors"
RISKY = (DERAIL / "risky_path.yaml").read_text(encoding="utf-8")
BRANCHING = (DERAIL / "branching.yaml").read_text(encoding="utf-8")
SHIFT = (DERAIL / "init_shift.yaml").read_text(encoding="utf-8")


GRID = """\
taskspec: 1
name: G
constants:
  map:
    grid: GRID
    legend: {S: 0, "#": 1}
state: {s: {type: int, low: 0, high: 1}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 5
initial: {s: "map[0, 0]"}
dynamics: {s': a}
reward: s
"""


@pytest.mark.parametrize("grid", ['["S#", "##"]', "|\n      S#\n      ##\n"])
def test_show_draws_a_map_as_it_is_written(tmp_path: Path, grid: str) -> None:
    found = Done("show", spec(tmp_path, GRID.replace("GRID", grid)), columns=80).out
    assert re.search(r"Maps +map \(S = 0, # = 1\)\n +S#\n +##\n", found), found


def test_list_alone_counts_the_tasks_of_suites_on_one_screen() -> None:
    out = Done("list", columns=80).out
    assert out.count("\n") < 24
    assert max(map(len, out.splitlines())) <= 80
    for suite in SUITES:
        assert re.search(rf"^ *{suite} +{len(suite_ids(suite))} ", out, re.MULTILINE)
    counts = re.search("capabilities: (.*?)\n\n", out, re.DOTALL)
    assert counts is not None
    assert sum(map(int, re.findall(r"\d+", counts[1]))) == len(task_ids())


def test_every_suite_has_a_line_that_fits() -> None:
    assert suite_ids(*SUITES) == task_ids()
    for suite in SUITES.values():
        assert len(suite.line) <= 60


@pytest.mark.parametrize("columns", [60, 80, 120, 160, 300])
def test_list_shows_size_horizon_and_summary_at_any_width(columns: int) -> None:
    out = Done("list", "derail", columns=columns).out
    lines = out.splitlines()
    assert max(map(len, lines)) <= columns
    assert set(re.findall(r"^ *(\w+/\S+)", out, re.MULTILINE)) == set(suite_ids("derail"))
    assert re.search(r"derail/Branching-v0 .*21 × 2 +10", out)
    assert "A long path on which every wrong turn is a dead end." in " ".join(out.split())
    assert ("exploration" in lines) == (columns < 150)


def test_list_takes_folders_suites_files_and_ids_alike() -> None:
    (one,) = Done("list", "derail/Sort", "--json").data
    same, variant = Done("list", DERAIL / "sort.yaml", "--json").data
    assert one["id"] == same["id"] == "derail/Sort-v0" and variant["id"] == "derail/SortSeals-v0"
    assert len(Done("list", DERAIL, "--json").data) == len(Done("list", "derail", "--json").data)
    assert len(Done("list", "--json").data) == len(shipped())


FOLDERS = {
    "list --json": '"id": "tiny/G-v0"',
    "check": "1 task in 1 spec and 1 experiment",
    "docs --no-results -o OUT": "on 1 task",
    "build -o OUT": "OUT/tasks.json  1 tasks",
}


@pytest.mark.parametrize("command", FOLDERS)
@pytest.mark.parametrize("written", [".", "./", "..", "../tiny", "/"])
def test_folders_are_found_however_they_are_written(
    command: str, written: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "tiny"
    (folder / "experiments").mkdir(parents=True)
    spec(folder, GRID.replace("GRID", '["S#"]').replace("high: 1", "high: 0"), "g.yaml")
    spec(folder / "experiments", "experiment: 1\nname: e\ntasks: [{task: ../g.yaml}]\n", "x.yaml")
    monkeypatch.chdir(folder / "experiments" if written == ".." else folder)
    out = tmp_path / "out"
    target = str(folder) + "/" if written == "/" else written
    done = Done(*command.replace("OUT", str(out)).split(), target, columns=400)
    assert done.status == 0, done.err
    assert FOLDERS[command].replace("OUT", str(out)) in done.out


def test_list_shows_what_isolates_a_capability() -> None:
    out = Done("list", "--capability", "exploration", "--json").out
    assert '"derail/Branching-v0"' in out and '"bsuite/DeepSea-v0"' in out
    assert '"derail/RiskyPath-v0"' not in out
    wrong = Done("list", "--capability", "explorasion")
    assert "did you mean 'exploration'?" in wrong.err


def test_list_json_says_what_a_program_needs() -> None:
    (task,) = Done("list", "derail/Branching-v0", "--json").data
    assert (task["states"], task["actions"], task["horizon"]) == (21, 2, 10)
    assert task["action_space"] == {"space": "Discrete", "n": 2, "start": 0}
    assert {p["name"]: p["default"] for p in task["parameters"]} == {"L": 10, "B": 2}


def test_list_goes_on_after_a_broken_spec(tmp_path: Path) -> None:
    spec(tmp_path, "taskspec: [", "a.yaml")
    spec(tmp_path, RISKY, "b.yaml")
    done = Done("list", tmp_path)
    assert done.status == 1
    assert "RiskyPath" in done.out
    assert "a.yaml:1:" in done.err


def test_check_passes_every_task_of_the_paper() -> None:
    done = Done("check", DERAIL, DERAIL.parent / "seals")
    assert done.status == 0, done.out
    assert "no errors, no warnings" in done.out
    for task_id in paper_ids():
        assert task_id in done.out


BROKEN = {
    "a misspelt key": (RISKY.replace("name: RiskyPath", "nmae: RiskyPath"), "2:1", "E202", "did you mean 'name'?"),
    "an unknown name": (BRANCHING.replace("s': s + (a", "s': ss + (a"), "40:7", "E302", "did you mean 's'?"),
    "a shape error": (RISKY.replace("reward:\n  by: [s']", "reward: [1, 2]\nx:\n  by: [s']"), "", "E", ""),
    "a row of 0.9": (RISKY.replace("trap: 1/2", "trap: 0.4"), "42:36", "E401", "sum to 0.9"),
    "a state out of range": (SHIFT.replace("high: 6", "high: 5"), "31:7", "E403", "from s = 2 with a = right"),
    "a comma in a flow mapping": (RISKY.replace("  s: start", "  s: {x: clip(1, 0, 1)}"), "", "E106", "quotes"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_check_says_what_is_wrong_and_where(case: str, tmp_path: Path) -> None:
    text, place, code, words = BROKEN[case]
    path = spec(tmp_path, text)
    done = Done("check", path)
    assert done.status == 1
    assert f"{path}:{place}" in done.out
    assert f"error[{code}" in done.out
    assert words in done.out


def test_check_survives_all_broken_specs() -> None:
    done = Done("check", ERRORS, "--json", "--strict")
    assert done.status == 1
    assert {path.stem[:4] for path in ERRORS.glob("*.yaml")} <= set(done.codes)


def test_check_tells_what_variants_share_once(tmp_path: Path) -> None:
    done = Done("check", spec(tmp_path, BRANCHING.replace("s': s + (a", "s': ss + (a")))
    assert done.out.count("'ss' is not defined") == 1
    assert "the same in BranchingSeals" in done.out


def test_check_formats(tmp_path: Path) -> None:
    path = spec(tmp_path, SHIFT.replace("high: 6", "high: 5"))
    data = Done("check", path, "--json").data
    assert data == {**Done("check", path, "--format", "json").data, "seconds": data["seconds"], "tasks": data["tasks"]}
    assert data["errors"] == sum(d["severity"] == "error" for d in data["diagnostics"])
    out = Done("check", path, "--format", "github").out
    assert f"::error file={path},line=31," in out
    for line in out.splitlines():
        assert line.startswith(("::error ", "::warning "))


def test_strict_makes_warnings_errors(tmp_path: Path) -> None:
    path = spec(tmp_path, Done("new", "Odd", "-o", tmp_path / "odd.yaml").out and (tmp_path / "odd.yaml").read_text())
    path.write_text(
        path.read_text().replace("  s: {type: int, low: 0, high: L", "  s: {type: int, low: 0, high: L + 5")
    )
    assert Done("check", path).status == 0
    assert "W501" in Done("check", path).out
    assert Done("check", path, "--strict").status == 1


def test_check_takes_parameters_and_variants() -> None:
    (task,) = Done("check", DERAIL / "branching.yaml", "--variant", "seals", "-p", "L=10", "--json", "--quick").data[
        "tasks"
    ]
    assert task["id"] == "derail/BranchingSeals-v0"
    assert task["other_parameter_values"] == 0


def test_claims_speak_of_the_default_parameters() -> None:
    assert Done("check", "NoisyObs", "-p", "M=7").status == 0
    assert Done("check", "NoisyObs", "--json").data["tasks"][0]["claims_proved"] > 0


EVERY = [*paper_ids(), *map(str, varied_files())]


@for_each("task", EVERY)
def test_show_is_a_page_of_80_columns(task: str) -> None:
    done = Done("show", task, columns=80)
    assert done.status == 0, done.err
    assert max(map(cell_len, done.out.splitlines())) <= 80
    for title in ("States", "Actions", "Observations", "Dynamics", "Rewards"):
        assert re.search(rf"^{title}  +\S", done.out, re.MULTILINE)


def test_show_tells_values_equations_errata_claims_and_sources() -> None:
    text = Done("show", "Branching", "-p", "L=4").out
    for line in (
        "Parameters L = 4, number of choices on the path (1 to 1000)",
        "States 𝒮 = {0, … , LB} s: position",
        "Discrete(9)",
        "Dynamics s′ = s + (a + 1) ⋅ 𝟙[s ≡ 0 (mod B) ∧ s < LB]",
        "Horizon L here 4",
        "Expert a = B − 1",
        "Claims optimal return = 1",
        "Here: the goal is absorbing",
        "Sources freire2020derail, sections 3.2, A.4",
    ):
        assert line in " ".join(text.split())


def test_show_source_is_the_code_that_runs() -> None:
    from taskspec import load
    from taskspec.programs.scalar import compile_scalar

    assert Done("show", "Sort", "--source").out.rstrip() == compile_scalar(load("derail/Sort")).source.rstrip()
    assert Done("show", "Sort", "--source", "--json").data["language"] == "python"


def test_show_json_holds_the_merged_spec() -> None:
    data = Done("show", "derail/EarlyTermNeg", "--json").data
    assert (data["id"], data["spec"]["reward"]) == ("derail/EarlyTermNeg-v0", -1)


def test_show_obeys_nothing_that_a_spec_says(tmp_path: Path) -> None:
    text = RISKY.replace("summary: A shortcut", 'summary: "\\e]0;owned\\a\\e[31m [bold]A shortcut').replace(
        "half of the time.", 'half."'
    )
    done = Done("show", spec(tmp_path, text))
    assert done.status == 0
    assert "\x1b" not in done.out
    assert "[bold]A shortcut" in done.out


@pytest.mark.parametrize("code", sparse(codes(), 3))
def test_explain_knows_every_code(code: str) -> None:
    done = Done("explain", code.lower())
    assert codes()[code].slug in done.out
    assert codes()[code].explanation.strip() in done.out
    assert code[:2] in classes()


def test_explain_knows_mistakes_of_learners() -> None:
    for name in ("limit_is_an_end", "limit is an end"):
        done = Done("explain", name)
        assert "a learner for which the time limit ends the world" in done.out
        assert "openai/baselines#436" in done.out
    assert Done("explain", "at_random", "--json").data[0]["mistake"] == "at random"


def test_explain_lists_all() -> None:
    listed = Done("explain").out
    for name in (*codes(), *map(anchor, MISTAKES.keys() - {"right"})):
        assert name in listed
    assert [entry["code"] for entry in Done("explain", "--json").data] == list(codes())


def test_schema_is_json_on_the_terminal_and_in_a_file(tmp_path: Path) -> None:
    assert "$schema" in Done("schema").data
    assert Done("schema", "-o", tmp_path / "deep" / "s.json").status == 0
    assert "$defs" in json.loads((tmp_path / "deep" / "s.json").read_text())
    assert "yaml-language-server: $schema" in Done("schema", "--help").out


def test_new_passes_check_and_runs(tmp_path: Path) -> None:
    path = tmp_path / "my_first_task.yaml"
    assert Done("new", "MyFirstTask", "-o", tmp_path).status == 0
    checked = Done("check", path, "--strict")
    assert checked.status == 0, checked.out
    assert Done("run", path, "--policy", "expert", "--json").data["mean"] == 1
    before = path.read_text()
    again = Done("new", "MyFirstTask", "-o", path)
    assert (again.status, path.read_text()) == (1, before)
    assert "already exists" in again.err


OUTSIDE = """\
taskspec: 1
name: Grid
constants: {map: {grid: ["..#", "#.."], legend: {".": 0, "#": 1}}}
state:
  x: {type: int, low: 0, high: 2}
action:
  a: {type: choice, values: {left: -1, right: 1}}
horizon: 5
initial: {x: 7}
dynamics: {x': "clip(x + a, 0, 2)"}
reward: x' == 2
figure: {kind: grid, at: [x, 0], map: map}
"""


@pytest.mark.parametrize("command", ["check", "docs", "build"])
def test_a_task_that_fails_silences_no_other(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    spec(tmp_path, RISKY, "a.yaml")
    spec(tmp_path, OUTSIDE, "grid.yaml")
    spec(tmp_path, OUTSIDE.replace("Grid", "Typo").replace("x' == 2", "y"), "typo.yaml")
    spec(tmp_path, RISKY.replace("RiskyPath", "Zebra"), "z.yaml")
    done = Done(command, ".", columns=200)
    said = done.out + done.err
    assert "E712" not in said
    assert "typo.yaml:11:9: error[E302 unknown-name]: 'y' is not defined here" in said
    assert done.status == 1
    assert "grid.yaml:9:14: error[E404 initial-state-outside]: x starts at 7" in said
    if command == "docs":
        assert {"risky-path.html", "zebra.html"} <= set(names(tmp_path / "build" / "docs"))
    else:
        assert "RiskyPath" in done.out
        assert "Zebra" in done.out


@pytest.mark.parametrize("command", [["solve"], ["figure", "-o", "x.svg"]])
def test_a_start_outside_the_map_is_no_fault_of_the_figure(
    command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    spec(tmp_path, OUTSIDE, "grid.yaml")
    done = Done(command[0], "grid.yaml", *command[1:])
    assert "E712" not in done.out + done.err
    assert ("can start outside" in done.out) if command == ["solve"] else ("grid.yaml:9:14: error[E404" in done.err)


def test_check_in_several_processes_finds_the_same(tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text(
        (ROOT / "tasks/derail/branching.yaml").read_text(encoding="utf-8").replace("horizon", "horizn"), "utf-8"
    )
    files = ["tasks/derail/experiments/noise.yaml", "tasks/derail/risky_path.yaml", wrong, "tasks/derail/sort.yaml"]
    found = []
    for jobs in ("1", "2"):
        done = taskspec(ROOT, "check", *files, "--json", "-j", jobs)
        assert done.returncode == 1
        found.append(re.sub(r'"seconds": [\d.e-]+', "", done.stdout))
    assert found[0] == found[1]
    assert "E202" in found[0]


def test_commands_take_specs_that_extend_another(run: Path) -> None:
    for command in (["check", "--strict", "--json"], ["list"], ["show"], ["docs", "-o", "pages"]):
        done = taskspec(run.parent, *command, run)
        assert done.returncode == 0, done.stdout + done.stderr
        if "--json" in command:
            ids = [task["id"] for task in json.loads(done.stdout)["tasks"]]
            assert ids == ["runs/Run-v0", "runs/RunShort-v0", "runs/RunLate-v0"]
