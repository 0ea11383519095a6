"""`taskspec card`: cards as JSON-LD and Markdown, with the values that exact analysis has."""

from pathlib import Path

import pytest
import yaml

from taskspec.exact.scores.returns import Results
from taskspec.language.registry import load
from tests.shared.commands import Done, spec

TERMS = {
    "@context", "@type", "identifier", "name", "headline", "description", "version", "keywords", "programmingLanguage",
    "runtimePlatform", "citation", "variableMeasured", "license",
}  # fmt: skip
"""Terms that schema.org has for software source code or data sets."""


def of_kind(card: dict[str, object], kind: str) -> dict[str, dict[str, object]]:
    measured = card["variableMeasured"]
    assert isinstance(measured, list)
    return {each["name"]: each for each in measured if each["propertyID"] == kind}


@pytest.mark.parametrize("task", ["derail/RiskyPath", "derail/Branching?L=4", "bsuite/DeepSea", "pomdp/Tiger"])
def test_linked_data_has_the_exact_values(task: str) -> None:
    card = Done("card", task, "--format", "json").data
    loaded = load(task)
    assert set(card) <= TERMS and card["@context"] == "https://schema.org"
    assert card["identifier"] == [loaded.instance_id, f"sha256:{loaded.content_hash}"]
    assert card["license"] == "https://spdx.org/licenses/MIT"
    assert {name: each["value"] for name, each in of_kind(card, "parameter").items()} == loaded.values
    random = Results(loaded).random
    assert random is not None
    assert of_kind(card, "return")["random return"]["value"] == pytest.approx(random.value)
    assert len(of_kind(card, "claim")) == len({claim.text for claim in loaded.annotations.claims})
    assert all(each["value"] for each in of_kind(card, "claim").values()), "all claims hold"
    assert len(card["citation"]) == len(loaded.spec.sources)


def test_a_return_is_a_fraction_where_it_is_exact() -> None:
    out = Done("card", "derail/RiskyPath").out
    assert "| random return | −122.21875 (exact: -3911/32) |" in out
    assert "| horizon | 5 |" in out and "- `optimal_return == 4`: proved" in out
    front = yaml.safe_load(out.split("---\n")[1])
    assert front == {
        "pretty_name": "Stochastic transitions", "tags": ["reinforcement-learning", "chance", "stochastic transitions"],
        "license": "mit"
    }  # fmt: skip


HOSTILE = """\
taskspec: 1
name: Bad
title: 'a "title" | with a bar: - and <b>'
summary: "<script>alert(1)</script> | `x` \\e[31m"
state: {s: {type: int, low: 0, high: 1}}
action: {a: {type: int, low: 0, high: 1}}
horizon: 2
initial: {s: 0}
dynamics: {s': a}
reward: s'
"""


def test_texts_of_a_spec_stay_texts(tmp_path: Path) -> None:
    path = spec(tmp_path, HOSTILE)
    out = Done("card", path).out
    assert "<script" not in out and "\x1b" not in out and "license" not in out
    assert yaml.safe_load(out.split("---\n")[1])["pretty_name"] == 'a "title" | with a bar: - and <b>'
    rows = [line for line in out.splitlines() if line.startswith("|")]
    assert all(line.replace(r"\|", "").count("|") == 3 for line in rows)
    assert Done("card", path, "--format", "xml").status == 2
