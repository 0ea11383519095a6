"""The closed table of diagnostic codes: one file per class of codes, one `Code` per situation.

A new code is one new entry in the file of its class. The error guide is generated from this table.
"""

from __future__ import annotations

from taskspec.codes.claims import TABLE as CLAIMS
from taskspec.codes.code import Code as Code
from taskspec.codes.code import Severity as Severity
from taskspec.codes.expressions import TABLE as EXPRESSIONS
from taskspec.codes.reading import TABLE as READING
from taskspec.codes.sense import TABLE as SENSE
from taskspec.codes.shape import TABLE as SHAPE
from taskspec.codes.soundness import TABLE as SOUNDNESS
from taskspec.codes.use import TABLE as USE

_TABLES = (
    READING,
    SHAPE,
    EXPRESSIONS,
    SOUNDNESS,
    SENSE,
    CLAIMS,
    USE,
)

CODES: dict[str, Code] = {entry.code: entry for table in _TABLES for entry in table}
"""Every code of an error or a warning, with its explanation."""

if len(CODES) != sum(map(len, _TABLES)):
    raise AssertionError("a diagnostic code stands twice in the table")
