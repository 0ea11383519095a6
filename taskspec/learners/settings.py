"""The settings of each learner, and those that a file changes, checked against their dataclasses."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from taskspec.base.diagnostics import Diagnostic, SpecError, suggest
from taskspec.source import Document, Path

# ---------- configurations
# What can be set of each learner. The defaults are those of the algorithms as published.

Activation = Literal["relu", "tanh"]


@dataclass(frozen=True, slots=True)
class Experience:
    """How a policy gathers steps.

    Attributes:
        lanes: environments that are stepped together.
        steps: of each lane in a round.
        whole: rounds are of whole episodes, begun anew; what is left of the last one is dropped.
        absorb: terminal states last until the horizon, so that all episodes are equally long; what is learned of them is told
            apart by a flag. Tasks without a horizon stay as they are.
        where: whose variant the policy acts in, where the roles of a task differ.
        critic_sees_time: the critic knows the time, so that it can tell that nothing follows the end of an episode.
        horizon: of the episodes that are learned in, in place of the task's own.
    """

    lanes: int = 1
    steps: int = 128
    whole: bool = False
    absorb: bool = False
    where: Literal["learner", "expert"] = "learner"
    critic_sees_time: bool = False
    horizon: int | None = None


@dataclass(frozen=True, slots=True)
class Ppo:
    """Proximal policy optimisation; `value_clip` None leaves the critic free."""

    experience: Experience = Experience()
    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 2.5e-4
    epochs: int = 4
    minibatches: int = 4
    discount: float = 0.99
    trace: float = 0.95
    clip: float = 0.2
    value_clip: float | None = 0.2
    entropy: float = 0.01
    value_weight: float = 0.5
    gradient_norm: float = 0.5


@dataclass(frozen=True, slots=True)
class Trpo:
    """Trust-region policy optimisation.

    Attributes:
        kl, accepted_kl: the size of a step, and up to where the line search accepts it.
        strict: accept only what is better; else what is no worse.
        halvings, shrink: of the line search.
        fisher_every: the Fisher matrix is that of every so many samples.
        critic: a net, or ridge regression on what was seen in the last round.
        entropy: added to the standardised advantage of a step, without a gradient: it only sways the line search.
    """

    experience: Experience = Experience(steps=1024)
    hidden: tuple[int, ...] = (64, 64)
    weights: Literal["orthogonal", "xavier"] = "orthogonal"
    discount: float = 0.99
    trace: float = 0.98
    kl: float = 0.01
    accepted_kl: float = 0.015
    strict: bool = False
    halvings: int = 10
    shrink: float = 0.5
    cg_iterations: int = 10
    damping: float = 0.01
    fisher_every: int = 5
    critic: Literal["net", "ridge"] = "net"
    critic_learning_rate: float = 3e-4
    critic_epochs: int = 3
    critic_batch: int = 128
    ridge: float = 1e-5
    entropy: float = 0.0


@dataclass(frozen=True, slots=True)
class Cloning:
    """Behavioural cloning.

    Attributes:
        share: of the episodes that are learned from; the others are left aside.
        updates: how many at least, whatever the number of epochs.
        loss: for real actions, the squared error of the mean (the deviation stays 1), or minus the log-likelihood.
        joint: several finite actions are one softmax over all their values, and each of its targets counts.
    """

    hidden: tuple[int, ...] = (64, 64)
    learning_rate: float = 1e-4
    batch: int = 64
    epochs: int = 10
    share: float = 0.7
    updates: int = 0
    loss: Literal["squared", "likelihood"] = "squared"
    joint: bool = True


@dataclass(frozen=True, slots=True)
class Reward:
    """A net that says how good a step is: theta, and where `shaped`, + discount phi(s') - phi(s).

    Attributes:
        inputs: what theta sees.
        scaled: boxes whose bounds are all finite are scaled to [0, 1].
        standardised: observations by a running mean and deviation of what was seen.
    """

    hidden: tuple[int, ...] = (32, 32)
    activation: Activation = "relu"
    inputs: Literal["state, action", "state"] = "state, action"
    shaped: bool = False
    scaled: bool = False
    standardised: bool = False
    learning_rate: float = 1e-3


@dataclass(frozen=True, slots=True)
class Adversarial:
    """GAIL and AIRL: a discriminator of learner and expert, and a policy that is paid for confusing it.

    With l = log D - log(1 - D), D being how much a step looks like the expert's, pay is `softplus(l)` = -log(1 - D) >= 0,
    `-softplus(-l)` = log D <= 0, `l`, or `f`, what the net says.

    Attributes:
        minus_log_policy: l = f - log pi (AIRL); otherwise l = f.
        deviation_as_variance: a mistake in the density of real actions in log pi.
        updates, batch: gradient steps of the discriminator at a time, on so many steps of each kind; 0 for all there are.
        every: so many rounds of the policy.
        kept: recent steps of the learner that are drawn from; 0 for those of the round alone.
        entropy: the weight of the entropy of D in its loss.
        budget_factor: the steps that are taken, over those that are granted.
    """

    policy: Ppo | Trpo = Ppo()
    reward: Reward = Reward()
    pay: Literal["softplus(l)", "-softplus(-l)", "l", "f"] = "softplus(l)"
    minus_log_policy: bool = False
    deviation_as_variance: bool = False
    updates: int = 2
    batch: int = 25
    every: int = 1
    kept: int = 4000
    entropy: float = 0.0
    budget_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Novelty:
    """Random network distillation: the standardised error of a net that learns what a random one says is added to the reward."""

    weight: float = 0.5
    hidden: tuple[int, ...] = (32, 32, 32)
    outputs: int = 50
    learning_rate: float = 1e-3
    rate: float = 0.01


@dataclass(frozen=True, slots=True)
class Comparing:
    """Deep reinforcement learning from human preferences.

    Attributes:
        episodes: asked about in a round; neighbours are compared.
        random: the probability of a uniform action in these.
        total: the loss is summed over pairs, and ties count nothing; else it is a mean, and ties are halves.
        kept: pairs that are kept to learn from; 0 for those of the round alone.
        updates, batch: gradient steps of a round, on so many pairs; 0 for all there are.
        stale: the first action of a round is taken for what was seen last, though the environment was reset since.
        noise_ties: nobody is preferred on tasks whose observations have noise, as if rewards could not be told from these.
        budget_factor: the steps that are taken, over those that are granted; those asked about come on top.
    """

    policy: Ppo = Ppo(learning_rate=1e-3)
    reward: Reward = Reward(shaped=True, scaled=True)
    episodes: int = 100
    random: float = 0.0
    total: bool = True
    kept: int = 0
    updates: int = 1
    batch: int = 0
    stale: bool = True
    noise_ties: bool = False
    novelty: Novelty | None = None
    budget_factor: float = 1.0


@dataclass(frozen=True, slots=True)
class Matching:
    """Maximum-entropy inverse reinforcement learning on the exact model.

    Attributes:
        causal: a step is worth the expectation over what follows; otherwise the log of the mean exponential, as if one could
            choose how chance falls.
        floor: added to the probabilities of steps before their logarithm is taken; 0 leaves out those that cannot be.
        bias: Adam's correction of its averages; without it they start too small.
        absorb: demonstrations that end early are taken to stay where they ended.
    """

    causal: bool = True
    floor: float = 1e-50
    learning_rate: float = 1e-3
    betas: tuple[float, float] = (0.9, 0.99)
    bias: bool = False
    tolerance: float = 1e-5
    iterations: int = 500_000
    absorb: bool = True


Configuration = Ppo | Cloning | Adversarial | Comparing | Matching


# ---------- settings
# Settings of a learner that a file changes, checked against its dataclasses, each with its place.

T = TypeVar("T")
_KINDS = {bool: "true or false", int: "a whole number", float: "a number", NoneType: "null"}


def changed(base: T, document: Document, path: Path) -> T:
    """A configuration with the settings that stand at a path of a document laid over it, section by section.

    Raises:
        SpecError: with every mistake: E201 for what is no mapping, E202 for an unknown setting, E204 and E206 for its value.
    """
    data: Any = document.data
    for step in path:
        data = data[step]
    problems: list[Diagnostic] = []
    found = _changed(base, data, document, path, problems)
    if problems:
        raise SpecError(problems)
    return found  # type: ignore[no-any-return]


def _changed(base: Any, data: Any, document: Document, path: Path, problems: list[Diagnostic]) -> Any:
    if not isinstance(data, dict):
        problems.append(Diagnostic("E201", document.span(path), "settings are a mapping: `name: value`"))
        return base
    hints, found = _hints(type(base)), {}
    for name, value in data.items():
        place = (*path, name)
        if name not in hints:
            message = f"{type(base).__name__} has no setting '{name}'"
            hint = suggest(name, hints) or f"it has {', '.join(hints)}"
            problems.append(Diagnostic("E202", document.key_span(place), message, hint))
            continue
        now = getattr(base, name)
        section = next((t for t in _options(hints[name]) if is_dataclass(t)), None)
        if section is not None and value is not None:
            found[name] = _changed(now if now is not None else section(), value, document, place, problems)  # type: ignore[operator]
        elif (fitting := list(_fitting(hints[name], value))) != []:
            found[name] = fitting[0]
        else:
            problems.append(_unfit(hints[name], value, document, place))
    return replace(base, **found)


def _unfit(hint: Any, value: Any, document: Document, place: Path) -> Diagnostic:
    words = [repr(word) for option in _options(hint) if get_origin(option) is Literal for word in get_args(option)]
    if words:
        return Diagnostic("E206", document.span(place), f"{value!r} is not one of {', '.join(words)}")
    kinds = [_KINDS.get(option, "a list of numbers") for option in _options(hint)]
    return Diagnostic("E204", document.span(place), f"{value!r} is not {' or '.join(kinds)}")


def _fitting(hint: Any, value: Any) -> Iterator[Any]:
    """The value as one of the types that are allowed."""
    for option in _options(hint):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if get_origin(option) is Literal and value in get_args(option):
            yield value
        elif get_origin(option) is tuple and isinstance(value, list):
            of = get_args(option)
            each = [list(_fitting(of[0], v)) for v in value]
            if all(each) and (of[-1] is Ellipsis or len(of) == len(value)):
                yield tuple(v[0] for v in each)
        elif option is float and number:
            yield float(value)
        elif (option is int and number and isinstance(value, int)) or (option is bool and isinstance(value, bool)):
            yield value
        elif option is NoneType and value is None:
            yield None


def _options(hint: Any) -> tuple[Any, ...]:
    """The types of a union; a single one by itself."""
    return (hint,) if isinstance(hint, type) or get_origin(hint) in (tuple, Literal) else get_args(hint)


def _hints(kind: Any) -> dict[str, Any]:
    hints = get_type_hints(kind)
    return {f.name: hints[f.name] for f in fields(kind)}
