"""What Gymnasium, RDDL and others call the keys and types of a spec, and how the same is written here."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping

_NAMES: Mapping[str, str] = {
    "terminal": "done terminated termination terminate terminals is_terminal goal end until",
    "horizon": "max_steps max_episode_steps episode_length steps time_limit truncation truncated truncate",
    "discount": "gamma discount_factor",
    "state": "states fluents state_fluents state_space",
    "action": "actions action_fluents action_space",
    "observation": "obs observations observ_fluents observation_space",
    "reward": "rewards utility",
    "dynamics": "transition transitions next step cpfs update",
    "initial": "init init_state initial_state reset start",
    "constants": "non_fluents consts",
    "definitions": "derived derived_fluents intermediate functions let define defines where macros helpers formulas",
    "parameters": "params args arguments",
    "expert": "policy",
    "default": "value initial init",
    "type: real": "float float32 float64 double continuous number",
    "type: int": "integer int32 int64 discrete multidiscrete",
    "type: bool": "boolean binary multibinary",
    "type: choice": "categorical enum str string",
    "type: int, shape: [n]": "list array vector tuple ndarray",
    "type": "dtype kind",
    "high": "max maximum upper ub",
    "low": "min minimum lower lb",
    "low: 0, high: n - 1": "n",
    "shape": "length size len dim dims",
    "values": "options choices labels categories",
    "doc": "desc description comment help",
}
_FORMS: Mapping[str, list[str]] = {
    name: [form for form, names in _NAMES.items() if name in names.split()]
    for name in " ".join(_NAMES.values()).split()
}


def advice(word: str, known: Collection[str]) -> str | None:
    """What to write for a word of others, given the keys that are known here; None where nothing is known of it."""
    forms = _FORMS.get(word.lower().replace("-", "_"), [])
    return next((f"write `{form}`" for form in forms if re.split(r"\W", form)[0] in known), None)
