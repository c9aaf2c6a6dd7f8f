"""How much later than the accelerometer the speed's derivative is, as manoeuvres show it."""

import numpy as np

from lfd_diagnosis.sample import POSSIBLE_JERK, beyond
from lfd_diagnosis.speed_derivative import JERK_FILTER, JERK_SHARE
from lfd_mpc.compiled import inner

LAG_MEMORY, LAG_PRIOR = 1000, 40.0
"""Samples that the lag is learnt over, and sum of squares of jerks (m^2/s^6) that it takes to move
it from zero."""

LITTLE_JERK = 160.0
"""Sum of squares of jerks (m^2/s^6) below which the accelerometer's slow noise may have made the
lag that is learnt."""

LARGEST_LAG = 0.3
"""Largest lag in s between accelerometer and speed that is learnt."""

LAG_DOUBT = 0.15
"""s by which the lag may differ from what is known of it before any jerk has told it."""

GENTLE = 2.0
"""m/s^3 up to which the accelerometer's jerk may as well be its noise, or a drift."""

SPEED_LAG = np.dtype(
    [
        ("product", "f8"),
        ("square", "f8"),
        ("best_product", "f8"),
        ("best_square", "f8"),
        ("jerk_then", "f8"),
        ("own_jerk", "f8"),
    ],
    align=True,
)
"""How late the speed's derivative is, in s, as the slope of a line through zero: `product` over
`square` (m^2/s^5, m^2/s^6), by the jerk that was felt a moment ago (`jerk_then`, m/s^3).
`best_product` over `best_square`: the same by the speed's own jerk, which smoothing lessens.

`own_jerk` (m/s^3): the accelerometer's jerk just now, as far as a manoeuvre may have made it.
"""


@inner
def start_lag(lag):
    """Begin with no lag."""
    lag.product, lag.square = 0.0, LAG_PRIOR
    lag.best_product, lag.best_square = 0.0, LAG_PRIOR
    forget_felt(lag)


@inner
def forget_felt(lag):
    """What was felt until now tells nothing of what is felt from now on."""
    lag.jerk_then = lag.own_jerk = 0.0


@inner
def lag_of(lag, settings):
    """How much the speed lags behind the accelerometer, and by how much it is smoothed, in s."""
    if not settings.learn_noise:
        return 0.0, 0.0
    late = lag.product / (lag.square + LITTLE_JERK)
    late = max(-LARGEST_LAG, min(LARGEST_LAG, late))
    best = max(-LARGEST_LAG, min(LARGEST_LAG, lag.best_product / lag.best_square))
    return late, max(-JERK_FILTER, min(0.0, best - late))


@inner
def lag_doubt(lag):
    """s by which the lag may differ from what is known of it: the more jerk told it, the less."""
    return LAG_DOUBT * (LAG_PRIOR + LITTLE_JERK) / (lag.square + LITTLE_JERK)


@inner
def follow_own_jerk(lag, jerk, leapt):
    """Take one step's jerk of the accelerometer (m/s^3); while its samples `leapt`, no manoeuvre
    made it."""
    if leapt:
        lag.own_jerk *= 1.0 - JERK_SHARE
    else:
        lag.own_jerk = beyond(jerk, GENTLE)


@inner
def learn_lag(lag, jerk, felt, moved):
    """Learn from one healthy step: the speed's `jerk` (m/s^3), the one that is `felt`, and what the
    accelerometer is ahead by (`moved`, m/s^2).

    The lag is told by what was felt a moment ago: the noise of that is in neither side of it now.
    The derivative's own jerk has the noise in it of what it is to explain, and would call a noisy
    speed early.
    """
    lag.best_product += jerk * moved - lag.best_product / LAG_MEMORY
    lag.best_square += jerk * jerk - (lag.best_square - LAG_PRIOR) / LAG_MEMORY
    then = lag.jerk_then
    lag.jerk_then = felt if abs(felt) <= POSSIBLE_JERK else 0.0
    lag.product += then * moved - lag.product / LAG_MEMORY
    square = lag.square + then * jerk - (lag.square - LAG_PRIOR) / LAG_MEMORY
    lag.square = max(square, LAG_PRIOR)
