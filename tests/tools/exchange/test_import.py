"""Specs of what other tools have: the same returns as the source, names that can be read, and files that are wrong."""

from __future__ import annotations

import gzip
import io
import json
import pickle
import struct
import tarfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec import load
from taskspec.exact import Results
from taskspec.language.task.legal import with_all_actions
from taskspec.tools.exchange import formats
from taskspec.tools.exchange.importing import imported
from tests.shared.commands import Done

TASKS = (
    "derail/RiskyPath", "derail/Branching", "derail/EarlyTermNeg", "derail/NoisyObs", "derail/Sort", "probes/EndInPlace",
    "irl/Shaping", "bsuite/DeepSea", "bsuite/Umbrella", "seals/CliffWorld", "pomdp/Tiger", "toy_text/FrozenLake",
    "textbook/Recycling", "safety/BoatRace", "planning/Hanoi", "operations/Inventory",
)  # fmt: skip


@pytest.mark.parametrize("format", ["umb", "gym-p", "npz"])
@pytest.mark.parametrize("name", TASKS)
def test_what_was_exported_has_the_same_returns_when_it_is_imported(name: str, format: str, tmp_path: Path) -> None:
    """The returns of the imported spec are those of the task; its claims are proved."""
    task = load(name)
    chosen = formats.FORMATS[format]
    if not chosen.is_settled:
        task = with_all_actions(task)
    path = tmp_path / f"file{chosen.suffix}"
    path.write_bytes(formats.written(formats.exported(task, chosen)[1], chosen))
    spec = tmp_path / "spec.yaml"
    spec.write_text(imported(str(path)).spec())
    known = Results(task, 1)
    found = Results(load(str(spec)), 1)
    for which in ("optimal", "random", "worst"):
        expected = known.enclosure(which, True)
        value = found.enclosure(which, True)
        assert expected is not None
        assert value is not None
        if expected.is_exact and chosen.is_settled:
            assert value == expected
        assert value.value == pytest.approx(expected.value, rel=1e-9, abs=1e-12)


def test_claims_say_that_the_spec_equals_its_source(tmp_path: Path) -> None:
    path = tmp_path / "lake.yaml"
    assert Done("import", "FrozenLake-v1", "-o", path).status == 0
    checked = Done("check", path, "--strict")
    assert "2 proved" in checked.out
    text = path.read_text()
    assert "horizon: 100\n" in text
    assert "terminal: s' in {r1c1, r1c3, r2c3, r3c0, r3c3}\n" in text
    assert "figure: {kind: grid, at: [s % 4, s // 4]}\n" in text
    path.write_text(text.replace("    r3c3: 1\n", "    r3c3: 2\n"))
    assert "E601" in Done("check", path).out


def test_a_grid_is_recovered_with_a_step_back_to_the_start(tmp_path: Path) -> None:
    path = tmp_path / "cliff.yaml"
    Done("import", "CliffWalking-v1", "--horizon", "200", "--name", "Cliff", "-o", path)
    task = load(str(path))
    assert task.name == "Cliff"
    assert "s % 12, s // 12" in path.read_text()
    assert Results(task, 1).optimal.value == -13  # type: ignore[union-attr]


def test_components_that_a_source_names_are_the_names_of_states(tmp_path: Path) -> None:
    path = tmp_path / "obs.umb"
    Done("export", "NoisyObs", "-o", path)
    text = Done("import", path).out
    assert "values: [x0_y0, x0_y1" in text
    assert "{x0_y0: 1/4, x0_y4: 1/4, x4_y0: 1/4, x4_y4: 1/4}" in text


def test_formats_that_storm_converts(tmp_path: Path) -> None:
    for name, option in (("maze.drn", "--explicit-drn"), ("maze.prism", "--prism"), ("maze.jani", "--jani")):
        done = Done("import", tmp_path / name)
        assert done.status == 1
        assert "E726" in done.err
        assert f"storm {option}" in " ".join(done.err.split())


def packed(index: Any, **files: bytes) -> bytes:
    result = io.BytesIO()
    with tarfile.open(fileobj=result, mode="w:gz") as tar:
        for name, content in {"index.json": json.dumps(index).encode(), **files}.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            tar.addfile(member, io.BytesIO(content))
    return result.getvalue()


