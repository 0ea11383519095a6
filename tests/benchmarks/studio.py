"""How soon the page of the studio follows an edit: exact scores, mathematics and figure, for each task of DERAIL."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from taskspec.cli.console import say, write_json
from taskspec.show.terminal.styled_text import Columns, console
from tests.benchmarks.tables import SUITE
from tests.tools.studio.browser import VIEW, Page, chromium, served

TARGET = 200.0
"""Milliseconds, at the 95th percentile."""
TASKS = 8
"""How many of the tasks have to reach it."""
FILES = {"EarlyTermPos": "early_term", "EarlyTermNeg": "early_term", "InitShiftExpert": "init_shift"}
PARTS = ("Exact scores", "Printed mathematics", "Figure")
EDIT = """
  const panel = document.getElementById("panel-Spec");
  const sections = [...panel.querySelectorAll("section")];
  const times = {};
  const begun = performance.now();
  return new Promise((resolve) => {
    const observer = new MutationObserver((changes) => {
      for (const { target, oldValue } of changes) {
        if (oldValue === "true" && !target.ariaBusy) times[target.ariaLabel] = performance.now() - begun;
      }
      if (Object.keys(times).length < sections.length) return;
      observer.disconnect();
      resolve(times);
    });
    observer.observe(panel, { attributes: true, subtree: true, attributeFilter: ["aria-busy"], attributeOldValue: true });
    const from = view.state.doc.toString().indexOf(old);
    view.dispatch({ changes: { from, to: from + old.length, insert: now } });
  });
"""
"""JavaScript that changes the text, and returns after how many milliseconds each part of the page had followed."""


def bench(edits: int, json: bool) -> bool:
    """Print a table of times, and return whether enough tasks reach the target."""
    with tempfile.TemporaryDirectory() as place, served(Path(place)) as tasks, chromium() as browser:
        page = Page(browser, tasks)
        rows = [_measured(page, name, edits) for name in SUITE]
    reached = sum(row["all"] < TARGET for row in rows)
    if json:
        write_json({"edits": edits, "target": TARGET, "reached": reached, "tasks": rows})
        return reached >= TASKS
    table = Columns("task", "scores", "mathematics", "figure", "all", right=range(1, 5))
    for row in rows:
        table.add_row(row["task"], *(f"{row[part]:.0f} ms" for part in (*PARTS, "all")))
    console().print(table)
    say(f"95th percentiles of {edits} edits; {reached} of {len(rows)} tasks follow within {TARGET:.0f} ms")
    return reached >= TASKS


def _measured(page: Page, name: str, edits: int) -> dict[str, Any]:
    """Return the 95th percentiles of the times after which each part of the page has followed edits of a task."""
    file = FILES.get(name) or "".join(f"_{c.lower()}" if c.isupper() else c for c in name).lstrip("_")
    page.open(f"{file}.yaml")
    if name in FILES:
        page.page.get_by_label("variant").select_option(name)
        page.follow()
    horizon = next(line for line in page.text.split("\n") if line.startswith("horizon:"))
    has_horizon = not horizon.endswith("none")
    summary = "summary: "
    now = horizon
    found = []
    for i in range(edits):
        if has_horizon and i % 2:  # a task that has not been solved before
            old = now
            now = f"{horizon} + {i}"
            change = [old, now]
        else:
            old = summary
            summary = f"summary: {'A' * (1 + i % 4)}"
            change = [old, summary]
        found.append(page.page.evaluate(f"async ([old, now]) => {{ {VIEW} {EDIT} }}", change))
        page.page.wait_for_timeout(100)
    times = np.array([[each[part] for part in PARTS] for each in found])
    parts = dict(zip(PARTS, np.percentile(times, 95, axis=0).tolist(), strict=True))
    return {"task": name, **parts, "all": float(np.percentile(times.max(axis=1), 95))}
