"""Tasks, components and spaces as plain data for JSON, and in words for tables; the suites in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from taskspec.base.display import decimal, setting
from taskspec.base.named import all_names
from taskspec.language.expressions.types import Domain, Kind
from taskspec.language.task.parts import Component, Parameter, Soft, are_finite, counts_of
from taskspec.language.task.spaces import SpaceLayout
from taskspec.language.task.task import Task

if TYPE_CHECKING:
    from taskspec.language.task.build import Outline

_SETS = {Kind.BOOL: "𝔹", Kind.INT: "ℤ", Kind.REAL: "ℝ"}
_RAISED = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def record(task: Task) -> dict[str, Any]:
    """Convert a task to plain data."""
    spec = task.spec
    expert: str | None = "expression"
    if task.annotations.expert is None or isinstance(task.annotations.expert, str):
        expert = task.annotations.expert
    elif isinstance(task.annotations.expert, Soft):
        expert = f"soft({task.annotations.expert.beta:g})"
    return {
        "id": task.id,
        "name": task.name,
        "suite": task.source.suite,
        "version": task.source.version,
        "variant": task.source.variant,
        "path": task.source.document.origin.name,
        "title": spec.title,
        "summary": spec.summary,
        "capability": spec.capability,
        "keywords": spec.keywords,
        "parameters": list(map(parameter, task.parameters)),
        "modifiers": list(map(str, task.modifiers)),
        "states": count(task.state),
        "actions": count(task.action),
        "state": list(map(component, task.state)),
        "action": list(map(component, task.action)),
        "observation_space": space(task.observation_layout),
        "action_space": space(task.action_layout),
        "horizon": task.horizon,
        "discount": task.discount,
        "expert": expert,
        "content_hash": task.content_hash,
    }


def constants(task: Task) -> dict[str, Any]:
    """Values of the constants of a task; drawn ones have the values of this instance."""
    values: dict[str, Any] = {}
    for name, value in task.constants.items():
        if isinstance(value, bool | int | float):
            values[name] = value
        else:
            values[name] = value.tolist()
    return values


def parameter(p: Parameter) -> dict[str, Any]:
    named = ("name", "kind", "value", "default", "low", "high", "values", "symbol", "doc", "alias")
    values = {}
    for name in named:
        if getattr(p, name) is not None:
            values[name] = getattr(p, name)
    return values


def component(c: Component) -> dict[str, Any]:
    data: dict[str, Any] = {"name": c.name, "type": str(c.type.kind), "shape": list(c.type.shape), "doc": c.doc}
    if c.domain is not None:
        return data | {"type": "choice", "labels": list(c.domain.labels)}
    return data | {"low": _bound(c.low), "high": _bound(c.high)}


def _bound(values: Sequence[float]) -> Any:
    if len(set(values)) == 1:
        return values[0]
    return list(values)


def count(components: Sequence[Component]) -> int | None:
    """Count the values of components together; None for infinitely many."""
    if not are_finite(components):
        return None
    return math.prod(counts_of(components))


def size(task: Task | Outline) -> str:
    """Write states times actions, or the sets of their values: `21 × 2`, `ℝ⁵⁰ × 2`."""
    return f"{_extent(task.state)} × {_extent(task.action)}"


def _extent(components: Sequence[Component]) -> str:
    finite = 1
    sets: dict[Kind, int] = {}
    for c in components:
        if c.is_finite:
            finite *= math.prod(c.counts)
        else:
            sets[c.type.kind] = sets.get(c.type.kind, 0) + c.type.size
    words = []
    if finite > 1 or not sets:
        words.append(short(finite))
    for kind, n in sets.items():
        words.append(_SETS[kind] + str(n).translate(_RAISED) * (n > 1))
    return " ".join(words)


def short(n: int) -> str:
    """Return a number of states, from a million on to two digits: `16,384`, `6.8·10¹⁰`."""
    if n < 1_000_000:
        return f"{n:,}"
    digits = math.floor(math.log10(n))  # Python refuses to write out numbers of more than 4,300 digits
    if 10**digits > n:
        digits -= 1
    return f"{n // 10 ** (digits - 1) / 10:.1f}·10{str(digits).translate(_RAISED)}"


def horizon(task: Task | Outline) -> str:
    if task.horizon is None:
        return "none"
    return f"{task.horizon:,}"


def space(layout: SpaceLayout) -> dict[str, Any]:
    """Convert a Gymnasium space to plain data."""
    match layout.form:
        case "discrete":
            c = layout.components[0]
            return {"space": "Discrete", "n": c.counts[0], "start": int(c.low[0])}
        case "multi_discrete":
            return {"space": "MultiDiscrete", "nvec": list(layout.counts)}
        case "one_hot":
            return {"space": "Box", "shape": list(layout.shape), "low": 0.0, "high": 1.0}
        case "dict":
            return {"space": "Dict", "keys": all_names(layout.components)}
        case "box":
            low = _bound(layout.low)
            high = _bound(layout.high)
            return {"space": "Box", "shape": list(layout.shape), "low": low, "high": high}


def space_words(layout: SpaceLayout) -> str:
    """Write a Gymnasium space in words: `Discrete(21)`, `Box(50) in [0, 1]`."""
    words = space(layout)
    match words:
        case {"space": "Discrete", "n": n, "start": start}:
            if start == 0:
                return f"Discrete({n})"
            return f"Discrete({n}, start={start})"
        case {"space": "MultiDiscrete", "nvec": nvec}:
            return f"MultiDiscrete({_listed(nvec)})"
        case {"space": "Dict", "keys": keys}:
            return f"Dict({', '.join(keys)})"
        case {"shape": shape, "low": low, "high": high}:
            bounds = ""
            if not isinstance(low, list) and not isinstance(high, list):
                bounds = f" in {interval(low, high)}"
            return f"Box({_listed(shape)}){bounds}"
    raise AssertionError(words)


def _listed(items: Sequence[Any]) -> str:
    shown = [*map(str, items[:5]), "…"]
    if len(items) <= 6:
        shown = list(map(str, items))
    return ", ".join(shown)


def interval(low: float, high: float) -> str:
    """Write an interval such as `[0, 1]`, open where there is no bound."""
    left = "(" if math.isinf(low) else "["
    right = ")" if math.isinf(high) else "]"
    return f"{left}{decimal(low)}, {decimal(high)}{right}"


def domain_words(c: Component | Parameter) -> str:
    """Write the domain of a component or a parameter: `int 0..20`, `real in [0, 1]`, `up | down`."""
    labels: Sequence[Any] | None
    if isinstance(c, Parameter):
        labels = c.values
        kind = c.kind
        shape = ""
        low, high = c.ends
    else:
        labels = None
        if c.domain is not None:
            labels = label_words(c.domain)
        kind = str(c.type.kind)
        shape = ""
        if c.type.shape:
            shape = f"[{', '.join(map(str, c.type.shape))}]"
        low = c.least
        high = c.most
    if labels is not None:
        return " | ".join(map(str, labels)) + shape
    if kind == "bool":
        return f"bool{shape}"
    if math.isinf(low) and math.isinf(high):
        return f"{kind}{shape}"
    if kind == "int":
        return f"int{shape} {_end(low)}..{_end(high)}"
    return f"real{shape} in {interval(low, high)}"


def value_words(value: Any) -> str:
    """Write one value of a state or an action, a real to four digits."""
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)


def label_words(domain: Domain) -> list[str]:
    if domain.values is None:
        return list(domain.labels)
    words = []
    for label, value in zip(domain.labels, domain.values, strict=True):
        words.append(f"{label} {_value(value)}")
    return words


def _value(value: Any) -> str:
    if isinstance(value, tuple | list):
        return f"({', '.join(map(setting, value))})"
    return setting(value)


def _end(value: float) -> str:
    if math.isinf(value):
        return ""
    return decimal(value).replace(",", "")


def settings(task: Task | Outline) -> str:
    """Write the parameters and modifiers of a task: `L=10 B=2 + sticky=0.25`."""
    words = [f"{p.name}={setting(p.value)}" for p in task.parameters]
    for modifier in task.modifiers:
        words.append(f"+ {modifier}")
    return " ".join(words)


class AboutSuite(NamedTuple):
    """A suite in words.

    Attributes:
        title: its heading in a gallery.
        line: at most 60 characters on its tasks, for a list.
    """

    title: str
    line: str


SUITES = {
    "derail": AboutSuite("DERAIL", "diagnostic tasks for reward and imitation learning"),
    "bsuite": AboutSuite("Behaviour suite", "bandits, chains and umbrellas, one question each"),
    "classic_control": AboutSuite("Classic control", "poles, pendulums and cars of Gymnasium"),
    "toy_text": AboutSuite("Gymnasium's toy text", "frozen lake, cliff, taxi and blackjack"),
    "textbook": AboutSuite("Textbook", "examples of Sutton and Barto's book, and bandits"),
    "memory": AboutSuite("Memory", "cards, lights and letters that have to be remembered"),
    "pomdp": AboutSuite("Partially observable", "published POMDPs: tigers, rocks and corridors"),
    "planning": AboutSuite("Planning", "puzzles and board games"),
    "operations": AboutSuite("Operations", "stocks, queues, repairs and offers"),
    "safety": AboutSuite("Safety", "AI safety gridworlds, vases and off-switches"),
    "irl": AboutSuite("What identifies a reward", "demonstrations that do or do not identify a reward"),
    "probes": AboutSuite("Probes", "two to five states on which usual mistakes lose return"),
    "families": AboutSuite("Families", "random tasks to tell two learners apart"),
    "seals": AboutSuite("Cliff worlds and random processes", "the tabular tasks of seals"),
}
"""The suites of the package, in the order in which they are shown."""
