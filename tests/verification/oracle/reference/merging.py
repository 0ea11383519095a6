"""Reading a spec and merging its variants: which sections a task has."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import yaml

Data = dict[str, Any]

ENTRIES = (
    "parameters",
    "constants",
    "definitions",
    "noise",
    "state",
    "action",
    "observation",
    "initial",
    "dynamics",
)
KEYS = ("parameters", "state", "action")


class Loader(yaml.SafeLoader):
    """YAML 1.2 as far as specs go: `yes`, `no`, `on` and `off` are words."""


Loader.yaml_implicit_resolvers = {
    first: [(tag, pattern) for tag, pattern in resolvers if tag != "tag:yaml.org,2002:bool" or first in "tTfF"]
    for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def read(path: Path) -> Data:
    data: Data = yaml.load(path.read_text("utf-8"), Loader)
    return data


def merged(spec: Data, variant: str | None) -> Data:
    """The sections of a spec with those of a variant, and of the variants that it is based on, laid over them."""
    result = {k: copy.deepcopy(v) for k, v in spec.items() if k != "variants"}
    if variant is None:
        return result
    chain = [variant]
    while base := spec["variants"][chain[-1]].get("base"):
        chain.append(base)
    for name in reversed(chain):
        lay_over(result, {k: v for k, v in spec["variants"][name].items() if k != "base"})
    return result


def lay_over(spec: Data, changes: Data) -> None:
    for section, change in changes.items():
        if change is None:
            spec.pop(section, None)
        elif section in ENTRIES and isinstance(change, dict):
            spec[section] = entries(spec.get(section) or {}, change, deeper=section in KEYS)
        else:
            spec[section] = copy.deepcopy(change)


def entries(old: Data, change: Data, *, deeper: bool) -> Data:
    """Named entries with single ones replaced, added, or removed by `null`."""
    result = dict(old)
    for name, value in change.items():
        if value is None:
            result.pop(name, None)
        elif deeper and isinstance(value, dict) and isinstance(result.get(name), dict):
            result[name] = entries(result[name], value, deeper=False)
        else:
            result[name] = copy.deepcopy(value)
    return result


def task_name(name: str, variant: str) -> str:
    """The name of a variant's task."""
    return variant if variant.startswith(name) else name + variant[0].upper() + variant[1:]