SYSTEM = {
    "time": "discrete", "#players": 1, "#states": 1, "#choices": 1, "#branches": 1, "#choice-actions": 0,
}  # fmt: skip


def test_a_wrong_umb_file_is_refused(tmp_path: Path) -> None:
    large = tarfile.TarInfo("index.json")
    large.size = 10**12
    cases = {
        "not in the format": b"not a tar file",
        "more than 50,000,000 bytes": gzip.compress(large.tobuf()),
        "transition-system": packed({}),
        "discrete time": packed({"transition-system": SYSTEM | {"time": "stochastic"}}),
        "#players": packed({"transition-system": {"time": "discrete"}}),
        "more than 500,000 states": packed({"transition-system": SYSTEM | {"#choices": 2**60}}),
        "branch-to-target.bin": packed({"transition-system": SYSTEM}),
        "has 2 numbers, not 1": packed({"transition-system": SYSTEM}, **{"branch-to-target.bin": b"0" * 16}),
        "ranges that overlap": packed(
            {"transition-system": SYSTEM | {"#states": 2}},
            **{"branch-to-target.bin": b"\0" * 8, "state-to-choices.bin": struct.pack("<3Q", 0, 1, 0)},
        ),
        "leads to state": packed({"transition-system": SYSTEM}, **{"branch-to-target.bin": b"\xff" * 8}),
    }
    for message, content in cases.items():
        path = tmp_path / "wrong.umb"
        path.write_bytes(content)
        done = Done("import", path)
        assert done.status == 1, message
        assert "E728" in done.err
        assert message in done.err


class Harmful:
    """What a pickle would execute."""

    def __reduce__(self) -> Any:
        return (Path.write_text, (Path("executed"), "x"))


def test_wrong_arrays_and_tables_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("pickled.npz", state=np.array([Harmful()], object))
    Path("plain.npz").write_bytes(pickle.dumps(Harmful()))
    np.savez("empty.npz", start=np.array([1.0]))
    Path("deep.json").write_text("[" * 100_000)
    Path("list.json").write_text("[1, 2]")
    Path("nan.json").write_text('{"P": {"0": {"0": [[NaN, 0, 0, false]]}}}')
    Path("paid.json").write_text('{"P": {"0": {"0": [[1, 0, Infinity, false]]}}}')
    Path("lost.json").write_text('{"P": {"0": {"0": [[1, 1e400, 0, false]]}}}')
    Path("gap.json").write_text('{"P": {"5": {"0": [[1, 0, 0, false]]}}}')
    Path("none.json").write_text('{"P": {}}')
    for path in sorted([*Path().glob("*.npz"), *Path().glob("*.json")]):
        done = Done("import", path)
        assert (done.status, "E728" in done.err) == (1, True), path
    assert not Path("executed").exists()
    assert "E726" in Done("import", "x.dot").err
    assert "E711" in Done("import", "x.umb").err
    assert "E701" in Done("import", "NoSuchEnvironment").err
    assert "E728" in Done("import", "CartPole-v1").err
    assert "E713" in Done("import", "FrozenLake-v1", "--name", "../x").err


def test_ten_thousand_rows_of_which_all_differ(tmp_path: Path) -> None:
    """States that are entered with and without an end get a copy, so that ends depend on the next state."""
    rng = np.random.default_rng(0)
    P = {
        s: {a: [[0.25, int(to), float(rng.integers(3)), bool(rng.random() < 0.01)] for to in rng.integers(0, 2500, 4)]
            for a in range(4)}
        for s in range(2500)
    }  # fmt: skip
    path = tmp_path / "many.json"
    path.write_text(json.dumps({"P": P, "horizon": 3}))
    found = imported(str(path))
    assert len(found.outcomes) * len(found.actions) > 10_000
    V = np.zeros(2500)
    for _ in range(3):
        Q = np.zeros((2500, 4))
        for s, row in P.items():
            for a, outcomes in row.items():
                Q[s, a] = sum(p * (r + (0 if ends else V[to])) for p, to, r, ends in outcomes)
        V = Q.max(axis=1)
    assert found.claims["optimal_return"] == pytest.approx(V[0])
    assert len(found.spec().splitlines()) > 2500
