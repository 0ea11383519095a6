"""Files that are wrong, cut off or hostile: refused, with the reason."""

from __future__ import annotations

import gzip
import json
import lzma
import pickle
import struct
import tarfile
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taskspec import load
from taskspec.base.diagnostics import SpecError
from taskspec.tools.exchange import formats
from taskspec.tools.exchange.reading import MOST_BYTES, ForeignFile, guarded
from tests.shared.commands import Done, spec
from tests.tools.exchange.umb_files import model, packed, umb, unpacked

PARTIAL = """\
taskspec: 1
name: Partial
state: {s: {type: int, low: 0, high: 3}}
action: {a: {type: choice, values: [left, right]}}
observation: {o: s >= 2}
horizon: 5
discount: 0.9
initial: {s: {0: 1/3, 1: 2/3}}
dynamics: {s': "clip(s + (1 if a == right else -1), 0, 3)"}
reward: s' == 3
terminal: s' == 0
figure: {kind: grid, at: [s, 0], highlight: {good: s == 3}}
"""


def reason(content: bytes, format: str = "umb") -> str:
    """Why a file is refused."""
    with pytest.raises(SpecError) as caught:
        guarded(formats.FORMATS[format].read)(ForeignFile("x", content))
    assert caught.value.diagnostics[0].code == "E728"
    return caught.value.diagnostics[0].message


