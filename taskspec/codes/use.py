"""E7xx: using tasks and environments from Python or the command line."""

from __future__ import annotations

from taskspec.codes.code import Code

TABLE = (
    Code(
        "E701",
        "unknown-task",
        "a task that does not exist",
        """
There is no registered task and no file of this name. `taskspec list` shows the tasks that exist.

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
        "parameters that cannot be combined",
        """
Each value is allowed, but a condition under `require` does not hold for their combination. The message comes from the
spec.
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
An environment has no state until `reset` is called.

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
A state given to `reset`, `set_state` or a command-line option lacks a component, has an unknown one, or has a value
outside its range.
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
The path exists, but it is a folder, or you have no permission to read it. The message has the reason that the
operating system gives. `extends` only accepts files that end in `.yaml`.
""",
    ),
    Code(
        "E712",
        "no-exact-model",
        "a task without an exact model",
        """
Exact results need a finite state space, finitely many outcomes per step, and a size that is within the limits of
memory and time. The message says which of these fails, and which of the [limits](language.md#limits) to raise if that
helps. Choose smaller parameters, or give the spec an `abstraction`.
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
Scores in a file belong to the task with the content hash that the file has: to its spec and its parameter values.
Compute them again.

```python
taskspec.exact.scores(task).save("scores.json")
```
""",
    ),
    Code(
        "E715",
        "int-too-wide-for-jax",
        "an int that may not fit in JAX's 32 bits",
        """
Without its 64-bit mode, JAX computes with ints of 32 bits, and values above 2147483647 become negative. A task in
which this may happen is rejected; the other backends have 64 bits.

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
The disk is full, you have no permission to write to the folder, or a file that must be new exists. The message has
the reason that the operating system gives. Existing files are unchanged.
""",
    ),
    Code(
        "E717",
        "no-display",
        "a window where there is no display",
        """
`taskspec play` opens a window, but there is no display: a machine without a screen, or a connection without graphics.
A video needs no display.

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
No modifier has this name; `taskspec reference modifiers` lists all of them. A modifier is written as a string or as a
mapping from its name.

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
        "a modifier that does not apply to the task",
        """
The modifier needs something that this task does not have, such as finite actions or a component of that name; the
message says what. Modifiers are applied in order, so one may also make another inapplicable.

```python
taskspec.load("Parabola", modifiers=["relabelled"])    # wrong: the observation has infinitely many values
```
""",
    ),
    Code(
        "E721",
        "not-results",
        "a file without results of this version",
        """
Results are stored in a database that taskspec creates, in a format of one version. This file belongs to another
program, or to another version of taskspec, or entries of it are damaged. It is left unchanged: move it away, and the
results are computed again.

The results of an exam are text, `exam.json`. If a value in it was changed, or is missing, the message gives its place.
""",
    ),
    Code(
        "E722",
        "results-in-use",
        "a file of results that another process is writing to",
        """
Only one run at a time can write to a file of results; any number can read it. Wait until the other run is finished,
or give this one another file. A run that was killed does not block the file.
""",
    ),
    Code(
        "E723",
        "no-cluster",
        "a Dask cluster that does not answer",
        """
No scheduler answers at the address, it has no workers, or it was lost in the middle of a run. Workers need the same
version of taskspec. Finished results are kept, and the same command resumes from there.

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
        "a learner that does not support a task",
        """
Some learners need something that not every task has: an exact model, a horizon, observations that are one number. An
exam leaves the task out, and says so. Your own learner can raise `taskspec.exam.CannotLearn` for this.

```python
def train(case):
    if not isinstance(case.action_space, Discrete):
        raise CannotLearn("actions are not finite")
```
""",
    ),
)
