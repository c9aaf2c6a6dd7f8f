"""The host's accelerometer against its speed, the observers and the lead's word (robust profile).

With the host's speed: the accelerometer and the derivative of the speed go through the same filter;
their difference is gravity on a slope, which changes slowly, and some noise. A fault is a sudden
change of the difference, or more of it than any road makes.

Without it: no car changes its acceleration by metres per second squared within a tenth of a second
and keeps it there, unless the lead seems to do the very same (then it is the accelerometer).
"""

from math import exp, isfinite, isnan, sqrt

import numpy as np

from lfd_diagnosis.acceleration_jump import (
    JUMP,
    find_jump,
    follow_difference,
    forget_jump,
    is_measured,
    jump_deviation,
    jump_size,
    learn_jump_noise,
    least_beyond,
    restart_jump,
    start_jump,
)
from lfd_diagnosis.evidence import (
    BECAUSE,
    CHECK,
    Ground,
    give_ground,
    is_exceeded,
    set_check,
)
from lfd_diagnosis.healthy_signal import (
    LEARNT_NOISE,
    POSSIBLE_JERK,
    REPETITION,
    RING,
    ROUGHNESS,
    append,
    as_measured,
    at,
    deviation,
    excuse_repetition,
    filter_share,
    is_frozen,
    is_full,
    is_new,
    is_rough,
    learn_noise,
    mean_of,
    resolution_of,
    restart_repetition,
    restart_roughness,
    rough_share,
    share_of,
    start_noise,
    start_repetition,
    start_ring,
    start_roughness,
    take_repetition,
    take_roughness,
)
from lfd_diagnosis.host_speed import (
    HOST_SPEED,
    JERK_SHARE,
    ROUGH_TIME,
    SLOW,
    came_to_rest,
    follow_speed,
    is_standing,
    is_usable,
    jerk_between,
    jerk_of,
    lose_speed,
    restart_speed,
    start_speed,
)
from lfd_diagnosis.lead_report import is_trusted
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

BASELINE, BASELINE_DELAY = 0.7, 30
"""Time constant in s and delay in steps of what the difference was a moment ago."""

WARM_UP = 3.0
"""Seconds over which the limits come down from thrice to once their width."""

LAG_DOUBT, CALM_JERK, LAG_MOST = 0.15, 4.0, 1.5
"""s by which the lag may differ from what is known of it before a jerk has told it, m/s^3 up to
which that does not matter, and m/s^2 that the accelerometer may be ahead at most."""

SHARP_JERK = 8.0
"""m/s^3 that a jerk must exceed for its excess to count for a moment longer."""

MOST_ALLOWANCE, STEEPEST = 6.0, 4.0
"""m/s^2 by which limits widen at most, and that a slope and a sensor's mounting make at most."""

LARGEST_STEP, LEAP, LEAP_MEMORY = 1.0, 3.0, 30
"""m/s^2 by which a possible jerk moves the accelerometer at most from one sample to the next, and
roughness beyond that: what exceeds them is a leap, for so many steps."""

LARGEST_LAG = 0.3
"""Largest lag in s between accelerometer and speed that is learnt."""

LAG_MEMORY, LAG_PRIOR = 1000, 40.0
"""Samples that the lag is learnt over, and how much jerk (m^2/s^6) it takes to move it."""

SLOPE_TIME = 4.0
"""Time constant in s of the slow mean, as far as its rate allows."""

BURST = 0.15
"""Share of a shaking's rms by which limits widen."""

SHAKEN = 0.1
"""Share of rough samples above which the road shakes a sensor."""

SHAKEN_LIMIT = 1.6
"""How much larger a jump must be while the road shakes the sensor."""

ROUGH_TIME_ALONE = 1.5
"""Seconds of roughness that make a fault where nothing tells a bad road from a bad sensor."""

SMOOTH = 0.3
"""Time constant in s through which an acceleration is rebuilt from the relative one."""

