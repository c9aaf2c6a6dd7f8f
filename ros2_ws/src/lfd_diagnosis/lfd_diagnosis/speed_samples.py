"""Which samples of the host's speed are taken, which make it faulty, and when it is right again."""

from math import isfinite

import numpy as np

from lfd_diagnosis.evidence import Ground, repeats
from lfd_diagnosis.held_speed import (
    convict_held,
    follow_repetition,
    look_for_hold,
    says_again,
    was_held,
)
from lfd_diagnosis.host_speed import (
    HEARD_OFTEN,
    believe_again,
    convict,
    felt_for,
    forget_samples,
    may_be_right,
    seems_to_stand,
)
from lfd_diagnosis.repetition import excuse_repetition
from lfd_diagnosis.roughness import (
    ROUGH_TIME,
    ROUGH_TIME_ALONE,
    is_rough,
    rough_share,
    take_roughness,
)
from lfd_diagnosis.sample import is_new
from lfd_diagnosis.speed_derivative import follow_motion, stop_following
from lfd_diagnosis.speed_jump import doubt_jump, follow_jumps
from lfd_diagnosis.speed_spacing import follow_spacing, is_too_seldom
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

BENDS = 2.0
"""How many times more the speed may bend than what is felt, which is filtered, says."""


@inner
def follow_speed(speed, settings, now, at, value, acceleration, shaken):
    """One step at `now`: newest sample in m/s of time `at` in s, the host accelerating as stated.

    `shaken`: the accelerometer feels a bad road.
    """
    speed.calm_for += 1
    spacing = speed.spacing
    new = is_new(at, spacing.heard_at)
    if new:
        follow_spacing(spacing, at)
    if is_too_seldom(spacing):
        believe_again(speed)
        forget_samples(speed)
        return
    if new and not (says_again(speed, at, value) or doubt_jump(speed, at, value, acceleration)):
        _take(speed, settings, at, value, acceleration, shaken)
    if speed.faulty and not may_be_right(speed):
        stop_following(speed.motion)
        return
    filter_time, motion = settings.host_speed_filter_time, speed.motion
    follow_motion(motion, filter_time, now, speed.last, speed.last_at, acceleration)


@inner
def _take(speed, settings, at, value, acceleration, shaken):
    """Take a sample (m/s) of time `at` (s) that is no outlier, the host accelerating as stated
    (m/s^2): learn from it, and judge the sensor by it."""
    period = felt_for(speed, at)
    possible = _possible_bend(period, acceleration, speed.felt)
    speed.felt = acceleration
    learn = not (speed.faulty or seems_to_stand(speed))
    take_roughness(speed.roughness, at, value, learn, possible)
    if seems_to_stand(speed):
        excuse_repetition(speed.held.repetition, speed.faulty)
    held = was_held(speed, value, period, acceleration)
    follow_repetition(speed, at, value, period, acceleration)
    if isfinite(speed.last):
        follow_jumps(speed, settings, value, period, acceleration, held)
    speed.last, speed.last_at = value, at
    speed.motion.derivative_then = speed.motion.derivative
    _look_for_faults(speed, settings, value, period, shaken)
    _requalify(speed, settings, value)


@inner
def _possible_bend(period, acceleration, before):
    """Second difference (m/s) that a car makes between samples so far apart (s), by what it feels
    and felt at the one `before` (m/s^2). Values of a table may be older than their stamps, now
    more, now less, by up to a sample."""
    late = period if period > HEARD_OFTEN else 0.0
    return BENDS * (period * abs(acceleration - before) + late * abs(acceleration))


@inner
def _look_for_faults(speed, settings, value, period, shaken):
    """Convict it where it is held or rough; else it is quiet for longer."""
    rough = is_rough(speed.roughness)
    speed.rough_for = speed.rough_for + period if rough else 0.0
    if settings.check_repetition and (look_for_hold(speed) or speed.held.still):
        convict_held(speed, value)
    elif settings.check_roughness and speed.rough_for >= ROUGH_TIME and not shaken:
        # Not every accelerometer feels a bad road.
        if speed.rough_for >= ROUGH_TIME_ALONE:
            share = rough_share(speed.roughness)
            convict(speed, Kind.NOISE, np.nan, Ground.ROUGHNESS, share, 0.0, 0.0)
        else:
            stop_following(speed.motion)
    else:
        speed.quiet += period


@inner
def _requalify(speed, settings, value):
    """A fault is over after a while of nothing odd."""
    # One that is still off after a jump must go on smoothly for longer: its derivative may be right
    # by now, or not. A hold is over when the speed moves.
    held = repeats(speed.kind)
    if speed.kind == Kind.ZERO and value == 0.0:
        speed.quiet = 0.0
    needed = settings.requalify_time if speed.off != 0.0 and not held else settings.clear_time
    if speed.faulty and speed.quiet >= needed:
        believe_again(speed)
