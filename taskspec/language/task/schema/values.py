"""Values that take several forms (expressions, names, bounds), and what may be wrong with them."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, Literal, NamedTuple, get_args

from taskspec.base.codes import codes
from taskspec.base.diagnostics import Advice, suggest

# ---------- problems
# Problems with values of a spec, and names of its keys in other formats.

_NAMES: Mapping[str, str] = {
    "terminal": "done terminated termination terminate terminals is_terminal goal end until",
    "horizon": "max_steps max_episode_steps episode_length steps time_limit truncation truncated truncate",
    "discount": "gamma discount_factor",
    "state": "states fluents state_fluents state_space",
    "action": "actions action_fluents action_space",
    "observation": "obs observations observ_fluents observation_space",
    "reward": "rewards utility",
    "measures": "measure cost costs performance metrics",
    "legal": "legal_actions action_mask mask allowed available preconditions",
    "dynamics": "transition transitions next step cpfs update",
    "initial": "init init_state initial_state reset start",
    "constants": "non_fluents consts",
    "definitions": "derived derived_fluents intermediate functions let define defines where macros helpers formulas",
    "parameters": "params args arguments",
    "expert": "policy",
    "default": "value initial init",
    "type: real": "float float32 float64 double continuous number",
    "type: int": "integer int32 int64 discrete multidiscrete",
    "type: bool": "boolean binary multibinary",
    "type: choice": "categorical enum str string",
    "type: int, shape: [n]": "list array vector tuple ndarray",
    "type": "dtype kind",
    "high": "max maximum upper ub",
    "low": "min minimum lower lb",
    "low: 0, high: n - 1": "n",
    "shape": "length size len dim dims",
    "values": "options choices labels categories",
    "doc": "desc description comment help",
}
_FORMS: Mapping[str, list[str]] = {
    name: [form for form, names in _NAMES.items() if name in names.split()]
    for name in " ".join(_NAMES.values()).split()
}


def advice(word: str, known: Collection[str]) -> str | None:
    """Suggest a key for a word of other formats, given the known keys."""
    forms = _FORMS.get(word.lower().replace("-", "_"), [])
    for form in forms:
        if re.split(r"\W", form)[0] in known:
            hint = f"write `{form}`"
            if form.isidentifier():
                return Advice(hint, word, form)
            return hint
    return None


# Problems of values of any form, and the rules for names.

OWN_WORDS = ("and", "or", "not", "in", "if", "else", "for", "true", "false", "True", "False")
"""Words that expressions use."""
WORDS = (*keyword.kwlist, "true", "false")
"""Words that cannot be names: words that expressions use, and other words of Python, by whose grammar they are read."""


class Problem(NamedTuple):
    """A mistake in a part of a value: `path` leads from the value to the part."""

    code: str
    path: tuple[str | int, ...]
    message: str
    hint: str | None = None
    of_key: bool = False

    def below(self, *steps: str | int) -> Problem:
        """Prefix the path of the problem."""
        return self._replace(path=(*steps, *self.path))


def below(problems: Iterable[Problem], *steps: str | int) -> Iterator[Problem]:
    """Yield the problems of a part, as seen from further up."""
    for problem in problems:
        yield problem.below(*steps)


def kind(value: object) -> str:
    """Describe a value: `the number 3`, `the text 'x'`, `a list`."""
    match value:
        case None:
            return "nothing"
        case bool():
            if value:
                return "`true`"
            return "`false`"
        case int() | float():
            return f"the number {value}"
        case str():
            if len(value) <= 30:
                short = value
            else:
                short = value[:29] + "…"
            return f"the text `{short}`"
        case list():
            return "a list"
    return "a mapping"


def wrong_kind(expected: str, value: object, hint: str | None = None) -> Problem:
    """Report a value of another kind."""
    if value is None:
        return Problem("E218", (), f"there is no value here; expected {expected}", hint)
    return Problem("E204", (), f"expected {expected}, found {kind(value)}", hint)


def name_problem(name: str) -> str | None:
    """Explain why a text cannot be a name in expressions."""
    if name in OWN_WORDS:
        return f"`{name}` is a word of the language"
    if name in WORDS:
        return f"`{name}` is a word of Python, by whose grammar expressions are read; no name can be one"
    if not name.isidentifier():
        return f"`{name}` is not a name: a letter, then letters, digits and `_`"
    if name.startswith("_"):
        return f"`{name}` is not a name: it starts with `_`"
    if unicodedata.normalize("NFKC", name) != name or "\N{MODIFIER LETTER PRIME}" in name:
        return f"`{name}` has letters that look like others"
    return None


def name(text: str, path: tuple[str | int, ...] = ()) -> Iterator[Problem]:
    """Check a name for use in expressions."""
    if trouble := name_problem(text):
        better = re.sub(r"\W+", "_", text.strip()).strip("_")
        if better in WORDS:
            better += "_"
        usable = better != text and better and not name_problem(better)
        hint = None
        if usable:
            hint = f"for example `{better}`"
        yield Problem("E205", path, trouble, hint, of_key=True)


def names(keys: Iterable[str]) -> Iterator[Problem]:
    for key in keys:
        yield from name(key, (key,))


def unknown_key(key: str, known: tuple[str, ...]) -> Problem:
    """Report an unknown key, with a known one to write instead."""
    hint = advice(key, known) or suggest(key, known) or ("it can be one of: " + ", ".join(known))
    return Problem("E202", (), f"unknown key `{key}`", hint, of_key=True)


# ---------- values
# Values that take several forms (expressions, names, bounds), checked by hand.
#
# Pydantic's unions answer a mistake in one form with complaints about all the others. Each function
# here looks at a value once, decides which form was meant, and says what is wrong with that one.

_FUNCTION = re.compile(r"([^()]*)\(([^()]*)\)")
Kind = Literal["int", "real", "bool", "choice"]
WARNINGS = tuple(code for code, entry in codes().items() if entry.severity == "warning")
SPACES = ("box", "dict", "one_hot", "multi_discrete", "discrete")


def primed(text: str) -> Iterator[Problem]:
    """Check a key of `dynamics`: the name of a state component with a prime."""
    if text.endswith("'"):
        yield from name(text[:-1])
    else:
        yield Problem(
            "E215",
            (),
            f"`{text}` lacks its prime",
            Advice(f"write `{text}'` for the next value", text, f"{text}'"),
            True,
        )


def warning(text: str) -> Iterator[Problem]:
    """Check a key of `accept`: the code of a warning."""
    if text not in WARNINGS:
        message = f"`{text}` is not the code of a warning"
        yield Problem("E206", (), message, suggest(text, WARNINGS) or "for example `W501`", of_key=True)


def reason(text: str) -> Iterator[Problem]:
    if not text.strip():
        yield wrong_kind("a reason", None)


def definition(text: str) -> Iterator[Problem]:
    """Check a key of `definitions`: a name, or a function with the names of its arguments."""
    function = _FUNCTION.fullmatch(text)
    arguments: list[str] = []
    if function:
        for part in function[2].split(","):
            arguments.append(part.strip())
    for each in (function[1] if function else text, *arguments):
        yield from name(each)
    if len(set(arguments)) < len(arguments):
        yield Problem("E205", (), f"two arguments of `{text}` have the same name", None, of_key=True)


def constant(value: Any) -> Iterator[Problem]:
    """Check a grid of letters with the value of each; other constants are expressions."""
    if not (isinstance(value, dict) and value.keys() & {"grid", "legend"}):
        return
    for key in value:
        if key not in ("grid", "legend"):
            yield unknown_key(key, ("grid", "legend")).below(key)
    lacking = [key for key in ("grid", "legend") if key not in value]
    if lacking:
        yield Problem("E203", (), f"this grid of letters has no `{lacking[0]}`")
        return
    lines = value["grid"]
    listed = isinstance(lines, list) and lines and all(isinstance(each, str) for each in lines)
    if not listed and not (isinstance(lines, str) and lines.strip()):
        yield wrong_kind("lines of letters", lines, 'for example ["S..", "..G"], or a block of text').below("grid")
    legend = value["legend"]
    if not isinstance(legend, dict):
        yield wrong_kind("an entry for each letter", legend).below("legend")
        return
    for letter in legend:
        if len(letter) != 1:
            yield Problem("E204", ("legend", letter), f"`{letter}` is not one letter", None, of_key=True)


def bound(value: Any) -> Iterator[Problem]:
    """Check a number, an expression, or a list of them for a vector."""
    if value is None or isinstance(value, bool | dict):
        yield wrong_kind("a number or an expression", value)


def shape(value: Any) -> Iterator[Problem]:
    """Check a list of lengths; `[]` is a single number."""
    for i, item in enumerate(value if isinstance(value, list) else [value]):
        steps = (i,) if isinstance(value, list) else ()
        if isinstance(item, bool) or not isinstance(item, int | str) or item == "":
            yield wrong_kind("a length, or a list of lengths", item).below(*steps)
        elif isinstance(item, int) and item < 0:
            yield Problem("E204", steps, f"a length cannot be {item}")


def labels(value: Any) -> Iterator[Problem]:
    """Check the labels of a choice: a list of words, or a mapping from each to its value."""
    if isinstance(value, dict) and value:
        for label in value:
            yield from _truth_label(label, (label,))
    elif isinstance(value, list) and value:
        seen: set[str] = set()
        for i, label in enumerate(value):
            if not isinstance(label, str) or not label:
                hint = "use words, or a mapping from words to numbers: {low: 0, high: 1}"
                yield wrong_kind("a label", label, hint).below(i)
            elif label in seen:
                yield Problem("E214", (i,), f"the label `{label}` stands twice")
            else:
                yield from _truth_label(label, (i,))
                seen.add(label)
    else:
        yield wrong_kind("the labels of the choice", value, "for example [left, right]")


def _truth_label(label: str, path: tuple[str | int, ...]) -> Iterator[Problem]:
    if label in ("true", "false", "True", "False"):
        hint = "what is either true or false has `type: bool`"
        yield Problem("E205", path, f"`{label}` is a word of the language", hint, of_key=True)


def horizon(value: Any) -> Iterator[Problem]:
    """Check a number of steps, an expression for it, or `none`."""
    if value is None or value == "":
        yield wrong_kind("a number of steps, or `none`", None)
    elif isinstance(value, bool | float | list | dict):
        yield wrong_kind("a number of steps, or `none`", value)
    elif isinstance(value, int) and value < 1:
        yield Problem("E204", (), f"an episode cannot last {value} steps")


def setting(value: Any) -> Iterator[Problem]:
    """Check a value of a parameter: a number, a truth value, or a text (a label, or `1/3`)."""
    if value is None or isinstance(value, list | dict):
        yield wrong_kind("a number, `true`, `false` or a label", value)


def grid(value: Any) -> Iterator[Problem]:
    """Choices of parameter values: `[{L: 3}, {L: 5}]`, or a grid, `{L: [3, 5]}`."""
    for path, entry in [((i,), each) for i, each in enumerate(value)] if isinstance(value, list) else [((), value)]:
        if not isinstance(entry, dict):
            yield wrong_kind("parameter values, such as `{L: [3, 5]}`", entry).below(*path)
            continue
        for key, values in entry.items():
            if values == []:
                yield wrong_kind("a value, or a list of some", None).below(*path, key)
            for i, each in enumerate(values) if isinstance(values, list) else ():
                yield from below(setting(each), *path, key, i)
            if not isinstance(values, list):
                yield from below(setting(values), *path, key)


def observation(value: Any, nullable: bool = False) -> Iterator[Problem]:
    """Check named expressions, and under `space` the kind of their space."""
    if not isinstance(value, dict):
        yield wrong_kind("named observations (`name: expression`)", value)
        return
    for key, part in value.items():
        if part is None and nullable:
            continue
        if key == "space" and part not in SPACES:
            yield Problem("E206", (key,), f"{kind(part)} is not a kind of space", "one of: " + ", ".join(SPACES))
        elif key != "space":
            yield from name(key, (key,))
            yield from below(_observed(part), key)


def measure(value: Any) -> Iterator[Problem]:
    """Check a measure: an expression, or `{value: expression, doc: ...}`."""
    if not isinstance(value, dict) or "value" not in value:
        return
    for key in value:
        if key not in _MEASURED:
            yield unknown_key(key, _MEASURED)._replace(path=(key,))
    if not isinstance(value.get("doc", ""), str):
        yield wrong_kind("a text", value["doc"]).below("doc")


_MEASURED = ("value", "doc")
_OBSERVED = ("value", "low", "high")
_TYPED = "its type follows from its expression: `name: expression`, or `{value: expression, low: ..., high: ...}`"
_BESIDE = "`space` is one for all: it stands under `observation`, beside the names"


def _observed(part: Any) -> Iterator[Problem]:
    """Check an expression, or `{value: expression, low: ..., high: ...}` with the bounds of its space."""
    if not isinstance(part, dict) or not ("value" in part or part.get("type") in get_args(Kind)):
        return
    for key in part:
        if key not in _OBSERVED:
            yield unknown_key(key, _OBSERVED)._replace(path=(key,), hint=_BESIDE if key == "space" else _TYPED)
    if "value" not in part:
        yield Problem("E203", (), "this observation has no `value`", "an expression over the state: `name: expression`")
        return
    for key in sorted(part.keys() & {"low", "high"}):
        yield from below(bound(part[key]), key)
