"""Rates and medians with 95 % confidence intervals."""

from collections.abc import Sequence

import numpy as np
from scipy import stats


def rate(found: int, windows: int) -> tuple[float, float, float]:
    """Share of windows found, and Wilson's limits."""
    interval = stats.binomtest(found, windows).proportion_ci(method="wilson")
    return found / windows, float(interval.low), float(interval.high)


def median(values: Sequence[float]) -> tuple[float, float, float]:
    """Median, and the limits that order statistics give; the extremes where these are too few."""
    ordered = np.sort(values)
    # The rank that is at or below the median in all but 2.5 %, counted from zero.
    low = max(int(stats.binom.ppf(0.025, len(ordered), 0.5)) - 1, 0)
    high = len(ordered) - 1 - low
    return float(np.median(ordered)), float(ordered[min(low, high)]), float(ordered[max(low, high)])
