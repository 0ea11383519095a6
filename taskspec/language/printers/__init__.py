"""Printing what authors wrote: back to text, and as mathematics for LaTeX and MathML.

Mathematics goes through one tree (`printers.tree`), so that the two forms cannot say different things.
"""

from __future__ import annotations

from taskspec.language.printers.expressions import mathematics as mathematics
from taskspec.language.printers.markup import latex as latex
from taskspec.language.printers.markup import mathml as mathml
from taskspec.language.printers.names import Notation as Notation
from taskspec.language.printers.text import plain as plain
from taskspec.language.printers.text import text as text
