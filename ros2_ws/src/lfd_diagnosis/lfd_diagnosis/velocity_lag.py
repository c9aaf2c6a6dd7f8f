"""By how much a radar's relative velocity is later than its clearance."""

import numpy as np

from lfd_mpc.compiled import inner

MOST_LAG = 0.35
"""Seconds by which a radar's relative velocity may be later than its clearance, or earlier."""

PRIOR, MEMORY, PROVEN = 200.0, 6000.0, 5.0
"""Sum of changes of the velocity squared, in m^2/s^2, until which the lag is hardly known; scans
after which what was learnt is forgotten; and seconds in which a drift is found, which would teach a
lag, too."""

VELOCITY_LAG = np.dtype(
    [
        ("time", "f8"),
        ("product", "f8"),
        ("square", "f8"),
        ("proving", "f8", (2, 3)),
        ("proving_since", "f8"),
    ],
    align=True,
)
"""By how many s (`time`) the velocity is learnt to be later than the clearance, as the slope of a
line through zero: sums of `product` and `square` (m^2/s and m^2/s^2).

`proving`: number of scans and both sums, of the last seconds, since `proving_since`, and of the
seconds before these. Neither counts before a drift would have been found.
"""


@inner
def start_lag(lag):
    """Begin with no lag."""
    lag.time, lag.product, lag.square = 0.0, 0.0, PRIOR
    forget_proving(lag)


@inner
def forget_proving(lag):
    """What the last seconds said is not learnt."""
    lag.proving[:, :] = 0.0
    lag.proving_since = np.inf


@inner
def learn_lag(lag, now, change, left):
    """Learn at a time in s from a healthy velocity that changed by so much (m/s) while the
    clearance `left` (m) the path which that makes without any lag."""
    latest, proven = lag.proving[0], lag.proving[1]
    latest[0] += 1.0
    latest[1] += left * change
    latest[2] += change * change
    lag.proving_since = min(lag.proving_since, now)
    if now - lag.proving_since < PROVEN:
        return
    keep = 1.0 - proven[0] / MEMORY
    lag.product = keep * lag.product + proven[1]
    lag.square = keep * (lag.square - PRIOR) + PRIOR + proven[2]
    lag.time = lag.product / lag.square
    lag.time = max(-MOST_LAG, min(MOST_LAG, lag.time))
    proven[:] = latest
    latest[:] = 0.0
    lag.proving_since = now


@inner
def fit_lag(said, off):
    """How well a lag explains what the clearance is `off` (m) a path of velocities `said` (m/s):
    squared error of the best one, and that lag in s."""
    mean_said, mean_off = said.mean(), off.mean()
    product = square = 0.0
    for i in range(len(said)):
        product += (said[i] - mean_said) * (off[i] - mean_off)
        square += (said[i] - mean_said) ** 2
    lag = product / max(square, 1e-9)
    error = 0.0
    for i in range(len(said)):
        error += (off[i] - mean_off - lag * (said[i] - mean_said)) ** 2
    return error, lag
