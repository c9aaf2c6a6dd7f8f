"""What a healthy accelerometer would say, and how surely that is known (robust profile)."""

from math import isnan, sqrt

from lfd_diagnosis.acceleration_jump import is_measured
from lfd_diagnosis.acceleration_size import BLIND_STD, DRIFT_TIME, SLOPE_DRIFT
from lfd_diagnosis.acceleration_state import BASELINE_DELAY, LEVEL_ROAD, newest_sample
from lfd_diagnosis.host_speed import is_standing, is_usable
from lfd_diagnosis.roughness import SECOND_DIFFERENCES
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

UNHEARD = 0.5
"""Seconds of silence after which a car may accelerate as it likes."""

DOUBT_OF_SLOPE = 0.6
"""Share of a slope that is in doubt where a level road is felt."""


@inner
def expected_std(monitor, settings):
    """Standard deviation in m/s^2 of `expected_acceleration`."""
    if not is_usable(monitor.speed, settings):
        return BLIND_STD
    doubt = _doubt_of_slope(monitor)
    if monitor.corrected:
        return sqrt(monitor.size_std**2 + doubt**2)
    since = (monitor.settled + BASELINE_DELAY) * STEP_S
    drift = SLOPE_DRIFT**2 * min(since, DRIFT_TIME)
    # Each sample has noise of its own; the slow mean of the slope is held against only where
    # nothing is known of a moment before.
    noise = monitor.roughness.usual / SECOND_DIFFERENCES
    if is_measured(monitor.jump):
        # By now it is the road that shakes it.
        noise = max(noise, monitor.shaking.burst)
    jumped = monitor.faulty and monitor.kind == Kind.OFFSET
    slope = 0.0 if jumped else monitor.slow_noise.variance
    return sqrt(slope + monitor.step_noise.variance + noise + drift + doubt**2)


@inner
def _doubt_of_slope(monitor):
    """Deviation (m/s^2) of the slope where a faulty accelerometer feels what it would on a level
    road: then it may be the slope that was wrong."""
    is_level = abs(monitor.felt) < LEVEL_ROAD < abs(monitor.reference)
    return DOUBT_OF_SLOPE * abs(monitor.reference - monitor.felt) if is_level else 0.0


@inner
def expected_acceleration(monitor, settings):
    """What a healthy accelerometer would say, in m/s^2: it feels the slope of the road, too."""
    told = is_usable(monitor.speed, settings)
    if told and monitor.corrected:
        return newest_sample(monitor) - monitor.size
    if told or is_standing(monitor.speed):
        # What is known of the slope by now, under a fault, too.
        slope = monitor.slope if isnan(monitor.reference) else monitor.reference
        return monitor.acceleration + slope
    if isnan(monitor.lead_reference) or isnan(monitor.lead):
        return monitor.acceleration + monitor.slope
    return monitor.lead_reference - monitor.relative_slow


@inner
def is_unheard(monitor):
    """Whether the accelerometer has said nothing for so long that what it last said tells
    nothing of now."""
    return monitor.silent_for > UNHEARD
