"""Learners with nets, on JAX: all seeds of a block are trained together, in one program."""

from __future__ import annotations

from taskspec.base.extras import need

need("jax", "learners", "a learner")
need("optax", "learners", "a learner")
