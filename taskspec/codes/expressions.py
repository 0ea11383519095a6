"""E3xx: what an expression says: its grammar, names, types, shapes and draws."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E301",
        "syntax",
        "text that is not an expression",
        """
Expressions follow Python's grammar for a single expression: balanced brackets, an operand on each
side of an operator, `**` for powers, `and`, `or` and `not` for conditions, `a if c else b` for a
choice.

```yaml
reward: 2(s + 1)       # wrong: a number is not a function
reward: 2*(s + 1)      # right
```
""",
    ),
    Code(
        "E302",
        "unknown-name",
        "a name that is not defined here",
        """
A name in an expression is a parameter, a constant, a definition, a state or action component, a noise, a label of a
choice, `t`, `T`, `pi` or `inf`. Which of them can be used depends on the section: `initial` has no action, and a
constant has no state.

```yaml
dynamics: {s': "paht + a"}    # wrong
dynamics: {s': "path + a"}    # right
```
""",
    ),
    Code(
        "E303",
        "unknown-function",
        "a function that does not exist",
        """
Only the functions of the language reference and those of the spec's own `definitions` can be
called. Methods, attributes and Python's other built-ins are not part of the language.

```yaml
reward: maximum(s, 0)    # wrong
reward: max(s, 0)        # right
```
""",
    ),
    Code(
        "E304",
        "wrong-arguments",
        "a wrong number of arguments",
        """
Each function takes a fixed number of arguments, or a range of numbers. The message says how many
this one takes.

```yaml
s': clip(s + a, 0)       # wrong: clip takes a value, a low end and a high end
s': clip(s + a, 0, 9)    # right
```
""",
    ),
    Code(
        "E305",
        "unknown-keyword",
        "a keyword argument that does not exist",
        """
Functions take their arguments by position. Distributions also take them by name; the message lists
the names that this one knows.

```yaml
s': Normal(mean=s, sigma=1)    # wrong
s': Normal(mean=s, std=1)      # right
```
""",
    ),
    Code(
        "E306",
        "type-mismatch",
        "a value of a type that is not allowed here",
        """
Values are `bool`, `int`, `real`, or a label of a choice. A `bool` counts as 0 or 1 in arithmetic, and an `int` can be
used where a `real` is expected; nothing else is converted automatically. Use `floor`, `ceil` or `round` to turn a
`real` into an `int`.

```yaml
s': s / 2     # wrong when s is an int: / gives a real
s': s // 2    # right
```

A choice takes one of its labels, or an int: the position of a label, from 0, or the value that a label stands for.

```yaml
dir': dir / 2          # wrong when dir is a choice: / gives a real
dir': (dir + 1) % 4    # right
```
""",
    ),
    Code(
        "E307",
        "shape-mismatch",
        "shapes that do not fit together",
        """
Once the parameters are bound, every value has a fixed shape: `()` for a number, `(n,)` for a
vector, `(n, m)` for a matrix. Two shapes fit when they are equal, or when one of them is `()`. A vector
of shape `(0,)` has neither a smallest nor a largest element.

```yaml
dynamics: {pos': "pos + (1, 0, 0)"}    # wrong when pos has two components
dynamics: {pos': "pos + (1, 0)"}       # right
```
""",
    ),
    Code(
        "E308",
        "no-next-value",
        "a prime where there is no next value",
        """
`x'` is the value of `x` after the step. Only state components have one, and it can be read only
where the step has been made: in `reward`, in `terminal`, and in lines of `dynamics`.

```yaml
expert: {a: "s' < L"}    # wrong: the expert acts before the step
expert: {a: "s < L"}     # right
```
""",
    ),
    Code(
        "E309",
        "name-taken",
        "a name that is defined twice, or reserved",
        """
All parameters, constants, definitions, noises, state and action components share one set of names, so that it is
always clear which one is meant. The names of functions and distributions, and `t`, `T`, `pi` and `inf`, are reserved.

