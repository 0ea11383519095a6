"""Specs while they are typed: partial documents, names by place, completion, meanings and fixes; without a protocol.

Everything here takes a text and an offset in it, and never raises for a bad text.
"""

from taskspec.tools.authoring.analysis import Analysis as Analysis
from taskspec.tools.authoring.analysis import analyse as analyse
from taskspec.tools.authoring.completion import Completion as Completion
from taskspec.tools.authoring.completion import complete as complete
from taskspec.tools.authoring.meanings import definition as definition
from taskspec.tools.authoring.meanings import hover as hover
from taskspec.tools.authoring.meanings import name_at as name_at
from taskspec.tools.authoring.meanings import references as references
from taskspec.tools.authoring.meanings import rename as rename
from taskspec.tools.authoring.meanings import signature_at as signature_at