SLOPE_DRIFT, DRIFT_TIME, JUMP_TIME = 0.17, 4.0, 0.45
"""What a road's slope makes of the difference: m/s^2 per square root of a second, for so long, and
for so long until a jump has been measured."""

UNDER_JUMP, LARGEST_RATE, LARGEST_SLOPE = 1.0, 0.5, 1.5
"""Time constant in s with which the slope is followed under a jump, and by how many m/s^3 and m/s^2
at most."""

JUMPED = 0.6
"""Share of its difference from the slow mean that came within the last moment where it jumped."""

THERE = 0.75
"""Share of a jump by which a sample may be off if it is still the jump that is seen in it."""

SECOND_DIFFERENCES = 6.0
"""How much larger than the variance of a white noise that of its second differences is."""

SIZE_FROM, SIZE_TO = 30, 130
"""Steps after conviction over which the size of a jump is averaged."""

SHARP, SHARP_GAP = 8, 4
"""Steps that are averaged before and after a jump, and steps between them."""

JUMP_MEMORY = 25
"""Steps after a jump in which it is held against the observers."""

RADAR_GONE = 30
"""Steps for which the last relative acceleration stands in for one that is no longer known."""

OWN_SHARE = 0.7
"""Share of its difference from the lead's word that the accelerometer must have made itself."""

LEAD_MEMORY = 2.0
"""Seconds over which the lead's acceleration is known when it is not measured."""

BACK, BACK_STEPS = 0.65, 5
"""Share of a fault by which it must jump back, and for how many steps, to be over."""

BLIND_STD = 0.7
"""m/s^2 to which an acceleration is known from the lead's alone: how much that varies."""

LEAST, FADED_STEPS = 0.6, 50
"""m/s^2 within which an acceleration that jumped must come back, and for how many steps if it did
not come back at once."""

HELD_CHANGE, HELD_STEPS = 0.2, 2.5
"""m/s^2, and steps of its resolution, by which the speed's derivative must change while the
accelerometer repeats itself."""

LASTING, LARGE = 6, 2.0
"""Steps for which a jump must have lasted, and how many times its limit it must be, to be seen in
the samples as they are."""

SAMPLES = 2 * SHARP + SHARP_GAP
"""Steps that are looked at for a jump."""

BEFORE_JUMP = 8
"""Steps by which a jump may be noticed late."""

BASE_SHARE, RELATIVE_SHARE = share_of(BASELINE), share_of(SMOOTH)
LEAD_KEEP = exp(-STEP_S / LEAD_MEMORY)

ACCELERATION = np.dtype(
    [
        ("speed", HOST_SPEED),
        ("roughness", ROUGHNESS),
        ("repetition", REPETITION),
        ("derivative_when_held", "f8"),
        # Noise of the difference against a moment ago, against its slow mean, and against V2V.
        ("step_noise", LEARNT_NOISE),
        ("slow_noise", LEARNT_NOISE),
        ("report_noise", LEARNT_NOISE),
        ("jump", JUMP),
        ("lag_product", "f8"),
        ("lag_square", "f8"),
        ("slope", "f8"),
        ("slope_known", "f8"),
        ("ticks", "i8"),
        ("check", CHECK),
        ("acceleration", "f8"),
        ("faulty", "?"),
        ("kind", "i8"),
        ("because", BECAUSE),
        ("confidence", "i8"),
        ("agreeing", "f8"),
        ("reference", "f8"),
        ("slope_before", "f8"),
        ("corrected", "?"),
        ("faded_for", "i8"),
        ("lead_reference", "f8"),
        ("size", "f8"),
        ("size_std", "f8"),
        ("off", "f8"),
        ("settled", "i8"),
        ("baseline", "f8"),
        ("recent", RING),
        ("back_for", "i8"),
        ("settling", "?"),
        ("last_at", "f8"),
        ("fresh", "?"),
        ("new_samples", "i8"),
        ("filtered", "f8"),
        ("slow_filtered", "f8"),
        ("leapt_for", "i8"),
        ("burst", "f8"),
        ("before_jump", RING),
        ("samples", RING),
        ("lead", "f8"),
        ("lead_slow", "f8"),
        ("lead_recent", RING),
        ("own_slow", "f8"),
        ("own_recent", RING),
        ("report_off", "f8"),
        ("relative_now", "f8"),
        ("relative_slow", "f8"),
        ("before", "f8"),
        ("relative", "f8"),
        ("radar_gone", "i8"),
        ("jumped_for", "i8"),
        ("jump_sign", "f8"),
        ("rough_for", "f8"),
        ("shaken", "?"),
    ],
    align=True,
)
"""State of the acceleration signal; `acceleration` (m/s^2) is how the host really accelerates."""


