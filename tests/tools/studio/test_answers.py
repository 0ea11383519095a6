"""What a page of the studio is answered, compared with what the package says without the studio."""

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("uvicorn")
pytest.importorskip("websockets")

import taskspec
from taskspec import exact
from taskspec.exact.solve import solve
from tests.tools.studio.shared import DERAIL, Page, running

NAMES = ("risky_path", "branching")
RESULTS = Path(__file__).parents[3] / "docs" / "results" / "corrected" / "bc" / "exam.json.gz"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("specs").resolve()
    for name in NAMES:
        shutil.copy(DERAIL / f"{name}.yaml", place)
    (place / "model.py").write_text("def act(observation):\n    return 0\n\ndef _hidden(x): ...\ndef two(a, b): ...\n")
    return place


@pytest.fixture(scope="module")
def page(folder: Path) -> Iterator[Page]:
    with running(folder) as studio, studio.connect() as socket:
        yield Page(socket)


def about(folder: Path, name: str, **settings: Any) -> dict[str, Any]:
    text = (folder / f"{name}.yaml").read_text()
    return {"text": text, "path": f"{name}.yaml", "settings": settings}


@pytest.mark.parametrize("name", NAMES)
def test_the_page_is_that_of_the_task(page: Page, folder: Path, name: str) -> None:
    task = taskspec.load(folder / f"{name}.yaml")
    shown = page.ask("page", **about(folder, name))
    assert (shown["name"], shown["horizon"]) == (task.name, task.horizon)
    assert "<math" in shown["mathematics"]
    assert "<script" not in shown["mathematics"]
    assert shown["figure"].startswith("<svg")
    assert {p["name"]: p["value"] for p in shown["parameters"]} == task.values
    assert shown["variants"][0] == {"name": None, "title": task.name}
    marked = set(re.findall(r'data-of="(\d+)"', shown["mathematics"]))
    assert marked <= set(re.findall(r'data-state="(\d+)"', shown["figure"]))


def test_settings_change_parameters_variants_and_modifiers(page: Page, folder: Path) -> None:
    shown = page.ask("page", **about(folder, "branching", parameters={"L": 4}))
    parameter = shown["parameters"][0]
    assert (parameter["name"], parameter["value"]) == ("L", 4)
    assert parameter["default"] != 4
    asked = about(folder, "risky_path", variant="seals", modifiers=["negated=1"])
    assert "there is no modifier" in page.refusal("scores", **asked)["message"]
    seals = page.ask("scores", **about(folder, "risky_path", variant="seals"))
    assert seals["rows"][0] | {"html": ""} == {
        "label": "optimal return", "exact": "3", "decimal": "3", "html": "", "estimated": False
    }  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_scores_and_claims_are_those_of_exact_analysis(page: Page, folder: Path, name: str) -> None:
    task = taskspec.load(folder / f"{name}.yaml")
    known = exact.scores(task)
    found = page.ask("scores", **about(folder, name))
    rows = {row["label"]: row for row in found["rows"]}
    for which in ("optimal", "random", "worst", "expert"):
        shown = rows[f"{which} return"]["decimal"].replace("−", "-")
        assert float(shown) == pytest.approx(getattr(known, which).value, abs=1e-9)
    assert found["states"] == int(exact.extract(task).entered.sum())
    lines = (folder / f"{name}.yaml").read_text().splitlines()
    found = page.ask("claims", **about(folder, name))
    assert len(found["claims"]) == len(task.annotations.claims)
    for claim in found["claims"]:
        assert (claim["status"], claim["holds"]) == ("proved", True)
        assert claim["text"] in lines[claim["line"] - 1]


def test_a_wrong_claim_and_a_mistake_are_answers(page: Page, folder: Path) -> None:
    asked = about(folder, "risky_path")
    wrong = page.ask("claims", **{**asked, "text": asked["text"].replace("optimal_return == 4", "optimal_return == 5")})
    assert (wrong["claims"][0]["status"], wrong["claims"][0]["holds"]) == ("false", False)
    assert wrong["problems"][0]["code"] == "E601"
    text = asked["text"].replace("safe: detour", "safe: detuor")
    mistake = page.refusal("page", **{**asked, "text": text})["problems"][0]
    assert (mistake["code"], mistake["line"]) == ("E313", text[: text.index("detuor")].count("\n") + 1)
    unsound = asked["text"].replace("goal: 1/2, trap: 1/2", "goal: 1/2, trap: 1/3")
    assert page.refusal("scores", **{**asked, "text": unsound})["problems"][0]["code"] == "E401"


