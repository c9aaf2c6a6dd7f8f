"""Whether a faulty radar signal agrees with its reference again, and for long enough."""

from math import sqrt

from lfd_diagnosis.evidence import is_gauged, repeats
from lfd_diagnosis.radar_fault_kind import shows_itself, still_repeats
from lfd_diagnosis.radar_jump import follow_jump, follow_step
from lfd_diagnosis.radar_residual import is_bad
from lfd_diagnosis.radar_signal import FIRST, largest_jump, restart_agreement, size_to_tell
from lfd_diagnosis.ring import is_full, start_ring
from lfd_diagnosis.roughness import is_rough
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

SIZE_TIME, CHANGED = 0.3, 0.5
"""Time constant in s over which the size of a fault is averaged, and share by which that of a jump
must have changed to be taken anew."""

TELLABLE, TELLABLE_FLOORS = 0.7, 1.5
"""Share of the fault, and least limits, that the doubt about its reference must stay below, the
larger of both, if agreement is to tell anything."""

HALF, WITHIN = 0.5, 3.0
"""Share of what the fault was off by, and deviations of a healthy measurement, that a signal which
agrees again may be off, the larger of both."""

BACK_FLOORS, BACK_SHARE = 0.8, 0.4
"""Least limits, and share of the fault, the larger of both, from which on a step to where the
signal agrees ends a fault that did not begin with a jump."""

AVERAGED, AGREED = 4.0, 0.4
"""Scans over which noise averages out while a faulty signal agrees, and share of the fault that it
may then be off in the mean."""

LONGEST_PERIOD = 0.2
"""Seconds that one scan's agreement counts for at most."""

NOISE_CLEARS = 1.6
"""How many times longer a noisy signal must agree: it leaves its limits now and then only."""


@inner
def follow_agreement(signal, period, step, spread, sigma):
    """Take note of whether a faulty signal agrees; false where it does not.

    `period` since the scan before and `step` since then beyond the lead's own motion; `spread`
    is the deviation of a healthy measurement about the reference, `sigma` how many of them count.
    """
    size = largest_jump(signal)
    # Noise averages out while it agrees; what the reference is off does not.
    averaged = 1.0 - 1.0 / AVERAGED
    known = sqrt(max(spread * spread - averaged * signal.noise.variance, 0.0))
    signal.tellable = sigma * known < max(TELLABLE * size, TELLABLE_FLOORS * signal.floor)
    bound = signal.limit
    if is_gauged(signal.kind):
        # What is known to be off by so much has not come back while it is off by half of it.
        bound = min(bound, max(HALF * abs(signal.estimate), WITHIN * spread))
    off = is_bad(signal) or abs(signal.residual) > bound
    follow_step(signal, period, step)
    if off and not follow_jump(signal, step):
        share = min(period / SIZE_TIME, 1.0)
        signal.estimate += share * (signal.residual - signal.estimate)
    # A jump is known best just after it, before its reference has been coasted for long.
    jumped = signal.kind == Kind.OFFSET and is_full(signal.first)
    if not jumped or abs(signal.estimate - signal.size) > CHANGED * abs(signal.size):
        signal.size = signal.estimate
    if off or (repeats(signal.kind) and still_repeats(signal)) or is_rough(signal.roughness):
        signal.came_back = signal.at_once = False
        restart_agreement(signal)
        return False
    start_ring(signal.again, FIRST)
    back = max(BACK_FLOORS * signal.floor, BACK_SHARE * size)
    if signal.kind != Kind.OFFSET and abs(step) > back:
        signal.came_back = True
        restart_agreement(signal)
    signal.agreed += signal.residual
    signal.agreed_scans += 1.0
    signal.agreeing += min(period, LONGEST_PERIOD)
    return True


@inner
def agrees_by_now(signal):
    """Whether a faulty signal seems right again, though it has not agreed for long yet."""
    return signal.agreeing > 0.0 and (signal.tellable or signal.came_back)


@inner
def ends_for_all_to_see(signal):
    """Whether its fault's end is seen whatever became of the reference: it jumped back, or repeated
    itself or was rough and is not any more."""
    return signal.came_back or shows_itself(signal)


@inner
def agrees_long_enough(signal, clear_time, latch):
    """Whether a faulty signal that agrees does so for long enough to be believed."""
    needed = clear_time * (NOISE_CLEARS if signal.kind == Kind.NOISE else 1.0)
    # Agreement with limits as wide as the fault is large says nothing.
    off = abs(signal.agreed) > AGREED * size_to_tell(signal) * signal.agreed_scans
    told = (signal.tellable and not off) or ends_for_all_to_see(signal)
    return signal.agreeing >= needed and (told or not latch)
