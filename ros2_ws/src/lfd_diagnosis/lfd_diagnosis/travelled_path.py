"""Clearance against the path that the relative velocity makes: which of them contradicts?"""

from math import exp

import numpy as np

from lfd_diagnosis.noise import LEARNT_NOISE, deviation, learn_noise, start_noise
from lfd_diagnosis.sample import beyond
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

MEAN = 0.25
"""Seconds at both ends of the window that are averaged."""

AVERAGED = 5.0
"""How many times smaller a clearance's noise is in such an average."""

LEAST_TIME, LEAST_POINTS = 1.0, 10
"""Seconds of path from which on it is judged, and points from which it is explained."""

RATE_TIME, RATE_DOUBT = 1.0, 2.0
"""Seconds over which it is seen how fast the two come apart, and deviations of the clearance's
noise that may be all of it."""

BEYOND_WINDOW = 1.0
"""Seconds by which the path that tells who is wrong reaches back farther than its window."""

LARGEST_GAP = 0.5
"""Seconds without a scan after which the path begins anew."""

ONSETS = 12
"""Onsets that are tried for each explanation."""

STEP_SEARCH, STEP_SHARE = 0.3, 0.6
"""Seconds around the onset in which a step of the velocity is looked for, and its least share."""

DOUBT = 0.6
"""Ratio of two explanations' errors above which neither is clearly better."""

CLEAR, PATIENCE, IN_DOUBT = 0.4, 2.2, 2.8
"""The same for who drifts, where the limit is just exceeded, and limits from which on the better
explanation counts, or what is likelier where a line is better but may be a bend."""

STEEP, WANDERS = 2.0, 0.25
"""How many times its least limit a relative velocity that drifts makes the two come apart at most,
and share of the clearance's noise that its wandering adds to either explanation's error."""

PLAIN = 2.0
"""Deviations of the clearance's noise that a path may lie off its explanation in the mean, where
that is not far beyond its limit."""

SHIFT_TIME, SHIFT_DOUBT, SHIFT_POINTS = 0.4, 0.5, 3
"""Seconds in which a radar goes over to another part of the same car, the ratio of errors below
which that explains a difference, and points that are needed on either side."""

MOST_LATE = 0.35
"""Seconds by which a radar's relative velocity may be later than its clearance, or earlier."""

LATE_TIME, LATE_PRIOR, LATE_MEMORY, LATE_PROVEN = 1.0, 200.0, 6000.0, 5.0
"""Seconds over which a change of the velocity tells how late it is; sum of such changes squared, in
m^2/s^2, until which that is hardly known; scans after which it is forgotten; and seconds in which a
drift is found, which would teach it, too."""

SUDDEN, SUDDEN_SHARE = 0.8, 0.7
"""Seconds in which no drift goes such a share of the way to its limit."""

DRIFT_STEPS = 2.5
"""Steps of the clearance's resolution that a drift may seem to have."""

HEALTHY = 0.6
"""Share of the limit up to which what has passed is learnt as healthy."""

CHOSEN = 0.35
"""Steps of the clearance's resolution that a swap between two parts of a car hides: who chooses the
nearest one chooses the one that just stepped nearer."""

LONGER = 1.4
"""How many times more the two may come apart over two windows than over one."""

LEARNT_OF_IT = 0.92
"""Share of a drift's variance that is learnt: not what goes on to one side for two windows."""

SIGMA = 5.0
"""Learnt standard deviations of the drift that make its limit."""

STEPPED, STEP_DRIFTS = 0.5, 4.0
"""Share of the limit of other drifts, and learnt standard deviations of the drift, from which on
one counts that began as the relative velocity stepped by just as much."""

STEP_LEAST, STEP_SIGMA, STEP_RESOLUTIONS = 0.25, 6.0, 2.0
"""m/s, deviations of its noise, and steps of its resolution of which that is a step."""

BESIDE_STEP = 5
"""Scans on either side of it that tell whether it came at once."""

