"""Whether a jump of the accelerometer is the end of a fault that nobody saw begin, or end."""

import numpy as np

from lfd_diagnosis.acceleration_against_lead import newest_mean
from lfd_diagnosis.acceleration_state import forgive_acceleration
from lfd_diagnosis.evidence import Ground
from lfd_diagnosis.ring import is_full
from lfd_diagnosis.road_slope import STILL_KNOWN
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

END_HIDDEN, ENDS_BY, ENDS_BY_MOST = 3.0, 0.5, 1.5
"""Seconds after the end of a fault in which a jump back may be its real end, since a road that bent
made it seem over; and least and largest share of its size that this jumps by."""

FIRST_TIME, NEARER_LEVEL = 1.0, 0.5
"""Seconds of learning in which a signal may have begun wrongly, and share of what it was off by
then that it may be from level ground by now."""

LEADS_TO_SLOPE = 0.6
"""Share of a jump by which it may miss the slope that it leads back to."""


@inner
def is_unseen_end(monitor, settings):
    """Whether what looks like a fault is the end of one: of the last one, of one that was too small
    to be found, or of one that the signal began with."""
    ends = _ends_the_last(monitor, settings) or _leads_back(monitor, settings)
    return ends or _began_wrongly(monitor)


@inner
def _ends_the_last(monitor, settings):
    """Whether it jumps back by about the size of the last fault, which seemed over just before: the
    road may have hidden it."""
    size = monitor.ended_size
    seen = monitor.check.ground == Ground.HOST_SPEED and is_full(monitor.samples)
    hidden = monitor.ended_for <= END_HIDDEN and abs(size) <= settings.steepest_road
    if not (seen and hidden):
        return False
    back = -_newest_residual(monitor)
    # Without dividing: what ended may have been of no size at all.
    return ENDS_BY * size * size < back * size < ENDS_BY_MOST * size * size


@inner
def _leads_back(monitor, settings):
    """Whether it leads back to the slope from beside it: a fault that was too small to be found may
    have put it there, or a road that bent."""
    check = monitor.check
    jumped = check.ground == Ground.HOST_SPEED and check.kind == Kind.OFFSET
    if not (jumped and is_full(monitor.samples)):
        return False
    step, beside = _newest_residual(monitor), check.reference - monitor.slope
    hidden = beside * step < 0.0 and abs(step) <= settings.steepest_road
    return hidden and abs(beside + step) < LEADS_TO_SLOPE * abs(step)


@inner
def _began_wrongly(monitor):
    """Whether it is what the very first samples were off by, as those of a signal that someone has
    smoothed: by now it is nearer to level ground."""
    check = monitor.check
    first = check.ground == Ground.HOST_SPEED and monitor.slope_known < FIRST_TIME
    return first and abs(monitor.difference) < NEARER_LEVEL * abs(check.reference)


@inner
def _newest_residual(monitor):
    """What the newest samples are off by, before the filter says so."""
    return monitor.check.residual + _ahead(monitor)


@inner
def _ahead(monitor):
    """How far the newest samples are ahead of the filter."""
    return newest_mean(monitor) - monitor.filtered


@inner
def take_for_slope(monitor):
    """There is no fault any more: what is felt by now is the slope, which is in doubt."""
    # A drift is counted from the slope, also where its reference is what was felt a moment ago.
    monitor.slope = monitor.difference + _ahead(monitor)
    monitor.slope_known = min(monitor.slope_known, STILL_KNOWN)
    monitor.ended_size = np.nan
    forgive_acceleration(monitor)
