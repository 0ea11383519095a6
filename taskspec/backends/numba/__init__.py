"""The Numba program: the lane form of a task, compiled in loops over lanes."""

from __future__ import annotations

from taskspec.backends.numba.engine import NumbaEngine as NumbaEngine
