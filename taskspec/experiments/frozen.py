"""Finite tasks as tables: read from an exact model, and written as a spec without draws of constants."""

from __future__ import annotations

import re
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from taskspec.base.display import small_fraction
from taskspec.model.extract import extract
from taskspec.model.model import Model, refuse
from taskspec.policies.adapters import ProbabilisticPolicy
from taskspec.policies.policy import states_of
from taskspec.scores.returns import Results
from taskspec.solve.plans import outcome_table
from taskspec.source import read_text
from taskspec.task.build import build
from taskspec.task.task import Task

MOST_STATES = 1000
PLAIN = 10_000
"""The largest denominator of a number that is written as a fraction."""
EXACT = 1e-12
_NAME = re.compile(r"[A-Za-z]\w*")


@dataclass(frozen=True)
class FrozenOutcome:
    """One outcome of a step."""

    probability: float
    state: int
    reward: float
    ends: bool


@dataclass(frozen=True)
class FrozenTask:
    """A finite task as tables.

    Attributes:
        states, actions: their names.
        start: the probability of each state at the beginning.
        outcomes: of each state and each action.
        last: the number of the step that ends the episode wherever it is taken; None where there is none.
        seen: the numbers that are observed in each state; None where the state itself is observed.
        text: `title`, `summary`, `description`, `capability`.
        claims: exact returns, by name.
    """

    name: str
    states: tuple[str, ...]
    actions: tuple[str, ...]
    start: tuple[float, ...]
    outcomes: tuple[tuple[tuple[FrozenOutcome, ...], ...], ...]
    horizon: int | None
    discount: float = 1.0
    last: int | None = None
    seen: tuple[tuple[float, ...], ...] | None = None
    text: Mapping[str, str] = field(default_factory=dict)
    claims: Mapping[str, float] = field(default_factory=dict)

    def steps(self) -> Iterator[tuple[int, int, FrozenOutcome]]:
        """Yield every outcome with its state and action."""
        for s, by_action in enumerate(self.outcomes):
            for a, found in enumerate(by_action):
                for outcome in found:
                    yield s, a, outcome

    def spec(self) -> str:
        """Return the text of a spec."""
        return "\n".join(_lines(self)) + "\n"

    def called(self, name: str, title: str, summary: str, description: str) -> FrozenTask:
        """Return the same task with a name and a text of its own; states and actions are numbered."""
        text = {
            "title": title,
            "summary": summary,
            "description": "\n".join(textwrap.wrap(description, 110)),
            "capability": "separation",
        }
        states = tuple(f"s{i}" for i in range(len(self.states)))
        actions = tuple(f"a{i}" for i in range(len(self.actions)))
        return replace(self, name=name, states=states, actions=actions, text=text)

    def task(self, suite: str = "") -> Task:
        """Return the task of the spec."""
        return build(read_text(self.spec(), f"{self.name}.yaml"), suite=suite)


# -- from a task ------------------------------------------------------------------------------------------------------


def freeze(task: Task) -> FrozenTask:
    """Return a task as tables, with its exact returns as claims.

    Raises:
        SpecError: E712 for a task that has no exact model, depends on the time, is too large, or whose observations are drawn.
    """
    model = extract(task)
    if model.n_states > MOST_STATES:
        refuse(f"{task.id} has {model.n_states:,} states; tables have {MOST_STATES:,} at most")
    last = _last_step(model)
    frozen = _of_model(model, last)
    results = Results(task, 1)
    claims = {}
    for name in ("optimal", "random", "worst"):
        value = getattr(results, name)
        if value is not None:
            claims[f"{name}_return"] = value.value
    text = {
        "title": f"{task.title or task.name}, frozen",
        "summary": f"{task.instance_id} as tables, without draws of constants.",
        "description": task.spec.description or "",
        "capability": task.capability or task.name,
    }
    return replace(frozen, text=text, claims=claims)


def _last_step(model: Model) -> int | None:
    """Return the step at which every episode ends, of a model in which nothing else depends on the time."""
    if not model.is_timed:
        return None
    first = model.step(0)
    for t, step in enumerate(model.steps):
        if step.same(first):
            continue
        ends_first = first.P_end is not None and first.P_end.sum() > 0
        if not ends_first and step.P.sum() == 0 and np.array_equal(step.R, first.R):
            return t
        break
    refuse(f"{model.task.id} depends on the time, which tables of states leave out", "add the time to the state")


