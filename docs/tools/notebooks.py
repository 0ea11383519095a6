"""The notebooks of the documentation: executed, and as pages of the site.

`python -m docs.tools.notebooks` writes their outputs.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "howto" / "notebooks"
NEEDS_A_KERNEL = "application/vnd.jupyter.widget-view+json"
"""The form of widgets, whose state is not kept: what else they show stays."""


def executed(path: Path) -> Any:
    """Return a notebook with the outputs that its cells give now, in a folder of its own."""
    import nbformat
    from nbclient import NotebookClient

    book = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    with tempfile.TemporaryDirectory() as outer:
        folder = Path(outer) / "mine"
        folder.mkdir()
        resources = {"metadata": {"path": str(folder)}}
        NotebookClient(book, timeout=300, kernel_name="python3", resources=resources, coalesce_streams=True).execute()
    book.metadata = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    for cell in book.cells:
        cell.metadata = {}
        for output in cell.get("outputs", ()):
            output.get("data", {}).pop(NEEDS_A_KERNEL, None)
    return book


def page(text: str) -> str:
    """Return a notebook as Markdown, with its outputs below its cells."""
    parts = []
    for cell in json.loads(text)["cells"]:
        source = _joined(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        language = "yaml" if source.startswith("%%writefile") else "python"
        parts.append(f"```{language}\n{source}\n```")
        parts += [_output(output) for output in cell["outputs"]]
    return "\n\n".join(parts) + "\n"


def _output(output: dict[str, Any]) -> str:
    data = output.get("data", {})
    for form in ("text/html", "image/svg+xml"):
        if form in data:
            return f"```{{raw}} html\n{_joined(data[form])}\n```"
    text = _joined(output["text"] if "text" in output else data["text/plain"])
    return f"```text\n{text.rstrip()}\n```"


def _joined(lines: str | list[str]) -> str:
    return lines if isinstance(lines, str) else "".join(lines)


def main() -> None:
    import nbformat

    for path in sorted(FOLDER.glob("*.ipynb")):
        nbformat.write(executed(path), path)  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    main()
