"""The host's speed as evidence: its derivative, and whether it can be believed."""

from math import isfinite, isnan

import numpy as np

from lfd_diagnosis.evidence import BECAUSE, Ground, give_ground, is_gauged, repeats
from lfd_diagnosis.noise import LEARNT_NOISE, deviation, learn_noise, start_noise
from lfd_diagnosis.repetition import (
    REPETITION,
    excuse_repetition,
    is_beyond_chance,
    is_frozen,
    is_seldom,
    note_change,
    restart_repetition,
    start_repetition,
    take_repetition,
)
from lfd_diagnosis.roughness import (
    ROUGHNESS,
    empty_roughness,
    is_noiseless,
    is_rough,
    resolution_of,
    restart_roughness,
    rough_share,
    start_roughness,
    take_roughness,
)
from lfd_diagnosis.sample import filter_share, is_new
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

STANDING = 0.3
"""Host speed in m/s below which the car may as well stand: equal samples mean nothing."""

NOISELESS = 0.0105
"""Second differences in m/s that a speed without noise hardly exceeds."""

SLOW, MISSED_SLOW = 2.0, 0.5
"""Below so many m/s a wheel turns so quietly that it tells nothing of a shaken car, nor do equal
samples mean anything until the accelerometer has felt a change of so many m/s meanwhile."""

MISSED, MISSED_STEPS, SLOPE_DOUBT = 0.15, 8.0, 0.8
"""The same where it turns faster: m/s, or steps of the speed's resolution, and m/s^2 by which the
slope of the road may be taken for a change after a second."""

UNLIKE = 0.4
"""Share of what it missed while it repeated itself that a leap may differ by."""

DEAD, DEAD_JUMP, DEAD_TIME = 2.0, 0.1, 1.0
"""m/s below which many a wheel's sensor says zero, and by how much it jumps at least, from there
and to there; its derivative begins anew, when the car has surely come to rest (s)."""

HARD, JERK_TIME, LATENESS = 2.0, 0.4, 0.1
"""m/s^2 of braking that ends with a jerk when the car comes to rest, for how many s, and s by which
the speed may be late to say so."""

LEAST_JUMP, LEAST_JUMP_SIGMA = 0.5, 8.0
"""Least jump in m/s between two samples that no car makes, and in deviations of its noise."""

RATTLE, RATTLES, BUMP = 4.0, 9, 30
"""Standard deviations of its noise beyond which a speed leaps as no car does, for how many steps a
wheel that was so shaken is not believed to the last, and for how many the road may still shake the
car."""

GRIP, SLIPPING = 12.0, 50
"""m/s^2 that no tyre makes, beyond which the wheels slip, and for how many steps they may go on."""

SWINGS_FOR = 0.1
"""Seconds for which a wheel that was shaken just now may jump as no car does."""

COARSE = 0.15
"""m/s of resolution beyond which the derivative goes up and down as on a road that bends."""

POSSIBLE_ACCELERATION, FOR_LONGER, LATE_SPEED, GROWS = 15.0, 10.0, 0.2, 1.5
"""m/s^2 by which a car may leave what its accelerometer feels for a moment, and for longer, m/s
that a speed may be late by then, and how many times farther off than the sample before one is that
does."""

BENDS = 2.0
"""How much more a speed may bend than what is felt, filtered, says."""

JERK_FILTER = 0.15
"""Time constant in s of the filter whose derivative is the jerk."""

HEARD_OFTEN = 0.02
"""Seconds between two samples of a speed that is known all the time."""

EQUAL_LEAST, EQUAL_MOST, EQUAL_TIME = 3, 10, 0.1
"""Equal samples in a row that are never suspect, at least and at most, and seconds for which they
are not, however often it is heard."""

MOVED_STEPS, LONGEST_REFRESH, REFRESH_SHARE = 2.5, 0.3, 0.2
"""Steps of its resolution by which a new value differs if it was not rounding that kept the one
before, the longest time in s for which a sensor says everything again, and the share by which a new
time is learnt."""

REPEATING, UNEVEN = 1.5, 1.2
"""How many times longer than a sample that time is for a sensor that repeats itself, and how many
of it an equal sample is the same one again."""

ROUGH_TIME, ROUGH_TIME_ALONE = 0.3, 1.5
"""Seconds of roughness that make a fault, and where nothing tells a bad road from a bad sensor."""

