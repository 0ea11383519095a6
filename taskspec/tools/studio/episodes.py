"""Values and policies over its states, an episode that is played, and episodes of policies, for the studio."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from taskspec.base.arrays import Array
from taskspec.base.diagnostics import SpecError, spec_error
from taskspec.base.display import number, small_fraction
from taskspec.envs import Environment, window
from taskspec.exact.model.extract import lasting
from taskspec.exact.model.model import Model, refuse
from taskspec.exact.policies.policy import greedy
from taskspec.exact.policies.python_files import is_function
from taskspec.exact.scores.returns import Results
from taskspec.exact.solve.backward import Boltzmann, Greedy, Plan, Rule, Uniform, action_values, backward
from taskspec.exact.solve.bounded import Bound, Bounded
from taskspec.exact.solve.infinite_horizon import InfiniteHorizon, chain_values, followed
from taskspec.exact.solve.plans import MaxEnt, tables
from taskspec.exact.solve.solve import visits_by_time
from taskspec.exact.soundness.phases import entries
from taskspec.exact.soundness.places import SectionScope, narrow
from taskspec.language.expressions.types import TIME
from taskspec.language.task.task import Task
from taskspec.show.figures import scene, svg
from taskspec.show.figures.overlays import Overlay
from taskspec.show.figures.shapes import Scene
from taskspec.show.figures.states import reads_of, state_table
from taskspec.show.terminal.rollouts import ENDINGS, action_words, policy_for, rollouts
from taskspec.show.terminal.scripts import is_script
from taskspec.tools.play import legend
from taskspec.tools.studio.folder import Folder

MOST_STATES = 500
MOST_STEPS = 200
"""States of which values are shown, and steps of an episode of which pictures are."""
MOST_PAIRS = 400
"""Pairs of state and action up to which the lines of the spec are looked up that decide about each."""
LARGEST = 10_000
"""The largest denominator of a number that is shown as a fraction."""
ARROWS = {"right": "ArrowRight", "left": "ArrowLeft", "down": "ArrowDown", "up": "ArrowUp"}
"""Names of keys in browsers."""


def keys(task: Task) -> list[dict[str, str]] | None:
    """Return the actions in words, each with the key that it is played with; None for a task that cannot be played so."""
    try:
        pairs = legend(task)
    except SpecError:
        return None
    return [{"name": name, "key": ARROWS.get(key, key)} for key, name in pairs]


# -- values -----------------------------------------------------------------------------------------------------------


def values(results: Results, message: Mapping[str, Any]) -> dict[str, Any]:
    """Return values and policy of a plan at a time, for each state, and a figure of them; no Q-value of an illegal action."""
    model = results.model
    if model is None:
        refuse(f"there is no exact model: {results.why_not}", results.remedy)
    model = lasting(model)
    plan_name = str(message.get("plan", "optimal"))
    rule = _rule(results, plan_name, float(message.get("temperature") or 1.0))
    last = model.horizon - 1 if model.horizon is not None else 0
    t = min(max(int(message.get("time") or 0), 0), last)
    plan = tables(model, rule)
    Q, V = _evaluated(model, plan, t)
    Q = model.among_legal(Q, None)
    pi = plan(t)
    (visits,) = deque(visits_by_time(model, plan, t + 1), maxlen=1)
    shown = np.flatnonzero(model.acting)
    order = shown[np.argsort(-visits[shown], kind="stable")][:MOST_STATES]
    lines = _lines(results.task, model)
    states = []
    for s in sorted(order.tolist()):
        states.append({
            "code": int(model.codes[s]), "label": model.state_name(s), "value": float(V[s]), "visits": float(visits[s]),
            "q": Q[:, s].tolist(), "policy": pi[:, s].tolist(), "lines": sorted(lines[s]),
        })  # fmt: skip
    over = None
    if results.abstraction is None and not results.task.modifiers:
        over = _overlay(model, V, pi, visits, plan_name, t, message.get("layers") or ("values", "policy", "occupancy"))
    return {
        "figure": svg_of(scene(results.task, over)), "plan": plan_name, "time": t, "horizon": model.horizon,
        "actions": [model.action_name(a) for a in range(model.n_actions)], "states": states,
        "more": len(shown) - len(order),
    }  # fmt: skip


def _rule(results: Results, name: str, temperature: float) -> Rule:
    match name:
        case "optimal":
            return Greedy()
        case "soft":
            return Boltzmann(1 / temperature)
        case "maxent":
            return MaxEnt(1 / temperature)
        case "random":
            return Uniform()
        case "expert" if results.expert_rule is not None:
            return results.expert_rule
        case "expert":
            refuse("the expert has no plan: there is none, or it remembers, or it draws from too many outcomes")
    raise spec_error("E713", f"there is no plan '{name}'", "use optimal, soft, maxent, random or expert")


def _evaluated(model: Model, plan: Plan, first: int) -> tuple[Array, Array]:
    """Return Q (A, S) and V (S,) at a time: expected returns of acting by a plan from then on."""
    gamma = model.discount
    shape = (model.n_actions, model.n_states)

    def Q_at(t: int, V: Array) -> Array:  # noqa: N802
        step = model.step(t)
        return action_values(step.P, step.R.reshape(shape), gamma, V)

    if model.horizon is None:
        pi = plan(0)
        step = model.step(0)
        gain = (pi * step.R.reshape(shape)).sum(axis=0)
        V = chain_values(gamma * followed(step.P, pi), gain, InfiniteHorizon(model).live)
        return Q_at(0, V), V
    steps = backward(Q_at, lambda t, Q: (plan(t) * Q).sum(axis=0), np.zeros(shape[1]), model.horizon, first)
    ((_, Q, V),) = deque(steps, maxlen=1)
    return Q, V


def _overlay(model: Model, V: Array, pi: Array, visits: Array, name: str, t: int, layers: Sequence[str]) -> Overlay:
    likeliest = greedy(pi.T) > 0
    most = float(visits.max()) or 1.0
    parts: dict[str, dict[int, Any]] = {"values": {}, "policy": {}, "occupancy": {}}
    for s in np.flatnonzero(model.acting).tolist():
        code = int(model.codes[s])
        parts["values"][code] = float(V[s])
        parts["policy"][code] = tuple(np.flatnonzero(likeliest[s]).tolist())
        parts["occupancy"][code] = float(visits[s]) / most
    legend = {
        "values": ("", f"expected return by the plan {name}, from step {t} on"),
        "policy": ("", f"likeliest actions of the plan {name} at step {t}"),
        "occupancy": (f"up to {number(most, 4)}", f"how likely an episode is there at step {t}"),
    }
    for layer in parts.keys() - set(layers):
        del parts[layer], legend[layer]
    return Overlay(**parts, legend=legend)  # type: ignore[arg-type]


def _lines(task: Task, model: Model) -> list[set[int]]:
    """Return for each state of a model the lines that decide about it: of branches and rows for next state, reward and end."""
    rows: list[set[int]] = [set() for _ in model.codes]
    if model.n_states * model.n_actions > MOST_PAIRS:
        return rows
    written = []
    for section in ("dynamics", "reward", "terminal", "expert"):
        for _, expr in entries(task, section):
            written.append((expr, SectionScope(task, section)))
    for s, a in np.ndindex(model.n_states, model.n_actions):
        reads = model.states.decode(model.codes[s : s + 1]) | model.actions.decode(np.array([a]))
        reads[TIME] = np.zeros(1, np.int64)
        for expr, scope in written:
            span = narrow(expr, scope, reads).place.span
            if span.origin.name == task.source.document.origin.name:
                rows[s].add(span.line)
    return rows


# -- an episode that is played ----------------------------------------------------------------------------------------


def play(results: Results, message: Mapping[str, Any]) -> dict[str, Any]:
    """Return an episode after some actions, a function of the seed and the actions alone; with the regret of each.

    The regret of an action is `gamma**t * (V[t, s] - Q[t, s, a])` of the optimal plan: regrets add up to what the actions lose.
    An illegal action has none.
    """
    task = results.task
    env = Environment(task)
    known = window.actions(task)
    taken = message.get("actions") or []
    observation, info = env.reset(seed=int(message.get("seed") or 0))
    visited = {0: env.state}
    steps: list[dict[str, Any]] = []
    total = 0.0
    ended = None
    for t, action in enumerate(taken):
        if ended is not None or action not in range(len(known)):
            raise spec_error("E713", f"{action} is not an action here, or the episode is over")
        words = action_words(env, known[action])
        observation, reward, terminated, truncated, info = env.step(known[action])
        if terminated or truncated:
            ended = "terminated" if terminated else "truncated"
        total += task.discount**t * reward
        visited[t + 1] = env.state
        about = {"action": words, "reward": reward, "return": total, "regret": None, "regret_text": None}
        steps.append({**about, "state": _words(env.state), "observation": _words(observation)})
    best = None
    for t, q in _optimal(results, visited):
        if t == len(taken):
            best = np.flatnonzero(greedy(q)).tolist()
            continue
        if q[taken[t]] > -np.inf:
            regret = task.discount**t * float(q.max() - q[taken[t]])
            steps[t] |= {"regret": regret, "regret_text": fraction(regret) or number(regret)}
    regrets = [step["regret"] for step in steps]
    lost = None if None in regrets else sum(regrets)
    if ended:
        best = None
    legal = info.get("action_mask", np.ones(len(known), np.bool_))
    return {
        "figure": _frame(task, env.state, visited), "caption": _words(env.state), "time": env.time, "horizon": task.horizon,
        "ended": ended, "return": total, "state": [{"name": k, "value": _words(v)} for k, v in env.state.items()],
        "observation": _words(observation), "legal": legal.astype(bool).tolist(),
        "best": best, "steps": steps, "regret": lost,
    }  # fmt: skip


def _optimal(results: Results, visited: Mapping[int, Mapping[str, Any]]) -> Iterator[tuple[int, Array]]:
    """Yield times with the optimal Q (A,) in the state that was visited then; no times without an exact model."""
    model = results.model
    if model is None:
        return
    at = {t: _index(results, model, state) for t, state in visited.items()}
    if model.horizon is None:
        Q = InfiniteHorizon(model).q_values()
        levels: Iterable[tuple[int, Bound, Any]] = ((t, Q, None) for t in at)
    else:
        levels = Greedy().plan(Bounded(model))
    for t, Q, _ in levels:
        s = at.get(t)
        if s is not None:
            yield t, model.among_legal(Q.value, -np.inf)[:, s]


def _index(results: Results, model: Model, state: Mapping[str, Any]) -> int | None:
    """Return the number of a state of the task in the model, which may be that of its abstraction; None where it has none."""
    values = {name: value for (_, name), value in reads_of(results.task, state).items()}
    if results.abstraction is not None:
        values = dict(results.abstraction.map(values))
    try:
        return int(model.state_indices(values, 1)[0])
    except SpecError:
        return None


def fraction(value: float) -> str | None:
    """Return a number as a short fraction, where it is one up to rounding."""
    exact = small_fraction(value, LARGEST, 1e-12 * max(1.0, abs(value)))
    if exact is None:
        return None
    return str(exact).replace("-", "−")


# -- episodes of policies ---------------------------------------------------------------------------------------------


def rollout(task: Task, message: Mapping[str, Any], folder: Folder) -> dict[str, Any]:
    """Return an episode of a policy as frames, with words for each step."""
    name = str(message.get("policy") or "random")
    path, _, function = name.partition(":")
    if is_function(name):
        name = f"{folder.place(path)}:{function}"
    elif is_script(name):
        name = str(folder.place(name))
    seed = int(message.get("seed") or 0)
    env = Environment(task)
    frames: list[dict[str, Any]] = []
    seen: dict[int, dict[str, Any]] = {}

    def watch(env: Environment, words: str, _: bool) -> None:
        seen[env.time] = env.state
        frames.append({"figure": _frame(task, env.state, seen), "words": words or "start"})

    (episode,) = rollouts(env, policy_for(name, env, seed), seed, 1, MOST_STEPS, watch)
    return {
        "policy": message.get("policy"), "return": episode.total, "length": episode.length, "ended": episode.ending,
        "ending": ENDINGS[episode.ending], "frames": frames,
    }  # fmt: skip


def _frame(task: Task, state: Mapping[str, Any], seen: Mapping[int, Mapping[str, Any]]) -> str:
    drawn = scene(task, Overlay(here=state, seen=seen)) or state_table(task, state)
    return svg(drawn, css=True)


def svg_of(drawn: Scene | None) -> str | None:
    """Return a figure for a page; None where there is none."""
    if drawn is None:
        return None
    return svg(drawn, css=True)


def _words(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name} = {_words(part)}" for name, part in value.items())
    if isinstance(value, np.ndarray):
        return window.array_text(value)
    if isinstance(value, float):
        return number(value, 6)
    return str(value)
