"""Pages -> files: LaTeX, HTML and Markdown."""
