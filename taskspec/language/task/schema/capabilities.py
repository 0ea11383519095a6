"""The capabilities of learners that tasks isolate: a closed list, so that tasks of different suites can be found together."""

from __future__ import annotations

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