```yaml
parameters: {T: {type: int, default: 10}}    # wrong: T is the horizon
parameters: {L: {type: int, default: 10}}    # right
```
""",
    ),
    Code(
        "E310",
        "cycle",
        "definitions that depend on each other",
        """
A definition, a constant, or a primed value may use others, but not itself, directly or through others. The message
lists the cycle.

```yaml
definitions: {f: "g + 1", g: "f - 1"}    # wrong
definitions: {f: "g + 1", g: "s - 1"}    # right
```
""",
    ),
    Code(
        "E311",
        "draw-not-allowed",
        "a random draw where none is allowed",
        """
Draws are allowed in `noise`, `initial`, `dynamics`, `reward`, `terminal`, `observation` and `expert`, and in
`constants` that are drawn once per instance. Definitions, bounds, parameters, claims and the horizon are
deterministic.

```yaml
definitions: {kick: "Normal(0, 1)"}    # wrong: would each use be a new draw?
noise: {kick: "Normal(0, 1)"}          # right: one draw in each step, shared by all uses
```
""",
    ),
    Code(
        "E312",
        "not-constant",
        "a value that must be known before the task runs",
        """
Bounds, shapes, the horizon, the number of items in `Permutation(n)` and the ends of `box` must be
known once the parameters are bound: they may use numbers, parameters and constants only.

```yaml
horizon: 2*s    # wrong: s changes from step to step
horizon: 2*L    # right when L is a parameter
```
""",
    ),
    Code(
        "E313",
        "unknown-label",
        "a label that the choice does not have",
        """
A choice takes the labels in its `values` and no others. They are case-sensitive. Similarly, a table over a component
has rows only for values within its numeric bounds.

```yaml
state: {s: {type: choice, values: [start, goal]}}
terminal: s == gaol    # wrong
terminal: s == goal    # right
```
""",
    ),
    Code(
        "E314",
        "too-costly",
        "a spec that is too expensive",
        """
There are limits on the length and depth of an expression, on its size once sets and comprehensions are written out,
on the size of the state, and on the numbers of variants and claims. The [limits](language.md#limits) are far above
what a readable spec needs, and the message says how to raise the one that was reached; a set that exceeds them is
usually better written as a distribution over each of its coordinates.

```yaml
initial: {x: "Uniform({p for p in box(0, 999, 4)})"}    # wrong: 10^12 points
initial: {x: "UniformInt(0, 999, shape=4)"}             # right: the same distribution
```
""",
    ),
    Code(
        "E315",
        "index-out-of-range",
        "an index outside the vector",
        """
A vector of `n` components has the indices `0` to `n - 1`, and `-n` to `-1` counted from the end. An
index that is known before the task runs must be one of them; one that depends on the state is moved
to the nearest end, `0` where it is negative. A vector without elements has no index at all.

```yaml
reward: x[3]    # wrong when x has three components
reward: x[2]    # right
```
""",
    ),
    Code(
        "E316",
        "unsupported-syntax",
        "Python that is not part of the language",
        """
The language is a small subset of Python's expressions. Attributes, methods, lambdas, `is`, assignment, bitwise
operators and formatted strings are left out on purpose: each spec must compile to every backend and print as
mathematics.

```yaml
reward: x.sum()    # wrong
reward: sum(x)     # right
```
""",
    ),
    Code(
        "E317",
        "no-next-rule",
        "a primed value read before it is known",
        """
A line of `dynamics` may read the next value of another component, as long as that one does not itself need the first,
and an initial value may only read those above it.

```yaml
initial: {x: "y", y: "0"}    # wrong: y comes later
initial: {y: "0", x: "y"}    # right
```
""",
    ),
    Code(
        "E318",
        "int-too-wide",
        "an int that may not fit in 64 bits",
        """
Ints have 64 bits on every backend. The bounds of components and constants tell how large a result can become; one
that may leave the range is rejected, because it would differ between backends. (A state component that is an
unbounded int stays between -2147483647 and 2147483647.)

```yaml
reward: s**20         # wrong when s can be 100
reward: (1.0*s)**20   # right: reals have a larger range
```
""",
    ),
)
