"""Whether an abstraction is faithful: proved by looking at every step of it, or tested on episodes of the task.

It is proved where the task can be rewritten over the mapped state (`homomorphism.factor`), or is finite itself, and then
agrees with the stand-in in every state, for every action, in the probability of every outcome. Elsewhere episodes are
compared with it; what rests on such an abstraction is tested, and no more.
"""

from __future__ import annotations

from dataclasses import dataclass

from taskspec.diagnostics import Diagnostic, SpecError
from taskspec.exact.abstraction.abstraction import Abstraction
from taskspec.exact.abstraction.homomorphism.compare import Uncompared, difference
from taskspec.exact.abstraction.homomorphism.factor import Unfactored, factored
from taskspec.exact.abstraction.trials import Simulation, endless_draw
from taskspec.lang.ir import Node, Read, Role
from taskspec.lang.types import Refused
from taskspec.task.task import Component


@dataclass(frozen=True)
class Faith:
    """What is known of an abstraction.

    `problem` says where it differs from the task (None: nowhere that was looked at). Otherwise it is proved where
    `episodes` is 0, and was tested on that many; `expert_episodes` is the same for its expert. `why` says what stood in
    the way of a proof.
    """

    episodes: int = 0
    expert_episodes: int = 0
    why: str = ""
    problem: str | None = None

    @property
    def is_proved(self) -> bool:
        return self.problem is None and not self.episodes


def examined(found: Abstraction, seed: int = 0) -> Faith:
    """Prove an abstraction, or test it."""
    try:
        proof = _proof(found)
    except (Unfactored, Uncompared, Refused) as error:
        return _tested(found, seed, str(error))
    except SpecError as error:
        return _tested(found, seed, error.diagnostics[0].message)
    if proof.problem is not None or not isinstance(found.task.expert, tuple) or not proof.why:
        return proof
    problem, episodes = Simulation(found, seed).experts()
    return Faith(0, episodes, proof.why, problem)


def unfaithful(found: Abstraction, faith: Faith | None = None) -> Diagnostic | None:
    """What is wrong with an abstraction, or None."""
    problem = (faith or examined(found)).problem
    if problem is None:
        return None
    expr = next(iter(found.task.surface.sections["abstraction"].values()))
    return Diagnostic("E604", expr.place.span, f"the abstraction is not faithful: {problem}")


def _proof(found: Abstraction) -> Faith:
    """`why` says why the expert is not part of the proof."""
    if found.task.is_finite:
        task, nodes, has_expert = found.task, found.nodes, isinstance(found.task.expert, tuple)
    else:
        result = factored(found)
        task, has_expert = result.task, result.has_expert
        nodes = tuple(_read(c) for c in task.state)
    wrong = difference(task, nodes, found.stand_in, has_expert and isinstance(found.stand_in.expert, tuple))
    if wrong is not None:
        return Faith(problem=wrong)
    return Faith(why="" if has_expert else "the expert depends on more than the mapped state")


def _read(c: Component) -> Node:
    return Read(Role.STATE, c.name, c.type, c.least, c.most)


def _tested(found: Abstraction, seed: int, why: str) -> Faith:
    endless = endless_draw(found.stand_in)
    if endless is not None:
        return Faith(why=why, problem=endless)
    simulation = Simulation(found, seed)
    problem, episodes = simulation.starts() or simulation.steps()
    if problem is None and isinstance(found.task.expert, tuple):
        problem, _ = simulation.experts()
    return Faith(episodes, episodes, why, problem)
