"""The notebooks of the documentation do what their outputs say, and are pages of the site."""

import json
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("nbclient")
pytest.importorskip("anywidget")

from docs.tools import notebooks
from tests.shared.sparse import sparse

BOOKS = sorted(notebooks.FOLDER.glob("*.ipynb"))


def outputs(cell: dict[str, Any]) -> list[Any]:
    """Return the texts that a cell prints, and the forms of what it shows."""
    found: list[Any] = []
    for output in cell.get("outputs", ()):
        text = output.get("text") or output["data"]["text/plain"]
        found.append(("".join(text), sorted(output.get("data", ()))))
    return found


@pytest.mark.parametrize("path", sparse(BOOKS, 3), ids=lambda path: path.stem)
def test_a_notebook_gives_the_outputs_that_are_stored(path: Path) -> None:
    stored = json.loads(path.read_text(encoding="utf-8"))
    assert [cell["cell_type"] for cell in stored["cells"]].count("code") > 4
    now = notebooks.executed(path)
    for cell, again in zip(stored["cells"], now.cells, strict=True):
        assert outputs(again) == outputs(cell), cell["source"]


@pytest.mark.parametrize("path", BOOKS, ids=lambda path: path.stem)
def test_the_page_of_a_notebook_shows_cells_and_outputs(path: Path) -> None:
    page = notebooks.page(path.read_text(encoding="utf-8"))
    assert page.startswith("# ") and "%pip install" in page
    assert "```{raw} html\n<" in page and "\n```text\n" in page
    assert page.count("```") % 2 == 0
