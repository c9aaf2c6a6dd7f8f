"""Whether the host's accelerometer is faulty, by all evidence, and when it is right again."""

from math import isfinite, isnan

import numpy as np

from lfd_diagnosis.acceleration_against_lead import (
    against_lead,
    follow_lead,
    is_resting,
    mean_of_swings,
)
from lfd_diagnosis.acceleration_against_speed import against_speed
from lfd_diagnosis.acceleration_direction import may_reverse
from lfd_diagnosis.acceleration_jump import came_at_once
from lfd_diagnosis.acceleration_samples import coast_samples
from lfd_diagnosis.acceleration_shaking import swings_over_bumps
from lfd_diagnosis.acceleration_size import estimate_size, find_size
from lfd_diagnosis.acceleration_state import (
    forget_baseline,
    forgive_acceleration,
    has_leapt,
    newest_sample,
)
from lfd_diagnosis.confidence import counted
from lfd_diagnosis.evidence import Ground, give_ground, is_exceeded, is_gauged
from lfd_diagnosis.faulty_acceleration import became_another, slope_after
from lfd_diagnosis.held_acceleration import is_still_held, look_for_hold
from lfd_diagnosis.held_speed import convict_held
from lfd_diagnosis.host_speed import SLOW, is_road_calm, is_usable, may_be_right
from lfd_diagnosis.road_bend import is_unproven
from lfd_diagnosis.road_slope import KNOWN_AFTER_SILENCE, STILL_KNOWN, lose_slope
from lfd_diagnosis.roughness import ROUGH_TIME, ROUGH_TIME_ALONE, rough_share
from lfd_diagnosis.speed_against_acceleration import (
    blame_speed,
    hold_speed,
    is_held,
    is_the_speeds,
    is_told,
    seems_road,
    speed_may_be_wrong,
)
from lfd_diagnosis.unseen_end import is_unseen_end, take_for_slope
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

DISAGREES = 0.5
"""Share of its limit beyond which a sample by itself disagrees."""

SWING, MORE_THAN_A_BUMP = 25, 1.5
"""Steps for which a bump may swing a sensor's mounting to one side at most, and times its limit by
which it is off if that need not be waited for."""

SELDOM = 0.03
"""Seconds between two samples beyond which a speed tells nothing of a bad road."""


@inner
def coast_acceleration(monitor):
    """One step in which nothing is heard of the host at all: neither that nor its speed says
    anything, and how its road goes on is seen by nobody."""
    coast_samples(monitor)
    _judge_nothing(monitor, STILL_KNOWN)
    monitor.silent_for += STEP_S


@inner
def judge_acceleration(
    monitor, settings, horizon, relative_acceleration, relative_velocity, lead_report
):
    """Judge the step whose samples were taken, or that there is none.

    The lead's relative acceleration (m/s^2), as the first observer makes it, and relative velocity
    (m/s), NaN where the radar tells nothing; `lead_report`: what it says itself.
    """
    if horizon.acceleration_stale:
        _judge_nothing(monitor, KNOWN_AFTER_SILENCE)
        monitor.silent_for += STEP_S
        return
    monitor.silent_for = 0.0
    monitor.ticks += 1
    monitor.ended_for += STEP_S
    rests = is_resting(relative_velocity)
    monitor.lead_rests_for = monitor.lead_rests_for + STEP_S if rests else 0.0
    follow_lead(monitor, relative_acceleration)
    usable = is_usable(monitor.speed, settings)
    monitor.must_agree = settings.clear_time
    _hold_against_evidence(monitor, settings, usable, relative_velocity, lead_report)
    exceeded = is_exceeded(monitor.check)
    _count(monitor, settings, exceeded)
    frozen = look_for_hold(monitor, settings, usable, relative_velocity)
    rough = settings.check_roughness and _seems_rough(monitor, usable)
    if frozen and (not monitor.faulty or is_gauged(monitor.kind)):
        _convict_held(monitor, settings, horizon.measured_acceleration)
    elif monitor.faulty:
        still = settings.check_repetition and is_still_held(monitor)
        _requalify(monitor, settings, exceeded or still or frozen or rough)
    elif rough:
        share = rough_share(monitor.roughness)
        _convict(monitor, settings, Kind.NOISE, Ground.ROUGHNESS, share, 0.0)
    elif exceeded and _is_beyond_doubt(monitor, settings):
        _tell_whose(monitor, settings)
        if usable and monitor.speed.faulty:
            _hold_against_evidence(monitor, settings, False, relative_velocity, lead_report)


