"""What any sample of a signal is taken for."""

from math import isfinite

import numpy as np

from lfd_mpc.compiled import inner
from lfd_mpc.settings import share_of

SAME_STAMP = 1e-4
"""Seconds below which two stamps are the same."""

LARGEST = 1e4
"""What a signal says at most, in its unit: sensors that say more cannot be farther off."""

POSSIBLE_JERK = 40.0
"""m/s^3 that a car may reach: cars brake hard all of a sudden."""


@inner
def is_new(at, last_at):
    """Whether a sample of time `at` (s) is another one than that of `last_at`."""
    return at > last_at + SAME_STAMP


@inner
def as_measured(value):
    """The value, not larger than anything is measured; NaN stays."""
    return min(max(value, -LARGEST), LARGEST) if isfinite(value) else np.nan


@inner
def beyond(value, limit):
    """By how much a value exceeds a limit, to the side that it is on."""
    return value - max(-limit, min(limit, value))


@inner
def nearest_to_zero(first, second):
    """The one nearer to zero, as what both of them say; 0 where they say the opposite."""
    if first * second <= 0.0:
        return 0.0
    return first if abs(first) < abs(second) else second


filter_share = inner(share_of)
"""`share_of` for compiled functions."""
