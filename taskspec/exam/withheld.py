"""The task as a learner gets it: without its reward, unless that is granted, and without its expert."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any

from taskspec.source import Document
from taskspec.task.merge import Merged
from taskspec.task.task import Task

_EXPERT = ("expert", "memory", "claims", "examples")
"""Sections of a spec that say what an expert does, and what it earns."""
_REWARD = ("reward", "absorbing_reward")
"""Sections of a spec that say what is paid."""


def withheld(task: Task, learns_from: Collection[str], sign: float = 0.0) -> Task:
    """Return a task without what a learner is not granted, of which nothing is left in its spec and in the task as written.

    Demonstrations come from an expert who is never part of the task: who may see them sees so many, and no more.

    Args:
        learns_from: what is granted; without "reward", what is paid is not that of the task.
        sign: what rewards are multiplied by that are not granted.
    """
    names = _EXPERT if "reward" in learns_from else (*_EXPERT, *_REWARD)
    document = _document(task.document, names)
    builder = task.builder
    reward = task.reward
    absorbing_reward = task.absorbing_reward
    if "reward" not in learns_from and sign == 0:
        reward = builder.scalar(0.0)
        absorbing_reward = builder.scalar(0.0)
    elif "reward" not in learns_from:
        reward = builder.apply("mul", builder.scalar(sign), reward)
        absorbing_reward = builder.apply("mul", builder.scalar(sign), absorbing_reward)
    as_written = None if task.written_as is None else withheld(task.written_as, learns_from, sign)
    changed = f"{task.content_hash} without {', '.join(names)}, {sign:g}"
    return replace(
        task,
        reward=reward,
        absorbing_reward=absorbing_reward,
        expert=None,
        memory=None,
        claims=(),
        examples=(),
        merged=_merged(task.merged, document, names),
        surface=replace(
            task.surface,
            sections={name: part for name, part in task.surface.sections.items() if name not in names},
            meanings={key: part for key, part in task.surface.meanings.items() if key[0] not in names},
        ),
        document=document,
        written_as=as_written,
        content_hash=hashlib.sha256(changed.encode()).hexdigest(),
    )


def _merged(merged: Merged, document: Document, names: Collection[str]) -> Merged:
    """The sections of a task without some."""
    data = _sections(merged.data, names)
    if "reward" in names:
        data["reward"] = 0
    return Merged(document, merged.name, merged.variant, data, {})


def _document(document: Document, names: Collection[str]) -> Document:
    """A document, and those that it extends, without some sections."""
    others = {name: _document(other, names) for name, other in document.others.items()}
    data = document.data
    if isinstance(data, Mapping):
        data = _sections(data, names)
        if "reward" in names:
            data["reward"] = 0
    return replace(document, data=data, others=others)


def _sections(data: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """The sections of a spec, or of a variant, without some."""
    found = {key: value for key, value in data.items() if key not in names}
    if isinstance(found.get("abstraction"), Mapping):
        found["abstraction"] = _sections(found["abstraction"], names)
    if isinstance(found.get("variants"), Mapping):
        variants = found["variants"].items()
        found["variants"] = {
            key: _sections(entry, names) if isinstance(entry, Mapping) else entry for key, entry in variants
        }
    return found
