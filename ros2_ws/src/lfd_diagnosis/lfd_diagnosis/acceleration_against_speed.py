"""The host's accelerometer against the derivative of its speed.

Both go through the same filter; their difference is gravity on a slope, which changes slowly, and
some noise. A fault is a sudden change of the difference, or more of it than any road makes.
"""

from math import isnan

import numpy as np

from lfd_diagnosis.acceleration_direction import (
    acceleration_by_speed,
    as_the_car_moves,
    follow_reversing,
)
from lfd_diagnosis.acceleration_jump import (
    follow_difference,
    forget_jump,
    is_measured,
    learn_jump_noise,
    least_beyond,
)
from lfd_diagnosis.acceleration_size import JUMPED, SIZE_TO, estimate_size
from lfd_diagnosis.acceleration_state import (
    BASE_SHARE,
    LAG_MEMORY,
    LAG_PRIOR,
    LEARNT_EVERY,
    LEVEL_ROAD,
    follow_off,
    forget_baseline,
    has_leapt,
    is_possible,
    newest_sample,
    shaking_left,
    swings_over_bumps,
)
from lfd_diagnosis.evidence import Ground, is_exceeded, is_gauged, repeats, set_check
from lfd_diagnosis.held_speed import tells_of_bends
from lfd_diagnosis.host_speed import rattles, seldom_heard
from lfd_diagnosis.noise import deviation, learn_noise, while_learning
from lfd_diagnosis.repetition import is_frozen
from lfd_diagnosis.ring import append, at, is_full
from lfd_diagnosis.road_bend import follow_bend, has_bent, is_unproven, leave_bend, slope_now
from lfd_diagnosis.roughness import is_rough
from lfd_diagnosis.sample import POSSIBLE_JERK, beyond
from lfd_diagnosis.speed_derivative import JERK_FILTER, JERK_SHARE, jerk_between, jerk_of
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

GENTLE = 2.0
"""m/s^3 up to which the accelerometer's jerk may as well be its noise, or a fault."""

WARM_UP = 3.0
"""Seconds over which the limits come down from thrice to once their width."""

STILL_KNOWN, KNOWN_AFTER_SILENCE, SLOPE_FADES = 1.0, 2.5, 0.8
"""Seconds of learning that a slope is worth however long nothing was heard of it, and after a
silence of an accelerometer, which may come back with an offset; and how many of them each second of
that takes."""

LAG_DOUBT, CALM_JERK, LAG_MOST = 0.15, 4.0, 1.5
"""s by which the lag may differ from what is known of it before a jerk has told it, m/s^3 up to
which that does not matter, and m/s^2 that the accelerometer may be ahead at most."""

SHARP_JERK = 8.0
"""m/s^3 that a jerk must exceed for its excess to count for a moment longer."""

MOST_ALLOWANCE, STEEPEST = 6.0, 4.0
"""m/s^2 by which limits widen at most, and that a slope and a sensor's mounting make at most."""

LITTLE_JERK = 160.0
"""Sum of squares of jerks, in m^2/s^6, below which an accelerometer's slow noise may as well make
the lag that is learnt."""

LARGEST_LAG = 0.3
"""Largest lag in s between accelerometer and speed that is learnt."""

SLOPE_TIME = 4.0
"""Time constant in s of the slow mean, as far as its rate allows."""

BURST, SHAKEN_SIGMA = 0.15, 2.0
"""Share of a shaking's rms by which limits widen, and deviations of what it leaves, if more."""

ENDING = 0.5
"""Share of a slope by which what changes towards level ground may be off longer: every slope ends,
and that is the road rather than a drift."""

LASTING, LARGE, LARGE_FOR_SWINGS = 6, 2.0, 3.0
"""Steps for which a jump must have lasted, and how many times its limit it must be, to be seen in
the samples as they are; and if bumps swing the sensor."""

LEAST, FADED_STEPS = 0.6, 50
"""m/s^2 within which an acceleration that jumped must come back, and for how many steps if it did
not come back at once."""

BACK, BACK_STEPS, STILL_THERE = 0.65, 5, 0.75
"""Share of a fault by which it must jump back, and for how many steps, to be over; and share of it
that for as many steps shows that it did not."""

UNDER_JUMP, LARGEST_RATE, LARGEST_SLOPE = 1.0, 0.5, 1.5
"""Time constant in s with which the slope is followed under a jump, and by how many m/s^3 and m/s^2
at most."""

FELT_SHARE = share_of(0.05)
"""Share by which the mean follows of what a faulty one is off by."""

LEVEL, GENTLE_SLOPE = 0.35, 3.0
"""m/s^2 within which a level stays where it is, and how many times longer a level road's must last
where the slope may be one."""

DOUBTFUL, SHARPLY = 0.5, 4
"""m/s^2 by which a jerk widens the limits when half of what the difference is may be its lag, and
power with which that share grows: a noisy speed shows a little jerk all the time."""