ENDS_BY, DRIFT_DOUBT = 0.25, 0.3
"""Share of what a speed has drifted by that a jump back may leave, and m/s^2 by which the rate of
that may be wrong all along: accelerometers are off by as much for long."""

SETTLING = 3.0
"""Filter times after which the derivative counts."""

LONGEST_FELT = 1.0
"""Seconds since the sample before that count at most: how the host accelerates at the newest one
says nothing of a longer time."""

JERK_SHARE = share_of(JERK_FILTER)

JERK_FADES = share_of(0.1)
"""Share by which the largest of the last jerks fades in a step: a wheel that is shaken has none
while it turns back."""

HOST_SPEED = np.dtype(
    [
        ("noise", LEARNT_NOISE),
        ("roughness", ROUGHNESS),
        ("repetition", REPETITION),
        ("faulty", "?"),
        ("kind", "i8"),
        ("because", BECAUSE),
        ("size", "f8"),
        ("size_std", "f8"),
        ("off", "f8"),
        ("quiet", "f8"),
        ("last", "f8"),
        ("last_at", "f8"),
        ("seen_at", "f8"),
        ("changed_at", "f8"),
        ("refresh", "f8"),
        ("doubt", "f8"),
        ("doubted_at", "f8"),
        ("possible", "f8"),
        ("outliers", "i8"),
        ("rough_for", "f8"),
        ("same", "i8"),
        ("missed", "f8"),
        ("held_for", "f8"),
        ("still", "?"),
        ("filtered", "f8"),
        ("derivative", "f8"),
        ("derivative_then", "f8"),
        ("derivative_when_held", "f8"),
        ("slow_derivative", "f8"),
        ("largest_jerk", "f8"),
        ("calm_for", "i8"),
        ("slipped", "i8"),
        ("followed", "f8"),
        ("felt", "f8"),
    ],
    align=True,
)
"""Derivative (m/s^2) of the host's speed, as long as its samples make sense.

`followed`: for how many s it has been filtered, below zero where the car has just come to rest and
it is to begin anew. `derivative_then` is that at the newest sample, `derivative_when_held` that
when it last changed, `slow_derivative` the same through one more filter, `largest_jerk` (m/s^3) the
largest lately. `calm_for` and `slipped`: steps since a wheel was shaken, and since the wheels
slipped.

`same`: samples in a row that are equal, those of a car that seems to stand, too; `missed` (m/s):
what the host's acceleration should have changed in `held_for` s of equal ones, `still`: whether
it has said the same ever since it was called held; `felt` (m/s^2): how the host accelerated at the
newest one. `off` (m/s): the sum of the jumps of a faulty one, and of
what it drifted by; `quiet` (s): for how long nothing was wrong with it. `doubt` (m/s) is what the
newest one, seen at `seen_at`, jumps by, NaN if it does not or is not in doubt any more, `possible`
(m/s) how far a car may jump; the first one that was in doubt is of `doubted_at` (where none is, the
newest one); `last` is of `last_at`, before them. `refresh` (s): how long the sensor, or a table it
was put into, says each value again and again; it changed at `changed_at`.
"""


@inner
def start_speed(speed, learn):
    """Begin with nothing."""
    start_noise(speed.noise, 0.03, 0.003, 1.0, learn, 400)
    start_roughness(speed.roughness, 32, NOISELESS)
    start_repetition(speed.repetition, EQUAL_MOST)
    speed.outliers, speed.refresh = 0, 0.0
    restart_speed(speed)


@inner
def restart_speed(speed):
    """Nothing from before counts but what was learnt."""
    believe_again(speed)
    speed.quiet = 0.0
    empty_roughness(speed.roughness)
    restart_repetition(speed.repetition)
    lose_speed(speed)


@inner
def believe_again(speed):
    """It is not faulty any more, and nothing is known of a fault."""
    speed.faulty, speed.kind = False, Kind.UNKNOWN
    speed.size = speed.size_std = np.nan
    speed.off, speed.still = 0.0, False
    speed.because.ground = Ground.NONE


@inner
def lose_speed(speed):
    """No sample, or none that is new enough."""
    speed.last, speed.last_at = np.nan, -np.inf
    speed.seen_at, speed.changed_at, speed.doubt = -np.inf, -np.inf, np.nan
    speed.doubted_at = -np.inf
    speed.rough_for, speed.same, speed.felt = 0.0, 0, 0.0
    speed.calm_for = BUMP
    speed.slipped = SLIPPING
    _stop_following(speed)


