"""Whether the road bends up or down: then gravity changes what the accelerometer feels.

That is slower than a sensor jumps and faster than it drifts.
"""

import numpy as np

from lfd_diagnosis.acceleration_jump import came_at_once, jump_deviation
from lfd_diagnosis.healthy_signal import RING, append, is_full, mean_of, range_of, start_ring
from lfd_mpc.compiled import inner

EVERY, KEPT, MEAN = 5, 24, 4
"""Steps between two values that are kept, how many are (over 1.2 s), and how many of them a mean is
made of: its newest and its oldest one are a second apart."""

FASTER = 0.6
"""m/s^2 that no drift changes within that second."""

STEADY = 2.5
"""m/s^2 by which the host's acceleration may change meanwhile: a manoeuvre shows every lag, and
looks like a bend."""

FASTEST = 20.0
"""m/s up to which roads bend so sharply."""

ROAD_BEND = np.dtype(
    [("differences", RING), ("derivatives", RING), ("steps", "i8")],
    align=True,
)
"""Lately: differences between accelerometer and speed, and the speed's derivatives, in m/s^2."""


@inner
def start_bend(bend):
    """Begin with nothing."""
    start_ring(bend.differences, KEPT)
    start_ring(bend.derivatives, KEPT)
    bend.steps = 0


@inner
def follow_bend(bend, difference, derivative):
    """Take one step's difference and derivative (m/s^2)."""
    if bend.steps % EVERY == 0:
        append(bend.differences, difference)
        append(bend.derivatives, derivative)
    bend.steps += 1


@inner
def slope_now(bend):
    """The mean of the newest differences (m/s^2)."""
    count = bend.differences.count
    return mean_of(bend.differences, count - MEAN, count)


@inner
def is_bending(bend, jump, speed, steepest):
    """Whether the road bends, at that host speed (m/s), towards no more than the `steepest` slope
    (m/s^2); `jump` tells what comes at once."""
    if speed > FASTEST or not is_full(bend.differences) or abs(slope_now(bend)) > steepest:
        return False
    changed = slope_now(bend) - mean_of(bend.differences, 0, MEAN)
    if abs(changed) < FASTER + jump_deviation(jump) or range_of(bend.derivatives) > STEADY:
        return False
    return not came_at_once(jump, changed)