@pytest.mark.parametrize("name", NAMES)
def test_values_agree_with_backward_induction(page: Page, folder: Path, name: str) -> None:
    task = taskspec.load(folder / f"{name}.yaml")
    model = exact.extract(task)
    best = dict(zip(model.codes.tolist(), solve.best(model).value.tolist(), strict=True))
    found = page.ask("values", **about(folder, name), plan="optimal", time=0)
    start = 0.0
    for state in found["states"]:
        assert state["value"] == pytest.approx(best[state["code"]])
        start += state["value"] * state["visits"]
    assert start == pytest.approx(exact.scores(task).optimal.value)
    assert f'data-state="{found["states"][0]["code"]}"' in found["figure"]


@pytest.mark.parametrize("plan", ["soft", "maxent", "random"])
def test_values_of_other_plans_satisfy_their_own_equations(page: Page, folder: Path, plan: str) -> None:
    """V = sum of pi Q; and one step back, Q = R + P V by a dense model."""
    task = taskspec.load(folder / "risky_path.yaml")
    model = exact.extract(task)
    P = model.step(0).P.toarray().reshape(model.n_actions, model.n_states, model.n_states)
    R = model.step(0).R.reshape(model.n_actions, model.n_states)
    codes = model.codes.tolist()
    V = np.zeros(model.n_states)
    for t in reversed(range(task.horizon)):
        found = page.ask("values", **about(folder, "risky_path"), plan=plan, time=t, temperature=2.0)
        Q = R + P @ V
        V = Q.mean(axis=0)  # of states that episodes do not enter
        for state in found["states"]:
            s = codes.index(state["code"])
            assert state["q"] == pytest.approx(Q[:, s].tolist())
            assert sum(state["policy"]) == pytest.approx(1)
            V[s] = np.dot(state["policy"], Q[:, s])
            assert state["value"] == pytest.approx(V[s])
    if plan == "random":
        assert model.start @ V == pytest.approx(-122.21875)


PURSE = (
    "taskspec: 1\nname: Purse\nhorizon: 3\nstate: {s: {type: int, low: 0, high: 2}}\n"
    "action: {a: {type: int, low: 0, high: 2}}\nlegal: a <= s\ninitial: {s: 2}\ndynamics: {s': 'max(s - a, 0)'}\nreward: a\n"
)


def test_an_illegal_action_has_no_regret(page: Page) -> None:
    """Moves that an edit of the text makes illegal are played on."""
    played = page.ask("play", text=PURSE, path="purse.yaml", settings={}, actions=[1, 2], seed=0)
    assert [step["reward"] for step in played["steps"]] == [1, 2]
    assert [step["regret"] for step in played["steps"]] == [0, None]
    assert played["regret"] is None


def test_an_action_of_a_file_that_is_none_is_named(page: Page, folder: Path) -> None:
    text = PURSE.replace("low: 0, high: 2}}\nlegal", "low: 1, high: 2}}\nlegal")
    said = page.refusal("rollout", text=text, path="purse.yaml", settings={}, policy="model.py:act")["message"]
    assert said.startswith("E706: 0 is not an action of ")


def test_illegal_actions_have_no_value(page: Page) -> None:
    states = page.ask("values", text=PURSE, path="purse.yaml", settings={}, plan="optimal", time=1)["states"]
    told = {state["label"]: state["q"] for state in states}
    assert told == {"s = 0": [0, None, None], "s = 1": [1, 1, None], "s = 2": [2, 2, 2]}


def test_a_state_has_the_lines_that_decide_about_it(page: Page, folder: Path) -> None:
    asked = about(folder, "risky_path")
    lines = asked["text"].splitlines()
    for state in page.ask("values", **asked)["states"]:
        label = state["label"].partition(" = ")[2]
        assert any(lines[line - 1].strip().startswith(f"{label}: ") for line in state["lines"])


@pytest.mark.parametrize("name", NAMES)
def test_regrets_of_a_game_add_up_to_what_it_loses(page: Page, folder: Path, name: str) -> None:
    """Without chance, the return is the best one minus the regrets; the rewards are those of the environment."""
    task = taskspec.load(folder / f"{name}.yaml")
    optimal = exact.scores(task).optimal.value
    known = [each["name"] for each in page.ask("page", **about(folder, name))["actions"]]
    actions: list[int] = []
    env = taskspec.make(task)
    env.reset(seed=3)
    game = page.ask("play", **about(folder, name), seed=3, actions=[])
    while game["ended"] is None:
        taken = game["best"][0] if len(actions) != 1 else len(known) - 1
        _, reward, terminated, _, _ = env.step(taken)
        actions.append(taken)
        game = page.ask("play", **about(folder, name), seed=3, actions=actions)
        assert game["steps"][-1]["reward"] == reward
        assert game["steps"][-1]["action"] == known[taken]
    assert game["ended"] == ("terminated" if terminated else "truncated")
    assert game["regret"] == pytest.approx(optimal - game["return"])
    assert page.ask("play", **about(folder, name), seed=3, actions=actions[:-1])["ended"] is None
    assert page.refusal("play", **about(folder, name), actions=[7])["problems"][0]["code"] == "E713"


