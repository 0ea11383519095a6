"""The table of base variates: one entry for each, the single source of everything known about it.

An entry has the words that a draw takes, its value on Python numbers and over arrays (of NumPy and of JAX), its form in generated
scalar code and in kernels, its bounds, its mean, and its outcomes with their probabilities where they are gone
through. Distributions (`taskspec.lang.dists`) are arithmetic over base variates. A new one is an entry in one of these files.
"""

from __future__ import annotations

from taskspec.lang.variates import choices, counts, lumps, reals
from taskspec.lang.variates.entry import Variate

VARIATES: dict[str, Variate] = {v.name: v for v in (*reals.TABLE, *choices.TABLE, *counts.TABLE, *lumps.TABLE)}
