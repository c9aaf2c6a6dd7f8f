"""Whether the car reverses: most wheels' speed has no sign, and its derivative is mirrored then.

What the accelerometer has felt since the car stood tells which way it drives off. An offset shows
the same difference while the car stands, a reversal does not.
"""

from math import isnan

import numpy as np

from lfd_diagnosis.acceleration_state import forget_differences
from lfd_diagnosis.evidence import Ground, is_exceeded
from lfd_diagnosis.host_speed import is_believed, seems_to_stand
from lfd_diagnosis.ring import append, at, start_ring
from lfd_diagnosis.speed_derivative import jerk_of
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

FASTEST_BACK = 3.0
"""m/s that no car reverses by."""

TELLING, TELLING_SHARE = 0.3, 0.5
"""m/s, and share of the speed, that must be felt to have been gained to tell the direction."""

FADES = 1.0
"""Time constant in s with which it fades what a car that seems to stand has gained: a speed may be
late, or zero below some m/s."""

FITS = 0.5
"""Share of what contradicts the speed that is left of it where the car moves the other way, and of
what the speed says that is felt at least."""

TOLD_BY = 0.4
"""m/s^2 that a speed's derivative must be for its direction to be told by what is felt of it."""

SETTLED = 0.1
"""m/s^2 below which the derivative of a speed at rest has no sign that matters."""

AT_REST = 0.05
"""m/s up to which a car is at rest rather than about to drive off."""

RESTED, RESTED_EVERY, RESTED_SHARE = 25, 3, 0.1
"""How many of which steps are kept until they tell what is felt at rest, and how much each does: a
car may have driven off before its speed says so."""


@inner
def as_the_car_moves(monitor, by_speed):
    """What a speed without a sign says of an acceleration or a jerk, or is to be told of one."""
    return -by_speed if monitor.direction.reverses else by_speed


@inner
def acceleration_by_speed(monitor):
    """How the car accelerates (m/s^2), forward, by the derivative of its speed."""
    return as_the_car_moves(monitor, monitor.speed.motion.derivative)


@inner
def jerk_by_speed(monitor):
    """Its jerk (m/s^3), likewise."""
    return as_the_car_moves(monitor, jerk_of(monitor.speed.motion))


@inner
def _turn(monitor, reverses):
    """The car moves that way: what was seen of its accelerations meanwhile tells nothing."""
    if reverses != monitor.direction.reverses:
        monitor.direction.reverses = reverses
        forget_differences(monitor)


@inner
def follow_direction(monitor):
    """Which way the car drives off after it stood."""
    speed, direction = monitor.speed, monitor.direction
    heard = is_believed(speed)
    forward = heard and abs(speed.last) > FASTEST_BACK
    if forward:
        _turn(monitor, False)
    if forward or isnan(monitor.filtered) or monitor.faulty:
        direction.gained = direction.gained_since = np.nan
    if heard and seems_to_stand(speed):
        _stand(monitor)
    elif not isnan(direction.gained):
        # It goes on while nothing is heard of the speed for a moment.
        felt, gained = monitor.filtered - direction.at_rest, abs(direction.gained)
        direction.gained += STEP_S * (monitor.filtered - monitor.slope)
        direction.gained_since += STEP_S * felt
        # The slope of a car that stood may be an old one: all must say the same.
        alike = direction.gained * direction.gained_since > 0.0 and direction.gained * felt > 0.0
        drives_off = heard and speed.motion.derivative * speed.last > 0.0
        told = drives_off and alike and gained > max(TELLING, TELLING_SHARE * abs(speed.last))
        if told:
            _turn(monitor, direction.gained * speed.last < 0.0)
        if told or gained > FASTEST_BACK:
            direction.gained = np.nan


@inner
def _stand(monitor):
    """The car seems to stand: it feels the slope, and may be about to drive off."""
    direction = monitor.direction
    settled = abs(monitor.speed.motion.derivative) < SETTLED
    if settled:
        # From here on it may go either way.
        direction.reverses = False
    if isnan(monitor.filtered) or monitor.faulty:
        return
    if isnan(direction.gained):
        direction.gained, direction.gained_since, direction.at_rest = 0.0, 0.0, monitor.filtered
        start_ring(direction.rested, RESTED)
    share = STEP_S / FADES
    direction.gained += STEP_S * (monitor.filtered - monitor.slope) - share * direction.gained
    direction.gained_since *= 1.0 - share
    direction.gained_since += STEP_S * (monitor.filtered - direction.at_rest)
    if settled and abs(monitor.speed.last) < AT_REST and monitor.ticks % RESTED_EVERY == 0:
        append(direction.rested, monitor.filtered)
        direction.at_rest += RESTED_SHARE * (at(direction.rested, 0) - direction.at_rest)


@inner
def _off_the_other_way(monitor):
    """By how many m/s^2 the accelerometer is off the speed of a car that moves the other way."""
    derivative = acceleration_by_speed(monitor)
    return monitor.check.residual + 2.0 * derivative


@inner
def follow_reversing(monitor):
    """A car that only fits if it drives forward does, or that feels so beside what it felt at
    rest."""
    derivative = monitor.speed.motion.derivative
    felt = (monitor.filtered - monitor.direction.at_rest) * (1.0 if derivative > 0.0 else -1.0)
    as_forward = abs(derivative) > TOLD_BY and felt > FITS * abs(derivative)
    fits = abs(_off_the_other_way(monitor)) <= FITS * abs(monitor.check.residual)
    if monitor.direction.reverses and (as_forward or (fits and is_exceeded(monitor.check))):
        _turn(monitor, False)


@inner
def may_reverse(monitor):
    """Whether what disagrees with the speed may be a car that just drives off, the other way."""
    by_speed = monitor.check.ground == Ground.HOST_SPEED and is_exceeded(monitor.check)
    fits = abs(_off_the_other_way(monitor)) <= monitor.check.limit
    return not isnan(monitor.direction.gained) and by_speed and fits
