"""The host's accelerometer, followed: its samples, and the acceleration that is best known
(robust profile)."""

from math import exp, isnan, sqrt

import numpy as np

from lfd_diagnosis.acceleration_against_lead import ends_braking, newest_mean, waits
from lfd_diagnosis.acceleration_direction import (
    acceleration_by_speed,
    as_the_car_moves,
    follow_direction,
)
from lfd_diagnosis.acceleration_shaking import follow_shaking, swings_over_bumps
from lfd_diagnosis.acceleration_state import (
    as_possible,
    is_possible,
    lose_samples,
)
from lfd_diagnosis.host_speed import is_believed, is_standing, is_usable, lose_speed
from lfd_diagnosis.repetition import excuse_repetition, take_repetition
from lfd_diagnosis.ring import append, at, is_full, mean_of
from lfd_diagnosis.roughness import is_rough, rough_share, take_roughness
from lfd_diagnosis.sample import POSSIBLE_JERK, SAME_STAMP, as_measured, filter_share, is_new
from lfd_diagnosis.speed_derivative import JERK_SHARE, came_to_rest
from lfd_diagnosis.speed_samples import follow_speed
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

LARGEST_STEP, LEAP_ROUGHNESS, LEAP_MEMORY = 1.0, 3.0, 30
"""m/s^2 by which a possible jerk moves the accelerometer at most from one sample to the next, and
roughness beyond that: what exceeds them is a leap, for so many steps."""

TOLD, FEW, SHORT, SHARPEST = 3.0, 3, 0.04, 60.0
"""m/s^2 by which single samples must leap where they are too noisy to tell, samples whose mean then
does, seconds that they take at most, and m/s^3 that it exceeds: no braking is as sharp."""

OUTLIER, OUTLASTS = 8.0, 0.04
"""m/s^2 by which no car's acceleration leaps: samples that do are not taken before they have done
so for that many seconds, as no shock does."""

SHAKEN = 0.1
"""Share of rough samples above which the road shakes a sensor."""

BRAKED_HARD, BRAKING_FADES, ENDS = 4.0, share_of(0.2), 0.5
"""m/s^2 of braking whose sudden end, as when the car comes to rest, radar and accelerometer tell
at different times; share by which it is forgotten in a step, and share of it left when it ends."""

ROUGH_ACCELERATION = 0.25
"""Second differences in m/s^2 that are not called rough, however smooth the sensor was."""

HOST_FADES = 2.0
"""Time constant in s with which an acceleration of the host fades that nothing tells any more."""

HOST_KEEP = exp(-STEP_S / HOST_FADES)
"""What is left of it after a step."""


@inner
def follow_acceleration(monitor, settings, horizon):
    """Take one step's samples; afterwards `acceleration` is the best that is known."""
    now = horizon.stamp * 1e-9
    speed, usable = monitor.speed, not horizon.acceleration_stale
    if settings.use_host_speed and not horizon.host_speed_stale:
        time = now - horizon.host_speed_age
        value = as_measured(horizon.measured_host_speed)
        felt = monitor.acceleration
        if not monitor.faulty and is_possible(monitor):
            felt = monitor.filtered - monitor.slope
        felt = as_the_car_moves(monitor, felt)
        follow_speed(speed, settings, now, time, value, felt, monitor.shaking.bad_road)
    else:
        lose_speed(speed)
    if usable:
        time = now - horizon.acceleration_age
        _follow_samples(monitor, settings, time, as_measured(horizon.measured_acceleration))
    else:
        lose_samples(monitor)
    if is_usable(speed, settings):
        monitor.acceleration = acceleration_by_speed(monitor)
    elif usable and not monitor.faulty and is_possible(monitor):
        rests = came_to_rest(speed.motion) or is_standing(speed)
        ended = rests or (monitor.jumped_for and ends_braking(monitor))
        if monitor.jumped_for and swings_over_bumps(monitor):
            # It may be a bump, of which a few samples are no mean, or brakes.
            monitor.acceleration = monitor.filtered - monitor.slope
        elif (ended or waits(monitor)) and is_full(monitor.samples):
            # No fault begins so slowly, or ends as suddenly as that: a filter would be late.
            monitor.acceleration = newest_mean(monitor) - monitor.slope
        elif not monitor.jumped_for:
            # While a jump is being looked into, what was before it.
            monitor.acceleration = at(monitor.before_jump, 0)
    elif is_standing(speed):
        # Whatever its derivative has yet to settle from.
        monitor.acceleration = 0.0
    else:
        monitor.acceleration *= HOST_KEEP
    heard = usable and is_possible(monitor)
    _follow_braking(monitor, as_measured(horizon.measured_acceleration) if heard else np.nan)
    follow_direction(monitor)


@inner
def coast_samples(monitor):
    """One step in which neither accelerometer nor host speed says anything."""
    lose_speed(monitor.speed)
    lose_samples(monitor)
    monitor.acceleration *= HOST_KEEP
    _follow_braking(monitor, np.nan)
    follow_direction(monitor)


