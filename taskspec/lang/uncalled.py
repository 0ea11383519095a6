"""Mistakes in the body of a function that nothing calls.

The types of its arguments are known only where it is called, so names and functions are all that can be checked.
"""

from __future__ import annotations

from taskspec.diagnostics import Collector, suggest
from taskspec.lang import calls
from taskspec.lang import syntax as s
from taskspec.lang.check import CONSTANTS
from taskspec.lang.operators import FUNCTIONS
from taskspec.lang.scope import FunctionDef


def check_uncalled(collector: Collector, function: FunctionDef) -> None:
    """Report (E302 to E305) names and functions that do not exist, and calls with arguments that they do not take."""
    scope = function.scope
    local = {*function.arguments, *s.targets(function.body), *CONSTANTS}
    for found in s.names(function.body):
        own = scope.lookup(found.function if isinstance(found, s.Call) else found.written)
        match found:
            case s.Call() if isinstance(own, FunctionDef) or (own is None and found.function in FUNCTIONS):
                called = own if isinstance(own, FunctionDef) else FUNCTIONS[found.function]
                calls.refuse_keywords(collector, found)
                if not found.keywords and not called.accepts(len(found.args)):
                    collector.add(
                        "E304", found.place, f"{called.signature} was given {calls.count_of(len(found.args))}"
                    )
            case s.Call():
                if own is None and not calls.is_function(found.function):
                    calls.no_function(collector, found, scope)
            case s.Name() if own is None and found.written not in local and not scope.is_label(found.id):
                message, known = f"'{found.written}' is not defined here", [*local, *scope.names()]
                collector.add("E302", found.place, message, suggest(found.id, known))
