"""Which of clearance and relative velocity is wrong where they drift apart, and by how much."""

import numpy as np

from lfd_diagnosis.travelled_path import MEAN, row_of
from lfd_diagnosis.velocity_lag import MOST_LAG, fit_lag
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

STEP_SEARCH, STEP_SHARE = 0.3, 0.6
"""Seconds around the onset in which a step of the velocity is looked for, and its least share of
the slope."""

DOUBT = 0.6
"""Ratio of two explanations' errors above which neither is clearly better."""

SHIFT_DOUBT = 0.5
"""Ratio of errors below which it is told that the radar sees another part of the car since."""

CLEAR, PATIENCE, IN_DOUBT = 0.4, 2.2, 2.8
"""The same for line and bend, where the limit is just exceeded; how many times the limit from which
on the better one counts as it is; and the same where a line is better but may be a bend."""

STEEP, WANDERS = 2.0, 0.25
"""How many times the least limit of the relative velocity the slope is at most of a line that may
be a bend, and share of the clearance's noise that its wandering adds to either one's error."""

PLAIN = 2.0
"""Deviations of the clearance's noise that a path may lie off its explanation in the mean, where
that is not far beyond its limit."""

ONSETS = 12
"""Onsets that are tried for a line, and for a bend."""

SHIFT_TIME, SHIFT_POINTS = 0.4, 3
"""Seconds in which a radar goes over to another part of the same car, and scans that are needed
before and after that."""

SUDDEN, SUDDEN_SHARE = 0.8, 0.7
"""Seconds in which no drift goes such a share of the way to its limit."""

DRIFT = np.dtype(
    [("told", "?"), ("of_clearance", "?"), ("kind", "i8"), ("error", "f8"), ("shifted", "?")],
    align=True,
)
"""Who is wrong: the clearance, or else the relative velocity; by how much in its unit. Not `told`
while that is in doubt. `shifted`: nobody is, the radar sees another part of the car."""


@inner
def blame(drift, of_clearance, kind, error):
    """One of the two is wrong by `error`, in its unit."""
    drift.told, drift.of_clearance, drift.kind, drift.error = True, of_clearance, kind, error


@inner
def _newest(path, reach):
    """The last `reach` s of the path: times from now (s, negative), what the clearance is off from
    it (m), steps of the velocity, and the velocity (m/s)."""
    now, skipped = path.then, 0
    while now - path.points[row_of(path, skipped), 0] > reach:
        skipped += 1
    n = path.count - skipped
    times, off, steps, said = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        k = row_of(path, skipped + i)
        times[i] = path.points[k, 0] - now
        off[i], steps[i], said[i] = path.points[k, 1], path.points[k, 2], path.points[k, 3]
    return times, off, steps, said


@inner
def _fit_onset(times, off, power):
    """Best of `base + slope * (t - onset)^power`, and `base` before the onset (s): squared error,
    onset, base, slope. A power of 1 is a line, one of 2 a bend."""
    n = len(times)
    best_error, best_onset, best_base, best_slope = np.inf, 0.0, 0.0, 0.0
    mean_off = off.mean()
    shape = np.empty(n)
    for k in range(ONSETS):
        onset = times[0] + k * (-2.0 * MEAN - times[0]) / (ONSETS - 1)
        mean_shape = 0.0
        for i in range(n):
            shape[i] = max(times[i] - onset, 0.0) ** power
            mean_shape += shape[i] / n
        product = square = 0.0
        for i in range(n):
            centred = shape[i] - mean_shape
            product += centred * off[i]
            square += centred * centred
        slope = product / square
        base = mean_off - slope * mean_shape
        error = 0.0
        for i in range(n):
            error += (base + slope * shape[i] - off[i]) ** 2
        if error < best_error:
            best_error, best_onset, best_base, best_slope = error, onset, base, slope
    return best_error, best_onset, best_base, best_slope