LINE_TIME, LINE_DOUBT, STRAIGHT = 0.6, 0.3, 0.12
"""Seconds after which such a drift is looked at, share of it by which it may differ, and ratio of
squared errors below which it is a line rather than none."""

POINTS = 4096
"""Scans of a path that are kept at most."""

TRAVELLED_PATH = np.dtype(
    [
        ("noise", LEARNT_NOISE),
        ("points", "f8", (POINTS, 5)),
        ("reach", "f8"),
        ("first", "i8"),
        ("count", "i8"),
        ("then", "f8"),
        ("clearance", "f8"),
        ("velocity", "f8"),
        ("skipped", "f8"),
        ("skipped_time", "f8"),
        ("late", "f8"),
        ("late_product", "f8"),
        ("late_square", "f8"),
        ("proving", "f8", (2, 3)),
        ("proving_since", "f8"),
    ],
    align=True,
)
"""What the clearance is off from the path travelled, over the last seconds.

`points` are time (s), that difference (m), how far the velocity was off from its prediction
(m/s), the velocity (m/s), and the time (s) that was left out until then. `reach`: seconds of path
that tell who is wrong. `skipped`: steps between parts of a car that were left out of the last
window, `skipped_time` the seconds that all of them took. `late`: by how many s the velocity is
learnt to be later than the clearance; `proving` are scans and sums of the last seconds, since
`proving_since`, and of those before, which may be a drift's.
"""

DRIFT = np.dtype(
    [("told", "?"), ("of_clearance", "?"), ("kind", "i8"), ("error", "f8"), ("shifted", "?")],
    align=True,
)
"""Who is wrong: the clearance, or else the relative velocity; by how much in its unit. Not `told`
while that is in doubt. `shifted`: nobody is, the radar sees another part of the car."""


@inner
def start_path(path, learn):
    """Begin with nothing."""
    start_noise(path.noise, 0.15, 0.02, 2.0, learn, 2000)
    path.late, path.late_product, path.late_square = 0.0, 0.0, LATE_PRIOR
    clear_path(path)


@inner
def clear_path(path):
    """The path begins anew at the next scan."""
    path.first = path.count = 0
    path.then = -np.inf
    path.clearance = path.velocity = np.nan
    path.skipped = path.skipped_time = 0.0
    path.proving[:, :] = 0.0
    path.proving_since = np.inf


@inner
def is_explainable(path):
    """Whether the path is long enough to say who is wrong."""
    return path.count >= LEAST_POINTS


@inner
def _point(path, number):
    return (path.first + number) % POINTS


@inner
def path_length(path):
    """Seconds of path that are known."""
    if not path.count:
        return 0.0
    return path.points[_point(path, path.count - 1), 0] - path.points[path.first, 0]


@inner
def path_limit(path, settings, widening, resolution):
    """Drift in m beyond which the two contradict each other, the clearance in such steps."""
    least = max(settings.drift_limit, DRIFT_STEPS * resolution)
    chosen = CHOSEN * resolution * path.skipped
    return widening * max(least, SIGMA * deviation(path.noise)) + chosen


@inner
def wander(path, noise, drifted):
    """Variance in m^2 of what a clearance lies beside the path for a while, beyond its `noise` and
    what it may have `drifted` (m): a radar that sees now this, now that part of the car."""
    variance = path.noise.variance / LEARNT_OF_IT
    return max(0.5 * (variance - drifted * drifted) - noise / AVERAGED, 0.0)


@inner
def _beside(path, time, clearance, velocity):
    """What a scan's clearance is off from the path travelled."""
    travelled = 0.5 * (velocity + path.velocity) * (time - path.then)
    travelled += path.late * (velocity - path.velocity)
    last = path.points[_point(path, path.count - 1), 1]
    return last + clearance - path.clearance - travelled