@inner
def _stop_following(speed):
    speed.filtered = speed.derivative = speed.slow_derivative = np.nan
    speed.derivative_then = speed.derivative_when_held = np.nan
    speed.followed = speed.largest_jerk = 0.0


@inner
def is_believed(speed):
    """Whether it is heard and not called faulty: its derivative is evidence, or will be in a
    moment."""
    return not (isnan(speed.last) or speed.faulty)


@inner
def is_usable(speed, settings):
    """Whether its derivative is evidence now."""
    return not speed.faulty and has_settled(speed, settings)


@inner
def has_settled(speed, settings):
    """Whether its derivative has been filtered for long enough to be that of the speed."""
    return speed.followed >= SETTLING * settings.host_speed_filter_time


@inner
def drifts(speed):
    """Whether it is called faulty for leaving what the accelerometer feels."""
    return speed.faulty and speed.kind == Kind.RAMP


@inner
def may_be_right(speed):
    """Whether it is called faulty, but its derivative may be right by now."""
    return speed.faulty and is_gauged(speed.kind)


@inner
def came_to_rest(speed):
    """Whether the car has just stopped, so that its derivative begins anew."""
    return speed.followed < 0.0


@inner
def seems_to_stand(speed):
    """Whether it says that the car stands."""
    return abs(speed.last) <= STANDING


@inner
def is_standing(speed):
    """Whether the car stands, as far as its speed is believed."""
    return not speed.faulty and seems_to_stand(speed)


@inner
def seldom_heard(speed):
    """Seconds for which nothing is heard of it, beyond what its filter is made for."""
    return max(max(speed.refresh, speed.roughness.period) - HEARD_OFTEN, 0.0)


@inner
def _should_have_changed(speed):
    """Whether a speed that stays the same though the car moves had reason to change."""
    missed = max(MISSED, MISSED_STEPS * resolution_of(speed.roughness))
    if abs(speed.last) <= SLOW:
        missed = MISSED_SLOW
    missed += SLOPE_DOUBT * max(speed.held_for - 1.0, 0.0)
    return abs(speed.missed) > missed and not seems_to_stand(speed)


@inner
def _look_for_hold(speed):
    """Take note of whether it had reason to change; whether it is held."""
    changed = _should_have_changed(speed)
    note_change(speed.repetition, changed)
    silent = abs(speed.last) <= SLOW or is_noiseless(speed.roughness)
    tells = changed or not silent
    return tells and is_frozen(speed.repetition, changed)


@inner
def speed_seems_held(speed, agrees_with_then, is_unlikely):
    """Whether it may be held by now, so that its derivative tells nothing: it has said the same for
    so long as it seldom does, or for a moment in which nothing else changed, or what is felt should
    have moved it, and the lead makes it unlikely. Also that of a car that seems to stand."""
    for_a_moment = speed.same >= speed.repetition.least
    missed = for_a_moment or abs(speed.missed) > _least_missed(speed)
    may_be = (for_a_moment and agrees_with_then) or (missed and is_unlikely)
    return may_be or is_seldom(speed.repetition, speed.same)


@inner
def hides_by_rounding(speed, settings):
    """Whether it has said the same for a while, as what is felt since then may well be less than
    one of its steps: so far its derivative tells nothing."""
    missed_less = abs(speed.missed) < resolution_of(speed.roughness)
    return _says_the_same(speed, settings) and missed_less


@inner
def is_coarse(speed):
    """Whether its derivative goes up and down with each of its steps."""
    return resolution_of(speed.roughness) > COARSE


@inner
def tells_of_bends(speed, settings):
    """Whether its derivative is fine enough to tell a bend of the road by."""
    return not (is_coarse(speed) or _says_the_same(speed, settings))


@inner
def _says_the_same(speed, settings):
    """Whether it has said the same for longer than its derivative is filtered."""
    return speed.held_for > settings.host_speed_filter_time


@inner
def _least_missed(speed):
    """By how many m/s it must have missed a change before that is seen at all."""
    return max(MISSED, MOVED_STEPS * resolution_of(speed.roughness))


