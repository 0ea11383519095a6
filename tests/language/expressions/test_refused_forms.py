"""What Python reads, or other languages write, and this one refuses: each with what to write instead."""

from __future__ import annotations

import json

import pytest

from taskspec.base.diagnostics import SpecError
from taskspec.language.expressions.evaluate import evaluate
from taskspec.language.expressions.types import Role
from taskspec.language.printers import text as printed
from taskspec.language.source import read_text
from taskspec.language.task.build import build
from tests.shared.sections import text

FORMS = [
    ("s.x", "E316", 1, "attributes (`a.b`) are not part", None),
    ("s.x()", "E316", 1, "methods and functions of modules (`x.f()`) are not part", "`f(x)`"),
    ("lambda s: s", "E316", 1, "`lambda` is not part", "a definition with arguments"),
    ("1 + s ^ 2", "E316", 1, "`^` is not an operator", "`x**2`"),
    ("1 + (s & 1)", "E316", 6, "bit operators are not part", "`and`, `or`, `not`"),
    ("s | 1", "E316", 1, "bit operators are not part", "`and`, `or`, `not`"),
    ("~s", "E316", 1, "bit operators are not part", "`and`, `or`, `not`"),
    ("s @ s", "E316", 1, "`@` is not an operator", "`dot(a, b)`"),
    ("f'{s}'", "E316", 1, "formatted strings are not part", "`s == 1`"),
    ("s == pass", "E301", 6, "`pass` is a word of Python", "a label is quoted: `'pass'`"),
    ("s if s == lambda else 0", "E301", 11, "`lambda` is a word of Python", "`'lambda'`"),
    ("sum(lambda x y: x)", "E316", 5, "`lambda` is not part", "a definition with arguments"),
    ("s == None", "E316", 6, "'None' is not a value", "`'None'`"),
    ("s mod 2", "E301", 2, "'mod' is not an operator", "`%`"),
    ('f"{s}" == s', "E316", 1, "formatted strings are not part", "`s == 1`"),
    ("1 if yes else 0", "E302", 6, "'yes' is not defined", "a truth value is `true`"),
    ("s == Off", "E302", 6, "'Off' is not defined", "a truth value is `false`"),
    ("sum([v for v in (s, 1)])", "E312", 17, "goes over a constant", "`(s, 1)[i]` in the place of `v`"),
    ("fold(s, [1, 2])", "E304", 1, "fold(f, start, x) was given 2 arguments", None),
    ("scan(max, start=0)", "E305", 11, "takes no keyword arguments", "write it without `start=`"),
    ("s is 1", "E316", 1, "`is` is not part", "`==`"),
    ("(s := 1)", "E316", 2, "this form (NamedExpr)", None),
    ("{**s}", "E316", 4, "`**` cannot unpack", None),
    ("s[...]", "E316", 3, "'...' is not a value", None),
    ("1j", "E316", 1, "'1j' is not a value", None),
    ("max(*s)", "E316", 5, "this form (Starred)", None),
    ("s && 1", "E301", 3, "'&&' is not an operator", "`and`"),
    ("s || 1", "E301", 3, "'||' is not an operator", "`or`"),
    ("s = 1", "E301", 3, "'=' is not an operator", "`==` compares"),
    ("!s", "E301", 1, "'!' is not an operator", "`not x`"),
    ("if s > 1 then 1 else 0", "E301", 1, "cannot be read", "`x if condition else y`"),
    ("∑ s", "E301", 1, "invalid character", "`sum(x)`"),
    ("s ? 1 : 0", "E301", 3, "'?' is not an operator", "`x if condition else y`"),
    ("1 if s", "E301", 1, "expected 'else' after 'if' expression", "`x if condition else y`"),
    ("1 + 2s", "E301", 5, "'2s' is neither a number nor a name", "`2 * s`"),
    ("“s > 1”", "E301", 1, "invalid character '“'", '`"`'),
    ("s\u00a0+ 1", "E301", 2, "invalid non-printable character U+00A0", "an ordinary space"),
    ("s + \u200b1", "E301", 5, "invalid non-printable character U+200B", None),
    ("s ≤ 3", "E301", 3, "invalid character '≤'", "`<=`"),
    ("1 + (s", "E301", 5, "this '(' is never closed", None),
    ("s if true' else 0", "E302", 6, "'true'' is not defined", None),
    ("sum([true for true in range(3)])", "E316", 15, "binds plain names", None),
    ("a' + s", "E308", 1, "'a' has no next value", "`memory` may use the next value of an observation"),
    ("z' + s", "E302", 1, "'z'' is not defined", None),
    ("1 + max", "E304", 5, "'max' is a function", None),
    ("1 + S", "E302", 5, "'S' is not defined", "'s'"),
    ("1 + UniformInt(3, 1)", "E408", 5, "'low' of UniformInt is 3, above 'high' 1", None),
    ("Binomial(s, 0.5)", "E312", 10, "must be a constant int", None),
    ("sum([j for j in range(s)])", "E312", 23, "must be a constant", None),
    ("s in range(s)", "E312", 12, "must be a constant", None),
    ("sum([j for j in range(3) if j < s])", "E312", 29, "must be a constant", "`[x if condition else 0 for ...]`"),
    ("sum((1, 2)[:s])", "E312", 13, "must be a constant", None),
    ("1 if (1, 2) == s else 0", "E307", 6, "one condition is needed", "`where(condition, x, y)` chooses"),
    ("(1, 2, 3) if (1, 2) == s else 0", "E307", 14, "one condition is needed", "write `all(...)` or `any(...)`"),
    ("s +", "E301", 3, "the expression ends too early", None),
]


