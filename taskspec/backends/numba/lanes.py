"""What generated kernels do with lanes whose episodes end."""

from __future__ import annotations

from typing import Any

from taskspec.backends.numba.basics import f32s, i64, i64s, inner, u64


@inner
def gather(n: Any, flags: Any, lanes: Any) -> Any:
    """The numbers of the lanes whose flag is set, and how many they are; `lanes` has room for n + 1."""
    m: Any = 0
    for j in range(n):
        lanes[m] = j
        m += i64(flags[j])
    return m


@inner
def keep_reals(m: Any, lanes: Any, rows: Any, every: Any, first: Any, n: Any, seen: Any, final: Any) -> None:
    """Copy rows of float32 observations of some lanes from `seen` to `final`."""
    for k in range(rows):
        a, b = f32s(seen, k * every + first), f32s(final, k * every + first)
        for i in range(m):
            j = u64(lanes[i])
            b[j] = a[j]


@inner
def keep_ints(m: Any, lanes: Any, rows: Any, every: Any, first: Any, n: Any, seen: Any, final: Any) -> None:
    for k in range(rows):
        a, b = i64s(seen, k * every + first), i64s(final, k * every + first)
        for i in range(m):
            j = u64(lanes[i])
            b[j] = a[j]


@inner
def show(n: Any, reals: Any, width: Any, number: Any, size: Any, seen: Any, row: Any, every: Any, first: Any) -> None:
    """Copy rows of drawn float32 numbers into rows of observations."""
    for k in range(size):
        a, b = f32s(reals, (number + k) * width), f32s(seen, (row + k) * every + first)
        for j in range(n):
            b[j] = a[j]


@inner
def show_some(
    m: Any,
    lanes: Any,
    reals: Any,
    width: Any,
    number: Any,
    size: Any,
    seen: Any,
    row: Any,
    every: Any,
    first: Any,
    n: Any,
) -> None:
    for k in range(size):
        a, b = f32s(reals, (number + k) * width), f32s(seen, (row + k) * every + first)
        for i in range(m):
            b[u64(lanes[i])] = a[i]