@inner
def may_miss_a_change(speed):
    """Whether it says the same, other than that the car stands, though what is felt may have moved
    it."""
    return speed.same > 0 and abs(speed.missed) > MISSED and not seems_to_stand(speed)


@inner
def misses_a_change(speed):
    """Whether that which is felt should have moved it by more than its steps."""
    return may_miss_a_change(speed) and abs(speed.missed) > _least_missed(speed)


@inner
def _makes_up(speed, value, period, acceleration):
    """Whether it leaps by what it missed while it repeated itself."""
    missed = speed.missed + acceleration * period
    off = abs(value - speed.last - missed)
    return speed.same > 0 and abs(missed) > _least_missed(speed) and off < UNLIKE * abs(missed)


@inner
def _starts_or_stops(speed, value):
    """Whether it goes to zero from a crawl, or back, by a jump."""
    slow = abs(value) < DEAD and abs(speed.last) < DEAD
    zero = value == 0.0 or speed.last == 0.0
    return slow and zero and abs(value - speed.last) > DEAD_JUMP


@inner
def _rests_with_a_jerk(speed, value):
    """Whether it comes to rest out of hard braking, or has by now: it is told late."""
    if seems_to_stand(speed) and value <= STANDING:
        # It does already.
        return False
    seldom = seldom_heard(speed)
    soon = value + (LATENESS + seldom) * speed.derivative
    slow = max(value, speed.last) < DEAD - seldom * speed.derivative
    return soon < DEAD_JUMP and slow and speed.derivative < -HARD


@inner
def jerk_between(acceleration, slow):
    """m/s^3, from an acceleration and the same through one more filter (`JERK_SHARE`)."""
    return (acceleration - slow) / JERK_FILTER


@inner
def jerk_of(speed):
    """m/s^3, filtered."""
    return jerk_between(speed.derivative, speed.slow_derivative)


@inner
def rattles(speed):
    """Whether a wheel was shaken just now."""
    return speed.calm_for < RATTLES


@inner
def slips(speed):
    """Whether its wheels slipped just now: they are slower than the car."""
    return speed.slipped < SLIPPING


@inner
def is_road_calm(speed):
    """Whether no wheel was shaken for a moment."""
    return speed.calm_for >= BUMP


@inner
def follow_speed(speed, settings, now, at, value, acceleration, shaken):
    """One step at `now`: newest sample in m/s of time `at` in s, the host accelerating as stated.

    `shaken`: the accelerometer feels a bad road.
    """
    speed.calm_for += 1
    if is_new(at, speed.seen_at):
        again = _says_again(speed, at, value)
        speed.seen_at = at
        if not (again or _doubt_jump(speed, at, value, acceleration)):
            _take(speed, settings, at, value, acceleration, shaken)
    if speed.faulty and not may_be_right(speed):
        _stop_following(speed)
        return
    filter_time = settings.host_speed_filter_time
    if isnan(speed.filtered):
        # As if the host had gone on like this for long.
        speed.slow_derivative = acceleration
        speed.filtered = speed.last - acceleration * filter_time
        speed.derivative_then = acceleration
    # Between two samples it goes on as it did: steps of a slow sensor are no jerks.
    value = speed.last + speed.derivative_then * (now - speed.last_at)
    speed.filtered += filter_share(filter_time) * (value - speed.filtered)
    speed.derivative = (value - speed.filtered) / filter_time
    speed.slipped = 0 if abs(speed.derivative) > GRIP else speed.slipped + 1
    speed.slow_derivative += JERK_SHARE * (speed.derivative - speed.slow_derivative)
    faded = speed.largest_jerk * (1.0 - JERK_FADES)
    speed.largest_jerk = max(faded, abs(jerk_of(speed)))
    speed.followed += STEP_S


@inner
def _says_again(speed, at, value):
    """Whether it is the sample before once more, of a sensor that says everything several times."""
    repeating = speed.refresh > REPEATING * (at - speed.seen_at)
    return repeating and value == speed.last and at - speed.changed_at < UNEVEN * speed.refresh


