"""Printing what authors wrote: back to text, and as mathematics for LaTeX and MathML.

Mathematics goes through one tree (`printers.tree`), so that the two forms cannot say different things.
"""

from __future__ import annotations

from taskspec.show.printers.expressions import mathematics as mathematics
from taskspec.show.printers.markup import latex as latex
from taskspec.show.printers.markup import mathml as mathml
from taskspec.show.printers.names import Notation as Notation
from taskspec.show.printers.text import plain as plain
from taskspec.show.printers.text import text as text
