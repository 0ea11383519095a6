"""The table of learners, one entry each, and learners of it by name or file, with the settings of a family.

Neither JAX nor SciPy is imported here: an entry names its trainer.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, is_dataclass, replace
from fnmatch import fnmatchcase
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from taskspec.base.diagnostics import Diagnostic, SpecError, spec_error, suggest
from taskspec.base.extras import install, is_installed, missing
from taskspec.base.named import entries_by_name
from taskspec.language.source import Document, read_file
from taskspec.language.source import Path as Place
from taskspec.learn.learners import paper_settings as paper
from taskspec.learn.learners.interface import LearnerCase

PACKAGES = ("jax", "optax")
"""The packages of learners with nets."""


@dataclass(frozen=True)
class Learner:
    """A learner of the package: `learner(case)` gives a policy for each of `case.seeds`, all of them trained together.

    Attributes:
        name: its name in the table.
        family: whose settings it has; those of the table are of the family `paper`.
        settings: a frozen dataclass; families and files change its fields.
        learns_from: what it has to be granted, of "reward", "demonstrations" and "preferences".
        trainer: `module:function`, called with settings and a `LearnerCase`.
        summary: what it is, in a phrase.
    """

    name: str
    family: str
    settings: Any
    learns_from: tuple[str, ...]
    trainer: str
    summary: str = field(repr=False)
    together: ClassVar[bool] = True

    def require_packages(self) -> None:
        """Check that its packages are installed, without importing them.

        Raises:
            SpecError: E705 for the first that is not.
        """
        if ".deep." in self.trainer:
            for package in PACKAGES:
                if not is_installed(package):
                    raise missing(package, install("learners"), "a learner")

    def __call__(self, case: LearnerCase) -> list[Any]:
        """Train.

        Raises:
            SpecError: E705 where JAX or optax are not installed, E713 for tasks that it cannot learn.
        """
        module, _, function = self.trainer.partition(":")
        return getattr(import_module(module), function)(self.settings, case)


_REWARD = ("reward",)
_SHOWN = ("demonstrations",)
_COMPARED = ("preferences",)
_PPO = "taskspec.learn.learners.deep.policy_training:train_ppo"
_BC = "taskspec.learn.learners.deep.bc:train_bc"
_ADVERSARIAL = "taskspec.learn.learners.deep.gail_airl:train_adversarial"
_PREFERENCES = "taskspec.learn.learners.deep.drlhp:train_from_preferences"
_GROUPED = "taskspec.learn.learners.deep.rloo_grpo_dpo:train_grouped"
_DIRECT = "taskspec.learn.learners.deep.rloo_grpo_dpo:train_direct"
_MAXENT = "taskspec.learn.learners.maxent:train_maxent"

BUILT_IN: dict[str, Learner] = entries_by_name((
    Learner("ppo", "paper", paper.Ppo(), _REWARD, _PPO, "proximal policy optimisation on the true reward"),
    Learner("bc", "paper", paper.Cloning(), _SHOWN, _BC, "behavioural cloning"),
    Learner("gail_im", "paper", paper.GAIL_IM, _SHOWN, _ADVERSARIAL, "GAIL with PPO and reward -log(1 - D) >= 0"),
    Learner("gail_sb", "paper", paper.GAIL_SB, _SHOWN, _ADVERSARIAL, "GAIL with TRPO and reward -log(1 - D) >= 0"),
    Learner("gail_fu", "paper", paper.GAIL_FU, _SHOWN, _ADVERSARIAL, "GAIL with TRPO and reward log D <= 0"),
    Learner("airl_im_sa", "paper", paper.AIRL_SA, _SHOWN, _ADVERSARIAL, "AIRL with PPO and a reward of state and action"),
    Learner("airl_im_so", "paper", paper.AIRL_SO, _SHOWN, _ADVERSARIAL, "AIRL with PPO and a reward of the state"),
    Learner("airl_fu", "paper", paper.AIRL_FU, _SHOWN, _ADVERSARIAL, "AIRL with TRPO"),
    Learner("drlhp_sa", "paper", paper.DRLHP_SA, _COMPARED, _PREFERENCES, "DRLHP with PPO and a reward of state and action"),
    Learner("drlhp_so", "paper", paper.DRLHP_SO, _COMPARED, _PREFERENCES, "DRLHP with PPO and a reward of the state"),
    Learner("drlhp_slow", "paper", paper.DRLHP_SLOW, _COMPARED, _PREFERENCES,
          "drlhp_sa with a low learning rate of the policy"),
    Learner("drlhp_eps", "paper", paper.DRLHP_EPS, _COMPARED, _PREFERENCES,
          "drlhp_sa with some random actions in the episodes that are compared"),
    Learner("drlhp_rnd", "paper", paper.DRLHP_RND, _COMPARED, _PREFERENCES,
          "drlhp_sa with a bonus for novelty"),
    Learner("rloo", "paper", paper.RLOO, _REWARD, _GROUPED, "REINFORCE with the mean of the other episodes as baseline"),
    Learner("grpo", "paper", paper.Grouped(), _REWARD, _GROUPED, "policy gradients standardised within groups of episodes"),
    Learner("dpo", "paper", paper.Direct(), _COMPARED, _DIRECT, "direct preference optimisation, without a reward in between"),
    Learner("maxent", "paper", paper.Matching(causal=False), _SHOWN, _MAXENT,
          "maximum-entropy inverse reinforcement learning on the exact model"),
    Learner("mce", "paper", paper.Matching(), _SHOWN, _MAXENT,
          "the causal version, which does not assume that it can choose random outcomes"),
))  # fmt: skip
"""Every learner by its name."""


# -- by name or file ----------------------------------------------------------------------------------------------

FAMILIES = {
    "corrected": "the mistakes of the published code corrected",
    "paper": "the code that the figures of the paper come from",
    "released": "the code as it was published in the end, its mistakes included",
}
"""Families of settings: `paper` in `paper_settings.py`; how the others differ from it, in `corrected_settings.yaml` and so on."""
_FOLDER = Path(__file__).parent
_KEYS = ("learner", "family", "settings")


def learner(source: str | os.PathLike[str], family: str = "corrected") -> Learner:
    """Return a learner by its name, or as a file has it: `learner: gail_im`, and maybe a `family` and `settings`.

    Args:
        source: its name, which may have its family in front, `paper/gail_im`; or a file.
        family: of names without one.

    Returns:
        The learner with its settings; it trains when it is called with a case.

    Raises:
        SpecError: E710, E725 for a name that there is none of; E2xx for mistakes in the file, each with its place.
    """
    name = os.fspath(source)
    before, slash, rest = name.partition("/")
    if slash and before in FAMILIES and rest in BUILT_IN:
        return _in_family(BUILT_IN[rest], before)
    if name in BUILT_IN:
        return _in_family(BUILT_IN[name], family)
    if not name.endswith((".yaml", ".yml")):
        hint = suggest(name, BUILT_IN) or f"there are {', '.join(BUILT_IN)}; a path ends in .yaml"
        raise spec_error("E725", f"there is no learner '{name}'", hint)
    document = read_file(Path(source))
    chosen = _in_family(_named_in(document), document.data.get("family", family))
    if "settings" not in document.data:
        return chosen
    return replace(chosen, settings=changed(chosen.settings, document, ("settings",)))


def _named_in(document: Document) -> Learner:
    data = document.data
    if not isinstance(data, dict) or "learner" not in data:
        raise SpecError([Diagnostic("E203", document.span(()), "a learner's file says which one: `learner: bc`")])
    for key in data:
        if key not in _KEYS:
            hint = suggest(key, _KEYS) or f"it has {', '.join(_KEYS)}"
            raise SpecError([Diagnostic("E202", document.key_span((key,)), f"unknown key `{key}`", hint)])
    for key, known in (("learner", BUILT_IN), ("family", FAMILIES)):
        if key in data and data[key] not in known:
            near = suggest(str(data[key]), tuple(known))
            message = f"{data[key]!r} is not one of {', '.join(known)}"
            raise SpecError([Diagnostic("E206", document.span((key,)), message, near)])
    return BUILT_IN[data["learner"]]


def _in_family(entry: Learner, family: str) -> Learner:
    if family not in FAMILIES:
        hint = suggest(family, FAMILIES) or f"there are {', '.join(FAMILIES)}"
        raise spec_error("E713", f"there is no family '{family}'", hint)
    settings = entry.settings
    if family != "paper":
        document = read_file(_FOLDER / f"{family}_settings.yaml")
        for i, rule in enumerate(document.data):
            if any(fnmatchcase(entry.name, pattern) for pattern in rule["learners"]):
                settings = changed(settings, document, (i, "settings"))
    return replace(entry, family=family, settings=settings)


# -- settings in files, checked against dataclasses ----------------------------------------------------------------

T = TypeVar("T")


def changed(base: T, document: Document, path: Place) -> T:
    """Return settings with those at a path of a document in their place, section by section."""
    data: Any = document.data
    for step in path:
        data = data[step]
    problems: list[Diagnostic] = []
    instance = _changed(base, data, document, path, problems)
    if problems:
        raise SpecError(problems)
    return instance


def _changed(base: Any, data: Any, document: Document, path: Place, problems: list[Diagnostic]) -> Any:
    if not isinstance(data, dict):
        problems.append(Diagnostic("E201", document.span(path), "settings are a mapping: `name: value`"))
        return base
    types = get_type_hints(type(base))
    values: dict[str, Any] = {}
    for name, value in data.items():
        place = (*path, name)
        if name not in types:
            message = f"{type(base).__name__} has no setting '{name}'"
            hint = suggest(name, types) or f"it has {', '.join(types)}"
            problems.append(Diagnostic("E202", document.key_span(place), message, hint))
            continue
        sections = list(filter(is_dataclass, (types[name], *get_args(types[name]))))
        if sections and value is not None:
            present = getattr(base, name) or sections[0]()  # type: ignore[operator]
            values[name] = _changed(present, value, document, place, problems)
            continue
        try:
            values[name] = TypeAdapter(types[name]).validate_json(json.dumps(value), strict=True)
        except ValidationError as error:
            first = error.errors()[0]
            code = "E206" if first["type"] == "literal_error" else "E204"
            problems.append(Diagnostic(code, document.span(place), f"{value!r} does not fit: {first['msg']}"))
    return replace(base, **values)