@inner
def _doubt_jump(speed, at, value, acceleration):
    """Take note of a sample that jumps; whether it does so alone so far: the next one tells whether
    it was an outlier; those of a wheel that was shaken just now may swing for a moment."""
    begins = speed.faulty or isnan(speed.doubt)
    if begins:
        speed.doubted_at, speed.doubt = at, np.nan
    period = min(at - speed.last_at, LONGEST_FELT)
    jump = _jump(speed, value, period, acceleration)
    speed.possible = _possible_jump(speed, period, jump)
    if speed.faulty:
        return False
    jumps = abs(jump) > speed.possible
    jumps = jumps and not (_rests_with_a_jerk(speed, value) or _starts_or_stops(speed, value))
    speed.outliers += not (jumps or begins)
    swings = not is_road_calm(speed) and at - speed.doubted_at < SWINGS_FOR
    doubtful = jumps and (begins or swings)
    speed.doubt = jump if doubtful else np.nan
    return doubtful


@inner
def _jump(speed, value, period, acceleration):
    """What a sample differs by (m/s) from what the host's acceleration makes of the last one."""
    return value - speed.last - acceleration * period


@inner
def _possible_jump(speed, period, jump):
    """Of a sample so far (s) from the last one that was taken, which jumps by so much (m/s); while
    several do, of the second one: later ones must not be farther off. And of the first one where it
    goes on from that: a car that brakes as hard goes on to do so."""
    first = speed.doubted_at - speed.last_at
    same = speed.doubt * jump > 0.0 and abs(jump) < GROWS * abs(speed.doubt)
    # A wheel that is shaken swings to and fro in no time.
    period = min(period, first if same and first > HEARD_OFTEN else 2.0 * first)
    accelerates = min(POSSIBLE_ACCELERATION * period, FOR_LONGER * period + LATE_SPEED)
    return max(LEAST_JUMP, LEAST_JUMP_SIGMA * deviation(speed.noise)) + accelerates


@inner
def _possible_bend(period, acceleration, before):
    """Second difference (m/s) that a car makes between samples so far apart (s), by what it feels
    and felt at the one before (m/s^2). A table may hold values that are older than it says, now
    more, now less, by a sample each."""
    late = period if period > HEARD_OFTEN else 0.0
    return BENDS * (period * abs(acceleration - before) + late * abs(acceleration))


@inner
def _take(speed, settings, at, value, acceleration, shaken):
    """Take a sample (m/s) of time `at` (s) that is no outlier, the host accelerating as stated
    (m/s^2): learn from it, and judge the sensor by it."""
    period = min(at - speed.last_at, LONGEST_FELT)
    possible = _possible_bend(period, acceleration, speed.felt)
    speed.felt = acceleration
    learn = not (speed.faulty or seems_to_stand(speed))
    take_roughness(speed.roughness, at, value, learn, possible)
    if seems_to_stand(speed):
        excuse_repetition(speed.repetition, speed.faulty)
    noisy = not is_noiseless(speed.roughness)
    beyond_chance = noisy and is_beyond_chance(speed.repetition, speed.same)
    was_held = beyond_chance or _makes_up(speed, value, period, acceleration)
    _follow_repetition(speed, at, value, period, acceleration)
    if isfinite(speed.last):
        _follow_jumps(speed, settings, value, period, acceleration, was_held)
    speed.last, speed.last_at = value, at
    speed.derivative_then = speed.derivative
    _look_for_faults(speed, settings, value, period, shaken)
    _requalify(speed, settings, value)


@inner
def _follow_repetition(speed, at, value, period, acceleration):
    """For how long it has said the same, and what it missed since then."""
    seldom = EQUAL_TIME / max(speed.roughness.period, EQUAL_TIME / EQUAL_MOST)
    speed.repetition.least = max(int(seldom), EQUAL_LEAST)
    speed.same = speed.same + 1 if value == speed.last else 0
    equal = take_repetition(speed.repetition, value, not speed.faulty)
    if not equal:
        speed.still = False
        speed.derivative_when_held = speed.derivative
        _learn_refresh(speed, at, value)
    speed.missed = speed.missed + acceleration * period if equal else 0.0
    speed.held_for = speed.held_for + period if equal else 0.0


@inner
def _follow_jumps(speed, settings, value, period, acceleration, was_held):
    """What jumps as a car comes to rest, or sets off, begins the derivative anew; what else jumps
    shakes the wheel, or is a fault."""
    if _rests_with_a_jerk(speed, value):
        _stop_following(speed)
        speed.followed = -JERK_TIME
    elif _starts_or_stops(speed, value):
        restart_roughness(speed.roughness)
        _stop_following(speed)
        if value == 0.0:
            speed.followed = -DEAD_TIME
    else:
        leap = abs(value - speed.last - speed.derivative_then * period)
        if leap > RATTLE * deviation(speed.noise):
            speed.calm_for = 0
            if was_held and settings.check_repetition:
                # What it jumps by is what it missed.
                _stop_following(speed)
        _check_jump(speed, value, period, acceleration, was_held)


