"""The host's accelerometer against the derivative of its speed: whether it is healthy.

Both go through the same filter; their difference is gravity on a slope, which changes slowly, and
some noise. A fault is a sudden change of the difference, or more of it than any road makes.
"""

from math import isnan

import numpy as np

from lfd_diagnosis.acceleration_allowance import MOST_ALLOWANCE, allowance_of, jerk_allowance
from lfd_diagnosis.acceleration_direction import (
    acceleration_by_speed,
    follow_reversing,
    jerk_by_speed,
)
from lfd_diagnosis.acceleration_jump import follow_difference, learn_jump_noise, least_beyond
from lfd_diagnosis.acceleration_shaking import swings_over_bumps
from lfd_diagnosis.acceleration_size import JUMPED
from lfd_diagnosis.acceleration_state import LEARNT_EVERY, felt_jerk, newest_sample
from lfd_diagnosis.evidence import Ground, is_exceeded, repeats, set_check
from lfd_diagnosis.faulty_acceleration import LEAST, follow_fault
from lfd_diagnosis.host_speed import rattles
from lfd_diagnosis.noise import deviation, learn_noise, while_learning
from lfd_diagnosis.road_slope import (
    STILL_KNOWN,
    WARM_UP,
    doubt_slope,
    follow_baseline,
    follow_road,
    learn_slope,
    levelling,
)
from lfd_diagnosis.sample import POSSIBLE_JERK
from lfd_diagnosis.speed_derivative import JERK_FILTER
from lfd_diagnosis.speed_lag import follow_own_jerk, lag_of, learn_lag
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

STEEPEST = 4.0
"""m/s^2 that a slope and a sensor's mounting make at most: of more nothing is learnt."""

LASTING, LARGE, LARGE_FOR_SWINGS = 6, 2.0, 3.0
"""Steps for which samples must have leapt to be seen before they are filtered, and times the limit
of a jump by which they must have; the same where bumps swing the sensor."""


@inner
def against_speed(monitor, settings):
    """Make the step's check by the derivative of the host's speed, and learn from a healthy one."""
    off = monitor.difference = difference(monitor, settings)
    if monitor.faulty:
        if repeats(monitor.kind):
            doubt_slope(monitor, STILL_KNOWN)
        follow_fault(monitor, settings, off)
        return
    if isnan(monitor.baseline):
        monitor.baseline = monitor.slope if monitor.slope_known > 0.0 else off
    learning = while_learning(monitor.slope_known, WARM_UP)
    allowance = allowance_of(monitor, settings)
    sigma = settings.acceleration_sigma
    follow_road(monitor, settings, off)
    step, slow = off - monitor.baseline, off - monitor.slope
    step_limit = max(settings.acceleration_step_limit, sigma * deviation(monitor.step_noise))
    slow_limit = max(settings.acceleration_limit, sigma * deviation(monitor.slow_noise))
    sudden, gradual = learning * step_limit + allowance, learning * slow_limit + allowance
    gradual += levelling(monitor, settings, slow)
    check = monitor.check
    # What jumped is held against a moment ago: the slope may have changed since its slow mean.
    if abs(step) < sudden and abs(slow) / gradual > abs(step) / sudden:
        jumped = abs(step) > JUMPED * abs(slow)
        kind = Kind.OFFSET if jumped else Kind.RAMP
        reference = monitor.baseline if jumped else monitor.slope
        set_check(check, Ground.HOST_SPEED, slow, gradual, kind, reference)
    else:
        set_check(check, Ground.HOST_SPEED, step, sudden, Kind.OFFSET, monitor.baseline)
    if monitor.leapt_for and not is_exceeded(check):
        _look_for_leap(monitor, settings, learning, step_limit)
    follow_reversing(monitor)
    if is_exceeded(check):
        monitor.reference = check.reference
    elif not monitor.confidence:
        monitor.reference = np.nan
        healthy = abs(step) < LEAST * step_limit
        jerk = jerk_by_speed(monitor)
        _learn(monitor, settings, off, jerk, step if healthy else np.nan, slow_limit)


@inner
def difference(monitor, settings):
    """By how much the accelerometer differs from the derivative of the speed in this step (m/s^2),
    without what the speed's lag makes of it; follows it."""
    jerk = jerk_by_speed(monitor)
    lag, smooth = lag_of(monitor.lag, settings)
    if rattles(monitor.speed):
        smooth = -JERK_FILTER
    derivative = acceleration_by_speed(monitor) + (lag + smooth) * jerk
    follow_difference(monitor.jump, newest_sample(monitor) - derivative, derivative)
    follow_own_jerk(monitor.lag, felt_jerk(monitor), monitor.leapt_for > 0)
    # What a smoothed speed tells too late, the accelerometer's own jerk tells by now.
    return monitor.filtered - derivative + smooth * monitor.lag.own_jerk


@inner
def _look_for_leap(monitor, settings, learning, step_limit):
    """Make a check of what leapt and stays there, before the filters say so: no bump lasts, and no
    manoeuvre leaps. The limit is `learning` times wider while little is known."""
    least = least_beyond(monitor.jump, LASTING)
    large = LARGE_FOR_SWINGS if swings_over_bumps(monitor) else LARGE
    # Six steps in a row are no shaking.
    widening = min(jerk_allowance(monitor, settings), MOST_ALLOWANCE)
    limit = large * learning * step_limit + widening
    if abs(least) > limit:
        set_check(monitor.check, Ground.HOST_SPEED, least, limit, Kind.OFFSET, monitor.baseline)


@inner
def _learn(monitor, settings, off, jerk, step, slow_limit):
    """Slope, noise and lag, from a healthy step."""
    follow_baseline(monitor, settings, off)
    if abs(off) > STEEPEST or abs(jerk) > POSSIBLE_JERK:
        return
    slow = off - monitor.slope
    learn_slope(monitor, settings, slow)
    if monitor.ticks % LEARNT_EVERY:
        return
    if not isnan(step):
        learn_noise(monitor.step_noise, step, 0.0)
        learn_jump_noise(monitor.jump)
    if abs(slow) < LEAST * slow_limit:
        learn_noise(monitor.slow_noise, slow, 0.0)
    # What the accelerometer is ahead by, beyond the slope.
    moved = monitor.filtered - acceleration_by_speed(monitor) - monitor.baseline
    learn_lag(monitor.lag, jerk, felt_jerk(monitor), moved)
