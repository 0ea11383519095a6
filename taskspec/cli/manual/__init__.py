"""The manual's generated pages, from what the program runs on: language, errors, difficulty, modifiers, names."""

from __future__ import annotations

from taskspec.cli.manual.difficulty import difficulty as difficulty
from taskspec.cli.manual.errors import errors as errors
from taskspec.cli.manual.language import language as language
from taskspec.cli.manual.modifiers import modifiers as modifiers
from taskspec.cli.manual.public import public as public