@inner
def _fit_shift(times, off):
    """Best of one level before and another one after: squared error, and how far apart they are.

    What lies between them, `SHIFT_TIME` at most, belongs to neither.
    """
    n = len(times)
    sums, squares = np.zeros(n + 1), np.zeros(n + 1)
    for i in range(n):
        sums[i + 1] = sums[i] + off[i]
        squares[i + 1] = squares[i] + off[i] ** 2
    best_error, best_shift = np.inf, 0.0
    after = 0
    for before in range(SHIFT_POINTS, n - SHIFT_POINTS + 1):
        while after < n and times[after] <= times[before - 1] + SHIFT_TIME:
            after += 1
        after_count = n - after
        if after_count < SHIFT_POINTS:
            after_count = SHIFT_POINTS
        first = n - after_count
        new = (sums[n] - sums[first]) / after_count
        old = sums[before] / before
        error = squares[before] - before * old * old
        error += squares[n] - squares[first] - after_count * new * new
        if error < best_error:
            best_error, best_shift = error, new - old
    return best_error, best_shift


@inner
def _is_sudden(times, off):
    """Whether most of the difference came within the last moment: it may not be over yet."""
    n = len(times)
    before = 0
    while times[before + 1] <= -SUDDEN:
        before += 1
    whole = off[n - 1] - off[:SHIFT_POINTS].mean()
    return abs(off[n - 1] - off[before]) > SUDDEN_SHARE * abs(whole)


@inner
def _was_step(times, steps, onset, slope):
    """Whether the velocity stepped by about that slope (m/s) about when the line begins."""
    for i in range(len(times)):
        near = abs(times[i] - onset) <= STEP_SEARCH
        if near and -np.sign(slope) * steps[i] > STEP_SHARE * abs(slope):
            return True
    return False


@inner
def explain_drift(path, settings, reach, excess, held, noise, drift):
    """Write into `drift` who is wrong, by the last `reach` s of the path.

    A clearance that drifts leaves the path in a straight line, and so it does where the relative
    velocity stepped by less than its own limits; but then the step was seen, or the line begins
    with the path. Where the relative velocity drifts, the clearance leaves the path in a bend. One
    that went over to another level at once lies on another part of the car, unless no car is that
    long.

    `excess`: drift over its limit; `held`: the clearance repeats itself; `noise`: variance of the
    clearance's, in m^2.
    """
    times, off, steps, said = _newest(path, reach)
    n = len(times)
    line_error, line_onset, line_base, line_slope = _fit_onset(times, off, 1)
    bend_error, bend_onset, _, bend_slope = _fit_onset(times, off, 2)
    drift.told = drift.shifted = False
    if held:
        blame(drift, True, Kind.HOLD, off[n - 1] - line_base)
        return
    better, worse = min(line_error, bend_error), max(line_error, bend_error)
    lag_error, lag = fit_lag(said, off)
    wandered = n * WANDERS * noise
    is_late = DOUBT * (lag_error + wandered) <= better + wandered
    if is_late and abs(lag) <= MOST_LAG:
        # One of the two is later than the other: nobody drifts.
        return
    shift_error, shift = _fit_shift(times, off)
    shifted = shift_error < SHIFT_DOUBT * better
    if abs(shift) <= settings.largest_shift and DOUBT * shift_error < better:
        # In doubt the next scans will tell.
        drift.shifted = shifted
        return
    if shifted:
        blame(drift, True, Kind.OFFSET, shift)
        return
    if _is_sudden(times, off):
        return
    # The farther they come apart, the less doubt is left.
    ratio = CLEAR + (1.0 - CLEAR) * (excess - 1.0) / (PATIENCE - 1.0)
    slope, floor = abs(line_slope), settings.relative_velocity_floor
    bends = bend_error < line_error
    # A bend looks much like a steep line beside a clearance that wanders.
    alike = line_error + wandered > DOUBT * (bend_error + wandered)
    may_bend = bends or (floor < slope <= STEEP * floor and alike)
    plain = better <= n * PLAIN * PLAIN * noise and better <= ratio * worse
    told = plain and bends == may_bend
    if not told and excess < (PATIENCE if bends == may_bend else IN_DOUBT):
        return
    # Off from the first scan of a target on: a step that nobody could see. Drifts are slower.
    unseen = line_onset - times[0] <= STEP_SEARCH and slope > floor
    if not bends and (unseen or _was_step(times, steps, line_onset, line_slope)):
        blame(drift, False, Kind.OFFSET, -line_slope)
    elif may_bend:
        blame(drift, False, Kind.RAMP, 2.0 * bend_slope * bend_onset)
    else:
        blame(drift, True, Kind.RAMP, off[n - 1] - line_base)
