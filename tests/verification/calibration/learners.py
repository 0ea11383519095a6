"""All right learners by name; those with networks are among them where PyTorch is installed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from tests.verification.calibration.imitators import IMITATORS
from tests.verification.calibration.right import TABLES

RIGHT: dict[str, Callable[[Any], Any]] = {**TABLES, **IMITATORS}
try:
    from tests.verification.calibration.deep import DEEP
except ImportError:
    pass
else:
    RIGHT |= DEEP
