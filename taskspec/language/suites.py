"""The suites that come with the package: their titles, and one line on each."""

from __future__ import annotations

from typing import NamedTuple


class AboutSuite(NamedTuple):
    """A suite in words.

    Attributes:
        title: its heading in a gallery.
        line: at most 60 characters on its tasks, for a list.
    """

    title: str
    line: str


SUITES = {
    "derail": AboutSuite("DERAIL", "diagnostic tasks for reward and imitation learning"),
    "bsuite": AboutSuite("Behaviour suite", "bandits, chains and umbrellas, one question each"),
    "classic_control": AboutSuite("Classic control", "poles, pendulums and cars of Gymnasium"),
    "toy_text": AboutSuite("Gymnasium's toy text", "frozen lake, cliff, taxi and blackjack"),
    "textbook": AboutSuite("Textbook", "examples of Sutton and Barto's book, and bandits"),
    "memory": AboutSuite("Memory", "cards, lights and letters that have to be remembered"),
    "pomdp": AboutSuite("Partially observable", "published POMDPs: tigers, rocks and corridors"),
    "planning": AboutSuite("Planning", "puzzles and board games"),
    "operations": AboutSuite("Operations", "stocks, queues, repairs and offers"),
    "safety": AboutSuite("Safety", "AI safety gridworlds, vases and off-switches"),
    "irl": AboutSuite("What identifies a reward", "demonstrations that do or do not identify a reward"),
    "probes": AboutSuite("Probes", "two to five states on which usual mistakes lose return"),
    "families": AboutSuite("Families", "random tasks to tell two learners apart"),
    "seals": AboutSuite("Cliff worlds and random processes", "the tabular tasks of seals"),
}
"""The suites of the package, in the order in which they are shown."""


CAPABILITIES = {
    "exploration": "Find rewards that random actions hardly ever reach.",
    "credit assignment": "Tell which action earned a reward that comes later, or among noise.",
    "memory": "Act on earlier observations, where the present one does not show enough.",
    "information gathering": "Spend steps on finding out what is hidden, before acting on it.",
    "planning": "Choose among long sequences of actions, where one step alone does not show which is right.",
    "chance": "Weigh outcomes by their probabilities, risks included.",
    "control": "Steer continuous quantities, such as positions and speeds.",
    "value estimation": "Learn values without bias: from rewards of any size, other policies' data, or features.",
    "termination": "Give the end of an episode its right value, whether by the task or by a time limit.",
    "generalisation": "Act well in instances, such as goals and maps, that were not seen before.",
    "distribution shift": "Act well where states or rules differ from those that were learned from.",
    "robustness to noise": "Ignore parts of the observation that mean nothing.",
    "high dimensionality": "Use long vectors of which every number matters.",
    "reward inference": "Work out from demonstrations or preferences what shall be achieved.",
    "safety": "Do what is meant where the reward does not say so.",
}  # fmt: skip
"""Capabilities, each with its definition: what a learner has to do. A word that is not among them goes to `keywords`."""
