"""A faulty accelerometer, followed by the speed: its size, the slope under it, and how it ends."""

from math import isnan

import numpy as np

from lfd_diagnosis.acceleration_allowance import allowance_of, jerk_allowance
from lfd_diagnosis.acceleration_jump import forget_jump, is_measured
from lfd_diagnosis.acceleration_size import SIZE_TO, estimate_size
from lfd_diagnosis.acceleration_state import (
    LEVEL_ROAD,
    follow_off,
    has_leapt,
    is_possible,
    newest_sample,
)
from lfd_diagnosis.evidence import Ground, is_gauged, set_check
from lfd_diagnosis.repetition import is_frozen
from lfd_diagnosis.road_slope import follow_baseline
from lfd_diagnosis.roughness import is_rough
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

LEAST, FADED_STEPS = 0.6, 50
"""m/s^2 to which an acceleration that jumped must come back, and steps for which it must stay there
if it came little by little."""

BACK, BACK_STEPS, STILL_THERE = 0.65, 5, 0.75
"""Share of a fault by which it must jump back, and steps for which it must stay there, to be over;
and share of it that, found again for as many steps, shows that it is not."""

UNDER_JUMP, LARGEST_RATE, LARGEST_SLOPE = 1.0, 0.5, 1.5
"""Time constant in s with which the slope is followed under a jump, m/s^3 by which it changes at
most, and m/s^2 by which in all."""

FELT_SHARE = share_of(0.05)
"""Share by which the mean of what is felt under a fault follows in a step."""

LEVEL, GENTLE_SLOPE = 0.35, 3.0
"""m/s^2 within which what is felt stays where it is, and how many times longer it must do so if it
is to be a level road's, where the slope from before may have been one."""

ANOTHER = 50
"""Steps after which a fault is surely of another size than the jump that was measured."""

THERE = 0.75
"""Share of a jump by which a sample may lie beside it that still shows it."""


@inner
def follow_fault(monitor, settings, off):
    """Make the step's check of a faulty accelerometer, by what the difference (`off`, m/s^2) was
    before the fault, and follow how far it is off."""
    residual = off - monitor.reference
    monitor.felt = off if isnan(monitor.felt) else monitor.felt + FELT_SHARE * (off - monitor.felt)
    follow_off(monitor, residual)
    monitor.settled += 1
    estimate_size(monitor, residual, True)
    _follow_slope(monitor, settings, off)
    least = LEAST if monitor.kind == Kind.OFFSET else settings.acceleration_limit
    limit = max(0.5 * abs(monitor.off), least)
    follow_baseline(monitor, settings, off)
    _await_jump_back(monitor, off)
    _follow_level(monitor, settings)
    faded = abs(off - monitor.slope_before) < min(abs(residual), LEAST)
    monitor.faded_for = monitor.faded_for + 1 if faded else 0
    if monitor.faded_for >= FADED_STEPS:
        # The fault faded, and what was taken for a changing slope was that.
        monitor.reference = monitor.slope_before
    left = 0.0 if monitor.settling else residual
    set_check(monitor.check, Ground.HOST_SPEED, left, limit, monitor.kind, np.nan)


@inner
def _await_jump_back(monitor, off):
    """Notice a jump back: the fault is over then, and what is left only has to settle."""
    if monitor.kind == Kind.NOISE:
        # Its swings are no jumps.
        return
    if monitor.settling:
        # A speed that comes in steps may have jumped for a moment: then the fault is still there.
        size = monitor.undone_by
        still = (off - monitor.undone) * size > STILL_THERE * size * size
        monitor.back_for = monitor.back_for - 1 if still else BACK_STEPS
        monitor.settling = monitor.back_for > 0
        return
    step = (off - monitor.baseline) * (1.0 if monitor.off > 0 else -1.0)
    back = step < -BACK * abs(monitor.off) and abs(monitor.off) > LEAST
    monitor.back_for = monitor.back_for + 1 if back else 0
    if monitor.back_for >= BACK_STEPS:
        # How the slope has changed meanwhile is felt in a moment.
        monitor.settling, monitor.undone_by = True, monitor.size
        monitor.undone = monitor.baseline - monitor.size


