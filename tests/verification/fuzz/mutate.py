"""Mutations of specs: of bytes, of words and signs, of the tree. Mutant number n is the same wherever it is made."""

from __future__ import annotations

import copy
import random
import re
from collections.abc import Callable
from typing import Any

from tests.verification.fuzz import corpus
from tests.verification.fuzz.scraps import KEYS, NUMBERS, OPERATORS, SCRAPS, SECTIONS, VALUES, WORDS

TOKEN = re.compile(r"[A-Za-z_][A-Za-z_0-9]*'?|\d+(?:\.\d+)?(?:[eE][+-]?\d+)?|\*\*|//|[<>=!]=|\s+|.", re.DOTALL)
BRACKETS = (("(", ")"), ("[", "]"), ("{", "}"), ('"', '"'), ("abs(", ")"), ("-", ""))


def mutant(number: int) -> bytes:
    """The input with a number."""
    chance = random.Random(number)
    mutate = chance.choices((of_bytes, of_tokens, of_tree), (2, 4, 4))[0]
    return mutate(chance)


def times(chance: random.Random) -> int:
    """How many changes are made at once: mostly one, since many are noticed by what notices the first."""
    return chance.choices((1, 2, 3, 8), (60, 25, 10, 5))[0]


# -- bytes --------------------------------------------------------------------------------------------------------


def of_bytes(chance: random.Random) -> bytes:
    content = bytearray(chance.choice(corpus.seeds()))
    for _ in range(times(chance)):
        at = chance.randrange(len(content) + 1)
        size = chance.choice((1, 1, 2, 4, 16, 64, 256))
        match chance.randrange(8):
            case 0 if at < len(content):
                content[at] ^= 1 << chance.randrange(8)
            case 1:
                content[at:at] = chance.choice(SCRAPS)
            case 2:
                content[at : at + size] = b""
            case 3:
                content[at:at] = content[at : at + size] * chance.choice((1, 2, 50))
            case 4:
                other = chance.choice(corpus.seeds())
                begin = chance.randrange(len(other) + 1)
                content[at : at + size] = other[begin : begin + size]
            case 5:
                content[at:at] = bytes(chance.randrange(256) for _ in range(min(size, 16)))
            case 6 if chance.random() < 0.3:
                del content[at:]
            case _:
                content[at : at + len(scrap)] = (scrap := chance.choice(SCRAPS))
    return bytes(content)


# -- words and signs ----------------------------------------------------------------------------------------------


def of_tokens(chance: random.Random) -> bytes:
    tokens = TOKEN.findall(chance.choice(corpus.seeds()).decode("utf-8", "surrogateescape"))
    change = _another_word if chance.random() < 0.6 else _other_words
    for _ in range(times(chance)):
        change(chance, tokens)
    return "".join(tokens).encode("utf-8", "surrogateescape")


def _another_word(chance: random.Random, tokens: list[str]) -> None:
    """A word or a sign for one of its kind, which often leaves a spec a spec."""
    places = [i for i, token in enumerate(tokens) if not token.isspace() and token not in ",:{}[]()\"'"]
    if places:
        at = chance.choice(places)
        token = tokens[at]
        if token[0].isdigit():
            tokens[at] = chance.choice(NUMBERS)
        elif token in OPERATORS:
            tokens[at] = chance.choice(OPERATORS)
        else:
            tokens[at] = chance.choice([t for t in tokens if t[0].isalpha()] or ["s"])


def _other_words(chance: random.Random, tokens: list[str]) -> None:
    at = chance.randrange(len(tokens) + 1)
    size = chance.choice((1, 1, 1, 2, 5))
    match chance.randrange(7):
        case 0:
            tokens[at : at + 1] = [chance.choice(WORDS)]
        case 1:
            tokens[at : at + 1] = [chance.choice(tokens or [""])]
        case 2:
            tokens[at:at] = [chance.choice(WORDS)]
        case 3:
            tokens[at : at + size] = []
        case 4:
            tokens[at:at] = tokens[at : at + size]
        case 5:
            tokens[at : at + size] = reversed(tokens[at : at + size])
        case _:
            left, right = chance.choice(BRACKETS)
            tokens[at : at + size] = [left, *tokens[at : at + size], right]


# -- the tree -----------------------------------------------------------------------------------------------------

Place = tuple[Any, Any]
"""A mapping or a list, and a key or an index of it."""


def of_tree(chance: random.Random) -> bytes:
    tree = copy.deepcopy(chance.choice(corpus.trees()))
    for _ in range(times(chance)):
        places = list(_places(tree))
        if not places:
            break
        holder, key = chance.choice(places)
        (change,) = chance.choices(tuple(CHANGES), tuple(CHANGES.values()))
        change(chance, holder, key, places)
    try:
        return corpus.dumped(tree)
    except (RecursionError, ValueError):
        return b""


def _places(tree: Any) -> list[Place]:
    found: list[Place] = []
    stack = [tree]
    while stack:
        node = stack.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
        for key in keys:
            found.append((node, key))
            stack.append(node[key])
    return found


def _delete(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    del holder[key]


def _replace(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    holder[key] = copy.deepcopy(chance.choice(VALUES))


def _swap(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    other, there = chance.choice(places)
    holder[key] = copy.deepcopy(other[there])


def _graft(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    """A part of another spec, under its own key if there is one."""
    tree = chance.choice(corpus.trees())
    other, there = chance.choice(_places(tree) or [(tree, next(iter(tree)))])
    if isinstance(holder, dict) and isinstance(other, dict):
        key = there
    holder[key] = copy.deepcopy(other[there])


def _rename(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    if isinstance(holder, dict):
        names = [k for h, k in places if isinstance(h, dict)]
        new = chance.choice((*names, *SECTIONS, f"{key}'", str(key).removesuffix("'"), chance.choice(KEYS)))
        value = holder.pop(key)
        holder[new] = value


def _add(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    value = copy.deepcopy(chance.choice(VALUES))
    if isinstance(holder, dict):
        holder[chance.choice(SECTIONS)] = value
    else:
        holder.insert(key, value)


def _wrap(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    value = holder[key]
    around: list[Any] = [[value], {"a": value}, {"value": value}, [value, value]]
    if isinstance(value, str):
        around.append({value: "1/2"})
    holder[key] = chance.choice(around)


def _variant(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    """What is somewhere in the spec, as a variant of it."""
    other, there = chance.choice(places)
    holder["variants" if isinstance(holder, dict) else key] = {"v": {str(there): copy.deepcopy(other[there])}}


def _text(chance: random.Random, holder: Any, key: Any, places: list[Place]) -> None:
    """A word of an expression."""
    tokens = TOKEN.findall(holder[key]) if isinstance(holder[key], str) else []
    chance.choice((_another_word, _other_words))(chance, tokens)
    holder[key] = "".join(tokens)


CHANGES: dict[Callable[[random.Random, Any, Any, list[Place]], None], int] = {
    _delete: 1, _replace: 2, _swap: 1, _graft: 1, _rename: 1, _add: 1, _wrap: 1, _variant: 1, _text: 6,
}  # fmt: skip