@inner
def start_acceleration(monitor, settings):
    """Begin with nothing."""
    learn = settings.learn_noise
    start_speed(monitor.speed, learn)
    start_roughness(monitor.roughness, 64)
    start_repetition(monitor.repetition, 8)
    monitor.derivative_when_held = np.nan
    start_noise(monitor.step_noise, 0.15, 0.03, 1.0, learn, 2000)
    start_noise(monitor.slow_noise, 0.2, 0.05, 1.0, learn, 2000)
    start_noise(monitor.report_noise, max(0.25, settings.lead_report_std), 0.1, 1.0, learn, 2000)
    start_jump(monitor.jump, learn)
    monitor.lag_product, monitor.lag_square = 0.0, LAG_PRIOR
    monitor.ticks = 0
    restart_acceleration(monitor)


@inner
def restart_acceleration(monitor):
    """Nothing from before counts but what was learnt."""
    monitor.check.ground = Ground.NONE
    # It may be another road.
    monitor.slope = monitor.slope_known = 0.0
    _forgive(monitor)
    restart_speed(monitor.speed)
    restart_roughness(monitor.roughness)
    restart_repetition(monitor.repetition)
    monitor.last_at = -np.inf
    monitor.fresh, monitor.new_samples = False, 0
    monitor.filtered, monitor.burst = np.nan, 0.0
    monitor.slow_filtered, monitor.leapt_for = np.nan, 0
    start_ring(monitor.before_jump, BEFORE_JUMP)
    start_ring(monitor.samples, SAMPLES)
    monitor.lead = monitor.lead_slow = np.nan
    start_ring(monitor.lead_recent, BASELINE_DELAY)
    monitor.own_slow = np.nan
    start_ring(monitor.own_recent, BASELINE_DELAY)
    monitor.report_off = 0.0
    monitor.relative_now = monitor.relative_slow = monitor.before = 0.0
    monitor.relative, monitor.radar_gone = 0.0, RADAR_GONE
    monitor.jumped_for, monitor.jump_sign = 0, 0.0
    monitor.rough_for = 0.0
    monitor.shaken = False
    monitor.acceleration = 0.0


@inner
def _forgive(monitor):
    monitor.faulty, monitor.kind = False, Kind.UNKNOWN
    monitor.because.ground = Ground.NONE
    monitor.confidence, monitor.agreeing = 0, 0.0
    monitor.reference = monitor.lead_reference = monitor.slope_before = np.nan
    monitor.corrected, monitor.faded_for = False, 0
    monitor.size = monitor.size_std = monitor.off = np.nan
    monitor.settled = 0
    _forget_baseline(monitor)
    # The way back is no noise.
    restart_jump(monitor.jump)
    monitor.back_for, monitor.settling = 0, False


@inner
def _forget_baseline(monitor):
    monitor.baseline = np.nan
    start_ring(monitor.recent, BASELINE_DELAY)


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
            return _newest(monitor) - monitor.size
        slope = monitor.slope if isnan(monitor.reference) else monitor.reference
        return monitor.acceleration + slope
    if isnan(monitor.lead_reference) or isnan(monitor.lead):
        return monitor.acceleration
    return monitor.lead_reference - monitor.relative_slow


@inner
def _newest(monitor):
    """The newest measurement in m/s^2, as it is."""
    return at(monitor.samples, monitor.samples.count - 1)