ANOTHER = 50
"""Steps after which what is off by another size than the jump that was measured surely is."""

THERE = 0.75
"""Share of a jump by which a sample may be off if it is still the jump that is seen in it."""


@inner
def against_speed(monitor, settings):
    """Against the derivative of the host's speed."""
    off = difference(monitor, settings)
    if monitor.faulty:
        if repeats(monitor.kind):
            doubt_slope(monitor, STILL_KNOWN)
        _follow_fault(monitor, settings, off)
        return
    if isnan(monitor.baseline):
        monitor.baseline = monitor.slope if monitor.slope_known > 0.0 else off
    learning = while_learning(monitor.slope_known, WARM_UP)
    allowance = allowance_of(monitor, settings)
    sigma = settings.acceleration_sigma
    _follow_road(monitor, settings, off)
    step, slow = off - monitor.baseline, off - monitor.slope
    step_limit = max(settings.acceleration_step_limit, sigma * deviation(monitor.step_noise))
    slow_limit = max(settings.acceleration_limit, sigma * deviation(monitor.slow_noise))
    sudden, gradual = learning * step_limit + allowance, learning * slow_limit + allowance
    gradual += _levelling(monitor, settings, slow)
    check = monitor.check
    # What jumped is held against a moment ago: the slope may have changed since its slow mean.
    if abs(step) < sudden and abs(slow) / gradual > abs(step) / sudden:
        jumped = abs(step) > JUMPED * abs(slow)
        kind = Kind.OFFSET if jumped else Kind.RAMP
        reference = monitor.baseline if jumped else monitor.slope
        set_check(check, Ground.HOST_SPEED, slow, gradual, kind, reference)
    else:
        set_check(check, Ground.HOST_SPEED, step, sudden, Kind.OFFSET, monitor.baseline)
    if monitor.leapt_for and not is_exceeded(check):
        # No bump lasts, no manoeuvre leaps: what does both is seen before the filters say so.
        least = least_beyond(monitor.jump, LASTING)
        large = LARGE_FOR_SWINGS if swings_over_bumps(monitor) else LARGE
        # Six steps in a row are no shaking.
        jerk_allowance = min(_jerk_allowance(monitor, settings), MOST_ALLOWANCE)
        limit = large * learning * step_limit + jerk_allowance
        if abs(least) > limit:
            set_check(check, Ground.HOST_SPEED, least, limit, Kind.OFFSET, monitor.baseline)
    follow_reversing(monitor)
    if is_exceeded(check):
        monitor.reference = check.reference
    elif not monitor.confidence:
        monitor.reference = np.nan
        healthy = abs(step) < LEAST * step_limit
        jerk = as_the_car_moves(monitor, jerk_of(monitor.speed.motion))
        _learn(monitor, settings, off, jerk, step if healthy else np.nan, slow_limit)


@inner
def difference(monitor, settings):
    """By how much they differ in this step (m/s^2), which is followed."""
    jerk = as_the_car_moves(monitor, jerk_of(monitor.speed.motion))
    lag, smooth = _lag(monitor, settings)
    if rattles(monitor.speed):
        smooth = -JERK_FILTER
    derivative = acceleration_by_speed(monitor) + (lag + smooth) * jerk
    follow_difference(monitor.jump, newest_sample(monitor) - derivative, derivative)
    # What smoothing made late, and the accelerometer tells by now.
    _follow_own_jerk(monitor)
    return monitor.filtered - derivative + smooth * monitor.own_jerk


@inner
def _follow_road(monitor, settings, off):
    """A road that bends is another slope."""
    bend, speed = monitor.bend, monitor.speed
    told = tells_of_bends(speed, settings) and not (monitor.leapt_for or monitor.reverses)
    steepest = settings.steepest_road if told else 0.0
    if not is_unproven(bend):
        bend.slope_before = monitor.slope
    bent = follow_bend(
        bend, monitor.jump, off, speed.motion.derivative, monitor.filtered, speed.last, steepest
    )
    if has_bent(bend):
        monitor.slope = slope_now(bend)
        forget_baseline(monitor)
        monitor.baseline = monitor.slope
    elif bent:
        monitor.slope += bent
        monitor.baseline += bent
        for i in range(monitor.recent.count):
            monitor.recent.values[i] += bent
    leave_bend(bend)


@inner
def _levelling(monitor, settings, slow):
    """By how many m/s^2 a gradual limit is wider for what may be the end of the slope."""
    if slow * monitor.slope >= 0.0:
        return 0.0
    return ENDING * min(abs(monitor.slope), settings.steepest_road)


