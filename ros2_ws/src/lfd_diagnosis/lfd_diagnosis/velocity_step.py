"""Whether a small step of the relative velocity was a fault, by how the clearance left its path."""

import numpy as np

from lfd_diagnosis.drift_explanation import STEP_SHARE, blame
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.travelled_path import MEAN, level_from, row_of
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

STEPPED, STEP_DRIFTS = 0.5, 4.0
"""Share of the limit of other drifts, and learnt standard deviations of the drift, the larger of
both, from which on one counts that began as the relative velocity stepped by just as much."""

STEP_LEAST, STEP_SIGMA, STEP_RESOLUTIONS = 0.25, 6.0, 2.0
"""m/s, deviations of the relative velocity's noise, and steps of its resolution, the largest of
them, from which on it has stepped rather than wavered."""

BESIDE_STEP = 5
"""Scans before and after a step that tell whether it came at once."""

LINE_TIME, LINE_DOUBT, STRAIGHT = 0.6, 0.3, 0.12
"""Seconds after which such a drift is looked at, share of it by which it may differ, and ratio of
squared errors below which it is a line rather than none."""


@inner
def least_step(noise, resolution):
    """m/s from which on a velocity of such a `noise` and `resolution` has stepped."""
    return max(STEP_LEAST, STEP_SIGMA * noise, STEP_RESOLUTIONS * resolution)


@inner
def step_limit(path, limit):
    """m beyond which a drift counts that began as the velocity stepped; the `limit` of others."""
    return max(STEPPED * limit, STEP_DRIFTS * deviation(path.noise))


@inner
def _largest_step(path, duration):
    """Which scan of the last `duration` s had the velocity that was farthest off its prediction."""
    farthest = path.count - 1
    for k in range(path.count - 2, -1, -1):
        i = row_of(path, k)
        if path.then - path.points[i, 0] > duration:
            break
        if abs(path.points[i, 2]) > abs(path.points[row_of(path, farthest), 2]):
            farthest = k
    return farthest


@inner
def _came_at_once(path, number):
    """The part of the step at that scan (m/s) that no lead makes by accelerating: the difference of
    the medians of some scans before and after it, less what the velocity would have changed by if
    it had gone on as it did before, or does since."""
    n = BESIDE_STEP
    if number < n or number + n > path.count:
        return 0.0
    said, times = np.empty(2 * n), np.empty(2 * n)
    for k in range(2 * n):
        i = row_of(path, number - n + k)
        said[k], times[k] = path.points[i, 3], path.points[i, 0]
    passed_before, passed_after = times[n - 1] - times[0], times[2 * n - 1] - times[n]
    if min(passed_before, passed_after) <= 0.0:
        # In what was left out of the path the lead may have accelerated as it liked.
        return 0.0
    before = (said[n - 1] - said[0]) / passed_before
    after = (said[2 * n - 1] - said[n]) / passed_after
    change = np.median(said[n:]) - np.median(said[:n])
    # In doubt the lead accelerates.
    gap = times[n + n // 2] - times[n // 2]
    least = change - gap * max(before, after, 0.0)
    most = change - gap * min(before, after, 0.0)
    if least * most <= 0.0:
        return 0.0
    return least if abs(least) < abs(most) else most


@inner
def _is_straight(path, number, before, rate):
    """Whether the clearance has left the path in a line of that `rate` (m/s) since that scan, from
    what it lay beside it `before` (m)."""
    line = flat = 0.0
    stepped_at = path.points[row_of(path, number), 0]
    for k in range(number, path.count):
        i = row_of(path, k)
        off = path.points[i, 1] - before
        line += (off - rate * (path.points[i, 0] - stepped_at)) ** 2
        flat += off * off
    return line < STRAIGHT * flat


@inner
def explain_step(path, settings, limit, least, drift):
    """Whether the velocity has been wrong since it stepped: the clearance has left the path in a
    straight line since then, just as fast. By how much is written into `drift`.

    Returns how far (m) the clearance has left; 0 where that says nothing. `limit`: m from which on
    it does; `least`: m/s that are a step.
    """
    number = _largest_step(path, settings.drift_window)
    stepped_at, by = path.points[row_of(path, number), 0], path.points[row_of(path, number), 2]
    since = path.then - stepped_at
    if abs(by) < least or since < LINE_TIME:
        return 0.0
    # The level now is that of the middle of the moment that is averaged.
    since -= 0.5 * MEAN
    before = level_from(path, stepped_at - MEAN)
    apart = level_from(path, path.then - MEAN) - before
    rate = apart / since
    if abs(apart) < limit or abs(rate + by) > LINE_DOUBT * abs(by):
        return 0.0
    step = _came_at_once(path, number)
    if abs(step) < least or step * by < STEP_SHARE * by * by:
        return 0.0
    if not _is_straight(path, number, before, rate):
        return 0.0
    blame(drift, False, Kind.OFFSET, -rate)
    return apart
