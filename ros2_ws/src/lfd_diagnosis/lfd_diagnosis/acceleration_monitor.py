"""The host's accelerometer: followed, judged, and what a healthy one would say (robust profile)."""

from math import exp, isfinite, isnan, sqrt

import numpy as np

from lfd_diagnosis.acceleration_against_lead import (
    BLIND_STD,
    against_lead,
    ends_braking,
    follow_lead,
    is_nearing,
    is_resting,
    mean_of_swings,
    newest_mean,
    waits,
)
from lfd_diagnosis.acceleration_against_speed import (
    KNOWN_AFTER_SILENCE,
    STILL_KNOWN,
    against_speed,
    allowance_of,
    became_another,
    doubt_slope,
    slope_after,
    speed_may_be_wrong,
)
from lfd_diagnosis.acceleration_direction import as_the_car_moves, follow_direction, may_reverse
from lfd_diagnosis.acceleration_jump import came_at_once, is_measured, restart_jump
from lfd_diagnosis.acceleration_size import DRIFT_TIME, SLOPE_DRIFT, find_size
from lfd_diagnosis.acceleration_state import (
    BASELINE_DELAY,
    as_possible,
    follow_shaking,
    forget_baseline,
    forgive_acceleration,
    has_leapt,
    is_possible,
    lose_samples,
    newest_sample,
    swings_over_bumps,
)
from lfd_diagnosis.confidence import counted
from lfd_diagnosis.evidence import Ground, give_ground, is_exceeded, is_gauged, repeats
from lfd_diagnosis.host_speed import (
    JERK_SHARE,
    ROUGH_TIME,
    ROUGH_TIME_ALONE,
    SLOW,
    came_to_rest,
    follow_speed,
    is_believed,
    is_coarse,
    is_road_calm,
    is_standing,
    is_usable,
    lose_speed,
)
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.repetition import (
    excuse_repetition,
    is_frozen,
    is_frozen_for,
    note_change,
    take_repetition,
    times_unchanged,
)
from lfd_diagnosis.ring import append, at, is_full, mean_of
from lfd_diagnosis.road_bend import start_bend
from lfd_diagnosis.roughness import (
    SECOND_DIFFERENCES,
    is_noiseless,
    is_rough,
    resolution_of,
    rough_share,
    take_roughness,
)
from lfd_diagnosis.sample import POSSIBLE_JERK, SAME_STAMP, as_measured, filter_share, is_new
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

LARGEST_STEP, LEAP_ROUGHNESS, LEAP_MEMORY = 1.0, 3.0, 30
"""m/s^2 by which a possible jerk moves the accelerometer at most from one sample to the next, and
roughness beyond that: what exceeds them is a leap, for so many steps."""

TOLD, FEW, SHORT, SHARPEST = 3.0, 3, 0.04, 60.0
"""m/s^2 by which single samples must leap where they are too noisy to tell, samples whose mean then
does, seconds that they take at most, and m/s^3 that it exceeds: no braking is as sharp."""

OUTLIER, OUTLASTS = 8.0, 0.04
"""m/s^2 by which no car's acceleration leaps: samples that do are not taken before they have done
so for that many seconds, as no shock does."""

DISAGREES = 0.5
"""Share of its limit beyond which a sample by itself disagrees."""

SHAKEN = 0.1
"""Share of rough samples above which the road shakes a sensor."""

SWING, MORE_THAN_A_BUMP = 25, 1.5
"""Steps for which a bump may swing a sensor's mounting to one side at most, and times its limit by
which it is off if that need not be waited for."""

END_HIDDEN, ENDS_BY, ENDS_BY_MOST = 3.0, 0.5, 1.5
"""Seconds after the end of a fault in which a jump back may be its real end, as a road that bent
made it seem over, and least and largest share of its size that this is off by."""

FIRST_TIME, NEARER_LEVEL = 1.0, 0.5
"""Seconds of learning in which a signal may have begun with something else, and share of that which
it is off by then at most."""

LEADS_TO_SLOPE = 0.6
"""Share of a jump by which it may miss the slope that it leads back to."""

SELDOM = 0.03
"""Seconds between two samples beyond which a speed tells nothing of a bad road."""

HELD_CHANGE, HELD_STEPS, SPEED_STEPS = 0.2, 2.5, 0.15
"""m/s^2, steps of its resolution, and of a coarse speed's resolution over the time that its
derivative is filtered for, by which that must change while the accelerometer repeats itself."""

