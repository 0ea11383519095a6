"""Proofs by interval arithmetic: that a value is a number, and that it stays within its range."""

from __future__ import annotations

from typing import TYPE_CHECKING

from taskspec.lang.builder import Builder

if TYPE_CHECKING:
    from taskspec.exact.checks.phases import Check


def proved(check: Check, builder: Builder) -> bool:
    """Whether bounds alone show that a check holds everywhere."""
    low, high = builder.bounds(check.node)
    return low >= max(check.low) and high <= min(check.high) and builder.finite(check.node)