@inner
def _hold_against_evidence(monitor, settings, usable, relative_velocity, lead_report):
    """Make the step's check: by the host's speed where that is `usable`, else by the lead."""
    if usable:
        # The speed tells what jumped.
        monitor.jumped_for = 0
        against_speed(monitor, settings)
    else:
        if not monitor.faulty:
            monitor.reference = np.nan
        forget_baseline(monitor)
        monitor.felt = np.nan
        if may_be_right(monitor.speed):
            hold_speed(monitor, settings)
        lose_slope(monitor, STILL_KNOWN)
        against_lead(monitor, settings, relative_velocity, lead_report)


@inner
def _convict_held(monitor, settings, value):
    """It says the same `value` (m/s^2) again and again."""
    if monitor.faulty:
        # What looked like an offset was where it stopped.
        monitor.reference = monitor.slope_before
    kind = Kind.ZERO if value == 0.0 else Kind.HOLD
    _convict(monitor, settings, kind, Ground.REPETITION, monitor.repetition.run + 1, 0.0)


@inner
def _is_beyond_doubt(monitor, settings):
    """Whether what disagrees surely does: for long enough, and by itself, while nothing else may be
    wrong."""
    return (
        monitor.confidence >= settings.acceleration_steps
        # One sample alone may be an outlier, however many steps hold it.
        and monitor.new_samples >= 2
        and _newest_disagrees(monitor)
        and _outlasts_a_bump(monitor)
        and not (monitor.check.ground == Ground.HOST_SPEED and may_reverse(monitor))
    )


@inner
def _tell_whose(monitor, settings):
    """What surely disagrees is the accelerometer's, or else the speed's, or of the road."""
    check = monitor.check
    if check.ground == Ground.HOST_SPEED and speed_may_be_wrong(monitor, settings):
        # If it is, it tells so in a moment.
        if is_held(monitor, settings):
            convict_held(monitor.speed, monitor.speed.last)
            forgive_acceleration(monitor)
        return
    if is_unseen_end(monitor, settings):
        take_for_slope(monitor)
    elif settings.check_speed and is_the_speeds(monitor, settings):
        _take_for_the_speeds(monitor, settings)
    else:
        _convict(monitor, settings, check.kind, check.ground, check.residual, check.limit)


@inner
def _take_for_the_speeds(monitor, settings):
    """What disagrees is the road that bent, or a speed that drifts, as soon as that is told."""
    if not is_told(monitor):
        return
    if seems_road(monitor, settings):
        take_for_slope(monitor)
    else:
        blame_speed(monitor, settings)
        forgive_acceleration(monitor)


@inner
def _judge_nothing(monitor, worth):
    """There is nothing to judge, and the slope still `worth` so many seconds of learning."""
    monitor.confidence, monitor.corrected = 0, False
    monitor.ended_for += STEP_S
    monitor.check.ground = Ground.NONE
    lose_slope(monitor, worth)


@inner
def _seems_rough(monitor, usable):
    """Whether it has been rough for long enough: for longer where no speed tells a bad road."""
    speed = monitor.speed
    if not usable or abs(speed.last) < SLOW or speed.roughness.period > SELDOM:
        return monitor.rough_for >= ROUGH_TIME_ALONE
    return monitor.rough_for >= ROUGH_TIME


@inner
def _newest_disagrees(monitor):
    """Whether the newest sample does so itself, not only what was made of those before."""
    check = monitor.check
    smooth = monitor.filtered
    if check.ground == Ground.OBSERVERS:
        smooth = mean_of_swings(monitor)
    newest = check.residual + newest_sample(monitor) - smooth
    return newest * check.residual > 0.0 and abs(newest) > DISAGREES * check.limit


