"""How much an accelerometer is shaken, by bumps, a bad road or brakes."""

from math import sqrt

import numpy as np

from lfd_diagnosis.ring import RING, append, at, start_ring
from lfd_mpc.compiled import inner

NEWEST, FEWEST = 9, 4
"""Samples that tell how much the sensor is shaken just now, and how many it takes."""

STRONG = 2.0
"""m/s^2 by which a sensor may be shaken as long as too few samples tell."""

SWINGING = 0.65
"""m/s^2 of usual roughness from which on a bump swings a sensor's mounting so far that it looks
like a jump."""

SHAKING = np.dtype(
    [("newest", RING), ("deviation", "f8"), ("burst", "f8"), ("bad_road", "?")], align=True
)
"""How an accelerometer is shaken: the `deviation` (m/s^2) of its samples just now, by the `newest`
ones; the `burst` (m^2/s^4), the square of what they lie beside their mean; and whether they are
rougher than usual, as on a `bad_road`."""


@inner
def lose_shaking(shaking):
    """No sample is new enough."""
    start_ring(shaking.newest, NEWEST)
    shaking.deviation, shaking.burst, shaking.bad_road = 0.0, 0.0, False


@inner
def follow_shaking(shaking, value):
    """Take a new sample (m/s^2). The deviation is the median of the steps between the newest ones,
    which a jump among them hardly changes."""
    newest = shaking.newest
    append(newest, value)
    if newest.count < FEWEST:
        shaking.deviation = STRONG
        return
    steps = np.empty(newest.count - 1)
    for i in range(len(steps)):
        steps[i] = abs(at(newest, i + 1) - at(newest, i))
    shaking.deviation = np.median(steps)


@inner
def shaking_left(monitor, time):
    """Deviation (m/s^2) that the shaking leaves in a mean over a `time` (s): the more samples, the
    less."""
    return monitor.shaking.deviation * sqrt(min(monitor.roughness.period / time, 1.0))


@inner
def swings_over_bumps(monitor):
    """Whether a bump swings the sensor so far that it looks like a jump while it lasts."""
    return monitor.roughness.usual > SWINGING**2
