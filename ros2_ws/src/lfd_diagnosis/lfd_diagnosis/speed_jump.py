"""A host speed that jumps: as cars come to rest or set off, as wheels rattle, or as no car does."""

from math import isnan

import numpy as np

from lfd_diagnosis.evidence import Ground
from lfd_diagnosis.host_speed import (
    HEARD_OFTEN,
    STANDING,
    convict,
    drifts,
    felt_for,
    is_road_calm,
    seems_to_stand,
    seldom_heard,
)
from lfd_diagnosis.noise import deviation, learn_noise
from lfd_diagnosis.roughness import restart_roughness
from lfd_diagnosis.speed_derivative import come_to_rest, stop_following
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

DEAD, DEAD_JUMP, DEAD_TIME = 2.0, 0.1, 1.0
"""m/s below which many a wheel's sensor says zero; m/s by which the speed at least jumps to zero
then, or back; and s after which a car that did has surely come to rest."""

HARD, JERK_TIME, LATENESS = 2.0, 0.4, 0.1
"""m/s^2 of braking that ends with a jerk when the car comes to rest, s for which that lasts, and s
by which the speed may be late to say so."""

LEAST_JUMP, LEAST_JUMP_SIGMA = 0.5, 8.0
"""Least jump between two samples that no car makes: in m/s, and in deviations of the noise."""

RATTLE = 4.0
"""Standard deviations of its noise by which a speed leaps where its wheel is shaken."""

SWINGS_FOR = 0.1
"""Seconds for which a wheel that was shaken just now may jump as no car does."""

POSSIBLE_ACCELERATION, FOR_LONGER, LATE_SPEED, GROWS = 15.0, 10.0, 0.2, 1.5
"""m/s^2 by which a speed may change beyond what is felt, for a moment, and for longer; m/s that it
may be late by, in addition, for longer; and how many times farther off than the sample before one
must be to leap anew."""

ENDS_BY = 0.25
"""Share of what a speed has drifted by that a jump back may leave."""


@inner
def _starts_or_stops(speed, value):
    """Whether it jumps from a crawl to zero, or back, as many sensors do."""
    slow = abs(value) < DEAD and abs(speed.last) < DEAD
    zero = value == 0.0 or speed.last == 0.0
    return slow and zero and abs(value - speed.last) > DEAD_JUMP


@inner
def _rests_with_a_jerk(speed, value):
    """Whether hard braking ends now as the car comes to rest, or just did: a speed is late."""
    if seems_to_stand(speed) and value <= STANDING:
        # It stood before.
        return False
    seldom = seldom_heard(speed)
    soon = value + (LATENESS + seldom) * speed.motion.derivative
    slow = max(value, speed.last) < DEAD - seldom * speed.motion.derivative
    return soon < DEAD_JUMP and slow and speed.motion.derivative < -HARD


@inner
def _jump(speed, value, period, acceleration):
    """By how much (m/s) a sample differs from what the acceleration makes of the last one."""
    return value - speed.last - acceleration * period


@inner
def _possible_jump(speed, period, jump):
    """How far (m/s) a sample may be off that comes a `period` (s) after the last that was taken.

    Where several samples in a row jump, it is no farther than for the second of them. It is no
    farther than for the first where the `jump` (m/s) stays what it was: a car that brakes so hard
    would have gone on to do so.
    """
    first = speed.doubt.since - speed.last_at
    same = speed.doubt.jump * jump > 0.0 and abs(jump) < GROWS * abs(speed.doubt.jump)
    # A wheel that is shaken swings to and fro in no time.
    period = min(period, first if same and first > HEARD_OFTEN else 2.0 * first)
    accelerates = min(POSSIBLE_ACCELERATION * period, FOR_LONGER * period + LATE_SPEED)
    return max(LEAST_JUMP, LEAST_JUMP_SIGMA * deviation(speed.noise)) + accelerates


@inner
def doubt_jump(speed, at, value, acceleration):
    """Whether a sample jumps as no car does, and is not to be taken yet: the next one tells whether
    it was an outlier. A wheel that was shaken just now may swing for longer."""
    begins = speed.faulty or isnan(speed.doubt.jump)
    if begins:
        speed.doubt.since, speed.doubt.jump = at, np.nan
    period = felt_for(speed, at)
    jump = _jump(speed, value, period, acceleration)
    speed.doubt.possible = _possible_jump(speed, period, jump)
    if speed.faulty:
        return False
    jumps = abs(jump) > speed.doubt.possible
    jumps = jumps and not (_rests_with_a_jerk(speed, value) or _starts_or_stops(speed, value))
    speed.doubt.outliers += not (jumps or begins)
    swings = not is_road_calm(speed) and at - speed.doubt.since < SWINGS_FOR
    doubtful = jumps and (begins or swings)
    speed.doubt.jump = jump if doubtful else np.nan
    return doubtful


@inner
def follow_jumps(speed, settings, value, period, acceleration, held):
    """What jumps as a car comes to rest, or sets off, begins the derivative anew; what jumps
    otherwise is a shaken wheel or, if it is more, a fault, such as one that was `held`."""
    if _rests_with_a_jerk(speed, value):
        come_to_rest(speed.motion, JERK_TIME)
    elif _starts_or_stops(speed, value):
        restart_roughness(speed.roughness)
        if value == 0.0:
            come_to_rest(speed.motion, DEAD_TIME)
        else:
            stop_following(speed.motion)
    else:
        leap = abs(value - speed.last - speed.motion.derivative_then * period)
        if leap > RATTLE * deviation(speed.noise):
            speed.calm_for = 0
            if held and settings.check_repetition:
                # What it jumps by is what it missed.
                stop_following(speed.motion)
        _check_jump(speed, value, period, acceleration, held)


@inner
def _check_jump(speed, value, period, acceleration, held):
    """What jumps farther than a car is a fault, or the end of one; of less the noise is learnt."""
    jump, limit = _jump(speed, value, period, acceleration), speed.doubt.possible
    if abs(jump) <= limit:
        if not speed.faulty:
            learn_noise(speed.noise, jump, 0.0)
        return
    ends = drifts(speed) and ENDS_BY * abs(speed.off) > abs(speed.off + jump)
    speed.off += jump
    if speed.faulty and (ends or abs(speed.off) <= limit):
        speed.off = 0.0
    elif speed.faulty:
        speed.size = speed.off
    # Its derivative would show the jump.
    stop_following(speed.motion)
    kind = Kind.HOLD if held else Kind.OFFSET
    if value == 0.0:
        kind = Kind.ZERO
    convict(speed, kind, jump, Ground.SPEED_JUMPED, jump, period, limit)