@pytest.mark.parametrize("name", [*formats.FORMATS, "umb without compression"])
def test_every_beginning_of_an_export_is_refused_or_equal(name: str, tmp_path: Path) -> None:
    chosen = formats.FORMATS[name.split()[0]]
    _, tables = formats.exported(load(str(spec(tmp_path, PARTIAL))), chosen)
    content = formats.written(tables, chosen)
    if name not in formats.FORMATS:
        content = gzip.decompress(content)
    read = guarded(chosen.read)
    expected = read(ForeignFile("x", content))
    assert expected.seen is not None
    ends = {*range(0, len(content), 1 + len(content) // 500), *range(0, len(content), tarfile.BLOCKSIZE)}
    refused = 0
    for end in ends:
        try:
            assert read(ForeignFile("x", content[:end])) == expected
        except SpecError:
            refused += 1
    assert refused > len(ends) / 2


def test_a_umb_file_that_contradicts_itself_is_refused() -> None:
    whole = unpacked(model([[("a", 0.0, {0: 1.0})]], classes=[0]))
    index = json.loads(whole["index.json"])
    assert formats.umb.read(ForeignFile("x", packed(whole))).seen == ((0.0,),)

    def changed(**system: Any) -> bytes:
        text = json.dumps(index | {"transition-system": index["transition-system"] | system})
        return packed(whole | {"index.json": text.encode()})

    cases = {
        "not in the format": b"not a tar file",
        "transition-system": packed({"index.json": b"{}"}),
        "discrete time": umb({"time": "stochastic"}),
        "#players": packed({"index.json": b'{"transition-system": {"time": "discrete"}}'}),
        "more than 500,000 states": umb({"#choices": 2**60}),
        "less than none": umb({"#choices": -1}),
        "has 2 numbers, not 1": umb(files={"branch-to-target.bin": bytes(16)}),
        "ranges that overlap": umb({"#states": 2}, {"state-to-choices.bin": struct.pack("<3Q", 0, 1, 0)}),
        "do not cover 1 entries": umb(files={"choice-to-branches.bin": bytes(16)}),
        "leads to state": umb(files={"branch-to-target.bin": b"\xff" * 8}),
        "0 states are marked as initial": umb(files={"state-is-initial.bin": bytes(8)}),
        "2 are declared": umb({"#initial-states": 2}),
        "type double-interval": umb(
            {"branch-probability-type": {"type": "double-interval"}}, {"branch-to-probability.bin": bytes(16)}
        ),
        "rationals of at most": umb(
            {"branch-probability-type": {"type": "rational", "size": 8 << 20}},
            {"branch-to-probability.bin": bytes(1 << 20)},
        ),
        "has no rewards": umb(annotations={}),
        "the observation 0, of -1": changed(**{"#observations": -1}),
        "depend on branches or on chance": changed(**{"observations-apply-to": "branches"}),
        "only observations of states": changed(**{"#observations": 0}),
        "on chance": packed(whole | {"observations/states/probabilities.bin": bytes(8)}),
        "has 2 numbers, not 3": changed(**{"#choice-actions": 2}),
    }
    for message, content in cases.items():
        assert message in reason(content), message


def test_a_model_without_rewards_names_its_labels() -> None:
    with pytest.raises(SpecError) as caught:
        formats.umb.read(ForeignFile("x", umb(annotations={"aps": {"goal": {}}})))
    assert "its labels: goal" in str(caught.value.diagnostics[0].hint)


def header(name: str, size: int, kind: bytes) -> bytes:
    member = tarfile.TarInfo(name)
    member.size = size
    member.type = kind
    return member.tobuf(tarfile.GNU_FORMAT)


INDEX = header("index.json", 2, tarfile.REGTYPE) + b"{}".ljust(512, b"\0")
END = bytes(1024)
LARGE = bytes(MOST_BYTES + 1_000_000)
HOSTILE = {
    "large member": (header("x", len(LARGE), tarfile.REGTYPE) + LARGE + END, "bytes"),
    "large extended header": (header("x", len(LARGE), tarfile.XHDTYPE) + LARGE + INDEX + END, "bytes"),
    "extended header of two megabytes": (header("x", 1 << 21, tarfile.XHDTYPE) + bytes(1 << 21) + INDEX + END, "headers"),
    "long name": (header("x", 1 << 21, tarfile.GNUTYPE_LONGNAME) + bytes(1 << 21) + INDEX + END, "headers"),
    "many members": (b"".join(header(f"f{i}", 0, tarfile.REGTYPE) for i in range(2100)) + END, "headers"),
    "many members of one name": (header("a", 0, tarfile.REGTYPE) * 2100 + END, "twice"),
    "hole": (header("x", 10**9, tarfile.GNUTYPE_SPARSE) + END, "pieces"),
    "declared and not there": (header("index.json", 8 * 10**9, tarfile.REGTYPE), "too early"),
    "negative size": (header("x", -1024, tarfile.XHDTYPE) + END, ""),
}  # fmt: skip


@pytest.mark.parametrize("how", ["plain", "gzip", "xz"])
@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_file_is_refused_before_it_costs_memory(name: str, how: str) -> None:
    content, message = HOSTILE[name]
    if how == "gzip":
        content = gzip.compress(content, 1)
    elif how == "xz":
        content = lzma.compress(content, preset=0)
    elif len(content) > MOST_BYTES:
        pytest.skip("files of more bytes are not read")
    tracemalloc.start()
    try:
        said = reason(content)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert message in said
    assert peak < 1.3 * MOST_BYTES


class Harmful:
    """What a pickle would execute."""

    def __reduce__(self) -> Any:
        return (Path.write_text, (Path("executed"), "x"))


def test_wrong_arrays_and_tables_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    np.savez("pickled.npz", state=np.array([Harmful()], object))
    Path("plain.npz").write_bytes(pickle.dumps(Harmful()))
    np.savez("empty.npz", start=np.array([1.0]))
    stays = '{"0": {"0": [[1, 0, 0, false]]}}'
    for name, text in {
        "deep": "[" * 100_000,
        "list": "[1, 2]",
        "nan": '{"P": {"0": {"0": [[NaN, 0, 0, false]]}}}',
        "paid": '{"P": {"0": {"0": [[1, 0, Infinity, false]]}}}',
        "likely": '{"P": {"0": {"0": [[1, 1e400, 0, false]]}}}',
        "gap": '{"P": {"5": {"0": [[1, 0, 0, false]]}}}',
        "none": '{"P": {}}',
        "names": f'{{"states": ["x", "y"], "P": {stays}}}',
        "actions": '{"actions": [], "P": {"0": {"-1": [[1, 0, 0, false]]}}}',
        "unnamed": '{"actions": ["x"], "P": {"0": {"1": [[1, 0, 0, false]]}}}',
        "starts": f'{{"initial": [0.5, 0.5], "P": {stays}}}',
        "seen": f'{{"observations": [[1], [2]], "P": {stays}}}',
        "ragged": '{"observations": [[1], [2, 3]], "P": {"0": {"0": [[1, 1, 0, false]]}, "1": {"0": [[1, 1, 0, false]]}}}',
        "horizon": f'{{"horizon": 2.5, "P": {stays}}}',
    }.items():
        Path(f"{name}.json").write_text(text)
    for path in sorted([*Path().glob("*.npz"), *Path().glob("*.json")]):
        done = Done("import", path)
        assert (done.status, "E728" in done.err) == (1, True), path
    assert not Path("executed").exists()
    assert "E726" in Done("import", "x.dot").err
    assert "E711" in Done("import", "x.umb").err
    assert "E701" in Done("import", "NoSuchEnvironment").err
    assert "E728" in Done("import", "CartPole-v1").err
    assert "E713" in Done("import", "FrozenLake-v1", "--name", "../x").err


def test_formats_that_storm_converts(tmp_path: Path) -> None:
    for name, option in (("maze.drn", "--explicit-drn"), ("maze.prism", "--prism"), ("maze.jani", "--jani")):
        done = Done("import", tmp_path / name)
        assert done.status == 1
        assert "E726" in done.err
        assert f"storm {option}" in " ".join(done.err.split())