def _of_model(model: Model, last: int | None) -> FrozenTask:
    """Return the tables of the states that some episode visits; those in which none acts stay as they are and pay nothing."""
    if model.legal is not None:
        refuse(f"some actions of {model.task.id} are illegal, which tables of states leave out")
    n = model.n_states
    found: dict[tuple[int, int], dict[tuple[int, bool], tuple[float, float]]] = {}
    table = outcome_table(model)
    for row, column, weight, reward, ends in zip(*(each.tolist() for each in table[:5]), strict=True):
        outcomes = found.setdefault((row % n, row // n), {})
        known, paid = outcomes.get((column, bool(ends)), (0.0, 0.0))
        outcomes[column, bool(ends)] = (known + weight, paid + weight * reward)
    for s in np.flatnonzero(~model.acting).tolist():
        for a in range(model.n_actions):
            found[s, a] = {(s, False): (1.0, 0.0)}
    visited = np.flatnonzero(model.entered).tolist()
    copies = _copies(found.values())
    reached = {(s, False): i for i, s in enumerate(visited)}
    for s in visited:
        reached[s, True] = len(visited) + copies.index(s) if s in copies else reached[s, False]
    rows = []
    for s in visited:
        by_action = []
        for a in range(model.n_actions):
            row_outcomes = []
            for to, (probability, total) in found[s, a].items():
                row_outcomes.append(FrozenOutcome(probability, reached[to], total / probability, to[1]))
            by_action.append(tuple(row_outcomes))
        rows.append(tuple(by_action))
    for s in copies:
        rows.append(((FrozenOutcome(1.0, reached[s, True], 0.0, False),),) * model.n_actions)
    names = _names([model.state(s) for s in visited], "s")
    seen = _observations(model)
    return FrozenTask(
        name=f"Frozen{model.task.name}",
        states=(*names, *(f"{names[reached[s, False]]}_end" for s in copies)),
        actions=tuple(_names([model.action(a) for a in range(model.n_actions)], "a")),
        start=(*model.start[visited].tolist(), *(0.0 for _ in copies)),
        outcomes=tuple(rows),
        horizon=model.horizon,
        discount=model.discount,
        last=last,
        seen=None if seen is None else tuple(seen[s] for s in (*visited, *copies)),
    )


def _copies(rows: Iterable[Mapping[tuple[int, bool], tuple[float, float]]]) -> list[int]:
    """Return the states that the same step reaches with and without an end: such ends get a state of their own."""
    both: dict[int, None] = {}
    for outcomes in rows:
        for state, ends in outcomes:
            if ends and (state, False) in outcomes:
                both[state] = None
    return list(both)


def _names(values: Sequence[Mapping[str, object]], letter: str) -> list[str]:
    """Return names of states or actions: their labels, or a letter and their values."""
    names = []
    for i, parts in enumerate(values):
        words = [str(value) for value in parts.values()]
        if len(words) == 1 and _NAME.fullmatch(words[0]) and words[0] not in ("True", "False"):
            names.append(words[0])
        elif len(words) == 1 and words[0].isdigit():
            names.append(f"{letter}{words[0]}")
        else:
            names.append(f"{letter}{i}")
    return names


def _observations(model: Model) -> list[tuple[float, ...]] | None:
    if model.task.observation.is_state:
        return None
    reader = ProbabilisticPolicy(model.task, np.asarray, 0)
    if reader.is_noisy or reader.sees_time:
        refuse(f"observations of {model.task.id} are not functions of the state")
    rows = reader.observe(states_of(model), 0, np.random.default_rng(0))
    parts = list(rows.values()) if isinstance(rows, dict) else [rows]
    flat = np.hstack([np.asarray(part, np.float64).reshape(model.n_states, -1) for part in parts])
    return [tuple(row) for row in flat.tolist()]


# -- to a spec --------------------------------------------------------------------------------------------------------

Entries = dict[tuple[str, str, str], str]
"""Values as text by state, action and next state."""
KEYS = ((), ("s",), ("a",), ("s'",), ("s", "a"), ("s", "a", "s'"))
"""What a table may depend on; the first that suffices is taken."""
_AT = {"s": 0, "a": 1, "s'": 2}


def _lines(task: FrozenTask) -> Iterator[str]:
    yield from ("taskspec: 1", f"name: {task.name}")
    for key in ("title", "summary"):
        if key in task.text:
            yield f"{key}: {_quoted(task.text[key])}"
    description = task.text.get("description", "").strip()
    if description:
        yield "description: |"
        yield from (f"  {line}".rstrip() for line in description.splitlines())
    yield f"capability: {_quoted(task.text.get('capability', 'separation'))}"
    yield ""
    yield from ("state:", f"  s: {{type: choice, values: [{', '.join(task.states)}]}}")
    yield from ("action:", f"  a: {{type: choice, values: [{', '.join(task.actions)}]}}")
    if task.seen is not None:
        yield from _observation(task.states, task.seen)
    yield f"horizon: {'none' if task.horizon is None else task.horizon}"
    if task.discount != 1:
        yield f"discount: {written(task.discount)}"
    yield from ("initial:", f"  s: {_distribution(zip(task.states, task.start, strict=True))}", "dynamics:")
    yield from _table("  s'", _next_states(task), task.states)
    yield from _table("reward", _rewards(task), task.states)
    yield from _ends(task)
    yield "expert: optimal"
    if task.claims:
        yield "claims:"
        for name, value in task.claims.items():
            yield from _claim(name, value)
    yield from ("figure:", "  kind: graph" if len(task.states) <= 12 else "  kind: matrix")


def _observation(states: Sequence[str], seen: Sequence[tuple[float, ...]]) -> Iterator[str]:
    numbers = [value for row in seen for value in row]
    yield from ("observation:", "  seen:", "    value:", "      by: [s]", "      rows:")
    for name, row in zip(states, seen, strict=True):
        values = ", ".join(map(written, row))
        yield f"        {name}: {values if len(row) == 1 else f'[{values}]'}"
    yield from (f"    low: {written(min(numbers))}", f"    high: {written(max(numbers))}")


def _next_states(task: FrozenTask) -> Entries:
    found: Entries = {}
    for s, by_action in enumerate(task.outcomes):
        for a, outcomes in enumerate(by_action):
            pairs = [(task.states[outcome.state], outcome.probability) for outcome in outcomes]
            found[task.states[s], task.actions[a], ""] = _distribution(pairs)
    return found


def _rewards(task: FrozenTask) -> Entries:
    found: Entries = {}
    for s, a, outcome in task.steps():
        found[task.states[s], task.actions[a], task.states[outcome.state]] = written(outcome.reward)
    return found


def _ends(task: FrozenTask) -> Iterator[str]:
    if task.last is not None:
        yield f"terminal: t == {task.last}"
        return
    found: Entries = {}
    for s, a, outcome in task.steps():
        found[task.states[s], task.actions[a], task.states[outcome.state]] = str(outcome.ends).lower()
    if "true" in found.values():
        yield from _table("terminal", found, task.states)


def _table(name: str, entries: Entries, states: Sequence[str]) -> Iterator[str]:
    """Yield the lines of a table with as few keys as tell its values apart."""
    for keys in KEYS:
        rows = _by(entries, keys)
        if rows is not None:
            break
    assert rows is not None
    if not keys:
        yield f"{name}: {rows[()]}"
        return
    indent = " " * (len(name) - len(name.lstrip()) + 2)
    yield from (f"{name}:", f"{indent}by: [{', '.join(keys)}]", f"{indent}rows:")
    texts = {}
    for first in dict.fromkeys(key[0] for key in rows):
        below = {key[1:]: value for key, value in rows.items() if key[0] == first}
        texts[first] = _row(below, states)
    common = _common(texts.values())
    is_shared = list(texts.values()).count(common) > 1 or (keys == ("s'",) and len(texts) < len(states))
    for first, text in texts.items():
        if text != common or not is_shared:
            yield f"{indent}  {first}: {text}"
    if is_shared:
        yield f"{indent}  else: {common}"


def _by(entries: Entries, keys: Sequence[str]) -> dict[tuple[str, ...], str] | None:
    """Return entries by some of their keys; None where these do not tell them apart."""
    found: dict[tuple[str, ...], str] = {}
    for entry, value in entries.items():
        key = tuple(entry[_AT[name]] for name in keys)
        if found.setdefault(key, value) != value:
            return None
    return found


def _row(below: dict[tuple[str, ...], str], states: Sequence[str]) -> str:
    """Return one row of a table: a value, or values by action, or by action and next state.

    A distribution that all actions share is written for each of them: alone it would be read as values by action.
    """
    first = next(iter(below.values()))
    is_distribution = first.startswith("{") and () not in below
    if len(set(below.values())) == 1 and not is_distribution:
        return first
    cells = []
    for key in dict.fromkeys(key[0] for key in below):
        inner = {entry[1:]: value for entry, value in below.items() if entry[0] == key}
        if len(set(inner.values())) == 1:
            cells.append(f"{key}: {next(iter(inner.values()))}")
            continue
        parts = [f"{state}: {value}" for (state,), value in inner.items()]
        if len(inner) < len(states):
            parts.append(f"else: {_common(inner.values())}")
        cells.append(f"{key}: {{{', '.join(parts)}}}")
    return f"{{{', '.join(cells)}}}"


def _common(values: Iterable[str]) -> str:
    return Counter(values).most_common(1)[0][0]


def _distribution(pairs: Iterable[tuple[str, float]]) -> str:
    likely = [(name, probability) for name, probability in pairs if probability > 0]
    if len(likely) == 1:
        return likely[0][0]
    return f"{{{', '.join(f'{name}: {written(probability)}' for name, probability in likely)}}}"


def _claim(name: str, value: float) -> Iterator[str]:
    text = written(value)
    if "." in text:
        yield from (f"  - claim: {name} == {text}", "    tolerance: 1e-9")
    else:
        yield f"  - {name} == {text}"


def written(value: float) -> str:
    """Return a number as specs write it: `2`, `1/3`, or with all its decimals."""
    near = small_fraction(value, PLAIN, EXACT * max(1.0, abs(value)))
    return repr(value) if near is None else str(near)


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'
