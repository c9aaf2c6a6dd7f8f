"""How the host accelerates, and with what jerk, by the derivative of its speed."""

from math import isnan

import numpy as np

from lfd_diagnosis.sample import filter_share
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

JERK_FILTER = 0.15
"""Time constant in s of the filter whose derivative is the jerk."""

JERK_SHARE = share_of(JERK_FILTER)
"""Share by which that filter follows in a step."""

JERK_FADES = share_of(0.1)
"""Share by which the largest of the last jerks fades in a step: a wheel that is shaken shows none
at the moment at which it turns back."""

GRIP, SLIPPING = 12.0, 50
"""m/s^2 that no tyre makes: where the derivative is larger, the wheels slip; and steps for which
they may go on slipping."""

SETTLING = 3.0
"""Filter times after which the derivative counts: until then, it is mostly what it began with."""

SPEED_MOTION = np.dtype(
    [
        ("filtered", "f8"),
        ("derivative", "f8"),
        ("derivative_then", "f8"),
        ("derivative_when_held", "f8"),
        ("slow_derivative", "f8"),
        ("largest_jerk", "f8"),
        ("followed", "f8"),
        ("slipped", "i8"),
    ],
    align=True,
)
"""How the host moves, by its speed, `filtered`: `derivative` (m/s^2), NaN while it is not followed.

`derivative_then` is that at the newest sample, `derivative_when_held` that when the speed last
changed; `slow_derivative` is the same through one more filter, `largest_jerk` (m/s^3) the largest
lately. `followed`: seconds for which it has been filtered, below zero where the car has just come
to rest and it begins anew at zero. `slipped`: steps since the wheels slipped.
"""


@inner
def lose_motion(motion):
    """No sample is new enough: the wheels are not known to slip, either."""
    motion.slipped = SLIPPING
    stop_following(motion)


@inner
def stop_following(motion):
    """The next step begins the derivative anew."""
    motion.filtered = motion.derivative = motion.slow_derivative = np.nan
    motion.derivative_then = motion.derivative_when_held = np.nan
    motion.followed = motion.largest_jerk = 0.0


@inner
def come_to_rest(motion, time):
    """The car stops with a jerk: its derivative begins anew, and counts as begun only after a
    `time` in s, when that is over."""
    stop_following(motion)
    motion.followed = -time


@inner
def follow_motion(motion, filter_time, now, last, last_at, acceleration):
    """One step at `now` (s): the newest sample is `last` (m/s), of time `last_at` (s). Where the
    derivative begins, the host accelerates as stated (m/s^2)."""
    if isnan(motion.filtered):
        # As if the host had gone on like this for long.
        motion.slow_derivative = acceleration
        motion.filtered = last - acceleration * filter_time
        motion.derivative_then = acceleration
    # Between two samples it goes on as it did: steps of a slow sensor are no jerks.
    value = last + motion.derivative_then * (now - last_at)
    motion.filtered += filter_share(filter_time) * (value - motion.filtered)
    motion.derivative = (value - motion.filtered) / filter_time
    motion.slipped = 0 if abs(motion.derivative) > GRIP else motion.slipped + 1
    motion.slow_derivative += JERK_SHARE * (motion.derivative - motion.slow_derivative)
    faded = motion.largest_jerk * (1.0 - JERK_FADES)
    motion.largest_jerk = max(faded, abs(jerk_of(motion)))
    motion.followed += STEP_S


@inner
def has_settled(motion, settings):
    """Whether the derivative has been filtered for long enough to be that of the speed."""
    return motion.followed >= SETTLING * settings.host_speed_filter_time


@inner
def came_to_rest(motion):
    """Whether the car has just stopped, so that the derivative begins anew."""
    return motion.followed < 0.0


@inner
def slips(motion):
    """Whether the wheels slipped just now: they are slower than the car."""
    return motion.slipped < SLIPPING


@inner
def jerk_between(acceleration, slow):
    """m/s^3, from an acceleration and the same through one more filter (`JERK_SHARE`)."""
    return (acceleration - slow) / JERK_FILTER


@inner
def jerk_of(motion):
    """m/s^3, filtered."""
    return jerk_between(motion.derivative, motion.slow_derivative)
