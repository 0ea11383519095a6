"""The measures of one task: those asked for, each worked out or with the reason why it is not known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from taskspec.diagnostics import SpecError, suggest
from taskspec.exact.difficulty.measures import MEASURES
from taskspec.exact.model.failure import misused
from taskspec.exact.planning.certified.enclosure import NoNumber
from taskspec.exact.scoring.returns import Results
from taskspec.notebook import html_table
from taskspec.progress import tell
from taskspec.task.task import TaskLike


@dataclass(frozen=True, eq=False)
class Difficulty(Mapping[str, float | None]):
    """Measures of a task's difficulty by name, in the order of `MEASURES`; None where one is not known.

    `why_not` says why, by name.
    """

    id: str
    parameters: Mapping[str, Any]
    measured: Mapping[str, float | None]
    why_not: Mapping[str, str]

    def __getitem__(self, name: str) -> float | None:
        return self.measured[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.measured)

    def __len__(self) -> int:
        return len(self.measured)

    def record(self) -> dict[str, Any]:
        """As plain data for JSON: the measures by name, and the reasons why some are None."""
        return {**self.measured, "why_not": dict(self.why_not)}

    def rows(self) -> list[tuple[str, float | None, str, str]]:
        """Name, value, unit, and what the measure is or why it is not known, of each."""
        return [(n, v, MEASURES[n].unit, self.why_not.get(n) or MEASURES[n].doc) for n, v in self.items()]

    def _repr_html_(self) -> str:
        """The measures, for notebooks."""
        rows = [(name, "unknown" if v is None else f"{v:.6g}", unit, said) for name, v, unit, said in self.rows()]
        return html_table(f"{self.id}: difficulty", ("measure", "value", "unit", ""), rows)


def difficulty(task: TaskLike | Results, names: Sequence[str] | None = None) -> Difficulty:
    """How hard a task is by measures from theory, worked out on its exact model.

    Args:
        task: the task, its id or its path, or `Results` of it, which spares working out what is known already.
        names: of measures (`MEASURES`); None is all of them.

    Raises:
        SpecError: E713 for a name that is no measure's; E705 without scipy.
    """
    chosen = MEASURES if names is None else {name: MEASURES[name] for name in names if _is_measure(name)}
    results = task if isinstance(task, Results) else Results(task)
    measured: dict[str, float | None] = {}
    why_not: dict[str, str] = {}
    for name, measure in chosen.items():
        tell(f"difficulty: {name.replace('_', ' ')}")
        try:
            measured[name] = measure.of(results)
        except (SpecError, NoNumber) as error:
            if isinstance(error, SpecError) and any(d.code == "E705" for d in error.diagnostics):
                raise
            measured[name] = None
            why_not[name] = error.diagnostics[0].message if isinstance(error, SpecError) else str(error)
    return Difficulty(results.task.id, results.task.values, measured, why_not)


def _is_measure(name: str) -> bool:
    if name not in MEASURES:
        misused(f"there is no measure '{name}'", suggest(name, list(MEASURES)) or f"there are: {', '.join(MEASURES)}")
    return True
