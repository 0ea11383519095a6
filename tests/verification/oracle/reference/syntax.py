"""Texts of expressions as Python's syntax trees; the prime of `s'` is written as a suffix on the way."""

from __future__ import annotations

import ast
import re
from functools import lru_cache

PRIME = "_prime"
_TOKEN = re.compile(r"""(?P<primed>[^\W\d]\w*')|(?P<text>'[^']*'|"[^"]*")|(?P<other>.)""", re.DOTALL)


@lru_cache(maxsize=8192)
def parse(text: str) -> ast.expr:
    """The tree of an expression; names of next values end in `PRIME`."""
    plain = "".join(m["primed"][:-1] + PRIME if m["primed"] else m[0] for m in _TOKEN.finditer(" ".join(text.split())))
    return ast.parse(plain.strip(), mode="eval").body