def test_episodes_of_policies_are_frames(page: Page, folder: Path) -> None:
    asked = about(folder, "risky_path")
    assert page.ask("files")["policies"] == ["model.py:act"]
    for policy, total in (("optimal", 4), ("expert", 4), ("model.py:act", 4)):
        found = page.ask("rollout", **asked, policy=policy, seed=1)
        assert (found["return"], found["length"], found["ended"]) == (total, 5, "truncated")
        assert len(found["frames"]) == 6
        for frame in found["frames"]:
            assert frame["figure"].startswith("<svg")
        assert found["frames"][-1]["words"].endswith("return 4")
    assert page.refusal("rollout", **asked, policy="../model.py:act")["refused"] == "outside"
    assert page.refusal("rollout", **asked, policy="clever")["problems"][0]["code"] == "E713"


def swept(page: Page, folder: Path, **asked: Any) -> dict[str, Any]:
    """Ask for a sweep until no value is left."""
    while True:
        found = page.ask("sweep", **about(folder, "branching"), parameter="L", **asked)
        if not found["left"]:
            return found


def test_a_sweep_has_the_exact_returns(page: Page, folder: Path) -> None:
    found = swept(page, folder, values=[2, 3, -1])
    for row in found["rows"][:2]:
        task = taskspec.load(folder / "branching.yaml", L=row["value"])
        assert row["random"] == pytest.approx(exact.scores(task).random.value)
    assert "L" in found["rows"][2]["error"]
    assert found["chart"].startswith("<svg")
    chosen = [row["value"] for row in swept(page, folder)["rows"]]
    assert chosen == sorted(set(chosen))
    assert 2 < len(chosen) <= 12


def test_results_of_the_folder_are_shown(page: Page, folder: Path) -> None:
    (folder / "build").mkdir(exist_ok=True)
    shutil.copy(RESULTS, folder / "build" / "exam.json.gz")
    (folder / "build" / "plot.svg").write_text("<svg xmlns='http://www.w3.org/2000/svg'/>")
    found = {each["path"]: each for each in page.ask("results")["results"]}
    assert found["build/exam.json.gz"]["html"].startswith("<!doctype html>")
    assert found["build/plot.svg"]["kind"] == "plot"


def test_copies_are_what_they_say(page: Page, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = about(folder, "risky_path", variant="seals")

    def copied(form: str) -> str:
        return page.ask("copy", **asked, format=form)["text"]

    assert r"\begin" in copied("latex")
    assert "seals" in copied("markdown")
    assert copied("svg").startswith("<svg")
    assert copied("command").splitlines()[0] == "taskspec check risky_path.yaml -v seals"
    monkeypatch.chdir(folder)
    made: dict[str, Any] = {}
    exec(copied("python"), made)
    assert made["env"].task.name == taskspec.load("risky_path.yaml", "seals").name
    assert page.refusal("copy", **asked, format="pdf")["problems"][0]["code"] == "E726"


def test_a_continuous_action_is_played_in_five_steps_from_bound_to_bound(page: Page) -> None:
    text = (DERAIL / "parabola.yaml").read_text()
    shown = page.ask("page", text=text, path="parabola.yaml", settings={})
    assert [action["name"] for action in shown["actions"]] == ["−1", "−0.5", "0", "0.5", "1"]
    game = page.ask("play", text=text, path="parabola.yaml", settings={}, seed=3, actions=[0, 4, 2])
    env = taskspec.make("derail/Parabola")
    env.reset(seed=3)
    total = 0.0
    for step, action in zip(game["steps"], (-1.0, 1.0, 0.0), strict=True):
        assert step["reward"] == env.step(np.array([action]))[1]
        total += step["reward"]
    assert game["return"] == total


def test_the_first_spec_is_the_first_with_a_figure(tmp_path: Path) -> None:
    plain = (DERAIL / "branching.yaml").read_text()
    (tmp_path / "a.yaml").write_text(plain[: plain.index("\nfigure:")])
    (tmp_path / "b.yaml").write_text(plain)
    with running(tmp_path) as studio, studio.connect() as socket:
        listed = Page(socket).ask("files")
    assert (listed["files"], listed["first"]) == (["a.yaml", "b.yaml"], "b.yaml")
