"""How far the clearance has left the path that the relative velocity makes, over some seconds."""

from math import exp

import numpy as np

from lfd_diagnosis.noise import LEARNT_NOISE, deviation, learn_noise, start_noise
from lfd_diagnosis.sample import beyond
from lfd_diagnosis.velocity_lag import VELOCITY_LAG, forget_proving, learn_lag, start_lag
from lfd_mpc.compiled import inner

MEAN = 0.25
"""Seconds at both ends of the window that are averaged."""

AVERAGED = 5.0
"""How many times smaller the variance of a clearance's noise is in such an average."""

LEAST_TIME, LEAST_POINTS = 1.0, 10
"""Seconds of path from which on it is judged, and scans from which on it is explained."""

RATE_TIME, RATE_DOUBT = 1.0, 2.0
"""Seconds over which it is seen how fast the two come apart, and deviations of the clearance's
noise that may be all of it."""

BEYOND_WINDOW = 1.0
"""Seconds by which the path that tells who is wrong reaches back farther than its window."""

LARGEST_GAP = 0.5
"""Seconds without a scan after which the path begins anew."""

LAG_TIME = 1.0
"""Seconds over which a change of the velocity tells how late it is."""

DRIFT_STEPS = 2.5
"""Steps of the clearance's resolution by which it may seem to drift."""

HEALTHY = 0.6
"""Share of the limit up to which a drift is learnt as healthy."""

CHOSEN = 0.35
"""Steps of the clearance's resolution that each swap between two targets of one car adds to its
drift: what takes the nearest one takes the one that just stepped nearer."""

LONGER = 1.4
"""How many times more the two may come apart over two windows than over one."""

LEARNT_OF_IT = 0.92
"""Share of a healthy drift's variance that is learnt: what goes on to one side for two windows is
left out."""

SIGMA = 5.0
"""Learnt standard deviations of the drift that make its limit."""

POINTS = 4096
"""Scans of a path that are kept at most."""

NOISE, NOISE_MEMORY = (0.15, 0.02, 2.0), 2000
"""How far a healthy clearance leaves the path within a window: deviations in m at first, at least,
and at most; and scans that they are learnt from."""

TRAVELLED_PATH = np.dtype(
    [
        ("noise", LEARNT_NOISE),
        ("points", "f8", (POINTS, 5)),
        ("first", "i8"),
        ("count", "i8"),
        ("reach", "f8"),
        ("then", "f8"),
        ("clearance", "f8"),
        ("velocity", "f8"),
        ("skipped", "f8"),
        ("skipped_time", "f8"),
        ("lag", VELOCITY_LAG),
    ],
    align=True,
)
"""What the clearance is off from the path travelled, over the last seconds; m, m/s and s.

`noise` is how far the two healthily come apart within a window. `points` are a ring of `count`
scans from row `first` on: time, that difference, how far the velocity was off from its prediction,
the velocity, and the time that was left out until then. `then`, `clearance` and `velocity` are the
newest scan's. `reach`: seconds of path that tell who is wrong. `skipped`: steps between parts of a
car that were left out of the last window, `skipped_time` the seconds that all of them took. `lag`:
by how much the velocity is later than the clearance.
"""


@inner
def start_path(path, learn):
    """Begin with nothing."""
    start_noise(path.noise, NOISE, learn, NOISE_MEMORY)
    start_lag(path.lag)
    clear_path(path)


@inner
def clear_path(path):
    """Forget the path: it begins anew at the next scan."""
    path.first = path.count = 0
    path.then = -np.inf
    path.clearance = path.velocity = np.nan
    path.skipped = path.skipped_time = 0.0
    forget_proving(path.lag)


@inner
def row_of(path, number):
    """The row of `points` with the scan of that number, 0 = oldest."""
    return (path.first + number) % POINTS


@inner
def path_length(path):
    """Seconds of path that are known."""
    if not path.count:
        return 0.0
    return path.points[row_of(path, path.count - 1), 0] - path.points[path.first, 0]


@inner
def is_explainable(path):
    """Whether the path is long enough to say who is wrong."""
    return path.count >= LEAST_POINTS


@inner
def _beside(path, time, clearance, velocity):
    """What the clearance of a scan to come is off from the path travelled (m)."""
    travelled = 0.5 * (velocity + path.velocity) * (time - path.then)
    travelled += path.lag.time * (velocity - path.velocity)
    last = path.points[row_of(path, path.count - 1), 1]
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
        path.first, path.count = row_of(path, 1), path.count - 1
    new = row_of(path, path.count)
    points[new, 0], points[new, 1] = time, off
    points[new, 2], points[new, 3], points[new, 4] = step, velocity, path.skipped_time
    path.count += 1
    while time - points[path.first, 0] > 2.0 * settings.drift_window + BEYOND_WINDOW:
        path.first, path.count = row_of(path, 1), path.count - 1
    path.then, path.clearance, path.velocity = time, clearance, velocity


