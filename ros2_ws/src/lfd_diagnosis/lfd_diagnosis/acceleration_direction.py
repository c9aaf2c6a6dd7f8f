"""Whether the car reverses: most wheels' speed has no sign, and its derivative is mirrored then.

What the accelerometer has felt since the car stood tells which way it drives off. An offset shows
the same difference while the car stands, a reversal does not.
"""

from math import isnan

import numpy as np

from lfd_diagnosis.evidence import Ground, is_exceeded
from lfd_diagnosis.host_speed import is_believed, seems_to_stand
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

FASTEST = 3.0
"""m/s that no car reverses by."""

TELLING, TELLING_SHARE = 0.3, 0.5
"""m/s, and share of the speed, that must be felt to have been gained to tell the direction."""

FADES = 1.0
"""Time constant in s with which it fades what a car that seems to stand has gained: a speed may be
late, or zero below some m/s."""


@inner
def follow_direction(monitor):
    """Which way the car drives off after it stood."""
    speed = monitor.speed
    heard = is_believed(speed) and not (isnan(monitor.filtered) or monitor.faulty)
    if not heard or abs(speed.last) > FASTEST:
        monitor.gained, monitor.reverses = np.nan, False
        return
    felt = monitor.filtered - monitor.slope
    if seems_to_stand(speed):
        before = 0.0 if isnan(monitor.gained) else monitor.gained
        monitor.gained = before + STEP_S * (felt - before / FADES)
        monitor.reverses = False
    elif not isnan(monitor.gained):
        monitor.gained += STEP_S * felt
        if abs(monitor.gained) > max(TELLING, TELLING_SHARE * abs(speed.last)):
            monitor.reverses = monitor.gained * speed.last < 0.0
            monitor.gained = np.nan


@inner
def _fits_mirrored(monitor):
    """Whether the accelerometer agrees with the speed of a car that reverses."""
    off = monitor.filtered + monitor.speed.derivative - monitor.check.reference
    return abs(off) <= monitor.check.limit


@inner
def follow_reversing(monitor):
    """A car that only fits if it drives forward does."""
    if monitor.reverses and not (is_exceeded(monitor.check) or _fits_mirrored(monitor)):
        monitor.reverses = False


@inner
def may_reverse(monitor):
    """Whether what disagrees with the speed may be a car that reverses, or just drives off."""
    possible = monitor.reverses or not isnan(monitor.gained)
    by_speed = monitor.check.ground == Ground.HOST_SPEED and is_exceeded(monitor.check)
    return possible and by_speed and _fits_mirrored(monitor)
