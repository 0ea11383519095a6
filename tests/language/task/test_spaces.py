"""Many Gymnasium values at once are those that are made one by one."""

from typing import Any

import numpy as np

import taskspec
from taskspec.language import registry
from taskspec.language.expressions.batch import DTYPES
from taskspec.language.expressions.types import Kind
from taskspec.language.task.spaces import SpaceLayout, pack, pack_many
from tests.shared.for_each import for_each

ROWS = 9


def columns(layout: SpaceLayout) -> list[np.ndarray[Any, Any]]:
    """Values of each component, (ROWS, elements), of its own kind."""
    rng = np.random.default_rng(5)
    found = []
    for c in layout.components:
        low = np.clip(c.low, -6, 6)
        high = np.clip(c.high, -6, 6)
        drawn = rng.uniform(low, high + 1e-9, (ROWS, c.type.size))
        if c.type.kind is not Kind.REAL:
            drawn = np.floor(drawn)
        found.append(drawn.astype(DTYPES[c.type.kind]))
    return found


@for_each("name", sorted(registry.known()))
def test_a_batch_is_its_rows_stacked(name: str) -> None:
    task = taskspec.load(name)
    for layout in (task.observation_layout, task.action_layout):
        given = columns(layout)
        batch = pack_many(layout, given)
        for i in range(ROWS):
            row = pack(layout, [tuple(column[i].tolist()) for column in given])
            for key in row if layout.is_dict else [...]:
                one = row[key] if layout.is_dict else row
                many = batch[key] if layout.is_dict else batch
                np.testing.assert_array_equal(np.asarray(one), np.asarray(many[i]), strict=True)
