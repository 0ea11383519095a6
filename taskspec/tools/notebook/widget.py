"""The widget of notebooks: a figure with values and a policy on it, and an episode that is played with buttons or keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import anywidget
import traitlets

from taskspec.base.diagnostics import SpecError
from taskspec.exact import Results
from taskspec.language.registry import load
from taskspec.language.task.task import TaskLike
from taskspec.tools.studio.episodes import keys, play, values

PLANS = ("optimal", "expert", "random", "soft", "maxent")


class Explorer(anywidget.AnyWidget):
    """A widget about one task.

    Attributes:
        results: the exact results of the task.
        actions: the actions of the episode so far, by index.
        view: what the page shows, as `taskspec.tools.studio.episodes` answers it.
    """

    _esm = Path(__file__).with_name("widget.js")
    view = traitlets.Dict().tag(sync=True)

    def __init__(self, task: TaskLike, seed: int = 0) -> None:
        super().__init__()
        self.results = Results(load(task))
        self.seed = seed
        self.actions: list[int] = []
        self.on_msg(self._receive)
        self.show()

    def __repr__(self) -> str:
        return f"<Explorer of {self.results.task.instance_id}>"

    def _repr_mimebundle_(self, **options: Any) -> Any:
        bundle = super()._repr_mimebundle_(**options)
        if bundle is None:
            return None
        data, about = bundle
        return data | {"text/html": self.view.get("figure") or ""}, about

    def act(self, action: int) -> None:
        """Take an action; nothing happens after the end of the episode."""
        if not self.view.get("ended"):
            self.actions.append(int(action))
            self.show()

    def undo(self) -> None:
        """Take the last action back."""
        del self.actions[-1:]
        self.show()

    def show(self, plan: str = "", time: int = 0) -> None:
        """Show the values of a plan at a time; without a plan, the episode."""
        task = self.results.task
        about: dict[str, Any] = {"name": task.instance_id, "keys": keys(task), "plans": [], "problem": ""}
        if self.results.model is not None:
            about["plans"] = [name for name in PLANS if name != "expert" or self.results.expert_rule is not None]
        try:
            if plan:
                about |= values(self.results, {"plan": plan, "time": time})
            else:
                about |= play(self.results, {"actions": self.actions, "seed": self.seed})
        except SpecError as error:
            about["problem"] = error.diagnostics[0].message
        self.view = about | {"plan": plan, "time": about.get("time", time)}

    def _receive(self, _: object, message: dict[str, Any], buffers: object) -> None:
        match message:
            case {"act": int(action)}:
                self.act(action)
            case {"undo": _}:
                self.undo()
            case {"again": _}:
                self.actions.clear()
                self.show()
            case {"plan": str(plan), "time": int(time)}:
                self.show(plan, time)
