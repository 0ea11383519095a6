"""The table of modifiers, in the order of the manual."""

from __future__ import annotations

from taskspec.modifiers import actions, episodes, observations, rewards, symmetries
from taskspec.modifiers.entry import ModifierEntry

MODIFIERS: dict[str, ModifierEntry] = {
    entry.name: entry
    for entry in (*actions.TABLE, *observations.TABLE, *symmetries.TABLE, *rewards.TABLE, *episodes.TABLE)
}
"""Every modifier by its name: what `modifiers=` and `-m` take."""
