"""The widget of notebooks, driven by the messages that its page sends."""

import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

pytest.importorskip("anywidget")

import taskspec
from taskspec.exact import Results
from taskspec.notebook import explore

PAGE = Path(taskspec.__file__).parent / "tools" / "notebook" / "widget.js"


def sent(widget: Any, **message: Any) -> dict[str, Any]:
    """Send a message as the page does, and return what it shows then."""
    widget._handle_custom_msg(message, [])
    return dict(widget.view)


def test_an_episode_is_played_to_its_end() -> None:
    widget = explore("derail/RiskyPath", seed=3)
    start = dict(widget.view)
    assert [each["name"] for each in start["keys"]] == ["safe", "risky"]
    assert start["best"] == [0] and ElementTree.fromstring(start["figure"]) is not None
    once = sent(widget, act=0)
    assert once["figure"] != start["figure"]
    assert [step["regret"] for step in once["steps"]] == [0.0]
    for _ in range(9):
        view = sent(widget, act=0)
    assert view["ended"] == "truncated" and len(view["steps"]) == 5
    assert view["return"] == 4.0 == Results("derail/RiskyPath").optimal.value
    assert len(sent(widget, undo=True)["steps"]) == 4
    assert sent(widget, again=True) == start


def test_values_of_plans_are_shown_over_time() -> None:
    widget = explore("derail/RiskyPath")
    view = sent(widget, plan="optimal", time=0)
    assert ("s = start", 4.0) in [(state["label"], state["value"]) for state in view["states"]]
    assert view["horizon"] == 5
    last = sent(widget, plan="optimal", time=4)
    assert ("s = goal", 1.0) in [(state["label"], state["value"]) for state in last["states"]]
    assert sent(widget, plan="", time=0)["steps"] == []


def test_a_task_without_a_model_is_played_and_says_what_it_lacks() -> None:
    widget = explore("classic_control/MountainCar")
    assert widget.view["plans"] == []
    assert sent(widget, plan="optimal", time=0)["problem"].startswith("there is no exact model")
    (step,) = sent(widget, act=1)["steps"]
    assert (step["reward"], step["regret"]) == (-1.0, None)


def test_the_page_is_a_module_that_renders() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    script = "import(process.argv[1]).then((page) => process.stdout.write(typeof page.default.render))"
    found = subprocess.run([node, "-e", script, PAGE.as_uri()], capture_output=True, text=True, check=True)
    assert found.stdout == "function"


ABSENT = ("fcntl", "termios", "resource", "numba", "jax", "optax", "matplotlib", "pygls", "starlette", "uvicorn")
"""What browsers do not have (JupyterLite), and what the extra `notebook` does not install."""
IN_A_BROWSER = f"""
import sys
sys.modules |= dict.fromkeys({ABSENT})
import numpy as np
import taskspec
from taskspec.exam import examine, learns_from
from taskspec.exact import Results, check

train = learns_from("reward")(lambda case: np.zeros((case.observation_space.n, case.action_space.n)))
exam = examine(train, tasks=["RiskyPath"], seeds=1, steps=9, twins=0, peeks=False)
shown = taskspec.load("RiskyPath"), Results("RiskyPath"), check("RiskyPath"), exam
assert all(each._repr_html_().startswith(("<table", "<svg")) for each in shown)
widget = taskspec.notebook.explore("RiskyPath")
widget.act(0)
print(widget, len(widget.view["steps"]))
"""


def test_notebooks_need_no_more_than_a_browser_has() -> None:
    found = subprocess.run([sys.executable, "-c", IN_A_BROWSER], capture_output=True, text=True, check=False)
    assert (found.stdout, found.stderr) == ("<Explorer of derail/RiskyPath-v0> 1\n", "")