@inner
def _follow_slope(monitor, settings, off):
    """A jump stays what it was; what changes slowly under it is the slope.

    As long as no more changes than under a healthy signal, what is best known of the acceleration
    is the measurement without the jump (`corrected`).
    """
    repeated = is_frozen(monitor.repetition, True)
    still = not monitor.settling and not repeated and not is_rough(monitor.roughness)
    measured = is_measured(monitor.jump)
    change = off - monitor.size - monitor.reference
    limit = settings.acceleration_step_limit + allowance_of(monitor, settings)
    newest = newest_sample(monitor) - monitor.size - monitor.acceleration - monitor.reference
    there = abs(newest) < THERE * abs(monitor.size)
    stays = abs(change) < limit
    known = monitor.kind == Kind.OFFSET and (measured or monitor.settled > SIZE_TO)
    monitor.another_for = monitor.another_for + 1 if still and known and not stays else 0
    leapt = monitor.leapt_ago < monitor.settled and has_leapt(monitor, change)
    if monitor.another_for >= ANOTHER and leapt:
        # It jumped again, to another level; without a leap it would be the road that changed.
        forget_jump(monitor.jump)
        monitor.another_for = monitor.settled = 0
    # What no car does is not a healthy sample plus a jump.
    steady = still and measured and stays and is_possible(monitor)
    monitor.corrected = steady and there
    if steady:
        rate = max(-LARGEST_RATE, min(LARGEST_RATE, change / UNDER_JUMP))
        slope = monitor.reference + STEP_S * rate
        least, most = monitor.slope_before - LARGEST_SLOPE, monitor.slope_before + LARGEST_SLOPE
        monitor.reference = max(least, min(most, slope))


@inner
def _follow_level(monitor, settings):
    """Take for the road's what stays where it is for long: where it came little by little and no
    steeper than roads are, since sensors jump, or go on drifting; and where it is what is felt on a
    level road, while the fault is held against a slope."""
    if isnan(monitor.level) or abs(monitor.felt - monitor.level) > LEVEL:
        monitor.level, monitor.level_for = monitor.felt, 0.0
    monitor.level_for += STEP_S
    if not is_gauged(monitor.kind) or monitor.settling:
        return
    felt, steep = abs(monitor.felt), abs(monitor.reference) > settings.acceleration_limit
    is_road = not monitor.came_at_once and felt <= settings.steepest_road
    # The slope that it is held against may be a real one, unless it is steep.
    times = 1.0 if is_road or steep else GENTLE_SLOPE
    is_level = is_road or felt < LEVEL_ROAD
    if is_level and monitor.level_for >= times * settings.requalify_time:
        monitor.reference, monitor.corrected = monitor.felt, False
        forget_jump(monitor.jump)


@inner
def became_another(monitor, settings):
    """Whether a jump undid more or less than the jump that made it faulty, and did not lead back to
    the slope either. Of drifts nobody can say so: part of theirs was taken for the slope."""
    if not (monitor.settling and monitor.kind == Kind.OFFSET):
        return False
    limit = settings.acceleration_limit + allowance_of(monitor, settings)
    felt = monitor.felt
    return min(abs(felt - monitor.undone), abs(felt - monitor.reference)) > limit


@inner
def slope_after(monitor, settings):
    """The slope (m/s^2) after a fault that was undone: what was followed under it, moved to what is
    felt by then, give or take a jerk; not moved where the fault became another."""
    if became_another(monitor, settings):
        return monitor.reference
    doubt = jerk_allowance(monitor, settings)
    slope = max(monitor.felt - doubt, min(monitor.felt + doubt, monitor.reference))
    if abs(slope - monitor.slope_before) > settings.steepest_road:
        # No road changes so much: the manoeuvre is not over yet.
        return monitor.reference
    return slope