@inner
def follow_acceleration(monitor, settings, horizon):
    """Take one step's samples; afterwards `acceleration` is the best that is known."""
    now = horizon.stamp * 1e-9
    speed = monitor.speed
    if settings.use_host_speed and not horizon.host_speed_stale:
        time = now - horizon.host_speed_age
        value = as_measured(horizon.measured_host_speed)
        felt = monitor.acceleration
        if not monitor.faulty and not isnan(monitor.filtered):
            felt = monitor.filtered - monitor.slope
        follow_speed(speed, settings, now, time, value, felt, monitor.shaken)
    else:
        lose_speed(speed)
    usable = not horizon.acceleration_stale
    if usable:
        time = now - horizon.acceleration_age
        _follow_samples(monitor, settings, time, as_measured(horizon.measured_acceleration))
    if is_usable(speed, settings):
        monitor.acceleration = speed.derivative
    elif usable and not monitor.faulty:
        # While a jump is being looked into, what was before it.
        if not monitor.jumped_for:
            monitor.acceleration = at(monitor.before_jump, 0)
    else:
        monitor.acceleration *= LEAD_KEEP


@inner
def _follow_samples(monitor, settings, time, value):
    share = filter_share(settings.host_speed_filter_time)
    if isnan(monitor.filtered):
        monitor.filtered = monitor.slow_filtered = value
    monitor.filtered += share * (value - monitor.filtered)
    monitor.slow_filtered += JERK_SHARE * (monitor.filtered - monitor.slow_filtered)
    monitor.burst += share * ((value - monitor.filtered) ** 2 - monitor.burst)
    monitor.fresh = is_new(time, monitor.last_at)
    monitor.leapt_for = max(monitor.leapt_for - 1, 0)
    if monitor.fresh:
        possible = min(POSSIBLE_JERK * (time - monitor.last_at), LARGEST_STEP)
        if abs(value - monitor.repetition.value) > possible + LEAP * sqrt(monitor.roughness.usual):
            monitor.leapt_for = LEAP_MEMORY
        standing = is_standing(monitor.speed)
        take_roughness(monitor.roughness, value, not (monitor.faulty or standing), 0.0)
        if standing:
            excuse_repetition(monitor.repetition, monitor.faulty)
        if not take_repetition(monitor.repetition, value, not monitor.faulty):
            monitor.derivative_when_held = monitor.speed.derivative
        monitor.last_at = time
    append(monitor.samples, value)
    append(monitor.before_jump, monitor.filtered - monitor.slope)
    # A bad road shakes the wheels, too; a sensor's own noise does not.
    monitor.shaken = rough_share(monitor.roughness) > SHAKEN
    # An engine, and those who get on, shake a standing car, and its wheels tell nothing of it.
    excused = is_standing(monitor.speed) and not monitor.faulty
    rough = is_rough(monitor.roughness) and not excused
    monitor.rough_for = monitor.rough_for + STEP_S if rough else 0.0


@inner
def judge_acceleration(monitor, settings, horizon, relative_acceleration, lead_report):
    """Judge the step; `relative_acceleration` in m/s^2, NaN where the radar tells nothing."""
    check, speed = monitor.check, monitor.speed
    if horizon.acceleration_stale:
        monitor.confidence, monitor.corrected = 0, False
        check.ground = Ground.NONE
        restart_jump(monitor.jump)
        return
    monitor.ticks += 1
    _follow_lead(monitor, relative_acceleration)
    usable = is_usable(speed, settings)
    if usable:
        _against_speed(monitor, settings)
    else:
        _forget_baseline(monitor)
        restart_jump(monitor.jump)
        _against_lead(monitor, settings, lead_report)
    exceeded = is_exceeded(check)
    _count(monitor, settings, exceeded)
    change = max(HELD_CHANGE, HELD_STEPS * resolution_of(monitor.roughness))
    should_change = not usable or abs(speed.derivative - monitor.derivative_when_held) > change
    frozen = (
        settings.check_repetition
        and is_frozen(monitor.repetition, should_change)
        and not (usable and is_standing(speed))
    )
    rough = settings.check_roughness and _seems_rough(monitor, usable)
    if monitor.faulty:
        held = settings.check_repetition and is_frozen(monitor.repetition, True)
        _requalify(monitor, settings, exceeded or held or rough)
    elif frozen:
        kind = Kind.ZERO if horizon.measured_acceleration == 0.0 else Kind.HOLD
        run = monitor.repetition.run + 1
        _convict(monitor, settings, kind, Ground.REPETITION, run, 0.0)
    elif rough:
        share = rough_share(monitor.roughness)
        _convict(monitor, settings, Kind.NOISE, Ground.ROUGHNESS, share, 0.0)
    elif (
        exceeded
        and monitor.confidence >= settings.acceleration_steps
        # One sample alone may be an outlier, however many steps hold it.
        and monitor.new_samples >= 2
    ):
        _convict(monitor, settings, check.kind, check.ground, check.residual, check.limit)


