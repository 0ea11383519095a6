"""How fast environments are: ours on each backend, and others beside them. Returns data; prints nothing.

Everything to be compared runs in one process and takes turns, round after round, so that a slow moment of the machine
meets all of them; rates are steps per second, of which medians and spreads are reported. Lanes are out of phase,
episodes that end are reset within the step, and actions are drawn beforehand.
"""

from __future__ import annotations

from taskspec.envs.measure.machine import machine as machine
from taskspec.envs.measure.programs import clock_for as clock_for
from taskspec.envs.measure.programs import jax_device as jax_device
from taskspec.envs.measure.programs import label as label
from taskspec.envs.measure.programs import ours as ours
from taskspec.envs.measure.race import Contestant as Contestant
from taskspec.envs.measure.race import Rate as Rate
from taskspec.envs.measure.race import race as race
from taskspec.envs.measure.race import spread as spread
from taskspec.envs.measure.starts import MemoryUse as MemoryUse
from taskspec.envs.measure.starts import Start as Start
from taskspec.envs.measure.starts import memory as memory
from taskspec.envs.measure.starts import start_times as start_times
from taskspec.envs.measure.tables import PAIRS as PAIRS
from taskspec.envs.measure.tables import STARTS as STARTS
from taskspec.envs.measure.tables import Pair as Pair
from taskspec.envs.measure.tables import games as games
from taskspec.envs.measure.tables import own as own
from taskspec.envs.measure.tables import pair as pair
from taskspec.envs.measure.tables import target_of as target_of
