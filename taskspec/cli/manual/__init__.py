"""The manual's generated pages: the language reference and the error guide, from the tables that the program runs on."""

from __future__ import annotations

from taskspec.cli.manual.errors import errors as errors
from taskspec.cli.manual.language import language as language