@inner
def _seems_rough(monitor, usable):
    if not usable or abs(monitor.speed.last) < SLOW:
        return monitor.rough_for >= ROUGH_TIME_ALONE
    return monitor.rough_for >= ROUGH_TIME and rough_share(monitor.speed.roughness) <= SHAKEN


@inner
def _count(monitor, settings, exceeded):
    """Confidence in a fault, by steps (eq 26)."""
    if exceeded:
        if monitor.confidence == 0:
            monitor.new_samples = 0
        monitor.new_samples += monitor.fresh
        monitor.confidence = min(monitor.confidence + 1, settings.confidence_max)
    else:
        monitor.confidence = max(monitor.confidence - 1, 0)


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
    _find_jump(monitor, off)
    _forget_baseline(monitor)
    monitor.back_for, monitor.settling = 0, False
    monitor.jumped_for = 0


@inner
def _find_jump(monitor, off):
    """Where it jumped, if that makes most of what it is off by (m/s^2)."""
    jump = monitor.jump
    find_jump(jump)
    told = monitor.kind == Kind.OFFSET and jump.found
    if not told or jump_size(jump) * off < JUMPED * off * off:
        forget_jump(jump)


@inner
def _requalify(monitor, settings, disagrees):
    if disagrees:
        monitor.agreeing = 0.0
        return
    monitor.agreeing += STEP_S
    if monitor.agreeing >= settings.clear_time:
        if not isnan(monitor.reference):
            monitor.slope += monitor.reference - monitor.slope_before
        _forgive(monitor)


@inner
def _against_speed(monitor, settings):
    """Against the derivative of the host's speed."""
    jerk = jerk_of(monitor.speed)
    derivative = monitor.speed.derivative + _lag(monitor, settings) * jerk
    off = monitor.filtered - derivative
    follow_difference(monitor.jump, _newest(monitor) - derivative)
    if monitor.faulty:
        _still_off(monitor, settings, off)
        return
    if isnan(monitor.baseline):
        monitor.baseline = monitor.slope if monitor.slope_known > 0.0 else off
    learning = 1.0 + 2.0 * max(0.0, 1.0 - monitor.slope_known / WARM_UP)
    allowance = _allowance(monitor, settings)
    sigma = settings.acceleration_sigma
    step, slow = off - monitor.baseline, off - monitor.slope
    step_limit = max(settings.acceleration_step_limit, sigma * deviation(monitor.step_noise))
    slow_limit = max(settings.acceleration_limit, sigma * deviation(monitor.slow_noise))
    sudden, gradual = learning * step_limit + allowance, learning * slow_limit + allowance
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
        limit = LARGE * learning * step_limit + allowance - BURST * monitor.burst**0.5
        if abs(least) > limit:
            set_check(check, Ground.HOST_SPEED, least, limit, Kind.OFFSET, monitor.baseline)
    if is_exceeded(check):
        monitor.reference = check.reference
    elif not monitor.confidence:
        monitor.reference = np.nan
        healthy = abs(step) < LEAST * step_limit
        _learn(monitor, settings, off, jerk, step if healthy else np.nan, slow_limit)


