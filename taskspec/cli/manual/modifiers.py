"""The page on modifiers: its table is that of the package."""

from __future__ import annotations

from collections.abc import Iterator

from taskspec.cli.manual.markdown import code, table
from taskspec.modifiers import MODIFIERS, ModifierArgument, ModifierEntry
from taskspec.modifiers.entry import never

_HEAD = """\
# Modifiers

A modifier makes a task harder, or just different, without editing its spec. Each is a function from tasks to tasks, so that
environments, backends, exact models, pages and the content hash all belong to the modified task:

```python
import taskspec
from taskspec.exact import scores

task = taskspec.load("derail/RiskyPath", modifiers=["sticky=0.25", {"delay": 2}])
print(task)
print(scores(task).optimal)
```

```text
<Task derail/RiskyPath-v0 + sticky=0.25 + delay=2>
Return(value=4.0, error=0.0, episodes=0)
```

Modifiers are applied one after the other, and the order matters: a shift before a scale is scaled as well. They are
written

| where | how |
|---|---|
| in Python | `taskspec.load(id, modifiers=["sticky=0.25", "delay=2"])`, and so with `make`, `make_vec`, `gymnasium.make` |
| of a task | `taskspec.modify(task, "sticky=0.25")` |
| on the command line | `taskspec solve RiskyPath -m sticky=0.25 -m delay=2` |
| in ids | `derail/RiskyPath-v0+sticky=0.25+delay=2` |
| in YAML | `modifiers: [{sticky: 0.25}, time_observed, {distractors: {count: 3, kind: uniform}}]` |

The first argument needs no name. Parts of a spec that may no longer hold are dropped: claims and examples with all modifiers
except `absorbing` and `time_observed`, and a written expert where it may no longer be optimal, or does not see what it remembers;
an expert that is `optimal` or `soft(b)` is planned for the modified task. The draws of a modifier come after those of the task,
which are the same as before for each seed. Figures show the task as written.

The tests prove, on the exact models of finite tasks, what each modifier keeps. *Every policy's return* means that of every
function of the original state and the time. *Also from observations* is said of modifiers that keep returns for those who see
observations alone, too: every policy of what was seen and done so far has one that earns the same, and the other way round. So
where observations hide the state, the best return of those who remember is kept. `permuted_actions` with `per_state=true`
keeps it only where no two states look alike: else nobody can know which permutation is the present one.

## The table

"""


def modifiers() -> str:
    """The page, as Markdown."""
    rows = ((code(name), entry.doc, _arguments(entry), _keeps(entry), entry.needs) for name, entry in MODIFIERS.items())
    return _HEAD + table(("modifier", "what it does", "arguments", "what it keeps", "what it needs"), rows) + "\n"


def _arguments(entry: ModifierEntry) -> str:
    return "; ".join(_argument(a) for a in entry.arguments)


def _argument(argument: ModifierArgument) -> str:
    default = "" if argument.default is None else f", {str(argument.default).lower()} unless given"
    return f"{code(argument.name)}: {argument.doc} ({argument.range}{default})"


def _keeps(entry: ModifierEntry) -> str:
    return "".join(_kept(entry)) if entry.keeps != "nothing" else ""


def _kept(entry: ModifierEntry) -> Iterator[str]:
    yield entry.keeps
    if entry.condition:
        yield f", where {entry.condition}"
    if entry.observed is not never:
        yield "; also from observations"
    if entry.observed_condition:
        yield f", where {entry.observed_condition}"