@inner
def _outlasts_a_bump(monitor):
    """Whether it has lasted longer than a swing of the sensor, if wheels were shaken just now or it
    is no more than a bump may be."""
    lasted = monitor.exceeded_for >= SWING
    large = abs(monitor.check.residual) > MORE_THAN_A_BUMP * monitor.check.limit
    return lasted or (large and is_road_calm(monitor.speed)) or not swings_over_bumps(monitor)


@inner
def _count(monitor, settings, exceeded):
    """Confidence in a fault, by steps (eq 26)."""
    monitor.exceeded_for = monitor.exceeded_for + 1 if exceeded else 0
    if exceeded:
        if monitor.confidence == 0:
            monitor.new_samples = 0
        monitor.new_samples += monitor.fresh and _newest_disagrees(monitor)
    monitor.confidence = counted(monitor.confidence, exceeded, settings.confidence_max)


@inner
def _take_for_drift(monitor):
    """A fault that did not come at once is held against the slope from before it, and what was
    taken for a bend of the road, but went on, was none of it; by how much more it is off
    (m/s^2)."""
    reference = monitor.reference
    if is_unproven(monitor.bend):
        monitor.slope = monitor.bend.slope_before
    monitor.kind, monitor.reference = Kind.RAMP, monitor.slope
    return reference - monitor.slope


@inner
def _convict(monitor, settings, kind, ground, first, second):
    """Faulty from now on, on that ground with its figures."""
    monitor.faulty, monitor.kind = True, kind
    give_ground(monitor.because, ground, first, second, 0.0)
    monitor.confidence, monitor.agreeing = settings.confidence_max, 0.0
    if isnan(monitor.reference):
        monitor.reference = monitor.slope
    off = monitor.check.residual if monitor.check.ground != Ground.NONE else 0.0
    # Where a late speed smears what it tells of a manoeuvre, the differences do not show a jump.
    monitor.came_at_once = came_at_once(monitor.jump, off) or has_leapt(monitor, off)
    if ground == Ground.HOST_SPEED and is_gauged(kind) and not monitor.came_at_once:
        off += _take_for_drift(monitor)
    monitor.slope_before, monitor.corrected = monitor.reference, False
    monitor.off, monitor.settled = off, 0
    find_size(monitor, off)
    estimate_size(monitor, off, ground == Ground.HOST_SPEED)
    forget_baseline(monitor)
    monitor.back_for, monitor.settling = 0, False
    monitor.level, monitor.level_for = np.nan, 0.0
    monitor.jumped_for = 0


@inner
def _requalify(monitor, settings, disagrees):
    """A fault is over after a while of agreement; what is felt by then tells the slope."""
    if disagrees:
        monitor.agreeing = 0.0
        return
    monitor.agreeing += STEP_S
    if monitor.agreeing >= monitor.must_agree:
        seen = monitor.check.ground == Ground.HOST_SPEED
        drifted = seen and monitor.kind == Kind.RAMP
        jumped = seen and monitor.kind == Kind.OFFSET
        if jumped or (drifted and monitor.settling):
            monitor.slope = slope_after(monitor, settings)
        else:
            monitor.slope += monitor.reference - monitor.slope_before
        if not seen:
            # What the slope is by now nobody has seen.
            monitor.slope_known = min(monitor.slope_known, STILL_KNOWN)
        left = monitor.check.residual
        told = is_gauged(monitor.kind) and not became_another(monitor, settings)
        monitor.ended_size, monitor.ended_for = monitor.size if told else np.nan, 0.0
        forgive_acceleration(monitor)
        if drifted:
            # What a slope or a drift within its limit has left is no jump.
            monitor.baseline = monitor.slope + left


@inner
def has_evidence(monitor):
    """Whether the newest check says anything in figures."""
    return monitor.check.ground != Ground.NONE and isfinite(monitor.check.residual)
