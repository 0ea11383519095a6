"""A reader of printed mathematics that shares nothing with the printers, and what expressions mean, to compare the two.

- `marks`: what stands on paper (symbols, fractions, scripts, brackets), without the braces and tags that nobody sees.
- `latex`, `mathml`, `unicode`: from one of the three printed forms to marks.
- `reading`: from marks to a value, by the conventions of mathematics alone. What has two readings is an error.
- `meaning`: values to compare, from surface syntax and from Python's own parse of printed text.
- `trees`: random expressions.
"""
