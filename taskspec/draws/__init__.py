"""Random draws: counter-based words and the variates made of them, in Python and in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.draws.threefry import POLICY as POLICY
from taskspec.draws.threefry import RESET as RESET
from taskspec.draws.threefry import STEP as STEP
from taskspec.draws.threefry import TEACHER as TEACHER
from taskspec.draws.threefry import block as block
from taskspec.draws.threefry import lane_seeds as lane_seeds
from taskspec.draws.threefry import lanes_ahead as lanes_ahead
from taskspec.draws.threefry import lanes_block as lanes_block
from taskspec.draws.threefry import rows as rows
from taskspec.draws.threefry import words as words
from taskspec.draws.variates import GAMMA_WORDS as GAMMA_WORDS
from taskspec.draws.variates import NEVER as NEVER
from taskspec.draws.variates import bernoulli as bernoulli
from taskspec.draws.variates import bernoullis as bernoullis
from taskspec.draws.variates import categorical as categorical
from taskspec.draws.variates import categoricals as categoricals
from taskspec.draws.variates import dirichlets as dirichlets
from taskspec.draws.variates import exponentials as exponentials
from taskspec.draws.variates import gamma_words as gamma_words
from taskspec.draws.variates import gammas as gammas
from taskspec.draws.variates import index as index
from taskspec.draws.variates import indices as indices
from taskspec.draws.variates import normal_words as normal_words
from taskspec.draws.variates import normals as normals
from taskspec.draws.variates import permutation as permutation
from taskspec.draws.variates import permutations as permutations
from taskspec.draws.variates import poisson_table as poisson_table
from taskspec.draws.variates import poisson_terms as poisson_terms
from taskspec.draws.variates import poisson_words as poisson_words
from taskspec.draws.variates import poissons as poissons
from taskspec.draws.variates import reachable as reachable
from taskspec.draws.variates import row_categoricals as row_categoricals
from taskspec.draws.variates import threshold_table as threshold_table
from taskspec.draws.variates import thresholds as thresholds
from taskspec.draws.variates import uniform as uniform
from taskspec.draws.variates import uniforms as uniforms
from taskspec.draws.variates import weighted_categorical as weighted_categorical
from taskspec.draws.variates import weighted_categoricals as weighted_categoricals

xp: Any = np
"""What entries of `taskspec.lang.variates` compute with; the library for JAX has its own."""