BRAKED_HARD, BRAKING_FADES, ENDS = 4.0, share_of(0.2), 0.5
"""m/s^2 of braking whose sudden end, as when the car comes to rest, radar and accelerometer tell
at different times; share by which it is forgotten in a step, and share of it left when it ends."""

ROUGH_ACCELERATION = 0.25
"""Second differences in m/s^2 that are not called rough, however smooth the sensor was."""

UNCHANGED_NOISY = 3.0
"""How many times longer than chance would have it a noisy accelerometer must repeat itself without
a reason to change."""

ZERO_SIGMA = 2.0
"""Deviations of the slow mean by which a zero may be what speed and slope say."""

UNHEARD = 0.5
"""Seconds of silence after which a car may accelerate as it likes."""

HOST_FADES = 2.0
"""Time constant in s with which an acceleration of the host fades that nothing tells any more."""

HOST_KEEP = exp(-STEP_S / HOST_FADES)
"""What is left of it after a step."""


@inner
def follow_acceleration(monitor, settings, horizon):
    """Take one step's samples; afterwards `acceleration` is the best that is known."""
    now = horizon.stamp * 1e-9
    speed, usable = monitor.speed, not horizon.acceleration_stale
    if settings.use_host_speed and not horizon.host_speed_stale:
        time = now - horizon.host_speed_age
        value = as_measured(horizon.measured_host_speed)
        felt = monitor.acceleration
        if not monitor.faulty and is_possible(monitor):
            felt = monitor.filtered - monitor.slope
        felt = as_the_car_moves(monitor, felt)
        follow_speed(speed, settings, now, time, value, felt, monitor.shaken)
    else:
        lose_speed(speed)
    if usable:
        time = now - horizon.acceleration_age
        _follow_samples(monitor, settings, time, as_measured(horizon.measured_acceleration))
    else:
        lose_samples(monitor)
    if is_usable(speed, settings):
        monitor.acceleration = as_the_car_moves(monitor, speed.derivative)
    elif usable and not monitor.faulty and is_possible(monitor):
        ended = came_to_rest(speed) or (monitor.jumped_for and ends_braking(monitor))
        if monitor.jumped_for and swings_over_bumps(monitor):
            # It may be a bump, of which a few samples are no mean, or brakes.
            monitor.acceleration = monitor.filtered - monitor.slope
        elif (ended or waits(monitor)) and is_full(monitor.samples):
            # No fault begins so slowly, or ends as suddenly as that: a filter would be late.
            monitor.acceleration = newest_mean(monitor) - monitor.slope
        elif not monitor.jumped_for:
            # While a jump is being looked into, what was before it.
            monitor.acceleration = at(monitor.before_jump, 0)
    else:
        monitor.acceleration *= HOST_KEEP
    heard = usable and is_possible(monitor)
    _follow_braking(monitor, as_measured(horizon.measured_acceleration) if heard else np.nan)
    follow_direction(monitor)


@inner
def coast_acceleration(monitor):
    """One step in which nothing is heard of the host at all: neither that nor its speed says
    anything, and how its road goes on is seen by nobody."""
    lose_speed(monitor.speed)
    lose_samples(monitor)
    monitor.acceleration *= HOST_KEEP
    _follow_braking(monitor, np.nan)
    follow_direction(monitor)
    _judge_nothing(monitor, STILL_KNOWN)
    monitor.silent_for += STEP_S


@inner
def _follow_braking(monitor, value):
    """How hard the host lately braked, and whether that may have ended at once; the newest sample
    in m/s^2, NaN if there is none."""
    rests, heard = came_to_rest(monitor.speed), not isnan(value)
    monitor.braked *= 1.0 - BRAKING_FADES
    if heard:
        slows = as_the_car_moves(monitor, monitor.slope - monitor.filtered)
        monitor.braked = max(monitor.braked, slows)
    monitor.stops_from = max(monitor.stops_from, monitor.braked) if rests else 0.0
    ends = rests or as_the_car_moves(monitor, monitor.slope - value) < ENDS * monitor.braked
    monitor.jolt = monitor.braked if heard and ends and monitor.braked > BRAKED_HARD else 0.0