@inner
def _allowance(monitor, settings):
    """By how many m/s^2 a jerk or a shaking widens the limits."""
    jerk = max(abs(jerk_of(monitor.speed)), monitor.speed.largest_jerk - SHARP_JERK)
    allowance = settings.jerk_allowance * jerk + BURST * monitor.burst**0.5
    # A sharp manoeuvre shows every lag that is not known; the accelerometer feels it first.
    doubt = LAG_DOUBT * LAG_PRIOR / monitor.lag_square
    allowance += doubt * max(jerk - CALM_JERK, 0.0)
    if not monitor.leapt_for:
        lag = settings.jerk_allowance + doubt
        own = jerk_between(monitor.filtered, monitor.slow_filtered)
        allowance += min(lag * max(abs(own) - CALM_JERK, 0.0), LAG_MOST)
    return min(allowance, MOST_ALLOWANCE)


@inner
def _lag(monitor, settings):
    """How much the speed lags behind the accelerometer, in s."""
    if not settings.learn_noise:
        return 0.0
    return max(-LARGEST_LAG, min(LARGEST_LAG, monitor.lag_product / monitor.lag_square))


@inner
def _learn(monitor, settings, off, jerk, step, slow_limit):
    """Slope, noise and lag, from a healthy step."""
    _follow_baseline(monitor, off)
    if abs(off) > STEEPEST or abs(jerk) > POSSIBLE_JERK:
        return
    monitor.slope_known += STEP_S
    slow = off - monitor.slope
    if monitor.slope_known < WARM_UP:
        monitor.slope += STEP_S / monitor.slope_known * slow
    else:
        rate = settings.slope_rate
        monitor.slope += STEP_S * max(-rate, min(rate, slow / SLOPE_TIME))
    if monitor.ticks % 10:
        return
    if not isnan(step):
        learn_noise(monitor.step_noise, step, 0.0)
        learn_jump_noise(monitor.jump)
    if abs(slow) < LEAST * slow_limit:
        learn_noise(monitor.slow_noise, slow, 0.0)
    moved = monitor.filtered - monitor.speed.derivative - monitor.baseline
    monitor.lag_product += jerk * moved - monitor.lag_product / LAG_MEMORY
    monitor.lag_square += jerk * jerk - (monitor.lag_square - LAG_PRIOR) / LAG_MEMORY


@inner
def _follow_baseline(monitor, off):
    """What the difference was a moment ago."""
    if isnan(monitor.baseline):
        monitor.baseline = off
    append(monitor.recent, off)
    if is_full(monitor.recent):
        monitor.baseline += BASE_SHARE * (at(monitor.recent, 0) - monitor.baseline)


@inner
def _still_off(monitor, settings, off):
    """A faulty signal against what the difference was before the fault."""
    residual = off - monitor.reference
    monitor.off += 3.0 * STEP_S * (residual - monitor.off)
    monitor.settled += 1
    _estimate_size(monitor, residual)
    _follow_slope(monitor, settings, off)
    least = LEAST if monitor.kind == Kind.OFFSET else settings.acceleration_limit
    limit = max(0.5 * abs(monitor.off), least)
    _follow_baseline(monitor, off)
    step = (off - monitor.baseline) * (1.0 if monitor.off > 0 else -1.0)
    back = step < -BACK * abs(monitor.off) and abs(monitor.off) > LEAST
    monitor.back_for = monitor.back_for + 1 if back else 0
    if monitor.back_for >= BACK_STEPS:
        # What made the fault was undone; how the slope has changed meanwhile nobody knows.
        monitor.settling = True
    faded = abs(off - monitor.slope_before) < min(abs(residual), LEAST)
    monitor.faded_for = monitor.faded_for + 1 if faded else 0
    if monitor.faded_for >= FADED_STEPS:
        # It was not the slope that changed: the jump faded.
        monitor.reference = monitor.slope_before
    left = 0.0 if monitor.settling else residual
    set_check(monitor.check, Ground.HOST_SPEED, left, limit, monitor.kind, np.nan)


