"""Which one is wrong where host speed and accelerometer come apart, if it is not the road.

A fault of the accelerometer changes what that says. Where the derivative of the speed alone
changes, it is a road that bends while the car is driven on as before, or a speed that drifts, as
that of wheels that slip.
"""

from math import isnan

from lfd_diagnosis.acceleration_against_speed import difference
from lfd_diagnosis.acceleration_allowance import allowance_of
from lfd_diagnosis.acceleration_direction import acceleration_by_speed, as_the_car_moves
from lfd_diagnosis.acceleration_jump import (
    came_at_once,
    came_lately,
    jump_noise,
    own_share,
    steps_since,
)
from lfd_diagnosis.acceleration_state import has_leapt, leapt_lately
from lfd_diagnosis.evidence import Ground, is_gauged
from lfd_diagnosis.faulty_acceleration import GENTLE_SLOPE
from lfd_diagnosis.held_speed import (
    hides_by_rounding,
    may_miss_a_change,
    misses_a_change,
    speed_seems_held,
)
from lfd_diagnosis.host_speed import (
    believe_again,
    convict_drift,
    doubt_again,
    drifts,
    follow_drift,
    is_standing,
)
from lfd_diagnosis.repetition import is_beyond_chance
from lfd_diagnosis.speed_derivative import has_settled, slips
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

AGAINST_IT, NONE_OF_IT = -1.5, 0.4
"""Least and largest share that the accelerometer may have made of a change that is the speed's:
wheels slip as the car brakes or speeds up, which is felt, too, the other way. Where the road may
have bent, the least is as near to zero as the largest: nothing of the kind is felt."""

SETTLED = 40
"""Steps after which the derivative has followed what changed."""

LEAD_RESTED = 2.0
"""Seconds for which a lead must have been at rest before a car that seems to stand surely does."""

REPEATS_FOR = 0.25
"""Seconds for which a speed must have said the same to be held: a coarse one may come in a table
that says everything again, and not tell so."""

STILL = 0.5
"""Share of the rate by which a speed drifted first that shows that it still does."""


@inner
def speed_may_be_wrong(monitor, settings):
    """Whether the speed that contradicts may be rounded or held: it tells so itself in a moment."""
    resting = is_standing(monitor.speed) and monitor.lead_rests_for >= LEAD_RESTED
    if resting or monitor.leapt_for:
        # A car that drove off would have left its lead, or followed one that is not at rest; and
        # nothing but its own fault makes an accelerometer leap.
        return False
    if hides_by_rounding(monitor.speed, settings) or slips(monitor.speed.motion):
        return True
    if not settings.check_repetition:
        return False
    if _repeats_as_it_is_felt(monitor):
        return True
    when_held = as_the_car_moves(monitor, monitor.speed.motion.derivative_when_held)
    then = monitor.filtered - when_held - monitor.check.reference
    agrees_with_then = abs(then) <= monitor.check.limit
    return speed_seems_held(monitor.speed, agrees_with_then, _lead_speaks_for(monitor))


@inner
def _lead_speaks_for(monitor):
    """Whether the lead, as observers see it, is steadier if the accelerometer is right than if the
    speed is."""
    by_speed = acceleration_by_speed(monitor) + monitor.relative_slow
    felt = monitor.filtered - monitor.check.reference + monitor.relative_slow
    return not isnan(monitor.lead) and abs(felt) < abs(by_speed)


@inner
def _repeats_as_it_is_felt(monitor):
    """Whether the speed says the same while what is felt changed just now, and little by little, as
    a car brakes: an accelerometer's fault jumps, or drifts for longer."""
    off = monitor.check.residual
    by_and_by = came_lately(monitor.jump, off) and not came_at_once(monitor.jump, off)
    return may_miss_a_change(monitor.speed) and by_and_by


@inner
def is_held(monitor, settings):
    """Whether a speed that may be wrong surely is held: it repeats itself while so much is felt
    as no road makes."""
    beyond_roads = abs(monitor.check.residual) > settings.steepest_road
    missing = settings.check_repetition and misses_a_change(monitor.speed)
    missing = missing and monitor.speed.held.same_for > REPEATS_FOR
    return missing and beyond_roads and _repeats_as_it_is_felt(monitor)


@inner
def is_the_speeds(monitor, settings):
    """Whether what disagrees with the speed surely is none of the accelerometer's doing."""
    check, repetition = monitor.check, monitor.repetition
    if check.ground != Ground.HOST_SPEED or not is_gauged(check.kind):
        return False
    leapt = leapt_lately(monitor) and has_leapt(monitor, check.residual)
    if leapt or is_beyond_chance(repetition, repetition.run):
        # What is held feels nothing, either.
        return False
    share = own_share(monitor.jump, check.residual)
    doubt = jump_noise(monitor.jump) / abs(check.residual)
    least = doubt - NONE_OF_IT if seems_road(monitor, settings) else AGAINST_IT
    return least < share < NONE_OF_IT - doubt


@inner
def is_told(monitor):
    """Whether the speed's derivative has followed the change by now, so that its size is known; not
    while the speed says the same, as one that is held."""
    return steps_since(monitor.jump) >= SETTLED and not monitor.speed.held.same


@inner
def seems_road(monitor, settings):
    """Whether it may be the road that changed the derivative: no road changes by more, and the lead
    does not say that it was the speed."""
    return abs(monitor.check.residual) <= settings.steepest_road and not _lead_speaks_for(monitor)


@inner
def blame_speed(monitor, settings):
    """The speed drifts by what the accelerometer differs by."""
    off = monitor.check.residual
    felt = own_share(monitor.jump, off) * off
    since = steps_since(monitor.jump) * STEP_S
    filter_time = settings.host_speed_filter_time
    convict_drift(monitor.speed, -off, monitor.check.limit, felt, since, filter_time)


@inner
def hold_speed(monitor, settings):
    """Hold a faulty speed, which may be right by now, against the accelerometer. What still differs
    after a long time by no more than a road makes is the road, and the speed is right."""
    speed = monitor.speed
    if monitor.faulty or isnan(monitor.filtered) or not has_settled(speed.motion, settings):
        return
    rate = monitor.slope - difference(monitor, settings)
    limit = STILL * abs(speed.because.first) if drifts(speed) else settings.acceleration_limit
    if abs(rate) < limit + allowance_of(monitor, settings):
        monitor.level_for = 0.0
        return
    doubt_again(speed)
    if drifts(speed):
        follow_drift(speed, rate, STEP_S)
    is_road = abs(rate) <= settings.steepest_road
    monitor.level_for = monitor.level_for + STEP_S if is_road else 0.0
    if monitor.level_for >= GENTLE_SLOPE * settings.requalify_time:
        # No speed drifts for so long.
        monitor.slope -= rate
        believe_again(speed)
