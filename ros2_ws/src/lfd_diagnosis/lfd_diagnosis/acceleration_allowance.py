"""How much farther accelerometer and speed may differ while the car jerks or a road shakes it."""

from lfd_diagnosis.acceleration_shaking import shaking_left
from lfd_diagnosis.acceleration_state import felt_jerk
from lfd_diagnosis.host_speed import seldom_heard
from lfd_diagnosis.speed_derivative import jerk_of
from lfd_diagnosis.speed_lag import lag_doubt
from lfd_mpc.compiled import inner

CALM_JERK, LAG_MOST = 4.0, 1.5
"""m/s^3 of jerk up to which it does not matter that the lag is not known, and m/s^2 that the
accelerometer may be ahead by at most."""

SHARP_JERK = 8.0
"""m/s^3 beyond which a jerk widens the limits for a moment after it is over."""

MOST_ALLOWANCE = 6.0
"""m/s^2 by which limits widen at most."""

BURST, SHAKEN_SIGMA = 0.15, 2.0
"""By how much a shaking widens the limits, whichever is more: share of its rms, and deviations of
what it leaves in a filtered acceleration."""


@inner
def jerk_allowance(monitor, settings):
    """By how many m/s^2 a jerk widens the limits."""
    motion = monitor.speed.motion
    jerk = max(abs(jerk_of(motion)), motion.largest_jerk - SHARP_JERK)
    seldom = seldom_heard(monitor.speed)
    allowance = (settings.jerk_allowance + seldom) * jerk
    # A sharp manoeuvre shows every lag that is not known; the accelerometer feels it first.
    doubt = lag_doubt(monitor.lag)
    allowance += doubt * max(jerk - CALM_JERK, 0.0)
    if not monitor.leapt_for:
        lag = settings.jerk_allowance + doubt
        own = felt_jerk(monitor)
        ahead = min(lag * max(abs(own) - CALM_JERK, 0.0), LAG_MOST)
        allowance += max(ahead, seldom * abs(own))
    return allowance


@inner
def _shaken_by(monitor, settings):
    """By how many m/s^2 a shaking widens the limits."""
    averaged = 2.0 * settings.host_speed_filter_time + monitor.roughness.period
    left = SHAKEN_SIGMA * shaking_left(monitor, averaged)
    return max(BURST * monitor.shaking.burst**0.5, left)


@inner
def allowance_of(monitor, settings):
    """By how many m/s^2 a jerk or a shaking widens the limits."""
    return min(jerk_allowance(monitor, settings) + _shaken_by(monitor, settings), MOST_ALLOWANCE)
