"""Random words: Threefry-2x32 with 20 rounds, in plain Python and in NumPy.

A word is a pure function of (seed, phase, n, number of the word), so nothing is stored and nothing
advances. The key is the seed; the counter is ``(n, slot)``. In phase ``STEP``, n counts the steps
since ``reset(seed)``; in phase ``RESET`` it counts the episodes, and the slot's top bit is set, so
the two phases never share a block. Word w of a phase is half ``w & 1`` of slot ``w >> 1``.
Draws beside an environment have phases of their own, high above the slots that a step takes: ``POLICY`` for
the actions of policies, by step, and ``TEACHER`` for those who compare trajectories, by pair.

Source: Salmon, Moraes, Dror, Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011; the
rotations, the parity constant and the known answers are from Random123.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Iterator
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Words = NDArray[np.uint32]

STEP = 0
POLICY = 1 << 30
TEACHER = POLICY + (1 << 29)
RESET = 1 << 31
MASK = 0xFFFFFFFF
PARITY = 0x1BD11BDA
ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))

# Up to here packed integers beat NumPy, whose hundred-odd calls cost the same for 1 block and 100.
PACKED_BLOCKS = 192
# Blocks at once: three arrays of 128 KiB, which a second-level cache holds, nearly.
CHUNK = 32768

_CONSTANTS = [np.array(i, np.uint32) for i in range(33)]
_scratch = threading.local()


# -- plain Python


def threefry(key: tuple[int, int], counter: tuple[int, int], lanes: int = 1) -> tuple[int, int]:
    """Threefry-2x32-20 of one block, or of many packed side by side in Python's long integers.

    Block i occupies bits 64i to 64i + 63 of all four arguments and of both results; each
    holds 32 bits. The upper half of a field gives the shifts and carries room: one long operation
    then does the work of ``lanes`` short ones at little more than the price of one.
    """
    ones = _ones(lanes)
    mask = MASK * ones
    k0, k1 = key
    k2 = k0 ^ k1 ^ PARITY * ones
    x0 = counter[0] + k0
    x1 = (counter[1] + k1) & mask
    keys = (k0, k1, k2)
    for i in range(1, 6):
        a, b, c, d = ROTATIONS[~i & 1]
        # x0 only ever grows by sums, a bit or so a round, so it is masked once, at the end.
        x0 += x1
        x1 = ((x1 << a | x1 >> 32 - a) ^ x0) & mask
        x0 += x1
        x1 = ((x1 << b | x1 >> 32 - b) ^ x0) & mask
        x0 += x1
        x1 = ((x1 << c | x1 >> 32 - c) ^ x0) & mask
        x0 += x1
        x1 = ((x1 << d | x1 >> 32 - d) ^ x0) & mask
        x0 += keys[i % 3]
        x1 = (x1 + keys[(i + 1) % 3] + i * ones) & mask
    return x0 & mask, x1


def words(seed: int, phase: int, n: int, count: int) -> tuple[int, ...]:
    """Return the first ``count`` words of one step or reset, as Python integers below 2**32."""
    data = _packed_block(seed, phase, n, 1, _slots(count))
    return struct.unpack_from(f"<{count}I", data)


def rows(seed: int, phase: int, first_n: int, how_many: int, count: int) -> list[tuple[int, ...]]:
    """Words of ``how_many`` consecutive n at once: row i has the words of ``first_n + i``."""
    if not count:
        return [()] * how_many
    data = _packed_block(seed, phase, first_n, how_many, _slots(count))
    return list(struct.iter_unpack(f"<{count}I{4 * (count & 1)}x", data))


def _slots(count: int) -> int:
    return (count + 1) >> 1


def _packed_block(seed: int, phase: int, first_n: int, how_many: int, slots: int) -> bytes:
    lanes = how_many * slots
    ones = _ones(lanes)
    ramp, slot = _ramps(how_many, slots)
    key = (seed & MASK) * ones, (seed >> 32 & MASK) * ones
    counter = (first_n & MASK) * ones + ramp, phase * ones + slot
    return _interleave(threefry(key, counter, lanes), lanes)


def _interleave(halves: tuple[int, int], lanes: int) -> bytes:
    return (halves[0] | halves[1] << 32).to_bytes(8 * lanes, "little")


@lru_cache(maxsize=1024)
def _ones(lanes: int) -> int:
    return _pack(1 for _ in range(lanes))


@lru_cache(maxsize=1024)
def _ramps(how_many: int, slots: int) -> tuple[int, int]:
    pairs = list(product(range(how_many), range(slots)))
    return _pack(i for i, _ in pairs), _pack(slot for _, slot in pairs)


def _pack(fields: Iterator[int]) -> int:
    return int.from_bytes(b"".join(struct.pack("<Q", field) for field in fields), "little")


# -- NumPy


def block(seed: int, phase: int, first_n: int, how_many: int, count: int) -> Words:
    """Return words of consecutive n for one environment: uint32 ``(how_many, count)``.

    Row i equals ``words(seed, phase, first_n + i, count)``.
    """
    slots = _slots(count)
    if how_many * slots <= PACKED_BLOCKS:
        data = _packed_block(seed, phase, first_n, how_many, slots)
        return np.frombuffer(data, "<u4").reshape(how_many, 2 * slots)[:, :count].astype(np.uint32)
    out = np.empty((how_many, count), np.uint32)
    n = (np.arange(how_many, dtype=np.uint64) + np.uint64(first_n & MASK)).astype(np.uint32)
    slot = np.arange(slots, dtype=np.uint32) + np.uint32(phase)
    schedule = _schedule(_uint32(seed & MASK), _uint32(seed >> 32 & MASK))
    _fill(schedule, n[:, None], slot, out[:, 0::2], out[:, 1::2])
    return out


def lane_seeds(seed: int, lanes: int, first: int = 0) -> NDArray[np.uint64]:
    """Return the seeds of the lanes from ``first`` on of a vector environment: uint64 (lanes,).

    Lane i has the seed ``seed + i`` modulo 2**64, as a scalar environment with that seed has.
    """
    return np.arange(lanes, dtype=np.uint64) + np.uint64((seed + first) % 2**64)


def lanes_block(seeds: NDArray[np.uint64], phase: int, n: ArrayLike, count: int, out: Words | None = None) -> Words:
    """Return words of many environments: uint32 ``(count, lanes)``, written to ``out`` if it is given.

    ``seeds``: uint64 (lanes,), see `lane_seeds`. ``n``: an integer, or integers (lanes,), modulo
    2**32. Column i equals ``words(int(seeds[i]), phase, n[i], count)``.
    """
    lanes = len(seeds)
    slots = _slots(count)
    if out is None:
        result = np.empty((count, lanes), np.uint32)
    else:
        result = out
    k0 = seeds.astype(np.uint32)
    k1 = (seeds >> np.uint64(32)).astype(np.uint32)
    n = _uint32(n)
    slot = np.arange(slots, dtype=np.uint32)[:, None] + np.uint32(phase)
    if lanes * slots <= PACKED_BLOCKS:
        return _packed_lanes((k0, k1), (n, slot), (slots, lanes), result)
    _fill(_schedule(k0, k1), n, slot, result[0::2], result[1::2])
    return result


def lanes_ahead(seeds: NDArray[np.uint64], n: NDArray[np.uint32], depth: int, count: int) -> Words:
    """Return words of ``depth`` consecutive steps of many environments: uint32 ``(count, depth * lanes)``.

    Column ``d * lanes + i`` equals ``words(int(seeds[i]), STEP, n[i] + d, count)``.
    """
    lanes = len(seeds)
    slots = _slots(count)
    if lanes * depth * slots <= PACKED_BLOCKS or (n != n[:1]).any():
        each = (n + np.arange(depth, dtype=np.uint32)[:, None]).ravel()
        return lanes_block(np.tile(seeds, depth), STEP, each, count)
    k0 = seeds.astype(np.uint32)
    k1 = (seeds >> np.uint64(32)).astype(np.uint32)
    # All lanes are at the same step, so that a row of blocks shares one counter, and the keys are scheduled once.
    steps = np.tile(n[0] + np.arange(depth, dtype=np.uint32), slots)[:, None]
    slot = np.repeat(np.arange(slots, dtype=np.uint32) + np.uint32(STEP), depth)[:, None]
    halves = np.empty((2, slots * depth, lanes), np.uint32)
    _fill(_schedule(k0, k1), steps, slot, halves[0], halves[1][: depth * (count >> 1)])
    paired = halves.reshape(2, slots, depth * lanes).swapaxes(0, 1)
    return paired.reshape(2 * slots, depth * lanes)[:count]


def _packed_lanes(key: tuple[Words, Words], counter: tuple[Words, Words], shape: tuple[int, int], out: Words) -> Words:
    fields = np.empty((4, *shape), "<u8")
    for field, values in zip(fields, (*key, *counter), strict=True):
        field[...] = values
    k0, k1, c0, c1 = (int.from_bytes(field.tobytes(), "little") for field in fields)
    size = shape[0] * shape[1]
    data = _interleave(threefry((k0, k1), (c0, c1), size), size)
    both = np.frombuffer(data, "<u4").reshape(*shape, 2)
    out[0::2] = both[..., 0]
    out[1::2] = both[: len(out) >> 1, :, 1]
    return out


Schedule = list[tuple[Words, Words]]


def _uint32(values: ArrayLike) -> Words:
    if isinstance(values, np.ndarray):
        return values.astype(np.uint32, copy=False)
    # Through int64, since NumPy refuses to narrow a Python integer that does not fit.
    return np.asarray(values, np.int64).astype(np.uint32)


def _schedule(k0: Words, k1: Words) -> Schedule:
    keys = (k0, k1, k0 ^ k1 ^ np.uint32(PARITY))
    schedule = []
    for i in range(6):
        schedule.append((keys[i % 3], np.add(keys[(i + 1) % 3], _CONSTANTS[i])))
    return schedule


def _fill(schedule: Schedule, c0: Words, c1: Words, y0: Words, y1: Words) -> None:
    """Fill ``y0`` (rows, columns) and ``y1`` (fewer rows where the last second halves are not wanted).

    Keys are scalars or (columns,); counters are (rows, 1) or (columns,). Work goes in chunks that
    stay in cache.
    """
    for place in _chunks(*y0.shape):
        keys = [(_part(p, place), _part(q, place)) for p, q in schedule]
        second = y1[place]
        x0, x1 = _rounds(keys, _part(c0, place), _part(c1, place), y0[place].shape, both=second.size > 0)
        np.add(x0, keys[5][0], y0[place])
        if second.size:
            np.add(x1, keys[5][1], x1)
            second[...] = x1[: second.shape[0], : second.shape[1]]


def _rounds(keys: Schedule, c0: Words, c1: Words, shape: tuple[int, ...], both: bool) -> tuple[Words, Words]:
    """Run all rounds but the last key addition, in this thread's scratch arrays; for the first half, or for both."""
    add = np.add
    left = np.left_shift
    right = np.right_shift
    xor = np.bitwise_xor
    merge = np.bitwise_or
    store: Any = getattr(_scratch, "arrays", None)
    if store is None:
        store = _scratch.arrays = np.empty((3, CHUNK), np.uint32)
    size = shape[0] * shape[1]
    x0, x1, shifted = (array[:size].reshape(shape) for array in store)
    add(c0, keys[0][0], x0)
    add(c1, keys[0][1], x1)
    for i in range(5):
        for r in ROTATIONS[i & 1]:
            add(x0, x1, x0)
            if not both and (i, r) == (4, ROTATIONS[0][-1]):
                break  # the last round: what follows is for the second half
            left(x1, _CONSTANTS[r], shifted)
            right(x1, _CONSTANTS[32 - r], x1)
            merge(x1, shifted, x1)
            xor(x1, x0, x1)
        if i < 4:
            add(x0, keys[i + 1][0], x0)
            add(x1, keys[i + 1][1], x1)
    return x0, x1


def _chunks(height: int, width: int) -> Iterator[tuple[slice, slice]]:
    across = max(1, min(width, CHUNK))
    down = CHUNK // across
    for row in range(0, height, down):
        for column in range(0, width, across):
            yield slice(row, row + down), slice(column, column + across)


def _part(values: Words, place: tuple[slice, slice]) -> Words:
    match values.ndim:
        case 0:
            return values
        case 1:
            return values[place[1]]
        case _:
            return values[place[0]]
