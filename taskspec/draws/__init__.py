"""Random draws: counter-based words and the variates made of them, in Python and in NumPy."""

from __future__ import annotations

from typing import Any

import numpy as np

from taskspec.draws.finite import NEVER as NEVER
from taskspec.draws.finite import POISSON_LIMIT as POISSON_LIMIT
from taskspec.draws.finite import POISSON_SHARE as POISSON_SHARE
from taskspec.draws.finite import categorical as categorical
from taskspec.draws.finite import categoricals as categoricals
from taskspec.draws.finite import index as index
from taskspec.draws.finite import indices as indices
from taskspec.draws.finite import permutation as permutation
from taskspec.draws.finite import permutations as permutations
from taskspec.draws.finite import poisson as poisson
from taskspec.draws.finite import poisson_table as poisson_table
from taskspec.draws.finite import poisson_terms as poisson_terms
from taskspec.draws.finite import poisson_words as poisson_words
from taskspec.draws.finite import poissons as poissons
from taskspec.draws.finite import reachable as reachable
from taskspec.draws.finite import row_categorical as row_categorical
from taskspec.draws.finite import row_categoricals as row_categoricals
from taskspec.draws.finite import threshold_table as threshold_table
from taskspec.draws.finite import thresholds as thresholds
from taskspec.draws.finite import weighted_categorical as weighted_categorical
from taskspec.draws.finite import weighted_categoricals as weighted_categoricals
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
from taskspec.draws.variates import bernoulli as bernoulli
from taskspec.draws.variates import bernoullis as bernoullis
from taskspec.draws.variates import dirichlet as dirichlet
from taskspec.draws.variates import dirichlet_words as dirichlet_words
from taskspec.draws.variates import dirichlets as dirichlets
from taskspec.draws.variates import exponential as exponential
from taskspec.draws.variates import exponentials as exponentials
from taskspec.draws.variates import gamma as gamma
from taskspec.draws.variates import gamma_words as gamma_words
from taskspec.draws.variates import gammas as gammas
from taskspec.draws.variates import normal as normal
from taskspec.draws.variates import normal_words as normal_words
from taskspec.draws.variates import normals as normals
from taskspec.draws.variates import uniform as uniform
from taskspec.draws.variates import uniforms as uniforms

xp: Any = np
"""What entries of `taskspec.lang.variates` compute with; the library for JAX has its own."""
