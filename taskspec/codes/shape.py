"""E2xx: the shape of a spec: its sections, their keys, and what kind of value each takes."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E201",
        "not-a-mapping",
        "a list or a single value where named entries are needed",
        """
The file as a whole, and each section that holds named things, is a mapping: `name: value` lines.

```yaml
state: [s]                               # wrong
state: {s: {type: int, low: 0, high: 9}}    # right
```
""",
    ),
    Code(
        "E202",
        "unknown-key",
        "a key that is not known here",
        """
Every key is checked, so that a typing mistake never silently changes a task. If no known key is similar, the message
lists those that are possible here.

```yaml
s: {type: int, lo: 0}     # wrong
s: {type: int, low: 0}    # right
```
""",
    ),
    Code(
        "E203",
        "missing-key",
        "a required key that is missing",
        """
An entry lacks a required key, such as the `type` of a component or the `default` of a parameter.

```yaml
L: {type: int}                 # wrong: a parameter needs a default
L: {type: int, default: 10}    # right
```
""",
    ),
    Code(
        "E204",
        "wrong-kind",
        "a value of the wrong kind",
        """
Each key takes one kind of value: a number, a text, a truth value (`true`, `false`), a list, named entries, or an
expression. YAML reads `no`, `on` and `yes` as words; only `true` and `false` are truth values.

```yaml
version: one    # wrong
version: 1      # right
```
""",
    ),
    Code(
        "E205",
        "bad-name",
        "a name that cannot be used in expressions",
        """
Names start with a letter and continue with letters, digits and underscores, so that expressions can use them;
Python's keywords (`if`, `in`, `lambda`, ...) are not names. A function is named with its arguments in quotes:
`"p(x)"`. `symbol` sets how a name is printed.

```yaml
state: {max-speed: {type: real}}    # wrong: reads as max minus speed
state: {max_speed: {type: real}}    # right
```
""",
    ),
    Code(
        "E206",
        "not-an-option",
        "a value that is not one of the options",
        """
The key takes one of a few words, which the message lists.

```yaml
s: {type: integer}    # wrong
s: {type: int}        # right
```
""",
    ),
    Code(
        "E207",
        "format-version",
        "a format that this version does not know",
        """
`taskspec: 1` says in which format the file is written. This version of the program reads format 1.
""",
    ),
    Code(
        "E208",
        "bad-table",
        "a decision table that is not complete",
        """
A table has `by`, one expression or a list of several, and `rows`, whose keys are the values of the first expression.
A row holds one cell for everything deeper, or the rows of the next expression. Rows cannot be nested deeper than `by`
is long.

```yaml
reward: {by: [s], rows: [1, 0]}                # wrong: rows have keys
reward: {by: [s], rows: {goal: 1, else: 0}}    # right
```
""",
    ),
    Code(
        "E209",
        "bad-pieces",
        "a value by cases that is not complete",
        """
A value by cases is a list of entries `if` and `then`, tried from above, with one last entry `else`, so that there is
always a value.

```yaml
reward:
  - {if: s == goal, then: 1}
  - {else: 0}                   # without it: wrong
```
""",
    ),
    Code(
        "E210",
        "missing-section",
        "a required section that is missing",
        """
A task has a `state`, an `action`, `initial` values for the state, `dynamics`, a `reward` and a
`horizon`, which may be `none`. A spec may leave some of them to its variants; then each variant must
have them all, its own or those of the variant that it is based on.
""",
    ),
    Code(
        "E211",
        "unknown-variant",
        "a variant that does not exist",
        """
`base` inside a variant, and the entries of `roles`, name variants of the same file.

```yaml
variants:
  easy: {parameters: {L: {default: 5}}}
  hard: {base: esay}    # wrong
```
""",
    ),
    Code(
        "E212",
        "variant-cycle",
        "variants, or specs, that are based on each other",
        """
Following `base` from variant to variant must end at one without a base, which starts from the spec
itself. So must `extends` from file to file, at a spec that extends no other.
""",
    ),
    Code(
        "E213",
        "bad-default",
        "a default that the parameter does not allow",
        """
Like every other value of a parameter, its default must satisfy the type, bounds and values.

```yaml
L: {type: int, default: 0, low: 1}    # wrong
L: {type: int, default: 1, low: 1}    # right
```
""",
    ),
    Code(
        "E214",
        "keys-conflict",
        "keys that cannot be combined",
        """
Bounds belong to numbers, `values` and `symbols` to a choice, and the low end is not above the high
end. An entry of a value by cases has `if` and `then`, or `else` alone.

```yaml
s: {type: bool, low: 0, high: 1}    # wrong: a bool has no bounds
s: {type: bool}                     # right
```
""",
    ),
    Code(
        "E215",
        "no-prime",
        "dynamics for a value without its prime",
        """
`dynamics` says what the *next* value of a component is, so its keys are primed; in `initial`, `state` and `action`
the same names have no prime.

```yaml
dynamics: {s: s + 1}     # wrong
dynamics: {s': s + 1}    # right
```
""",
    ),
    Code(
        "E216",
        "unknown-component",
        "a component that is not declared",
        """
`initial` and `dynamics` are for the components of `state`, and `expert` for those of `action`.

```yaml
state: {s: {type: int}}
initial: {x: 0}    # wrong: no such component
initial: {s: 0}    # right
```
""",
    ),
    Code(
        "E217",
        "missing-initial",
        "a state component without an initial value",
        """
Every component of the state needs a line in `initial`, unless it has only one possible value.

```yaml
state: {s: {type: int}, u: {type: bool}}
initial: {s: 0}              # wrong: u is missing
initial: {s: 0, u: false}    # right
```
""",
    ),
    Code(
        "E218",
        "empty-value",
        "a key with nothing after it",
        """
A key without a value would silently mean nothing. Give it a value or remove the line. Inside
`variants`, an explicit `null` removes what the spec had.

```yaml
terminal:              # wrong
terminal: s == goal    # right
```
""",
    ),
    Code(
        "E219",
        "nothing-to-change",
        "a variant that changes or removes something that does not exist",
        """
An entry of a variant that has no `type`, or that is `null`, changes or removes the entry of the same name in the spec
or variant that it is based on. Here there is no entry of that name, most often because of a typing mistake.

```yaml
parameters: {length: {type: int, default: 5}}
variants:
  long: {parameters: {lenght: {default: 9}}}    # wrong
  short: {parameters: {length: {default: 2}}}   # right
```

A claim to drop, `claims: {drop: [...]}`, is written exactly as it is there.
""",
    ),
)