@inner
def doubt_slope(monitor, worth):
    """A step that tells nothing of the slope of the road, which may change meanwhile, but still is
    `worth` so many seconds of learning."""
    least = min(monitor.slope_known, worth)
    known = min(monitor.slope_known, WARM_UP) - SLOPE_FADES * STEP_S
    monitor.slope_known = max(known, least)


@inner
def _follow_own_jerk(monitor):
    """The accelerometer's jerk, as far as a manoeuvre may have made it."""
    own = jerk_between(monitor.filtered, monitor.slow_filtered)
    if monitor.leapt_for:
        monitor.own_jerk *= 1.0 - JERK_SHARE
    else:
        monitor.own_jerk = beyond(own, GENTLE)


@inner
def _shaken_by(monitor, settings):
    """What a shaking leaves in the filtered acceleration (m/s^2)."""
    averaged = 2.0 * settings.host_speed_filter_time + monitor.roughness.period
    left = SHAKEN_SIGMA * shaking_left(monitor, averaged)
    return max(BURST * monitor.burst**0.5, left)


@inner
def allowance_of(monitor, settings):
    """By how many m/s^2 a jerk or a shaking widens the limits."""
    return min(_jerk_allowance(monitor, settings) + _shaken_by(monitor, settings), MOST_ALLOWANCE)


@inner
def _jerk_allowance(monitor, settings):
    """By how many m/s^2 a jerk widens the limits."""
    jerk = max(abs(jerk_of(monitor.speed.motion)), monitor.speed.motion.largest_jerk - SHARP_JERK)
    seldom = seldom_heard(monitor.speed)
    allowance = (settings.jerk_allowance + seldom) * jerk
    # A sharp manoeuvre shows every lag that is not known; the accelerometer feels it first.
    doubt = LAG_DOUBT * (LAG_PRIOR + LITTLE_JERK) / (monitor.lag_square + LITTLE_JERK)
    allowance += doubt * max(jerk - CALM_JERK, 0.0)
    if not monitor.leapt_for:
        lag = settings.jerk_allowance + doubt
        own = jerk_between(monitor.filtered, monitor.slow_filtered)
        ahead = min(lag * max(abs(own) - CALM_JERK, 0.0), LAG_MOST)
        allowance += max(ahead, seldom * abs(own))
    return allowance


@inner
def _lag(monitor, settings):
    """How much the speed lags behind the accelerometer, and by how much it is smoothed, in s."""
    if not settings.learn_noise:
        return 0.0, 0.0
    lag = monitor.lag_product / (monitor.lag_square + LITTLE_JERK)
    lag = max(-LARGEST_LAG, min(LARGEST_LAG, lag))
    best = max(-LARGEST_LAG, min(LARGEST_LAG, monitor.best_product / monitor.best_square))
    return lag, max(-JERK_FILTER, min(0.0, best - lag))


@inner
def _learn(monitor, settings, off, jerk, step, slow_limit):
    """Slope, noise and lag, from a healthy step."""
    _follow_baseline(monitor, settings, off)
    if abs(off) > STEEPEST or abs(jerk) > POSSIBLE_JERK:
        return
    monitor.slope_known += STEP_S
    slow = off - monitor.slope
    if monitor.slope_known < WARM_UP:
        monitor.slope += STEP_S / monitor.slope_known * slow
    else:
        rate = settings.slope_rate
        monitor.slope += STEP_S * max(-rate, min(rate, slow / SLOPE_TIME))
    if monitor.ticks % LEARNT_EVERY:
        return
    if not isnan(step):
        learn_noise(monitor.step_noise, step, 0.0)
        learn_jump_noise(monitor.jump)
    if abs(slow) < LEAST * slow_limit:
        learn_noise(monitor.slow_noise, slow, 0.0)
    _learn_lag(monitor, jerk)


@inner
def _learn_lag(monitor, jerk):
    """From what the accelerometer felt a moment ago: whose noise is in neither side of it now.

    The derivative's own jerk has the noise in it of what it is to explain, and would call a noisy
    speed early.
    """
    derivative = acceleration_by_speed(monitor)
    moved = monitor.filtered - derivative - monitor.baseline
    monitor.best_product += jerk * moved - monitor.best_product / LAG_MEMORY
    monitor.best_square += jerk * jerk - (monitor.best_square - LAG_PRIOR) / LAG_MEMORY
    then, now = monitor.jerk_then, jerk_between(monitor.filtered, monitor.slow_filtered)
    monitor.jerk_then = now if abs(now) <= POSSIBLE_JERK else 0.0
    monitor.lag_product += then * moved - monitor.lag_product / LAG_MEMORY
    square = monitor.lag_square + then * jerk - (monitor.lag_square - LAG_PRIOR) / LAG_MEMORY
    monitor.lag_square = max(square, LAG_PRIOR)