@inner
def follow_path(path, settings, time, clearance, velocity, step):
    """Take one scan of a time in s; `step`: how far its velocity was off from its prediction, in
    m/s."""
    points = path.points
    if not path.count or time - path.then > LARGEST_GAP:
        clear_path(path)
        off, step = 0.0, 0.0
    else:
        off = _beside(path, time, clearance, velocity)
        path.skipped *= exp(-(time - path.then) / settings.drift_window)
    if path.count == POINTS:
        path.first, path.count = _point(path, 1), path.count - 1
    new = _point(path, path.count)
    points[new, 0], points[new, 1] = time, off
    points[new, 2], points[new, 3], points[new, 4] = step, velocity, path.skipped_time
    path.count += 1
    while time - points[path.first, 0] > 2.0 * settings.drift_window + BEYOND_WINDOW:
        path.first, path.count = _point(path, 1), path.count - 1
    path.then, path.clearance, path.velocity = time, clearance, velocity


@inner
def learn_lateness(path):
    """How much later the velocity is than the clearance, from a healthy path: what the clearance
    leaves it by as the velocity changes."""
    newest, number = _point(path, path.count - 1), path.count - 1
    while number > 0 and path.then - path.points[_point(path, number), 0] < LATE_TIME:
        number -= 1
    then = _point(path, number)
    known = path.then - path.points[then, 0] >= LATE_TIME
    if not known or path.points[newest, 4] != path.points[then, 4]:
        return
    change = path.points[newest, 3] - path.points[then, 3]
    left = path.points[newest, 1] - path.points[then, 1] + path.late * change
    now, proven = path.proving[0], path.proving[1]
    now[0] += 1.0
    now[1] += left * change
    now[2] += change * change
    path.proving_since = min(path.proving_since, path.then)
    if path.then - path.proving_since < LATE_PROVEN:
        return
    keep = 1.0 - proven[0] / LATE_MEMORY
    path.late_product = keep * path.late_product + proven[1]
    path.late_square = keep * (path.late_square - LATE_PRIOR) + LATE_PRIOR + proven[2]
    path.late = path.late_product / path.late_square
    path.late = max(-MOST_LATE, min(MOST_LATE, path.late))
    proven[:] = now
    now[:] = 0.0
    path.proving_since = path.then


@inner
def least_step(noise, resolution):
    """m/s from which on it is a step of a velocity that has such a `noise` and `resolution`."""
    return max(STEP_LEAST, STEP_SIGMA * noise, STEP_RESOLUTIONS * resolution)


@inner
def step_limit(path, limit):
    """m beyond which a drift counts that began as the velocity stepped; the `limit` of others."""
    return max(STEPPED * limit, STEP_DRIFTS * deviation(path.noise))


@inner
def skip_path(path, time, clearance, velocity):
    """The scan to come at a time in s is of another part, or another car: what lies between the two
    is no drift, and the time between them tells nothing."""
    passed = time - path.then
    if passed > LARGEST_GAP:
        clear_path(path)
        return
    path.skipped += 1.0
    path.skipped_time += passed
    for i in range(path.count):
        path.points[_point(path, i), 0] += passed
    path.then, path.clearance, path.velocity = time, clearance, velocity


@inner
def _level(path, start):
    """Mean of what the clearance was beside the path in the moment that begins at a time (s), or
    after the gap that is there."""
    points = path.points
    total, count, begin = 0.0, 0, np.inf
    for i in range(path.count):
        k = _point(path, i)
        if points[k, 0] < start:
            continue
        begin = min(begin, points[k, 0])
        if points[k, 0] > begin + MEAN:
            break
        total += points[k, 1]
        count += 1
    return total / count


@inner
def _moved_on(path, time):
    """Where a time in s lies in the path by now, for what was left out of it since."""
    for i in range(path.count - 1, -1, -1):
        k = _point(path, i)
        left_out = path.skipped_time - path.points[k, 4]
        if path.points[k, 0] - left_out <= time:
            return time + left_out
    return time


@inner
def drift_rate(path, noise, time):
    """How fast the two surely came apart (m/s) in the second before a time in s, the clearance's
    noise having that variance in m^2; 0 where little is known."""
    time = _moved_on(path, time)
    known = time - path.points[path.first, 0] if path.count else 0.0
    known = min(known - MEAN, RATE_TIME)
    if known < MEAN or path.then < time - MEAN:
        return 0.0
    last = _level(path, time - MEAN)
    rate = (last - _level(path, time - MEAN - known)) / known
    doubt = RATE_DOUBT * noise**0.5 / known
    return beyond(rate, doubt)


