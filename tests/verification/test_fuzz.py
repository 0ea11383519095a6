"""Mutated specs: a thousand here, any number by `python -m tests.verification.fuzz`; and earlier failures, minimised."""

from __future__ import annotations

import random
import subprocess
import sys
from pathlib import Path

import pytest

from taskspec.base.diagnostics import Diagnostic, Origin, Span, SpecError
from tests.shared.sparse import sparse
from tests.shared.specs import spec_file
from tests.verification import processes
from tests.verification.fuzz import __main__ as fuzz
from tests.verification.fuzz import corpus, found, layers, worker
from tests.verification.fuzz.mutate import mutant

ROOT = Path(__file__).parents[2]
INPUTS = 300
LAYERS = {"read", "shape", "build", "scalar", "numpy", "check", "pages"}
SPEC = (ROOT / "tasks" / "derail" / "risky_path.yaml").read_bytes()
CRASHING = """
import ctypes, sys
from tests.verification.fuzz import worker
from tests.shared.specs import spec_file
from tests.shared.specs import spec_file
def put_through(content, chance):
    if chance.getstate() == worker.chance_of(3).getstate():
        ctypes.string_at(0)
    return put(content, chance)
put, worker.put_through = worker.put_through, put_through
sys.argv[:] = ["worker", *sys.argv[-2:]]
worker.main(int(sys.argv[1]), int(sys.argv[2]))
"""


def test_a_good_spec_goes_through_all_layers() -> None:
    assert set(worker.examined(SPEC).layers) >= LAYERS


def test_mutants() -> None:
    """In processes of their own; some twice, with other hashes."""
    tally = fuzz.run(INPUTS, seed=0, jobs=1, twice=20)
    assert tally.inputs == INPUTS
    assert tally.twice == INPUTS // 20
    assert LAYERS - {"pages"} <= set(tally.layers)  # few inputs get as far as pages
    assert not tally.kinds, tally.examples
    assert tally.peak < 2**30
    assert tally.slowest[0][0] < 10


@pytest.mark.parametrize("path", sparse(found.kept(), 3), ids=lambda path: path.stem)
def test_found(path: Path) -> None:
    """What gave a fault once."""
    assert not worker.examined(path.read_bytes()).faults


def test_mutants_follow_from_their_numbers() -> None:
    assert [mutant(n) for n in range(50)] == [mutant(n) for n in range(50)]
    assert len({mutant(n) for n in range(200)}) > 190


def test_every_spec_of_the_repository_is_a_seed() -> None:
    assert spec_file("acrobot").read_bytes() in corpus.seeds()
    assert SPEC in corpus.seeds()


def test_specs_go_through_every_layer() -> None:
    outcome = layers.put_through(SPEC)
    assert outcome.layers[-4:] == ["scalar", "numpy", "check", "pages"]
    assert not outcome.faults


# -- faults are noticed -------------------------------------------------------------------------------------------


def test_an_exception_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def build(*_: object) -> None:
        raise KeyError("x")

    monkeypatch.setattr(layers, "build", build)
    (fault,) = {f.signature for f in layers.put_through(SPEC).faults}
    assert fault == "build: KeyError at outside"


def test_a_smaller_input_has_the_same_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def build(document: layers.Document, *_: object) -> None:
        if "trap" in document.origin.text:
            raise KeyError("x")

    monkeypatch.setattr(layers, "build", build)

    def still(content: bytes) -> bool:
        return any(f.layer == "build" for f in worker.examined(content, random.Random(0)).faults)

    smaller = found.smaller(SPEC, still, 300)
    assert still(smaller)
    assert len(smaller) < len(SPEC) / 4


def test_a_warning_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    def build(*_: object) -> None:
        import warnings

        warnings.warn("careful", RuntimeWarning, stacklevel=1)

    monkeypatch.setattr(layers, "build", build)
    assert {f.kind for f in layers.put_through(SPEC).faults} == {"RuntimeWarning"}


TEXT = Origin("f", "one\r\ntwo")


@pytest.mark.parametrize(
    ("span", "good"),
    [
        ((1, 1, 1, 4), True), ((1, 4, 1, 4), True), ((2, 4, 2, 4), True), ((1, 2, 2, 1), True),
        ((1, 5, 1, 5), False), ((3, 1, 3, 1), False), ((0, 1, 0, 1), False), ((1, 0, 1, 1), False), ((1, 3, 1, 2), False),
        ((2, 1, 1, 1), False), ((1, 1, 1, 9), False),
    ],
)  # fmt: skip
def test_a_place_outside_the_file_is_a_fault(span: tuple[int, int, int, int], good: bool) -> None:
    assert (layers.wrong(Diagnostic("E301", Span(TEXT, *span), "m")) is None) == good


def test_what_is_said_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    def build(*_: object) -> None:
        raise SpecError([Diagnostic("E301", Span(TEXT, 7, 1, 7, 1), "m")])

    monkeypatch.setattr(layers, "build", build)
    assert {f.signature for f in layers.put_through(SPEC).faults} == {"build: message at E301"}


def test_too_much_time_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(worker, "PATIENCE", 1)
    monkeypatch.setattr(worker, "put_through", lambda *_: [None for _ in iter(int, 1)])
    assert [f.kind for f in worker.examined(SPEC).faults] == ["hang"]


def in_a_process(program: str, *arguments: str) -> str:
    command = [sys.executable, "-c", program, *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True, timeout=100).stdout


def test_too_much_memory_is_a_fault() -> None:
    hungry = "worker.limited(); worker.put_through = lambda *_: bytearray(2**31)"
    said = in_a_process(
        f"from tests.verification.fuzz import worker; {hungry}; print(worker.examined(b'').faults[0].kind)"
    )
    assert said == "MemoryError\n"


def test_a_crash_is_a_fault_and_the_run_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    real = subprocess.Popen

    def popen(command: list[str], **options: object) -> object:
        return real([command[0], "-c", CRASHING, *command[-2:]], **options)  # type: ignore[call-overload]

    monkeypatch.setattr(processes.subprocess, "Popen", popen)
    tally = fuzz.run(6, seed=0, jobs=1, twice=0)
    assert tally.inputs == 6
    assert dict(tally.kinds) == {"any: died of 11 at ": 1}
    assert tally.examples["any: died of 11 at "][0] == 3


def test_another_answer_is_a_fault() -> None:
    tally = fuzz.Tally()
    once = [{"input": 1, "digest": "a"}, {"input": 2, "digest": "b"}]
    fuzz.compare(tally, once, [{"input": 1, "digest": "a"}, {"input": 2, "digest": "c"}])
    assert tally.examples == {"any: another answer at ": (2, "a second process answers differently")}
