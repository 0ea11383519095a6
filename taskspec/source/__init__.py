"""YAML text -> plain data, with a map from every value (and every character of it) to its place."""

from __future__ import annotations

from taskspec.source.document import Document as Document
from taskspec.source.document import Path as Path
from taskspec.source.reading import Packed as Packed
from taskspec.source.reading import packed as packed
from taskspec.source.reading import read as read
from taskspec.source.reading import read_file as read_file
from taskspec.source.reading import read_text as read_text
from taskspec.source.reading import unpacked as unpacked
