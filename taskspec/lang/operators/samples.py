"""Inputs on which every form of an operator is compared with its reference."""

from __future__ import annotations

import math

PAIRS = ((1, 2), (-7, 2), (7, -2), (0, 5), (-3, -3), (1.5, -0.25), (0.0, 3.0), (-2.5, 0.75), (2, 0.5))
ZEROS = ((1, 0), (0, 0), (-4, 0), (1.0, 0.0), (0.0, 0.0), (-1.0, 0.0))
NANS = ((math.nan, 1.0), (1.0, math.nan), (math.nan, math.nan), (math.inf, 1.0), (-math.inf, math.nan))
REALS = (
    (0.0,), (0.5,), (-1.25,), (3.7,), (-100.0,), (math.inf,), (-math.inf,), (math.nan,), (1e9,), (2.5,), (-0.5,),
)  # fmt: skip
LOGIC = ((True, True), (True, False), (False, True), (False, False))
VECTORS = (((3, 1, 2),), ((1, 1, 0, 1),), ((5,),), ((2.5, -1.0, 2.5, 0.0),), ((-1.0, math.inf, -math.inf),))
NAN_VECTORS = (((math.nan, 1.0, 3.0),), ((1.0, math.nan, 3.0, 3.0),), ((math.nan, math.nan),))
MASKS = (((True, False, True),), ((False,),), ((True, True),))
INTS, MIXED = (3, -1, 2), (0.5, -2.0, 1.5)
"""Vectors as arguments of functions."""
ROWS = ((1, 2), (3, -1))
"""A matrix as one."""