@inner
def undone_rise(path, jump):
    """How far (m) the clearance has come away from the path travelled, over all of it that is
    known: of what that may be the nearest to what a `jump` (m) undoes; 0 while the path is short.

    What was left out may have gone on just so.
    """
    length, points = path_length(path), path.points
    if length < LEAST_TIME:
        return 0.0
    first, last = path.first, _point(path, path.count - 1)
    rise = _level(path, points[last, 0] - MEAN) - _level(path, points[first, 0])
    whole = rise * (1.0 + (points[last, 4] - points[first, 4]) / length)
    return max(min(rise, whole), min(-jump, max(rise, whole)))


@inner
def path_drift(path, settings, limit):
    """How far the two have come apart over one window in m, or over two less what that may be more;
    0 while the path is short. Sets its `reach`, and learns how far they healthily come apart."""
    length, window = path_length(path), settings.drift_window
    path.reach = window + BEYOND_WINDOW
    if length < LEAST_TIME:
        return 0.0
    now = path.points[_point(path, path.count - 1), 0]
    newest = _level(path, now - MEAN)
    short, long = newest - _level(path, now - window), newest - _level(path, now - 2.0 * window)
    half = min(window, 0.5 * length)
    middle = _level(path, now - half)
    recent, before = newest - middle, middle - _level(path, now - 2.0 * half)
    # What is nearly a contradiction is not learnt as healthy, nor what goes on and on.
    goes_on = recent * before > 0.0 and min(abs(recent), abs(before)) > deviation(path.noise)
    if abs(before) <= HEALTHY * limit and not goes_on:
        learn_noise(path.noise, before, 0.0)
    long /= LONGER
    over_one = abs(short) >= abs(long)
    path.reach = (window if over_one else 2.0 * window) + BEYOND_WINDOW
    return short if over_one else long


@inner
def _fit(times, off, power):
    """Best of `base + slope * (t - onset)^power`: squared error, onset, base, slope."""
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
def _fit_lateness(said, off):
    """Best of a relative velocity that is later than its clearance: squared error, and by how many
    s."""
    mean_said, mean_off = said.mean(), off.mean()
    product = square = 0.0
    for i in range(len(said)):
        product += (said[i] - mean_said) * (off[i] - mean_off)
        square += (said[i] - mean_said) ** 2
    lateness = product / max(square, 1e-9)
    error = 0.0
    for i in range(len(said)):
        error += (off[i] - mean_off - lateness * (said[i] - mean_said)) ** 2
    return error, lateness


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
    """Whether the velocity stepped by that slope as the line begins."""
    for i in range(len(times)):
        near = abs(times[i] - onset) <= STEP_SEARCH
        if near and -np.sign(slope) * steps[i] > STEP_SHARE * abs(slope):
            return True
    return False


@inner
def _newest(path, reach):
    """The last `reach` s of the path: times before now (s), what the clearance is off from it (m),
    steps of the velocity, and the velocity (m/s)."""
    now, skipped = path.then, 0
    while now - path.points[_point(path, skipped), 0] > reach:
        skipped += 1
    n = path.count - skipped
    times, off, steps, said = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    for i in range(n):
        k = _point(path, skipped + i)
        times[i] = path.points[k, 0] - now
        off[i], steps[i], said[i] = path.points[k, 1], path.points[k, 2], path.points[k, 3]
    return times, off, steps, said


@inner
def _tell(drift, of_clearance, kind, error):
    drift.told, drift.of_clearance, drift.kind, drift.error = True, of_clearance, kind, error


@inner
def _largest_step(path, duration):
    """Where in the last `duration` s the velocity was farthest off its prediction."""
    farthest = path.count - 1
    for k in range(path.count - 2, -1, -1):
        i = _point(path, k)
        if path.then - path.points[i, 0] > duration:
            break
        if abs(path.points[i, 2]) > abs(path.points[_point(path, farthest), 2]):
            farthest = k
    return farthest