@inner
def _follow_slope(monitor, settings, off):
    """A jump stays what it was; what changes slowly under it is the slope that is felt.

    As long as it changes as a healthy signal may, the best that is known of the acceleration is
    the measurement without the jump.
    """
    jumped = is_measured(monitor.jump) and not monitor.settling
    still = jumped and not is_frozen(monitor.repetition, True) and not is_rough(monitor.roughness)
    change = off - monitor.size - monitor.reference
    limit = settings.acceleration_step_limit + _allowance(monitor, settings)
    newest = _newest(monitor) - monitor.size - monitor.acceleration - monitor.reference
    there = abs(newest) < THERE * abs(monitor.size)
    steady = still and abs(change) < limit
    monitor.corrected = steady and there
    if steady:
        rate = max(-LARGEST_RATE, min(LARGEST_RATE, change / UNDER_JUMP))
        slope = monitor.reference + STEP_S * rate
        least, most = monitor.slope_before - LARGEST_SLOPE, monitor.slope_before + LARGEST_SLOPE
        monitor.reference = max(least, min(most, slope))


@inner
def _estimate_size(monitor, residual):
    """Of a jump just after it, when the slope has hardly changed; of others as they are now."""
    if is_measured(monitor.jump):
        monitor.size = jump_size(monitor.jump)
        monitor.size_std = jump_deviation(monitor.jump)
        return
    settled = monitor.settled
    if monitor.kind == Kind.RAMP or settled < SIZE_FROM:
        monitor.size = monitor.off
    elif settled <= SIZE_TO:
        monitor.size += (residual - monitor.size) / (settled - SIZE_FROM + 1)
    drift = SLOPE_DRIFT**2 * min(settled * STEP_S, JUMP_TIME)
    monitor.size_std = sqrt(monitor.step_noise.variance + drift)


@inner
def _follow_lead(monitor, relative_acceleration):
    """The lead's acceleration as accelerometer and observers make it."""
    gone = isnan(relative_acceleration)
    if gone:
        monitor.radar_gone += 1
        if monitor.radar_gone > RADAR_GONE:
            monitor.lead = np.nan
            start_ring(monitor.lead_recent, BASELINE_DELAY)
            return
    else:
        monitor.radar_gone = 0
        if not monitor.jumped_for:
            monitor.relative = relative_acceleration
    now = monitor.relative if gone else relative_acceleration
    monitor.relative_now = now
    monitor.relative_slow += RELATIVE_SHARE * (now - monitor.relative_slow)
    monitor.lead = monitor.filtered + now
    if not monitor.confidence and not monitor.jumped_for:
        append(monitor.lead_recent, monitor.lead)
        if isnan(monitor.lead_slow):
            monitor.lead_slow = monitor.lead
        monitor.lead_slow += BASE_SHARE * (at(monitor.lead_recent, 0) - monitor.lead_slow)
        append(monitor.own_recent, monitor.filtered)
        if isnan(monitor.own_slow):
            monitor.own_slow = monitor.filtered
        monitor.own_slow += BASE_SHARE * (at(monitor.own_recent, 0) - monitor.own_slow)


@inner
def _against_lead(monitor, settings, lead_report):
    """Without the host's speed: against its own past, the observers and the lead's word."""
    check = monitor.check
    if monitor.faulty:
        _still_off_lead(monitor, settings, lead_report)
        return
    check.ground = Ground.NONE
    if not is_full(monitor.lead_recent) or isnan(monitor.lead):
        return
    if is_trusted(lead_report, settings):
        _against_report(monitor, settings, lead_report)
    # A car that has braked to rest jerks back as it does at no other time.
    if settings.use_observers and not came_to_rest(monitor.speed):
        _against_observers(monitor, settings)


