"""What accelerometer and speed differ by where both are healthy: the slope of the road."""

from math import isnan

from lfd_diagnosis.acceleration_allowance import jerk_allowance
from lfd_diagnosis.acceleration_jump import restart_jump
from lfd_diagnosis.acceleration_state import BASE_SHARE, forget_baseline
from lfd_diagnosis.held_speed import tells_of_bends
from lfd_diagnosis.ring import append, at, is_full
from lfd_diagnosis.road_bend import (
    follow_bend,
    has_bent,
    is_unproven,
    leave_bend,
    slope_now,
    start_bend,
)
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

WARM_UP = 3.0
"""Seconds of learning until the slope is known: limits are thrice as wide at first."""

STILL_KNOWN, KNOWN_AFTER_SILENCE, SLOPE_FADES = 1.0, 2.5, 0.8
"""Seconds of learning that a slope is worth at least, however long nothing was heard of it; the
same where the accelerometer is silent, which may come back with an offset; and how many of them
each second takes that tells nothing."""

SLOPE_TIME = 4.0
"""Time constant in s of the slow mean, as far as its rate allows."""

ENDING = 0.5
"""Share of the slope by which the limit of a drift is wider towards level ground: every slope
ends."""

DOUBTFUL, SHARPLY = 0.5, 4
"""m/s^2 of a jerk's allowance at which a difference counts half, since it may as well be a lag; and
power by which it counts less the larger that is: a noisy speed jerks a little all the time."""


@inner
def learn_slope(monitor, settings, slow):
    """Learn from a healthy step, which lies so much beside the slope (`slow`, m/s^2)."""
    monitor.slope_known += STEP_S
    if monitor.slope_known < WARM_UP:
        monitor.slope += STEP_S / monitor.slope_known * slow
    else:
        rate = settings.slope_rate
        monitor.slope += STEP_S * max(-rate, min(rate, slow / SLOPE_TIME))


@inner
def doubt_slope(monitor, worth):
    """A step tells nothing of the slope, which may change meanwhile: what is known fades, but stays
    `worth` so many seconds of learning."""
    least = min(monitor.slope_known, worth)
    known = min(monitor.slope_known, WARM_UP) - SLOPE_FADES * STEP_S
    monitor.slope_known = max(known, least)


@inner
def lose_slope(monitor, worth):
    """Nothing tells how the road goes on, or what jumped; what the slope was stays `worth` so many
    seconds of learning, except under a fault, which keeps it."""
    restart_jump(monitor.jump)
    start_bend(monitor.bend)
    if not monitor.faulty:
        doubt_slope(monitor, worth)


@inner
def follow_road(monitor, settings, off):
    """Follow a road that bends: its slope is another one from there on."""
    bend, speed = monitor.bend, monitor.speed
    told = tells_of_bends(speed, settings) and not (monitor.leapt_for or monitor.direction.reverses)
    steepest = settings.steepest_road if told else 0.0
    if not is_unproven(bend):
        bend.slope_before = monitor.slope
    bent = follow_bend(
        bend, monitor.jump, off, speed.motion.derivative, monitor.filtered, speed.last, steepest
    )
    if has_bent(bend):
        monitor.slope = slope_now(bend)
        forget_baseline(monitor)
        monitor.baseline = monitor.slope
    elif bent:
        monitor.slope += bent
        monitor.baseline += bent
        for i in range(monitor.recent.count):
            monitor.recent.values[i] += bent
    leave_bend(bend)


@inner
def levelling(monitor, settings, slow):
    """By how many m/s^2 the limit of a drift is wider, since this may be the end of the slope."""
    if slow * monitor.slope >= 0.0:
        return 0.0
    return ENDING * min(abs(monitor.slope), settings.steepest_road)


@inner
def follow_baseline(monitor, settings, off):
    """Follow what the difference (`off`, m/s^2) was a moment ago. In a manoeuvre it may be a lag,
    and counts little."""
    if isnan(monitor.baseline):
        monitor.baseline = off
    doubt = (jerk_allowance(monitor, settings) / DOUBTFUL) ** SHARPLY
    told = (off - monitor.baseline) / (1.0 + doubt)
    append(monitor.recent, monitor.baseline + told)
    if is_full(monitor.recent):
        monitor.baseline += BASE_SHARE * (at(monitor.recent, 0) - monitor.baseline)
