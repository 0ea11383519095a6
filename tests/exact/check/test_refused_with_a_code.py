"""Specs that once ended in a traceback, or took minutes: each through `check` and `run`, with the code that it gets now."""

import pytest

from tests.shared.diagnostics import refusal
from tests.shared.sections import build_text


@pytest.mark.parametrize(
    ("expression", "code", "note"),
    [
        ("(1, 2, 3)[N - K + M]", "E315", ("with N = 99, K = 0, M = 0",)),
        ("norm1((1, 2) - [i / 2 for i in range(K + 1)])", "E307", ("with K = 0",)),
        ("s in {norm1(p) for p in box(0, N, 9)}", "E314", ("with N = 99",)),
        ("s in {norm1(p) for p in box(1, M, 2)}", "E407", ("with M = 0",)),
        ("sum((1, 2) + (1, 2, 3))", "E307", ()),
    ],
)
def test_what_hangs_on_parameters_names_their_values(expression: str, code: str, note: tuple[str, ...]) -> None:
    text = f"""
parameters: {{K: {{type: int, default: 0}}, M: {{type: int, default: 0}}, N: {{type: int, default: 99}}}}
state: {{s: {{type: int, low: 0, high: 9}}}}
action: {{a: {{type: int, low: 0, high: 1}}}}
horizon: 9
initial: {{s: 0}}
dynamics: {{s': s}}
reward: "{expression}"
"""
    assert [(d.code, d.notes) for d in refusal(build_text, text).diagnostics] == [(code, note)]
