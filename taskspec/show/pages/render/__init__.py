"""Pages -> files: LaTeX, HTML and Markdown, by templates, which only lay out what renderers have escaped."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined

TEMPLATES = Path(__file__).parents[1] / "templates"


@lru_cache(maxsize=1)
def html_environment() -> Environment:
    """Return the environment for HTML, which escapes all that is not marked as markup."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined,
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip


@lru_cache(maxsize=1)
def text_environment() -> Environment:
    """Return the environment for LaTeX and Markdown, with marks that neither uses; values have been escaped before."""
    return Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=False, undefined=StrictUndefined,
        block_start_string="<%", block_end_string="%>", variable_start_string="<<", variable_end_string=">>",
        comment_start_string="<#", comment_end_string="#>",
        trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True,
    )  # fmt: skip