@inner
def _follow_baseline(monitor, settings, off):
    """What the difference was a moment ago; a manoeuvre, which shows every lag, tells little of
    it."""
    if isnan(monitor.baseline):
        monitor.baseline = off
    doubt = (_jerk_allowance(monitor, settings) / DOUBTFUL) ** SHARPLY
    told = (off - monitor.baseline) / (1.0 + doubt)
    append(monitor.recent, monitor.baseline + told)
    if is_full(monitor.recent):
        monitor.baseline += BASE_SHARE * (at(monitor.recent, 0) - monitor.baseline)


@inner
def _follow_fault(monitor, settings, off):
    """A faulty signal against what the difference was before the fault."""
    residual = off - monitor.reference
    monitor.felt = off if isnan(monitor.felt) else monitor.felt + FELT_SHARE * (off - monitor.felt)
    follow_off(monitor, residual)
    monitor.settled += 1
    estimate_size(monitor, residual, True)
    _follow_slope(monitor, settings, off)
    least = LEAST if monitor.kind == Kind.OFFSET else settings.acceleration_limit
    limit = max(0.5 * abs(monitor.off), least)
    _follow_baseline(monitor, settings, off)
    _await_jump_back(monitor, off)
    _follow_level(monitor, settings)
    faded = abs(off - monitor.slope_before) < min(abs(residual), LEAST)
    monitor.faded_for = monitor.faded_for + 1 if faded else 0
    if monitor.faded_for >= FADED_STEPS:
        # It was not the slope that changed: the jump faded.
        monitor.reference = monitor.slope_before
    left = 0.0 if monitor.settling else residual
    set_check(monitor.check, Ground.HOST_SPEED, left, limit, monitor.kind, np.nan)


@inner
def _await_jump_back(monitor, off):
    """Whether what made the fault was undone, so that it only has to settle."""
    if monitor.kind == Kind.NOISE:
        # Its swings are no jumps.
        return
    if monitor.settling:
        # It may have been the speed that jumped for a moment, as one does that comes in steps.
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
def _follow_level(monitor, settings):
    """What stays where it is for long is the slope where it came little by little and is no more
    than a road makes, as sensors jump, or go on drifting; and where it is what a level road makes,
    but the slope that it was held against is none."""
    if isnan(monitor.level) or abs(monitor.felt - monitor.level) > LEVEL:
        monitor.level, monitor.level_for = monitor.felt, 0.0
    monitor.level_for += STEP_S
    if not is_gauged(monitor.kind) or monitor.settling:
        return
    felt, steep = abs(monitor.felt), abs(monitor.reference) > settings.acceleration_limit
    is_road = not monitor.came_at_once and felt <= settings.steepest_road
    # A road as steep as the slope that it was held against may well be one, but hardly for long.
    times = 1.0 if is_road or steep else GENTLE_SLOPE
    is_level = is_road or felt < LEVEL_ROAD
    if is_level and monitor.level_for >= times * settings.requalify_time:
        monitor.reference, monitor.corrected = monitor.felt, False
        forget_jump(monitor.jump)


@inner
def became_another(monitor, settings):
    """Whether another jump undid more than the jump that made it faulty, or less, and did not lead
    back to the slope. A drift's size is not known so well: part of it was taken for the slope."""
    if not (monitor.settling and monitor.kind == Kind.OFFSET):
        return False
    limit = settings.acceleration_limit + allowance_of(monitor, settings)
    felt = monitor.felt
    return min(abs(felt - monitor.undone), abs(felt - monitor.reference)) > limit


@inner
def slope_after(monitor, settings):
    """The slope (m/s^2) when a fault has been undone: what was followed under it, as far as what is
    felt by then does not differ; that is none where the fault became another."""
    if became_another(monitor, settings):
        return monitor.reference
    doubt = _jerk_allowance(monitor, settings)
    slope = max(monitor.felt - doubt, min(monitor.felt + doubt, monitor.reference))
    if abs(slope - monitor.slope_before) > settings.steepest_road:
        # No road changes so much: the manoeuvre is not over yet.
        return monitor.reference
    return slope


@inner
def _follow_slope(monitor, settings, off):
    """A jump stays what it was; what changes slowly under it is the slope that is felt.

    As long as it changes as a healthy signal may, the best that is known of the acceleration is
    the measurement without the jump.
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
        # It jumped again, to another level: what came little by little is the road.
        forget_jump(monitor.jump)
        monitor.another_for = monitor.settled = 0
    # What is beyond the possible is no healthy sample and a jump.
    steady = still and measured and stays and is_possible(monitor)
    monitor.corrected = steady and there
    if steady:
        rate = max(-LARGEST_RATE, min(LARGEST_RATE, change / UNDER_JUMP))
        slope = monitor.reference + STEP_S * rate
        least, most = monitor.slope_before - LARGEST_SLOPE, monitor.slope_before + LARGEST_SLOPE
        monitor.reference = max(least, min(most, slope))
