"""Random words, as strategies and as those of one step."""

import numpy as np
from hypothesis import strategies as st

from taskspec.language import draws

TOP = 2**32 - 1
EDGES = (0, 1, 255, 256, 2**31 - 1, 2**31, 2**31 + 1, TOP - 1, TOP)

word = st.integers(0, TOP) | st.sampled_from(EDGES)
seeds = st.integers(0, 2**64 - 1) | st.sampled_from([0, TOP, 2**32, 2**63, 2**64 - 1])
phases = st.sampled_from([draws.STEP, draws.RESET])
counters = st.integers(0, TOP) | st.sampled_from([0, TOP - 1, TOP])
probabilities = st.lists(st.integers(0, 5), min_size=1, max_size=15).filter(any)
positive = st.floats(2**-20, 1e4, width=32)


def stream(count: int, lanes: int, seed: int = 20_240_229) -> draws.Words:
    """uint32 (count, lanes): the words of one step of many lanes."""
    return draws.lanes_block(draws.lane_seeds(seed, lanes), draws.STEP, 0, count)


def lists_of(size: int) -> st.SearchStrategy[list[int]]:
    return st.lists(word, min_size=size, max_size=size)


def column(words: list[int]) -> draws.Words:
    return np.array(words, np.uint32)[:, None]