@inner
def _came_at_once(path, number):
    """The part of the step at that point (m/s) that no lead makes by accelerating: between the
    medians of some scans before and after it, less what the velocity rose by before or rises by
    since."""
    n = BESIDE_STEP
    if number < n or number + n > path.count:
        return 0.0
    said, times = np.empty(2 * n), np.empty(2 * n)
    for k in range(2 * n):
        i = _point(path, number - n + k)
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
    """Whether a line of that rate (m/s) from what the clearance was beside the path `before` (m)
    explains what it has been since that point."""
    line = flat = 0.0
    stepped_at = path.points[_point(path, number), 0]
    for k in range(number, path.count):
        i = _point(path, k)
        off = path.points[i, 1] - before
        line += (off - rate * (path.points[i, 0] - stepped_at)) ** 2
        flat += off * off
    return line < STRAIGHT * flat


@inner
def explain_step(path, settings, limit, least, drift):
    """Whether the velocity has been wrong since it stepped, as the clearance has it that has left
    the path in a straight line since then, just as fast: into `drift`. Returns how far that was, in
    m; 0 where it says nothing. `least`: m/s that are a step."""
    number = _largest_step(path, settings.drift_window)
    stepped_at, by = path.points[_point(path, number), 0], path.points[_point(path, number), 2]
    since = path.then - stepped_at
    if abs(by) < least or since < LINE_TIME:
        return 0.0
    # The level now is that of the middle of the moment that is averaged.
    since -= 0.5 * MEAN
    before = _level(path, stepped_at - MEAN)
    apart = _level(path, path.then - MEAN) - before
    rate = apart / since
    if abs(apart) < limit or abs(rate + by) > LINE_DOUBT * abs(by):
        return 0.0
    step = _came_at_once(path, number)
    if abs(step) < least or step * by < STEP_SHARE * by * by:
        return 0.0
    if not _is_straight(path, number, before, rate):
        return 0.0
    _tell(drift, False, Kind.OFFSET, -rate)
    return apart


@inner
def explain_drift(path, settings, reach, excess, held, noise, drift):
    """Who is wrong, by the last `reach` s of the path: into `drift`.

    A clearance that drifts leaves the path in a straight line; a relative velocity that drifts
    bends it; a step of the velocity, too small for its own limits, leaves a straight line, but
    was seen as a step, or began before the path did. A clearance that went over to another level at
    once is a radar that sees another part of the car, unless no car is that long. `excess`: drift
    over its limit; `held`: the clearance repeats itself; `noise`: variance of the clearance's, in
    m^2.
    """
    times, off, steps, said = _newest(path, reach)
    n = len(times)
    line_error, line_onset, line_base, line_slope = _fit(times, off, 1)
    bend_error, bend_onset, _, bend_slope = _fit(times, off, 2)
    drift.told = drift.shifted = False
    if held:
        _tell(drift, True, Kind.HOLD, off[n - 1] - line_base)
        return
    better, worse = min(line_error, bend_error), max(line_error, bend_error)
    late_error, lateness = _fit_lateness(said, off)
    wandered = n * WANDERS * noise
    is_late = DOUBT * (late_error + wandered) <= better + wandered
    if is_late and abs(lateness) <= MOST_LATE:
        # One of the two is later than the other: nobody drifts.
        return
    shift_error, shift = _fit_shift(times, off)
    shifted = shift_error < SHIFT_DOUBT * better
    if abs(shift) <= settings.largest_shift and DOUBT * shift_error < better:
        # In doubt the next scans will tell.
        drift.shifted = shifted
        return
    if shifted:
        _tell(drift, True, Kind.OFFSET, shift)
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
        _tell(drift, False, Kind.OFFSET, -line_slope)
    elif may_bend:
        _tell(drift, False, Kind.RAMP, 2.0 * bend_slope * bend_onset)
    else:
        _tell(drift, True, Kind.RAMP, off[n - 1] - line_base)
