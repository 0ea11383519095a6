"""DRN, the explicit text format of the model checker Storm.

Source: https://www.stormchecker.org/documentation/background/languages.html. What the format has no place for, the horizon, is a
comment.
"""

from __future__ import annotations

import re
from fractions import Fraction

from taskspec.exchange.reading import ForeignFile, assembled
from taskspec.exchange.settled import expected_rewards, legal_choices
from taskspec.exchange.tables import FrozenOutcome, FrozenTask

TYPES = ("MDP", "DTMC", "POMDP")

_STATE = re.compile(r"state\s+(\d+)(?:\s*\{\d+\})?(?:\s*!\s*(?P<rate>\S+))?(?:\s*\[(?P<paid>[^\]]*)\])?(?P<labels>.*)$")
_ACTION = re.compile(r"action\s+(?P<name>\"[^\"]*\"|\S+)(?:\s*\[(?P<paid>[^\]]*)\])?$")
_OUTCOME = re.compile(r"(\d+)\s*:\s*(\S+)$")
_LABEL = re.compile(r'"([^"]*)"|(\S+)')


def write(task: FrozenTask) -> bytes:
    """Return the file of a settled task; rewards are those expected of an action."""
    lines = [f"// {task.name}, by taskspec"]
    if task.horizon is not None:
        lines.append(f"// horizon: {task.horizon}")
    choices = sum(1 for by_action in task.outcomes for outcomes in by_action if outcomes)
    lines += ["@type: MDP", "@parameters", "", "@reward_models", "reward"]
    lines += ["@nr_states", str(len(task.states)), "@nr_choices", str(choices), "@model"]
    for s, by_action in enumerate(task.outcomes):
        labels = [name for name, held in task.labels.items() if s in held]
        if task.start[s]:
            labels.insert(0, "init")
        lines.append(" ".join([f"state {s} [0]", *labels]))
        lines.append(f"//{task.states[s]}")
        for a, outcomes in legal_choices(by_action):
            lines.append(f"\taction {task.actions[a]} [{expected_rewards(outcomes)}]")
            shares: dict[int, Fraction] = {}
            for outcome in outcomes:
                shares[outcome.state] = shares.get(outcome.state, Fraction(0)) + Fraction(outcome.probability)
            lines += [f"\t\t{target} : {share}" for target, share in sorted(shares.items())]
    return ("\n".join(lines) + "\n").encode()


def read(source: ForeignFile) -> FrozenTask:
    """Return the settled task of a file; rewards of states and actions are added, of the first reward model."""
    return _DrnReader(source).task()


class _DrnReader:
    """The states of a file, line by line."""

    def __init__(self, source: ForeignFile) -> None:
        self.source = source
        self.rows: list[dict[str, list[FrozenOutcome]]] = []
        self.labels: dict[str, set[int]] = {}
        self.horizon: int | None = None
        self.outcomes: list[FrozenOutcome] | None = None
        self.paid = [Fraction(0), Fraction(0)]
        in_model = False
        for number, raw in enumerate(source.text().splitlines(), 1):
            line = raw.strip()
            self.line = number
            if in_model:
                self._of_model(line)
            elif line.startswith("// horizon:"):
                self.horizon = int(self._number(line.removeprefix("// horizon:").strip()))
            elif line.startswith("@type:") and line.partition(":")[2].strip().upper() not in TYPES:
                source.wrong(
                    f"models of type {line.partition(':')[2].strip()} are not read, only {', '.join(TYPES)}", number
                )
            in_model = in_model or line == "@model"
        if not self.rows:
            source.wrong("there is no state after a line `@model`")

    def _of_model(self, line: str) -> None:
        if not line or line.startswith("//"):
            return
        for pattern, take in ((_OUTCOME, self._outcome), (_ACTION, self._action), (_STATE, self._state)):
            found = pattern.match(line)
            if found:
                take(found)
                return
        self.source.wrong("this is no state, action or outcome", self.line)

    def _state(self, found: re.Match[str]) -> None:
        if int(found[1]) != len(self.rows):
            self.source.wrong(f"state {len(self.rows)} is expected here", self.line)
        self.paid[0] = self._reward(found["paid"])
        for quoted, plain in _LABEL.findall(found["labels"]):
            self.labels.setdefault(quoted or plain, set()).add(len(self.rows))
        self.rows.append({})
        self.outcomes = None

    def _action(self, found: re.Match[str]) -> None:
        if not self.rows:
            self.source.wrong("an action without a state", self.line)
        self.paid[1] = self._reward(found["paid"])
        name = found["name"].strip('"')
        if name in self.rows[-1] or name == "__NOLABEL__":
            name = f"a{len(self.rows[-1])}"
        self.outcomes = self.rows[-1].setdefault(name, [])

    def _outcome(self, found: re.Match[str]) -> None:
        if self.outcomes is None:
            self.source.wrong("an outcome without an action", self.line)
        share = self._number(found[2])
        self.outcomes.append(FrozenOutcome(share, int(found[1]), self.paid[0] + self.paid[1], False))

    def _reward(self, text: str | None) -> Fraction:
        first = (text or "").partition(",")[0].strip()
        return self._number(first) if first else Fraction(0)

    def _number(self, text: str) -> Fraction:
        return self.source.number(text, self.line)

    def task(self) -> FrozenTask:
        first = sorted(self.labels.get("init", {0}))
        start = {s: Fraction(1, len(first)) for s in first}
        labels = {name: frozenset(held) for name, held in self.labels.items() if name != "init"}
        return assembled(self.source, start, self.rows, labels=labels, horizon=self.horizon)