@inner
def _follow_samples(monitor, settings, time, said):
    # What is said beyond what is possible is as far off as that, and no other way.
    value = as_possible(said)
    share = filter_share(settings.host_speed_filter_time)
    period = time - monitor.last_at
    monitor.fresh = is_new(time, monitor.last_at)
    if monitor.fresh:
        # What swings back from a sample that was taken is no leap.
        leaps = min(abs(value - monitor.taken), abs(value - monitor.filtered)) > OUTLIER
        monitor.outliers += monitor.doubted and not leaps
        if leaps and not monitor.doubted:
            monitor.leapt_at = time
        monitor.doubted = leaps and time - monitor.leapt_at < OUTLASTS - SAME_STAMP
        monitor.last_at = time
    if monitor.doubted:
        value, monitor.fresh = monitor.taken, False
    monitor.taken = value
    if isnan(monitor.filtered):
        _start_filters(monitor, settings, value)
    monitor.filtered += share * (value - monitor.filtered)
    monitor.slow_filtered += JERK_SHARE * (monitor.filtered - monitor.slow_filtered)
    monitor.burst += share * ((value - monitor.filtered) ** 2 - monitor.burst)
    monitor.leapt_for = max(monitor.leapt_for - 1, 0)
    monitor.leapt_ago += 1
    if monitor.fresh:
        follow_shaking(monitor, value)
        leap = _leap(monitor, period)
        if leap:
            monitor.leap, monitor.leapt_for, monitor.leapt_ago = leap, LEAP_MEMORY, 0
        standing = is_standing(monitor.speed)
        healthy = not (monitor.faulty or standing)
        take_roughness(monitor.roughness, time, value, healthy, ROUGH_ACCELERATION)
        if standing:
            excuse_repetition(monitor.repetition, monitor.faulty)
        same = take_repetition(monitor.repetition, said, not monitor.faulty)
        _follow_while_held(monitor, settings, same)
    append(monitor.samples, value)
    append(monitor.before_jump, monitor.filtered - monitor.slope)
    # A bad road shakes the wheels, too; a sensor's own noise does not.
    monitor.shaken = rough_share(monitor.roughness) > SHAKEN
    # An engine, and those who get on, shake a standing car, and its wheels tell nothing of it.
    excused = is_standing(monitor.speed) or _is_bad_road(monitor.speed)
    rough = is_rough(monitor.roughness) and (monitor.faulty or not excused)
    monitor.rough_for = monitor.rough_for + STEP_S if rough else 0.0


@inner
def _follow_while_held(monitor, settings, same):
    """What the speed's derivative was when the accelerometer began to say the `same`.

    A late speed comes to what was felt before: that is no reason to change, its leaving it is.
    """
    speed = monitor.speed
    derivative = as_the_car_moves(monitor, speed.derivative)
    if not same:
        monitor.felt_when_held = monitor.taken - monitor.slope
        monitor.derivative_when_held = derivative
    elif is_usable(speed, settings):
        felt, then = monitor.felt_when_held, monitor.derivative_when_held
        if isnan(then) or abs(derivative - felt) < abs(then - felt):
            monitor.derivative_when_held = derivative


@inner
def _start_filters(monitor, settings, value):
    """With the first sample (m/s^2), or the first one after a silence: as if it had said all the
    time what speed and slope say."""
    monitor.filtered = monitor.slow_filtered = value
    if is_usable(monitor.speed, settings) and monitor.slope_known > 0.0 and not monitor.faulty:
        monitor.filtered = as_the_car_moves(monitor, monitor.speed.derivative) + monitor.slope
        slow = as_the_car_moves(monitor, monitor.speed.slow_derivative)
        monitor.slow_filtered = slow + monitor.slope


@inner
def _is_bad_road(speed):
    """Whether the wheels are shaken, too."""
    return is_believed(speed) and rough_share(speed.roughness) > SHAKEN


