"""Hostile and unlucky input: nothing in a spec, its file name or a call runs code, hangs, crashes or goes wrong in silence."""

from typing import Any

import numpy as np
import pytest

import taskspec
from tests.shared.diagnostics import refusal
from tests.shared.for_each import for_each
from tests.shared.walks import BASE, written

EVIL = 'x"""\nraise SystemExit("ran")\n"""\\'
# -- code from text ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", [EVIL, "a\\", 'a"', "C:\\new\\u.yaml", "a\nb", "{x}", "%s"])
def test_file_names_and_suites_are_never_code(text: str) -> None:
    for task in (written(name=text, horizon=f" {20 + ord(text[-1])}"), written(suite=text)):
        env = taskspec.make(task)
        env.reset(seed=0)
        assert env.step(1)[1] == 1


NAMES = ["exec", "np", "index", "alive", "past", "episodes", "kept", "o", "h0", "w1_0", "v1", "C0", "nan", "action", "self",
         "é", "λ", "変数", "x١", "a_0", "absorbed", "seen", "end"]  # fmt: skip


@for_each("name", NAMES)
def test_names_do_not_meet_those_of_the_generated_code(name: str) -> None:
    """Components that are called like what the generated code calls its own."""
    text = BASE.replace("s'", f"{name}'").replace("s:", f"{name}:").replace("s +", f"{name} +")
    text = text.replace(f"constant{name}:", "constants:").replace(f"dynamic{name}:", "dynamics:")
    env: Any = taskspec.make(written(text), ending="absorb", observe_time=True)
    env.reset(seed=0)
    assert env.step(1)[1] == 1
    assert set(env.state) >= {name}


def test_elements_of_actions_do_not_meet_other_actions() -> None:
    task = written(
        action="\n  x: {type: int, shape: 2, low: 0, high: 3}\n  x_0: {type: int, low: 0, high: 3}",
        dynamics=" {s': s}", reward=" 100 * x[0] + 10 * x[1] + x_0",
    )  # fmt: skip
    env = taskspec.make(task)
    env.reset(seed=0)
    assert env.step(np.array([1, 2, 3]))[1] == 123


@for_each(
    "label",
    ["a b", 'c"d', "None", "if", "pi", "t", "T", "sum", "__import__('os').system('x')", "{x}", "%s", "x#y", "go-left",
     "x'", "é", "optimal", "s", "1"],
)  # fmt: skip
def test_labels_are_labels(label: str) -> None:
    quoted = '"' + label.replace('"', '\\"') + '"'
    task = written(
        state=f"\n  s: {{type: choice, values: [{quoted}, other]}}",
        initial=f"\n  s: {quoted}", dynamics=" {s': other}", reward=f"\n  by: s\n  rows: {{{quoted}: 1, other: 2}}",
    )  # fmt: skip
    env: Any = taskspec.make(task)
    env.reset(seed=0, options={"state": {"s": label}})
    assert env.state == {"s": label}
    assert (env.step(0)[1], env.state) == (1, {"s": "other"})


# -- cost -------------------------------------------------------------------------------------------------------------

TABLE = "\n".join(f"    {i}: {i % 7}" for i in range(100_000))
COSTLY = {
    "power": {"reward": " 9**9**9"},
    "powers": {"reward": " (9**9)**(9**9)"},
    "fraction": {"reward": " 1/3**99999"},
    "digits": {"reward": f" s + {'9' * 5000}"},
    "sum": {"reward": f" {'s+' * 9000}s"},
    "brackets": {"reward": f" {'(' * 10_000}s{')' * 10_000}"},
    "minus": {"reward": f" {'-' * 5000}s"},
    "branches": {"reward": f" {'1 if s == 1 else ' * 300}0"},
    "box": {"reward": ' "s in {p[0] for p in box(-10**6, 10**6, 3)}"'},
    "range": {"reward": " sum([s for i in range(10**9)])"},
    "matrix": {"reward": ' "sum([sum([s + i*j for i in range(1000)]) for j in range(1000)])"'},
    "onehot": {"reward": ' "sum(onehot(s, 10**12))"'},
    "normal": {"reward": ' "sum(Normal(shape=10**12))"'},
    "poisson": {"reward": ' "Poisson(10**9)"'},
    "shape": {"state": "\n  s: {type: int, shape: 10**12}"},
    "bound": {"state": "\n  s: {type: int, low: 0, high: 10**100}"},
    "one hot": {"observation": " {o: s * 10**7, space: one_hot}"},
    "names": {"definitions": "\n  d0: s\n" + "".join(f"  d{i}: d{i - 1} * d{i - 1}\n" for i in range(1, 200)), "reward": " d199"},
    "calls": {
        "definitions": '\n  "f0(x)": x\n' + "".join(f'  "f{i}(x)": f{i - 1}(x) + f{i - 1}(x + 1)\n' for i in range(1, 40)),
        "reward": " f39(s)",
    },
    "table": {"reward": f"\n  by: s\n  rows:\n{TABLE}"},
    "tables": {"reward": f" {'{by: s, rows: {0: ' * 300}1{', else: 0}}' * 300}"},
    "aliases": {"constants": " {a: &a [1, 1], b: [*a, *a]}"},
}  # fmt: skip


@for_each("case", COSTLY)
def test_cost_is_refused_before_it_is_spent(case: str) -> None:
    assert set(refusal(written, **COSTLY[case]).codes) <= {"E314", "E114", "E102", "E408", "E214"}


@pytest.mark.parametrize("name", ["table", "weights"])
def test_long_tables_are_read(name: str) -> None:
    n = 5000
    rows = "".join(f"    {i}: {i % 7}\n" for i in range(n))
    state = {"state": f"\n  s: {{type: int, low: 0, high: {n - 1}}}"}
    if name == "table":
        task = written(**state, dynamics=f" {{s': (s + a) % {n}}}", reward=f"\n  by: s\n  rows:\n{rows}")
    else:
        task = written(**state, dynamics=f"\n  s': {{{', '.join(f'{i}: 1/{n}' for i in range(n))}}}")
    taskspec.make(task).reset(seed=0)