@pytest.mark.parametrize(("expression", "code", "column", "message", "hint"), FORMS, ids=[form[0] for form in FORMS])
def test_each_is_refused_where_it_stands(
    expression: str, code: str, column: int, message: str, hint: str | None
) -> None:
    with pytest.raises(SpecError) as caught:
        build(read_text(text(reward=json.dumps(expression, ensure_ascii=False))))
    (found,) = caught.value.diagnostics
    assert found.span is not None
    assert (found.code, found.span.column - len('reward: "')) == (code, column)
    assert message in found.message
    assert (hint in (found.hint or "")) if hint else found.hint is None


@pytest.mark.parametrize("written", ["true", "True"])
def test_truth_values_are_spelled_as_in_yaml_or_in_python(written: str) -> None:
    task = build(read_text(text(reward=f'"2 if s == 0 and {written} else (0 if {written} else 1)"')))
    same = build(read_text(text(reward='"2 if s == 0 and True else (0 if True else 1)"')))
    assert str(task.process.reward) == str(same.process.reward)
    assert printed(task.source.surface.sections["reward"]) == printed(same.source.surface.sections["reward"])
    choice = f'{{a: {{type: choice, values: ["{written}", other]}}}}'
    with pytest.raises(SpecError, match=f"`{written}` is a word of the language"):
        build(read_text(text(action=choice)))


PLACES = {
    "after a comment": ("|\n  s + # the first\n  q + 1", "E302", "3:3", "'q' is not defined"),
    "after comments with quotes": (
        '|\n  s + (  # it\'s\n    2 * # "two"\n    s) + q',
        "E302",
        "4:10",
        "'q' is not defined",
    ),
    "a row for no condition": (
        "{by: s > 1, rows: {0: 1, 1: 2, 2: 3}}",
        "E313",
        "1:40",
        "'2' is not a value of this column",
    ),
}


@pytest.mark.parametrize("name", PLACES)
def test_places_in_what_has_parts(name: str) -> None:
    written, code, place, message = PLACES[name]
    lines = text(reward=written)
    first = lines[: lines.index("reward: ")].count("\n")
    with pytest.raises(SpecError) as caught:
        build(read_text(lines))
    (found,) = caught.value.diagnostics
    assert found.span is not None
    assert (found.code, f"{found.span.line - first}:{found.span.column}") == (code, place)
    assert message in found.message


def test_an_index_for_each_axis_may_be_a_vector_of_any_kind() -> None:
    indices = [
        "(1, s % 2)",
        "[s % 2 for i in range(2)]",
        "where(s > 1, (1, 0), (0, 1))",
        "(1, 1) * (s % 2)",
        "(s % 2, -1)",
    ]
    made = [build(read_text(text(reward=f'"sum(put([[1, 2], [3, 4]], {each}, 5)[1])"'))) for each in indices]
    rewards = [[evaluate([task.process.reward], {(Role.STATE, "s"): (k,)})[0][0] for k in (1, 2)] for task in made]
    assert rewards == [[8, 9], [8, 7], [7, 9], [8, 7], [8, 7]]
