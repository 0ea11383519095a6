"""Backends, and values as constants of the core."""

from typing import Any

import numpy as np
import pytest

from taskspec.language.expressions.builder import Builder
from taskspec.language.expressions.ir import Node
from taskspec.language.expressions.types import Kind, Type

BACKENDS = ("numpy", "numba", "jax")
SLOWLY = ("numpy", pytest.param("numba", marks=pytest.mark.slow), pytest.param("jax", marks=pytest.mark.slow))
KINDS = {bool: Kind.BOOL, int: Kind.INT}


def kind_of(value: Any) -> Kind:
    values = value if isinstance(value, tuple) else (value,)
    return max(KINDS.get(type(v), Kind.REAL) for v in values)


def type_of(value: Any) -> Type:
    array = np.array(value, object)
    return Type(kind_of(tuple(array.flat)), array.shape)


def constant(b: Builder, value: Any) -> Node:
    type_ = type_of(value)
    return b.const(tuple(np.array(value, object).flat) if type_.shape else value, type_)
