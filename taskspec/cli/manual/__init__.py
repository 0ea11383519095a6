"""The manual's generated pages: the language reference, the error guide and the public names, from what the program runs on."""

from __future__ import annotations

from taskspec.cli.manual.errors import errors as errors
from taskspec.cli.manual.language import language as language
from taskspec.cli.manual.public import public as public
