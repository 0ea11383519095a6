"""Learners with nets, on JAX: all seeds of a block are trained together, in one program."""

from __future__ import annotations

from taskspec.base.extras import need
from taskspec.learn.learners.built_in import PACKAGES

for _package in PACKAGES:
    need(_package, "learners", "a learner")