@inner
def _follow_braking(monitor, value):
    """How hard the host lately braked, and whether that may have ended at once; the newest sample
    in m/s^2, NaN if there is none."""
    rests, heard = came_to_rest(monitor.speed.motion), not isnan(value)
    monitor.braked *= 1.0 - BRAKING_FADES
    if heard:
        slows = as_the_car_moves(monitor, monitor.slope - monitor.filtered)
        monitor.braked = max(monitor.braked, slows)
    monitor.stops_from = max(monitor.stops_from, monitor.braked) if rests else 0.0
    ends = rests or as_the_car_moves(monitor, monitor.slope - value) < ENDS * monitor.braked
    monitor.jolt = monitor.braked if heard and ends and monitor.braked > BRAKED_HARD else 0.0


@inner
def _follow_samples(monitor, settings, time, said):
    # What is said beyond what is possible is as far off as that, and no other way.
    value = as_possible(said)
    share = filter_share(settings.host_speed_filter_time)
    period = time - monitor.last_at
    monitor.fresh = is_new(time, monitor.last_at)
    if monitor.fresh:
        # What swings back from a sample that was taken is no leap.
        leaps = min(abs(value - monitor.taken), abs(value - monitor.filtered)) > OUTLIER
        monitor.outliers += monitor.doubted and not leaps
        if leaps and not monitor.doubted:
            monitor.leapt_at = time
        monitor.doubted = leaps and time - monitor.leapt_at < OUTLASTS - SAME_STAMP
        monitor.last_at = time
    if monitor.doubted:
        value, monitor.fresh = monitor.taken, False
    monitor.taken = value
    if isnan(monitor.filtered):
        _start_filters(monitor, settings, value)
    monitor.filtered += share * (value - monitor.filtered)
    monitor.slow_filtered += JERK_SHARE * (monitor.filtered - monitor.slow_filtered)
    monitor.shaking.burst += share * ((value - monitor.filtered) ** 2 - monitor.shaking.burst)
    monitor.leapt_for = max(monitor.leapt_for - 1, 0)
    monitor.leapt_ago += 1
    if monitor.fresh:
        follow_shaking(monitor.shaking, value)
        leap = _leap(monitor, period)
        if leap:
            monitor.leap, monitor.leapt_for, monitor.leapt_ago = leap, LEAP_MEMORY, 0
        standing = is_standing(monitor.speed)
        healthy = not (monitor.faulty or standing)
        take_roughness(monitor.roughness, time, value, healthy, ROUGH_ACCELERATION)
        if standing:
            excuse_repetition(monitor.repetition, monitor.faulty)
        same = take_repetition(monitor.repetition, said, not monitor.faulty)
        _follow_while_held(monitor, settings, same)
    append(monitor.samples, value)
    append(monitor.before_jump, monitor.filtered - monitor.slope)
    # A bad road shakes the wheels, too; a sensor's own noise does not.
    monitor.shaking.bad_road = rough_share(monitor.roughness) > SHAKEN
    # An engine, and those who get on, shake a standing car, and its wheels tell nothing of it.
    excused = is_standing(monitor.speed) or _is_bad_road(monitor.speed)
    rough = is_rough(monitor.roughness) and (monitor.faulty or not excused)
    monitor.rough_for = monitor.rough_for + STEP_S if rough else 0.0


@inner
def _follow_while_held(monitor, settings, same):
    """What the speed's derivative was when the accelerometer began to say the `same`.

    A late speed comes to what was felt before: that is no reason to change, its leaving it is.
    """
    speed = monitor.speed
    derivative = acceleration_by_speed(monitor)
    if not same:
        monitor.felt_when_held = monitor.taken - monitor.slope
        monitor.derivative_when_held = derivative
    elif is_usable(speed, settings):
        felt, then = monitor.felt_when_held, monitor.derivative_when_held
        if isnan(then) or abs(derivative - felt) < abs(then - felt):
            monitor.derivative_when_held = derivative


@inner
def _start_filters(monitor, settings, value):
    """With the first sample (m/s^2), or the first one after a silence: as if it had said all the
    time what speed and slope say."""
    monitor.filtered = monitor.slow_filtered = value
    if is_usable(monitor.speed, settings) and monitor.slope_known > 0.0 and not monitor.faulty:
        monitor.filtered = acceleration_by_speed(monitor) + monitor.slope
        slow = as_the_car_moves(monitor, monitor.speed.motion.slow_derivative)
        monitor.slow_filtered = slow + monitor.slope


@inner
def _is_bad_road(speed):
    """Whether the wheels are shaken, too."""
    return is_believed(speed) and rough_share(speed.roughness) > SHAKEN


@inner
def _leap(monitor, period):
    """By how many m/s^2 the newest sample, or the mean of three, leaves the one before as no
    manoeuvre does, else 0; a noisy sensor's single ones tell little."""
    newest, rough = monitor.shaking.newest, LEAP_ROUGHNESS * sqrt(monitor.roughness.usual)
    last = newest.count - 1
    if last < 1:
        return 0.0
    possible = min(POSSIBLE_JERK * period, LARGEST_STEP)
    step = at(newest, last) - at(newest, last - 1)
    if abs(step) > possible + rough:
        return step
    if last < 2 * FEW or FEW * period > SHORT or possible + rough < TOLD:
        return 0.0
    now, before = newest.count - FEW, newest.count - 2 * FEW
    step = mean_of(newest, now, newest.count) - mean_of(newest, before, now)
    # The difference of two such means has a third of a second difference's noise.
    return step if abs(step) > SHARPEST * FEW * period + rough / 3.0 else 0.0