@inner
def _look_for_faults(speed, settings, value, period, shaken):
    """Convict it where it is held or rough; else it is quiet for longer."""
    rough = is_rough(speed.roughness)
    speed.rough_for = speed.rough_for + period if rough else 0.0
    if settings.check_repetition and (_look_for_hold(speed) or speed.still):
        convict_held(speed, value)
    elif settings.check_roughness and speed.rough_for >= ROUGH_TIME and not shaken:
        # Not every accelerometer feels a bad road.
        if speed.rough_for >= ROUGH_TIME_ALONE:
            share = rough_share(speed.roughness)
            _convict(speed, Kind.NOISE, np.nan, Ground.ROUGHNESS, share, 0.0, 0.0)
        else:
            _stop_following(speed)
    else:
        speed.quiet += period


@inner
def _requalify(speed, settings, value):
    """A fault is over after a while of nothing odd."""
    # A speed that jumped and goes on smoothly is as good for its derivative, but who knows; one
    # that was held is over with it when it moves.
    held = repeats(speed.kind)
    if speed.kind == Kind.ZERO and value == 0.0:
        speed.quiet = 0.0
    needed = settings.requalify_time if speed.off != 0.0 and not held else settings.clear_time
    if speed.faulty and speed.quiet >= needed:
        believe_again(speed)


@inner
def _learn_refresh(speed, at, value):
    """From a value that differs from the last one by more than rounding."""
    since = at - speed.changed_at
    speed.changed_at = at
    moved = abs(value - speed.last) > MOVED_STEPS * resolution_of(speed.roughness)
    if moved and since < LONGEST_REFRESH:
        speed.refresh += REFRESH_SHARE * (since - speed.refresh)


@inner
def _check_jump(speed, value, period, acceleration, was_held):
    jump, limit = _jump(speed, value, period, acceleration), speed.possible
    if abs(jump) <= limit:
        if not speed.faulty:
            learn_noise(speed.noise, jump, 0.0)
        return
    ends = drifts(speed) and ENDS_BY * abs(speed.off) > abs(speed.off + jump)
    speed.off += jump
    if speed.faulty and (ends or abs(speed.off) <= limit):
        speed.off = 0.0
    elif speed.faulty:
        speed.size = speed.off
    # Its derivative would show the jump.
    _stop_following(speed)
    kind = Kind.HOLD if was_held else Kind.OFFSET
    if value == 0.0:
        kind = Kind.ZERO
    _convict(speed, kind, jump, Ground.SPEED_JUMPED, jump, period, limit)


@inner
def _convict(speed, kind, size, ground, first, second, third):
    speed.quiet = 0.0
    if not speed.faulty:
        speed.faulty, speed.kind = True, kind
        speed.size, speed.size_std = size, deviation(speed.noise)
        give_ground(speed.because, ground, first, second, third)


@inner
def convict_held(speed, value):
    """It says the same `value` (m/s) again and again."""
    run = speed.repetition.run + 1
    _convict(speed, Kind.HOLD, np.nan, Ground.SPEED_HELD, value, run, 0.0)
    speed.still = True


@inner
def convict_drift(speed, rate, limit, felt, since, filter_time):
    """It left what the accelerometer feels by so many m/s^2 (`rate`), while what that felt changed
    by so many, so many s ago (`since`): how long exactly the filter hides."""
    _convict(speed, Kind.RAMP, 0.0, Ground.SPEED_LEFT, rate, limit, felt)
    speed.off, speed.size_std = 0.0, abs(rate) * filter_time
    follow_drift(speed, rate, since)


@inner
def doubt_again(speed):
    """A faulty one still is wrong."""
    speed.quiet = 0.0


@inner
def follow_drift(speed, rate, time):
    """One that drifts went on to do so by so many m/s^2 (`rate`) for so many s."""
    speed.off += rate * time
    speed.size = speed.off
    speed.size_std += DRIFT_DOUBT * time
