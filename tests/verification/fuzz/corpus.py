"""What mutations start from: every spec of the repository, those that were wrong once, and random ones."""

from __future__ import annotations

import random
import re
from functools import cache
from pathlib import Path
from typing import Any

import yaml

ROOT = Path(__file__).parents[3]
FOLDERS = ("tasks", "tests", "taskspec", "docs")
RANDOM_SPECS = 300
LONGEST = 8_000
BLOCK = re.compile(r"^```yaml\n(taskspec:.*?)^```$", re.MULTILINE | re.DOTALL)
Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)


@cache
def seeds() -> tuple[bytes, ...]:
    """Texts of specs, always in the same order."""
    files = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.yaml"))
    pages = sorted((ROOT / "docs").rglob("*.md"))
    found = [path.read_bytes() for path in files]
    found += [block.encode() for page in pages for block in BLOCK.findall(page.read_text("utf-8"))]
    found += [made(number) for number in range(RANDOM_SPECS)]
    return tuple(content for content in found if len(content) <= LONGEST)


def made(number: int) -> bytes:
    """A random spec that is well typed."""
    from tests.verification.oracle.generator.spec import spec

    return dumped(spec(random.Random(number)))


@cache
def trees() -> tuple[Any, ...]:
    """Those of the texts that YAML can read, as data."""
    found = (loaded(content) for content in seeds())
    return tuple(tree for tree in found if isinstance(tree, dict))


def loaded(content: bytes) -> Any:
    try:
        return yaml.load(content, Loader)  # a safe one
    except (yaml.YAMLError, ValueError):
        return None


def dumped(data: Any) -> bytes:
    text: str = yaml.dump(data, Dumper=Dumper, sort_keys=False, width=10_000, allow_unicode=True)
    return text.encode("utf-8", "surrogatepass")