@inner
def _take_if_worse(check, ground, residual, limit):
    """Of several kinds of evidence the one that disagrees most counts."""
    first = check.ground == Ground.NONE
    if first or abs(residual) / limit > abs(check.residual) / check.limit:
        set_check(check, ground, residual, limit, Kind.OFFSET, np.nan)


@inner
def _report_limit(monitor, settings):
    """How far the lead's acceleration as seen may lie from its word, in m/s^2."""
    sigma = settings.acceleration_sigma
    return max(settings.acceleration_limit, sigma * deviation(monitor.report_noise))


@inner
def _against_report(monitor, settings, lead_report):
    """Blamed only for what it did itself: the lead's word or the radar may be wrong as well."""
    off = monitor.lead - lead_report.acceleration
    share = filter_share(settings.host_speed_filter_time)
    monitor.report_off += share * (off - monitor.report_off)
    residual = monitor.report_off
    own = monitor.filtered - monitor.own_slow
    limit = _report_limit(monitor, settings)
    if abs(residual) < 0.8 * limit and monitor.ticks % 10 == 0:
        learn_noise(monitor.report_noise, residual, 0.0)
    if own * residual < 0.0 or abs(own) < OWN_SHARE * abs(residual):
        residual = 0.0
    if abs(residual) > limit:
        monitor.lead_reference = monitor.lead_slow
    _take_if_worse(monitor.check, Ground.LEADS_WORD, residual, limit)


@inner
def _against_observers(monitor, settings):
    samples = monitor.samples
    jump = 0.0
    if is_full(samples):
        jump = mean_of(samples, SAMPLES - SHARP, SAMPLES) - mean_of(samples, 0, SHARP)
    # On a bad road, or over a kerb, even the mean of some samples jumps.
    limit = settings.jump_limit * (SHAKEN_LIMIT if monitor.shaken else 1.0)
    if abs(jump) > limit:
        if not monitor.jumped_for:
            monitor.lead_reference = mean_of(monitor.lead_recent, 0, 2 * BASELINE_DELAY // 3)
            monitor.before = mean_of(samples, 0, SHARP)
        monitor.jumped_for, monitor.jump_sign = JUMP_MEMORY, 1.0 if jump > 0 else -1.0
    if not monitor.jumped_for:
        _take_if_worse(monitor.check, Ground.OBSERVERS, jump, limit)
        return
    monitor.jumped_for -= 1
    # A jump that the observers answer with the opposite one is the car's own.
    now = mean_of(samples, samples.count - SHARP, samples.count)
    residual = now - monitor.before + monitor.relative_now - monitor.relative
    if residual * monitor.jump_sign < 0.0:
        residual = 0.0
    _take_if_worse(monitor.check, Ground.OBSERVERS, residual, 0.8 * limit)


@inner
def _still_off_lead(monitor, settings, lead_report):
    """A faulty signal against the lead, who goes back to driving as most do."""
    trusted = is_trusted(lead_report, settings)
    if isnan(monitor.lead_reference):
        monitor.lead_reference = monitor.lead_slow
    mean = settings.lead_acceleration_mean
    monitor.lead_reference += STEP_S / LEAD_MEMORY * (mean - monitor.lead_reference)
    if trusted:
        monitor.lead_reference = lead_report.acceleration
    if isnan(monitor.lead) or isnan(monitor.lead_reference):
        # Nothing to hold it against: it stays what it was.
        monitor.agreeing = 0.0
        monitor.check.ground = Ground.NONE
        return
    residual = monitor.lead - monitor.lead_reference
    monitor.settled += 1
    monitor.off += 3.0 * STEP_S * (residual - monitor.off)
    _estimate_size(monitor, residual)
    monitor.size_std = BLIND_STD
    limit = _report_limit(monitor, settings) if trusted else settings.jump_limit
    set_check(monitor.check, Ground.OBSERVERS, residual, limit, monitor.kind, np.nan)


@inner
def has_evidence(monitor):
    """Whether the newest check says anything in figures."""
    return monitor.check.ground != Ground.NONE and isfinite(monitor.check.residual)