@inner
def _leap(monitor, period):
    """By how many m/s^2 the newest sample, or the mean of three, leaves the one before as no
    manoeuvre does, else 0; a noisy sensor's single ones tell little."""
    newest, rough = monitor.newest, LEAP_ROUGHNESS * sqrt(monitor.roughness.usual)
    last = newest.count - 1
    if last < 1:
        return 0.0
    possible = min(POSSIBLE_JERK * period, LARGEST_STEP)
    step = at(newest, last) - at(newest, last - 1)
    if abs(step) > possible + rough:
        return step
    if last < 2 * FEW or FEW * period > SHORT or possible + rough < TOLD:
        return 0.0
    now, before = newest.count - FEW, newest.count - 2 * FEW
    step = mean_of(newest, now, newest.count) - mean_of(newest, before, now)
    # The difference of two such means has a third of a second difference's noise.
    return step if abs(step) > SHARPEST * FEW * period + rough / 3.0 else 0.0


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
    frozen = _look_for_hold(monitor, settings, usable, relative_velocity)
    rough = settings.check_roughness and _seems_rough(monitor, usable)
    if frozen and (not monitor.faulty or is_gauged(monitor.kind)):
        _convict_held(monitor, settings, horizon.measured_acceleration)
    elif monitor.faulty:
        still = settings.check_repetition and _is_still_held(monitor)
        _requalify(monitor, settings, exceeded or still or frozen or rough)
    elif rough:
        share = rough_share(monitor.roughness)
        _convict(monitor, settings, Kind.NOISE, Ground.ROUGHNESS, share, 0.0)
    elif exceeded and _is_beyond_doubt(monitor, settings):
        ends = _ends_the_last(monitor, settings) or _leads_back(monitor, settings)
        if ends or _began_wrongly(monitor):
            _end_the_last(monitor)
        else:
            check = monitor.check
            _convict(monitor, settings, check.kind, check.ground, check.residual, check.limit)


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
        _lose_slope(monitor, STILL_KNOWN)
        against_lead(monitor, settings, relative_velocity, lead_report)


@inner
def _look_for_hold(monitor, settings, usable, relative_velocity):
    """Take note of whether the newest sample had reason to differ; whether it is held."""
    should_change = _should_have_changed(monitor, settings, usable, relative_velocity)
    if monitor.fresh:
        note_change(monitor.repetition, should_change)
    # What nears its lead moves, but may do so steadily.
    if not (should_change and usable) and is_noiseless(monitor.roughness):
        return False
    # Where noise changes it all the time, a car that moves makes it repeat nothing for long.
    unchanged = times_unchanged(monitor.repetition, UNCHANGED_NOISY)
    return (
        settings.check_repetition
        and is_frozen_for(monitor.repetition, should_change, unchanged)
        # A car that may stand repeats itself for as long as it stands.
        and (not is_standing(monitor.speed) if usable else should_change)
    )


@inner
def _is_still_held(monitor):
    """Whether a faulty one says the same again and again: what was held is, whatever told of it,
    until it changes; a coarse sensor repeats itself then as it did before."""
    repetition = monitor.repetition
    # The run that convicted it only grows, and others are shorter.
    held = repeats(monitor.kind) and repetition.run + 1 >= monitor.because.first
    return held or is_frozen(repetition, True)


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
        and not (
            monitor.check.ground == Ground.HOST_SPEED
            and (speed_may_be_wrong(monitor, settings) or may_reverse(monitor))
        )
    )


@inner
def _ends_the_last(monitor, settings):
    """Whether what looks like a fault is the end of the one before, which seemed over too soon, as
    one that a road may hide."""
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
    """Whether what looks like a fault leads back to the slope, from where a fault that was too
    small to be found may have put it, or a road that bent."""
    check = monitor.check
    jumped = check.ground == Ground.HOST_SPEED and check.kind == Kind.OFFSET
    if not (jumped and is_full(monitor.samples)):
        return False
    step, beside = _newest_residual(monitor), check.reference - monitor.slope
    hidden = beside * step < 0.0 and abs(step) <= settings.steepest_road
    return hidden and abs(beside + step) < LEADS_TO_SLOPE * abs(step)


@inner
def _began_wrongly(monitor):
    """Whether what looks like a fault is what the very first samples were off by, as a signal may
    be that someone has smoothed: by now it is nearer to level ground."""
    check = monitor.check
    first = check.ground == Ground.HOST_SPEED and monitor.slope_known < FIRST_TIME
    return first and abs(check.reference + check.residual) < NEARER_LEVEL * abs(check.reference)


@inner
def _newest_residual(monitor):
    """What the newest samples are off by, before the filter says so."""
    return monitor.check.residual + newest_mean(monitor) - monitor.filtered


