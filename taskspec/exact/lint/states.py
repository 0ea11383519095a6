"""States that do not occur."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from taskspec.diagnostics import Collector, SpecError
from taskspec.exact.extract import extract
from taskspec.exact.lint.case import Case
from taskspec.exact.model import Model
from taskspec.exact.space import plain, words
from taskspec.lang.ir import Role
from taskspec.spec.build import build
from taskspec.spec.task import Component

Array = np.ndarray[Any, Any]


def unreachable(case: Case, collector: Collector) -> None:
    """W501: values of a component that occur in no episode, however long, of this task or of one that shares its roles."""
    model = case.model
    if model is None:
        return
    entered = [model.states.decode(m.codes[m.connected]) for m in (model, *_partners(case))]
    for c in model.task.state:
        seen = np.concatenate([e[Role.STATE, c.name].reshape(-1, e[Role.STATE, c.name].shape[-1]) for e in entered], 1)
        missing = _missing(c, seen)
        if missing:
            shown = ", ".join(missing[:6]) + (", ..." if len(missing) > 6 else "")
            message = f"no episode is ever in a state with {c.name} = {shown}"
            collector.add("W501", case.key("state", c.name), message)


def _missing(c: Component, seen: Array) -> list[str]:
    """Values that a scalar component never takes, in words."""
    if not c.type.is_scalar or c.counts[0] > 100_000:
        return []
    every = np.arange(int(c.low[0]), int(c.high[0]) + 1)
    return [words(plain(c, np.asarray(v))) for v in np.setdiff1d(every, seen.astype(np.int64))[:7]]


def _partners(case: Case) -> Iterator[Model]:
    """The models of the variants in which expert and learner act."""
    roles = case.task.surface.data.get("roles") or {}
    for variant in dict.fromkeys(roles.values()):
        if variant in (case.task.name, case.task.variant):
            continue
        try:
            yield extract(build(case.task.document, str(variant), case.task.values, case.task.suite), reachable=False)
        except SpecError:
            continue
