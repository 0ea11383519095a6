"""Specs while they are typed: partial documents, names by place, completion, meanings and fixes; without a protocol.

Everything here takes a text and an offset in it, and never raises for a bad text.
"""

from taskspec.analysis.analysis import Analysis as Analysis
from taskspec.analysis.analysis import analyse as analyse
from taskspec.analysis.completion import Completion as Completion
from taskspec.analysis.completion import complete as complete
from taskspec.analysis.meanings import definition as definition
from taskspec.analysis.meanings import hover as hover
from taskspec.analysis.meanings import name_at as name_at
from taskspec.analysis.meanings import references as references
from taskspec.analysis.meanings import rename as rename
from taskspec.analysis.meanings import signature_at as signature_at
