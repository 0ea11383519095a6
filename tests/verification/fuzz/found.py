"""Inputs that once gave a fault, in their smallest form, kept as files and run again by the tests."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

FOLDER = Path(__file__).parent / "found"
TRIES = 600
TOKEN = re.compile(rb"\w+|\s+|.", re.DOTALL)
PROGRAM = """
import json, sys
from tests.verification.fuzz.worker import examined, limited
limited()
print(json.dumps([f.signature for f in examined(sys.stdin.buffer.read()).faults]))
"""


def kept() -> list[Path]:
    return sorted(FOLDER.glob("*.yaml"))


def signatures(content: bytes) -> list[str]:
    """The faults of an input, found by a process of its own."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], input=content, capture_output=True, timeout=300, check=False)
    if done.returncode < 0:
        return [f"any: died of {-done.returncode} at "]
    found: list[str] = json.loads(done.stdout)
    return found


def keep(number: int, signature: str) -> Path:
    """Minimise an input and keep it."""
    from tests.verification.fuzz.mutate import mutant
    from tests.verification.fuzz.worker import examined

    dies = signature.startswith(("any: died", "any: ended"))
    found: Callable[[bytes], list[str]] = signatures if dies else lambda c: [f.signature for f in examined(c).faults]
    content = smaller(mutant(number), lambda c: signature in found(c), 60 if dies or "hang" in signature else TRIES)
    name = re.sub(r"[^A-Za-z0-9]+", "-", signature).strip("-").lower()
    path = FOLDER / f"{name}-{hashlib.sha256(content).hexdigest()[:6]}.yaml"
    path.write_bytes(content)
    return path


def smaller(content: bytes, still: Callable[[bytes], bool], tries: int) -> bytes:
    """The smallest input found that has the fault: without lines, then without words (Zeller and Hildebrandt, 2002)."""
    if not still(content):
        return content  # it takes what came before it in its process
    for cut in (lambda c: c.splitlines(keepends=True), TOKEN.findall):
        parts: list[bytes] = cut(content)
        size = max(1, len(parts) // 2)
        while size and tries > 0:
            for shorter in _without(parts, size):
                tries -= 1
                if still(b"".join(shorter)):
                    parts = shorter
                    break
                if tries <= 0:
                    break
            else:
                size //= 2
        content = b"".join(parts)
    return content


def _without(parts: list[bytes], size: int) -> Iterator[list[bytes]]:
    for start in range(0, len(parts), size):
        yield parts[:start] + parts[start + size :]