@inner
def _end_the_last(monitor):
    """What is felt by now is the slope, which is in doubt."""
    monitor.slope = monitor.check.reference + _newest_residual(monitor)
    monitor.slope_known = min(monitor.slope_known, STILL_KNOWN)
    monitor.ended_size = np.nan
    forgive_acceleration(monitor)


@inner
def _judge_nothing(monitor, worth):
    """There is nothing to judge, and the slope still `worth` so many seconds of learning."""
    monitor.confidence, monitor.corrected = 0, False
    monitor.ended_for += STEP_S
    monitor.check.ground = Ground.NONE
    _lose_slope(monitor, worth)


@inner
def _lose_slope(monitor, worth):
    """Nothing tells how the road goes on; what its slope was is `worth` so many seconds of
    learning."""
    restart_jump(monitor.jump)
    start_bend(monitor.bend)
    if not monitor.faulty:
        doubt_slope(monitor, worth)


@inner
def _should_have_changed(monitor, settings, usable, relative_velocity):
    """Whether an accelerometer that repeats itself had reason to change."""
    speed = monitor.speed
    if not usable:
        # Nothing tells a car that stands but that it nears its lead.
        return not is_believed(speed) and is_nearing(relative_velocity)
    change = max(HELD_CHANGE, HELD_STEPS * resolution_of(monitor.roughness))
    if is_coarse(speed):
        # Each of its steps shows in its derivative.
        change += SPEED_STEPS * resolution_of(speed.roughness) / settings.host_speed_filter_time
    change += allowance_of(monitor, settings)
    derivative = as_the_car_moves(monitor, speed.derivative)
    if abs(derivative - monitor.derivative_when_held) > change:
        return True
    # What is held was measured once; a zero was not.
    zero_for = derivative + monitor.slope
    doubt = ZERO_SIGMA * deviation(monitor.slow_noise)
    return monitor.repetition.value == 0.0 and abs(zero_for) > change + doubt


@inner
def _seems_rough(monitor, usable):
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
def _convict(monitor, settings, kind, ground, first, second):
    monitor.faulty, monitor.kind = True, kind
    give_ground(monitor.because, ground, first, second, 0.0)
    monitor.confidence, monitor.agreeing = settings.confidence_max, 0.0
    if isnan(monitor.reference):
        monitor.reference = monitor.slope
    monitor.slope_before, monitor.corrected = monitor.reference, False
    off = monitor.check.residual if monitor.check.ground != Ground.NONE else 0.0
    monitor.size = monitor.off = off
    monitor.size_std, monitor.settled = np.nan, 0
    find_size(monitor, off)
    forget_baseline(monitor)
    monitor.back_for, monitor.settling = 0, False
    # Where a late speed smears what it tells of a manoeuvre, the differences do not show a jump.
    monitor.came_at_once = came_at_once(monitor.jump, off) or has_leapt(monitor, off)
    monitor.level, monitor.level_for = np.nan, 0.0
    monitor.jumped_for = 0


@inner
def _requalify(monitor, settings, disagrees):
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
def expected_std(monitor, settings):
    """Standard deviation in m/s^2 of `expected_acceleration`."""
    if not is_usable(monitor.speed, settings):
        return BLIND_STD
    if monitor.corrected:
        return monitor.size_std
    since = (monitor.settled + BASELINE_DELAY) * STEP_S
    drift = SLOPE_DRIFT**2 * min(since, DRIFT_TIME)
    # Each sample has noise of its own; the slow mean of the slope is held against only where
    # nothing is known of a moment before.
    noise = monitor.roughness.usual / SECOND_DIFFERENCES
    if is_measured(monitor.jump):
        # By now it is the road that shakes it.
        noise = max(noise, monitor.burst)
    jumped = monitor.faulty and monitor.kind == Kind.OFFSET
    slope = 0.0 if jumped else monitor.slow_noise.variance
    return sqrt(slope + monitor.step_noise.variance + noise + drift)


@inner
def expected_acceleration(monitor, settings):
    """What a healthy accelerometer would say, in m/s^2: it feels the slope of the road, too."""
    if is_usable(monitor.speed, settings):
        if monitor.corrected:
            return newest_sample(monitor) - monitor.size
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


@inner
def has_evidence(monitor):
    """Whether the newest check says anything in figures."""
    return monitor.check.ground != Ground.NONE and isfinite(monitor.check.residual)
