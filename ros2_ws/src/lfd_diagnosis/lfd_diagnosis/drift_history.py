"""Where a radar signal that drifts was lately: whether it has stopped, and how fast it was."""

import numpy as np

from lfd_diagnosis.noise import deviation
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

HISTORY = 4096
"""Residuals of a drift that are kept at most; over long times not every one is."""

SAME, SAME_SIGMA, MOST_OF = 0.6, 4.0, 0.9
"""Share of the least limit, and deviations of the noise, that the residuals of a drift which has
stopped differ by at most, and share of the time asked for over which they must be known."""

DRIFT_HISTORY = np.dtype(
    [("values", "f8", (HISTORY, 2)), ("first", "i8"), ("count", "i8")], align=True
)
"""Times (s) and residuals (in the signal's unit) of a drift: `count` of them, from the number
`first` on, and from the beginning again after the last one."""


@inner
def start_history(history):
    """Begin with nothing."""
    history.first = history.count = 0


@inner
def follow_drift(signal, time, duration):
    """Keep where a drift is at a time in s; what is older than `duration` s goes."""
    if signal.kind != Kind.RAMP:
        return
    values, first, count = signal.history.values, signal.history.first, signal.history.count
    newest = (first + count - 1) % HISTORY
    if not count or time - values[newest, 0] >= 2.0 * duration / HISTORY:
        newest = (first + count) % HISTORY
        values[newest, 0], values[newest, 1] = time, signal.residual
        count += 1
    while values[newest, 0] - values[first, 0] > duration:
        first, count = (first + 1) % HISTORY, count - 1
    signal.history.first, signal.history.count = first, count


@inner
def has_stopped(signal, duration):
    """Whether a drift has not gone on for `duration` s: nothing contradicts anything now."""
    values, first, count = signal.history.values, signal.history.first, signal.history.count
    newest = (first + count - 1) % HISTORY
    if signal.kind != Kind.RAMP or not count:
        return False
    if values[newest, 0] - values[first, 0] <= MOST_OF * duration:
        return False
    lowest, highest = np.inf, -np.inf
    for i in range(count):
        value = values[(first + i) % HISTORY, 1]
        lowest, highest = min(lowest, value), max(highest, value)
    return highest - lowest < SAME * signal.floor + SAME_SIGMA * deviation(signal.noise)


@inner
def drifts_by(signal, duration):
    """How fast a drift went on over the last seconds, in the signal's unit per s; NaN where that is
    not known."""
    values, first, count = signal.history.values, signal.history.first, signal.history.count
    if signal.kind != Kind.RAMP:
        return np.nan
    newest = (first + count - 1) % HISTORY
    time = values[newest, 0]
    k = newest
    while count > 1 and time - values[k, 0] < duration:
        k, count = (k - 1) % HISTORY, count - 1
    since = time - values[k, 0]
    if since < duration:
        return np.nan
    return (values[newest, 1] - values[k, 1]) / since
