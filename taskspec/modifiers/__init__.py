"""Modifiers: difficulty that any task can be given without editing it. Each is one function from tasks to tasks, in one table."""

from __future__ import annotations

from taskspec.modifiers.apply import MODIFIERS as MODIFIERS
from taskspec.modifiers.apply import Written as Written
from taskspec.modifiers.apply import is_as_written as is_as_written
from taskspec.modifiers.apply import keeps_observers as keeps_observers
from taskspec.modifiers.apply import modifier as modifier
from taskspec.modifiers.apply import modify as modify
from taskspec.modifiers.apply import sentences as sentences
from taskspec.modifiers.apply import stand_in as stand_in
from taskspec.modifiers.apply import with_options as with_options
from taskspec.modifiers.entry import ModifierArgument as ModifierArgument
from taskspec.modifiers.entry import ModifierEntry as ModifierEntry
from taskspec.task.task import Modifier as Modifier

__all__ = ["MODIFIERS", "Modifier", "modify"]
