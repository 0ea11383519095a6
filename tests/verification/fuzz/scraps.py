"""What mutations put into specs: bytes, words and values that mean something somewhere, or nothing anywhere."""

from __future__ import annotations

from typing import Any


def _split(text: str) -> tuple[str, ...]:
    return tuple(word.strip() for word in text.split("¦") if word.strip())


SCRAPS = (
    b'\x00', b'\x1b[31m', b'\xff', b'\xef\xbb\xbf', b'\xe2\x80\xa8', b'\xe2\x80\xae', b'\xed\xa0\x80',
    b'\xf4\x8f\xbf\xbf', b'\xc2\x85', b'\t', b'\r', b'\r\n', b'\n', b'\n  ', b'\n- ', b'---\n', b'...\n',
    b'%YAML 1.1\n', b'# ', b'&a ', b'*a ', b'!!python/name:os ', b'!x ', b'<<: ', b'? ', b'| ', b'>-\n', b'"', b"'",
    b'\\', b'${x}', b'{{x}}', b'{', b'}', b'[', b']', b'(', b')', b': ', b',', b'\\u202e', b'\\x1b', b'\\udc00',
    b'\\N', b'\xc3\xa9', b'\xe5\x8f\x98', b'x\xcc\xa7', b'\xf0\x9d\x94\xb8', b'\xef\xac\x81', b'\xe2\x80\x8d',
)  # fmt: skip
WORDS = _split("""
    0 ¦ 1 ¦ -1 ¦ 2 ¦ 0.0 ¦ -0.0 ¦ 0.5 ¦ 1e308 ¦ 1e-308 ¦ 1e999 ¦ 2147483647 ¦ 2147483648 ¦ 9223372036854775808 ¦
    100000000000000000000000000000000000000000000000000000000000000000000000000000000 ¦ 1/3 ¦ 1/0 ¦ 0/0 ¦ inf ¦ nan ¦ pi ¦
    True ¦ true ¦ null ¦ none ¦ ~ ¦ yes ¦ t ¦ T ¦ s' ¦ s ¦ a ¦ s'' ¦ __import__ ¦ lambda ¦ for ¦ if ¦ else ¦ in ¦ not in ¦
    and ¦ or ¦ not ¦ is ¦ await ¦ * ¦ ** ¦ // ¦ % ¦ @ ¦ < ¦ >= ¦ == ¦ != ¦ := ¦ ~ ¦ ^ ¦ | ¦ ... ¦ optimal ¦ soft(1) ¦
    uniform ¦ expert ¦ range(3) ¦ range(10**9) ¦ box(-2, 2, 2) ¦ box(0, 9, 99) ¦ [1, 2, 3] ¦ [] ¦ {} ¦ (1, 2) ¦
    [i for i in range(3)] ¦ {x for x in range(9)} ¦ {a: 1/2, b: 1/2} ¦ Uniform(0, 1) ¦ UniformInt(0, 3) ¦
    UniformInt(0, 10**10) ¦ Normal(0, -1) ¦ Categorical([1/2, 1/2]) ¦ Bernoulli(2) ¦ Poisson(s) ¦ Permutation(3) ¦
    Permutation(10**7) ¦ Dirichlet([1, 2]) ¦ Exponential(0) ¦ Uniform({1, 2}) ¦ sum(s) ¦ swap([1, 2], s, 0) ¦ onehot(s, 3) ¦
    sort([s, 1]) ¦ x[-1] ¦ x[::0] ¦ x[9:1] ¦ 9**9**9 ¦ 2.0**2000 ¦ shape=3 ¦ shape=[2, 2] ¦ instance_seed ¦
    reachable(s == 0) ¦ optimal_return ¦ prefers(soft(1), a == 0) ¦
""")
NUMBERS = tuple(word for word in WORDS if word.lstrip("-")[:1].isdigit())
OPERATORS = _split("+ ¦ - ¦ * ¦ / ¦ // ¦ % ¦ ** ¦ < ¦ <= ¦ > ¦ >= ¦ == ¦ != ¦ and ¦ or ¦ in")
VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, -1, 2, 3, 0.5, -0.0, 1e+308, float("inf"), float("-inf"), float("nan"), 2147483648,
    9223372036854775808, -9223372036854775808,
    100000000000000000000000000000000000000000000000000000000000000000000000000000000, '', ' ', 's', 'a', "s'", 't',
    'T', 'none', 'optimal', 'soft(1)', '0', '1/0', 'x y', '\x1b[2J', '\u202e', 'é', 'if', 'None', '__class__', '{',
    "'", '\\', [], {}, [[]], [1, 2], ['a', 'b'], [[1, 2], [3, 4]], {'a': 1}, {'a': 0.5, 'b': 0.5},
    {'if': 's == 0', 'then': 1}, [{'else': 1}], [{'if': 's == 0', 'then': 1}, {'else': 2}],
    {'by': 's', 'rows': {'else': 1}}, {'by': ['s', 'a'], 'rows': {'0': {'1': 1}, 'else': 2}},
    {'type': 'int', 'low': 0, 'high': 3}, {'type': 'real'}, {'type': 'bool'}, {'type': 'choice', 'values': ['l', 'r']},
    {'type': 'choice', 'values': {'l': -1, 'r': 1}}, {'type': 'int', 'low': 5, 'high': 1},
    {'type': 'real', 'low': 0, 'high': 1, 'shape': [2]}, {'type': 'int', 'shape': 1000000},
    {'grid': ['ab', 'c'], 'legend': {'a': 0}}, {'value': 's', 'low': 0, 'high': 1},
    {'claim': 'states == 1', 'for': [{}]}, 'UniformInt(0, 3)', 'Normal(s, 1)', '{1: 1/2, 0: 1/2}',
    '[Uniform(0, 1) for i in range(3)]', 's if a else 1 - s', '1 <= s <= 2', "0 if s' > s else 1",
)  # fmt: skip
KEYS = tuple(value for value in VALUES if not isinstance(value, dict | list))
SECTIONS = _split("""
    parameters ¦ constants ¦ definitions ¦ noise ¦ state ¦ action ¦ observation ¦ horizon ¦ terminal ¦ discount ¦ initial ¦
    dynamics ¦ reward ¦ absorbing_reward ¦ expert ¦ roles ¦ claims ¦ examples ¦ abstraction ¦ figure ¦ variants ¦ require ¦
    accept ¦ title ¦ summary ¦ description ¦ sources ¦ errata ¦ version ¦ name ¦ taskspec ¦ base ¦ space ¦ low ¦ high ¦
    shape ¦ symbol ¦ symbols ¦ default ¦ type ¦ values ¦ doc ¦ by ¦ rows ¦ else ¦ grid ¦ legend ¦ map ¦ under ¦ where ¦
    tolerance ¦
""")
