"""E7xx: using tasks and environments from Python or the command line."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E701",
        "unknown-task",
        "a task that does not exist",
        """
No registered task, and no file, has this name. `taskspec list` shows the tasks that exist.

```python
taskspec.load("Branchng")     # wrong
taskspec.load("Branching")    # right
```
""",
    ),
    Code(
        "E702",
        "unknown-parameter",
        "a parameter that the task does not have",
        """
Only parameters that the spec declares can be set; the message lists them.

```python
taskspec.load("Branching", length=5)    # wrong
taskspec.load("Branching", L=5)         # right
```
""",
    ),
    Code(
        "E703",
        "parameter-out-of-range",
        "a parameter value that is not allowed",
        """
The value has the wrong type, lies outside the parameter's bounds, or is not one of its values.

```python
taskspec.load("Branching", L=0)    # wrong when L is at least 1
taskspec.load("Branching", L=1)    # right
```
""",
    ),
    Code(
        "E704",
        "requirement-violated",
        "parameters that do not go together",
        """
Each value is allowed alone, but a condition under `require` does not hold for all of them together.
The message is the spec's own.
""",
    ),
    Code(
        "E705",
        "missing-extra",
        "a feature whose packages are not installed",
        """
The feature needs packages that are installed with an extra. The message has the command: in a checkout it is
`pip install -e ".[numba]"` or the like, elsewhere it names the distribution, which is `taskspec-rl`.
""",
    ),
    Code(
        "E706",
        "invalid-action",
        "an action outside the action space",
        """
`step` takes an element of the action space, of the right shape, and finite.

```python
env.step(2)    # wrong when the space is Discrete(2): 0 or 1
```
""",
    ),
    Code(
        "E707",
        "step-before-reset",
        "a step before the first reset",
        """
An environment has no state until `reset` was called.

```python
env = gym.make("derail/Branching-v0")
env.reset(seed=0)    # without it: wrong
env.step(0)
```
""",
    ),
    Code(
        "E708",
        "step-after-end",
        "a step after the end of the episode",
        """
After `terminated` or `truncated` the episode is over. Call `reset` before the next step.
""",
    ),
    Code(
        "E709",
        "invalid-state",
        "a state that the task does not have",
        """
A state given to `reset`, `set_state` or a command line option lacks a component, has one too many,
or holds a value outside its domain.
""",
    ),
    Code(
        "E710",
        "file-not-found",
        "a file that does not exist",
        """
There is no file at this path. Relative paths start at the current folder.
""",
    ),
    Code(
        "E711",
        "file-unreadable",
        "a file that cannot be read",
        """
The path exists, but it is a folder, or it may not be read. The message gives the reason that the
operating system gives. A spec `extends` files that end in `.yaml` only.
""",
    ),
    Code(
        "E712",
        "no-exact-model",
        "a task without an exact model",
        """
Exact results need a finite state space, finitely many outcomes per step, and a size that fits in
memory and in the time that an analysis has. The message says which of them fails, and which of the
[limits](language.md#limits) to raise where that helps. Choose smaller parameters, or give the spec an
`abstraction`.
""",
    ),
    Code(
        "E713",
        "invalid-option",
        "an option that is not one of those allowed",
        """
A keyword of `load`, `make` or a command takes one of a few values, which the message lists.

```python
taskspec.make("Branching", ending="stop")         # wrong
taskspec.make("Branching", ending="terminate")    # right
```
""",
    ),
    Code(
        "E714",
        "stale-scores",
        "scores of another version of a task",
        """
Scores kept in a file belong to the task whose content hash they carry: its spec and its parameter
values. Work them out anew.

```python
taskspec.exact.scores(task).save("scores.json")
```
""",
    ),
    Code(
        "E715",
        "int-too-wide-for-jax",
        "an int that may not fit in the 32 bits that JAX has",
        """
Without its 64-bit mode JAX computes with ints of 32 bits, and what passes 2147483647 becomes negative.
A task in which that may happen is refused there; the other backends have 64 bits.

```python
taskspec.make_vec("Hash", num_envs=8, backend="jax")      # wrong where s' is (s * 31 + a) % 1000000007
taskspec.make_vec("Hash", num_envs=8, backend="numba")    # right
```
""",
    ),
    Code(
        "E716",
        "file-unwritable",
        "a file that cannot be written",
        """
The disk is full, the folder may not be written to, or a file that was to be new exists. The message gives the
reason that the operating system gives. What was there before is as it was.
""",
    ),
    Code(
        "E717",
        "no-display",
        "a window where there is no display",
        """
`taskspec play` opens a window, and there is nowhere to show it: a machine without a screen, or a connection
that does not carry one. A film needs none.

```console
taskspec run Branching --render gif --output branching.gif
```
""",
    ),
    Code(
        "E718",
        "unknown-modifier",
        "a modifier that does not exist",
        """
No modifier has this name; `taskspec reference modifiers` has them all. One is written as a text or as a mapping of its name.

```python
taskspec.load("Branching", modifiers=["stiky=0.25"])    # wrong
taskspec.load("Branching", modifiers=["sticky=0.25"])    # right
taskspec.load("Branching", modifiers=[{"sticky": 0.25}])    # the same
```
""",
    ),
    Code(
        "E719",
        "wrong-modifier-argument",
        "an argument that a modifier does not take",
        """
The modifier has no argument of this name, needs one that is missing, or takes other values. The first argument may be given
without its name.

```python
taskspec.load("Branching", modifiers=["sticky=2"])    # wrong: a probability is at most 1
taskspec.load("Branching", modifiers=["distractors=3,kind=normal"])    # right
```
""",
    ),
    Code(
        "E720",
        "inapplicable-modifier",
        "a modifier that the task cannot be given",
        """
The modifier needs something that this task does not have, such as finite actions or a component of that name; the message
says what. Modifiers are applied in order, so that one may also be in the way of another.

```python
taskspec.load("Parabola", modifiers=["relabelled"])    # wrong: what is observed has infinitely many values
```
""",
    ),
    Code(
        "E721",
        "not-results",
        "a file that holds no results of this version",
        """
Results are kept in a file that taskspec made itself, with tables of one version. The file is another program's, or that of
another version of taskspec. It is left as it is.
""",
    ),
    Code(
        "E722",
        "results-in-use",
        "a file of results that another process is writing to",
        """
One run at a time writes to a file of results; any number may read it. Wait until the other run is done, or give this one
another file. A run that was killed holds nothing back.
""",
    ),
    Code(
        "E723",
        "no-cluster",
        "a Dask cluster that does not answer",
        """
No scheduler answers at the address, it has no workers, or it was lost in the middle of a run. Workers need taskspec and loky
installed, in the same versions. What was done is kept, and the same command goes on from there.

```console
dask scheduler
dask worker tcp://10.0.0.1:8786
taskspec sweep noise.yaml --cluster tcp://10.0.0.1:8786
```
""",
    ),
    Code(
        "E724",
        "cannot-learn",
        "a learner that is not made for a task",
        """
Some learners need something that not every task has: an exact model, a horizon, observations that are one number. An exam leaves
the task out, and says so. A learner of your own raises `taskspec.exam.CannotLearn` to say the same.

```python
def train(case):
    if not isinstance(case.action_space, Discrete):
        raise CannotLearn("actions are not finite")
```
""",
    ),
)
