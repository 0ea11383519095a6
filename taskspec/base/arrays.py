"""Types of arrays.

Shapes stand in docstrings, one letter an axis: S states, A actions, T times, K features, N lanes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, Any]
"""An array of NumPy."""
AnyArray = Any
"""An array of NumPy or of JAX."""
