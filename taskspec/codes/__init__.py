"""The closed table of diagnostic codes: one file per class of codes, one `Code` per situation.

A new code is one new entry in the file of its class. The error guide is generated from this table.
"""

from __future__ import annotations

from taskspec.codes import claims, expressions, reading, sense, shape, soundness, use
from taskspec.codes.code import Code as Code
from taskspec.codes.code import Severity as Severity

_TABLES = (
    reading.TABLE,
    shape.TABLE,
    expressions.TABLE,
    soundness.TABLE,
    sense.TABLE,
    claims.TABLE,
    use.TABLE,
)

CODES: dict[str, Code] = {entry.code: entry for table in _TABLES for entry in table}

if len(CODES) != sum(map(len, _TABLES)):
    raise AssertionError("a diagnostic code stands twice in the table")
