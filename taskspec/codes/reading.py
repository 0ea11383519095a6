"""E1xx: reading the file as YAML, and the places where YAML reads something else than was meant."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E101",
        "duplicate-key",
        "a key that occurs twice in one mapping",
        """
Most YAML parsers silently keep the last of two equal keys. Here this is an error, because one of the values would be
lost.

```yaml
dynamics:
  s': s + 1
  s': s + 2    # wrong: which of the two?
```
""",
    ),
    Code(
        "E102",
        "special-first-character",
        "a value that starts with a special character of YAML",
        """
`*`, `&`, `!`, `|`, `>`, `%`, `@`, `` ` ``, `,`, `]`, `}` and `- ` have a special meaning at the start of a value. Put
the value in quotes. Specs have no anchors, aliases or tags: write a value that is needed twice as a definition or a
constant.

```yaml
reward: *s        # wrong: an alias
reward: "-s"      # right: quotes make it text
```
""",
    ),
    Code(
        "E103",
        "starts-with-brace",
        "an expression that starts with a brace",
        """
A value that starts with `{` is a YAML mapping, so an expression that starts with a set needs quotes. A distribution
over values, `{value: probability}`, is a mapping and needs none.

```yaml
s': {1, 2, 3}          # wrong: a mapping of three keys without values
s': "{1, 2, 3}"        # right: an expression
s': {goal: 1/2, trap: 1/2}    # right: a mapping from values to probabilities
```
""",
    ),
    Code(
        "E104",
        "unquoted-colon",
        "a colon followed by a space inside a value",
        """
`: ` ends a key, so a value that contains it must be in quotes. This happens most often with `Categorical` and with
prose.

```yaml
s': Categorical({0: 1/2, 1: 1/2})      # wrong
s': "Categorical({0: 1/2, 1: 1/2})"    # right
```
""",
    ),
    Code(
        "E105",
        "tab",
        "a tab where YAML needs spaces",
        """
YAML is indented with spaces only. Configure your editor to insert spaces in YAML files.
""",
    ),
    Code(
        "E106",
        "split-by-comma",
        "a value split by a comma or a bracket",
        """
Between `{` and `}`, or `[` and `]`, a comma ends an entry, even inside round brackets, and `[`, `{` begin a new list
or mapping. YAML reads `{x: clip(a, 0, 1)}` as three entries, and `{type: int, doc: keys, boxes and doors}` as one
with a key `boxes and doors`. Put the text in quotes, as the hint shows, or on a line of its own. A comprehension is
quoted with its brackets.

```yaml
dynamics: {x': clip(a, 0, 1)}      # wrong: three entries
dynamics: {x': "clip(a, 0, 1)"}    # right
dynamics:
  x': clip(a, 0, 1)                # right
here: [f(i, 0) for i in range(4)]      # wrong: two texts
here: "[f(i, 0) for i in range(4)]"    # right
```
""",
    ),
    Code(
        "E107",
        "key-without-value",
        "a key without a value between braces",
        """
Between `{` and `}` every entry is `key: value`, with a space after the colon.

```yaml
parameters: {L: {type: int, default:10}}     # wrong: one key, named `default:10`
parameters: {L: {type: int, default: 10}}    # right
```

A single word without a value may also be the rest of a text with a comma: `{doc: keys, boxes}`. Then put the text in
quotes.
""",
    ),
    Code(
        "E108",
        "key-not-text",
        "a key that is not a word, number or expression",
        """
A key is a single piece of text: the name of a section or component, a label, a number, or an expression. It cannot be
empty, a list or a mapping. Write a vector as a key with round brackets, in quotes.

```yaml
rows: {[0, 1]: goal}      # wrong
rows: {"(0, 1)": goal}    # right
```
""",
    ),
    Code(
        "E109",
        "text-after-value",
        "text after the end of a value",
        """
A value that starts with a quote ends with the matching quote, and one that starts with `[` ends
with the matching bracket. Nothing may follow it. Put the whole expression in one pair of quotes.

```yaml
reward: [1, 2][a]      # wrong: the list ends before [a]
reward: "[1, 2][a]"    # right
```
""",
    ),
    Code(
        "E110",
        "indentation",
        "a line that does not line up",
        """
The keys of one mapping, and the dashes of one list, start in the same column. A line that belongs
to the value above it is indented further than that value's key.

```yaml
state:
  s: {type: bool}
   u: {type: bool}    # wrong: one space too many
```
""",
    ),
    Code(
        "E111",
        "not-closed",
        "a bracket or quote that is never closed",
        """
The file, or the block, ends before the bracket or quote that was opened here is closed.

```yaml
s: {type: int, low: 0      # wrong
s: {type: int, low: 0}     # right
```
""",
    ),
    Code(
        "E112",
        "not-yaml",
        "text that YAML cannot read",
        """
The text is not YAML, in a way that no other code describes. The position is where the parser gave up; the mistake is
there or just above. A line without a colon among `key: value` lines is the usual reason.

```yaml
horizon 10     # wrong
horizon: 10    # right
```
""",
    ),
    Code(
        "E113",
        "not-text",
        "bytes or characters that are not text",
        """
A spec is a text file in UTF-8, without control characters. Save the file again as UTF-8, or remove
the character that the message names.
""",
    ),
    Code(
        "E114",
        "too-large",
        "a file that is too large, too deep, or has too large a number",
        """
Limits prevent a damaged or malicious file from exhausting the machine's resources: the size of the file, the number
of its values, the depth of nested values, the digits of a number. They are far above what a readable spec needs.
""",
    ),
    Code(
        "E115",
        "empty",
        "an empty file",
        """
The file has no content, or comments only. The smallest spec has `taskspec: 1`, a name, a state, an
action, initial values, dynamics and a reward.
""",
    ),
    Code(
        "E116",
        "several-documents",
        "more than one YAML document in a file",
        """
A line of three dashes begins a new document. One file holds one task; write related tasks as
`variants`, or as files of their own.
""",
    ),
    Code(
        "E117",
        "backslash",
        "a backslash between double quotes",
        """
Between double quotes a backslash begins an escape: `"\\beta"` is a backspace followed by `eta`.
Write mathematics between single quotes, where a backslash is a backslash.

```yaml
symbol: "\\beta"    # wrong
symbol: '\\beta'    # right
```
""",
    ),
)