@inner
def skip_path(path, time, clearance, velocity):
    """Go on from a scan of a time in s that is of another part, or another car: the step to it is
    no drift, and the time since the last one is left out."""
    passed = time - path.then
    if passed > LARGEST_GAP:
        clear_path(path)
        return
    path.skipped += 1.0
    path.skipped_time += passed
    for i in range(path.count):
        path.points[row_of(path, i), 0] += passed
    path.then, path.clearance, path.velocity = time, clearance, velocity


@inner
def learn_lateness(path):
    """Learn from a healthy path by how much the velocity is later than the clearance: what this
    leaves the path by as the velocity changes."""
    newest, number = row_of(path, path.count - 1), path.count - 1
    while number > 0 and path.then - path.points[row_of(path, number), 0] < LAG_TIME:
        number -= 1
    then = row_of(path, number)
    known = path.then - path.points[then, 0] >= LAG_TIME
    if not known or path.points[newest, 4] != path.points[then, 4]:
        return
    change = path.points[newest, 3] - path.points[then, 3]
    left = path.points[newest, 1] - path.points[then, 1] + path.lag.time * change
    learn_lag(path.lag, path.then, change, left)


@inner
def level_from(path, start):
    """Mean of what the clearance was beside the path (m) over the moment that begins at a time (s),
    or with the first scan after that."""
    points = path.points
    total, count, begin = 0.0, 0, np.inf
    for i in range(path.count):
        k = row_of(path, i)
        if points[k, 0] < start:
            continue
        begin = min(begin, points[k, 0])
        if points[k, 0] > begin + MEAN:
            break
        total += points[k, 1]
        count += 1
    return total / count


@inner
def path_limit(path, settings, widening, resolution):
    """Drift in m beyond which the two contradict each other: farther while the noise is learnt
    (`widening` times), and where the clearance has a coarse `resolution` (m)."""
    least = max(settings.drift_limit, DRIFT_STEPS * resolution)
    chosen = CHOSEN * resolution * path.skipped
    return widening * max(least, SIGMA * deviation(path.noise)) + chosen


@inner
def path_drift(path, settings, limit):
    """How far (m) the two have come apart over one window, or over two in the measure of one, where
    that is farther; 0 while the path is short. Sets its `reach`, and learns how far they healthily
    come apart."""
    length, window = path_length(path), settings.drift_window
    path.reach = window + BEYOND_WINDOW
    if length < LEAST_TIME:
        return 0.0
    now = path.points[row_of(path, path.count - 1), 0]
    newest = level_from(path, now - MEAN)
    short, long = (
        newest - level_from(path, now - window),
        newest - level_from(path, now - 2.0 * window),
    )
    half = min(window, 0.5 * length)
    middle = level_from(path, now - half)
    recent, before = newest - middle, middle - level_from(path, now - 2.0 * half)
    # What is nearly a contradiction is not learnt as healthy, nor what goes on and on.
    goes_on = recent * before > 0.0 and min(abs(recent), abs(before)) > deviation(path.noise)
    if abs(before) <= HEALTHY * limit and not goes_on:
        learn_noise(path.noise, before, 0.0)
    long /= LONGER
    over_one = abs(short) >= abs(long)
    path.reach = (window if over_one else 2.0 * window) + BEYOND_WINDOW
    return short if over_one else long


@inner
def wander(path, noise, drifted):
    """Variance in m^2 of what a clearance lies beside the path for a while, beyond its `noise` and
    what it may have `drifted` (m): a radar that sees now this, now that part of the car."""
    variance = path.noise.variance / LEARNT_OF_IT
    return max(0.5 * (variance - drifted * drifted) - noise / AVERAGED, 0.0)


@inner
def _moved_on(path, time):
    """Where a time in s lies in the path by now: what was left out since has moved it on."""
    for i in range(path.count - 1, -1, -1):
        k = row_of(path, i)
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
    last = level_from(path, time - MEAN)
    rate = (last - level_from(path, time - MEAN - known)) / known
    doubt = RATE_DOUBT * noise**0.5 / known
    return beyond(rate, doubt)


@inner
def undone_rise(path, jump):
    """How far (m) the clearance has left the path travelled over all of it that is known, as a
    `jump` (m) may undo it; 0 while the path is short.

    In the time that was left out, the clearance may have stayed beside the path, or gone on leaving
    it just so: of all between, this is the nearest to what the jump undoes.
    """
    length, points = path_length(path), path.points
    if length < LEAST_TIME:
        return 0.0
    first, last = path.first, row_of(path, path.count - 1)
    rise = level_from(path, points[last, 0] - MEAN) - level_from(path, points[first, 0])
    whole = rise * (1.0 + (points[last, 4] - points[first, 4]) / length)
    return max(min(rise, whole), min(-jump, max(rise, whole)))
