"""Whether a host speed that says the same again and again is held, and what it missed meanwhile."""

import numpy as np

from lfd_diagnosis.evidence import Ground
from lfd_diagnosis.host_speed import (
    EQUAL_MOST,
    SLOW,
    convict,
    is_coarse,
    seems_to_stand,
)
from lfd_diagnosis.repetition import (
    is_beyond_chance,
    is_frozen,
    is_seldom,
    note_change,
    take_repetition,
)
from lfd_diagnosis.roughness import is_noiseless, resolution_of
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

MISSED_SLOW = 0.5
"""m/s that a slow speed must have missed by what is felt, so that it had reason to change."""

MISSED, MISSED_STEPS, SLOPE_DOUBT = 0.15, 8.0, 0.8
"""The same where it is faster: m/s, or steps of its resolution; and m/s^2 of what is felt after a
second that may be the slope of the road."""

UNLIKE = 0.4
"""Share of what it missed while it repeated itself that a leap may differ by."""

EQUAL_LEAST, EQUAL_TIME = 3, 0.1
"""Equal samples in a row that are never suspect, at least, and seconds for which they are not, as
far as `EQUAL_MOST` allows."""

MOVED_STEPS, LONGEST_REFRESH, REFRESH_SHARE = 2.5, 0.3, 0.2
"""Steps of its resolution by which a new value differs where it was not rounding that kept the one
before; the longest time in s for which a sensor says each value again and again, and the share by
which each such time is learnt."""

REPEATING, UNEVEN = 1.5, 1.2
"""A sensor says everything several times where that time is so many times longer than the one
between two samples; an equal sample is the same one again for so many of that time."""


@inner
def says_again(speed, at, value):
    """Whether the newest one is the sample before once more, of a sensor that says everything
    several times."""
    held = speed.held
    repeating = held.refresh > REPEATING * speed.spacing.gap
    return repeating and value == speed.last and at - held.changed_at < UNEVEN * held.refresh


@inner
def follow_repetition(speed, at, value, period, acceleration):
    """Take a sample (m/s) of time `at` (s): for how long it has said the same, and what it missed
    meanwhile, by how the host accelerates (m/s^2)."""
    held = speed.held
    seldom = EQUAL_TIME / max(speed.roughness.period, EQUAL_TIME / EQUAL_MOST)
    held.repetition.least = max(int(seldom), EQUAL_LEAST)
    held.same = held.same + 1 if value == speed.last else 0
    equal = take_repetition(held.repetition, value, not speed.faulty)
    if not equal:
        held.still = False
        speed.motion.derivative_when_held = speed.motion.derivative
        _learn_refresh(speed, at, value)
    held.missed = held.missed + acceleration * period if equal else 0.0
    held.same_for = held.same_for + period if equal else 0.0


@inner
def _learn_refresh(speed, at, value):
    """How long it says each value again and again, from one (m/s) that differs from the last one by
    more than rounding."""
    held = speed.held
    since = at - held.changed_at
    held.changed_at = at
    moved = abs(value - speed.last) > MOVED_STEPS * resolution_of(speed.roughness)
    if moved and since < LONGEST_REFRESH:
        held.refresh += REFRESH_SHARE * (since - held.refresh)


@inner
def _says_the_same(speed, settings):
    """Whether it has said the same for longer than its derivative is filtered."""
    return speed.held.same_for > settings.host_speed_filter_time


@inner
def hides_by_rounding(speed, settings):
    """Whether it has said the same for so long that its derivative is zero, while what is felt may
    well amount to less than one of its steps: then the derivative tells nothing."""
    missed_less = abs(speed.held.missed) < resolution_of(speed.roughness)
    return _says_the_same(speed, settings) and missed_less


@inner
def tells_of_bends(speed, settings):
    """Whether its derivative is fine enough to tell a bend of the road by."""
    return not (is_coarse(speed) or _says_the_same(speed, settings))


@inner
def _least_missed(speed):
    """m/s by which it must have missed a change for that to be more than rounding."""
    return max(MISSED, MOVED_STEPS * resolution_of(speed.roughness))


@inner
def may_miss_a_change(speed):
    """Whether it says the same while the car moves, though what is felt may have changed it."""
    return speed.held.same > 0 and abs(speed.held.missed) > MISSED and not seems_to_stand(speed)


@inner
def misses_a_change(speed):
    """Whether it surely does: what is felt would have moved it by more than its steps."""
    return may_miss_a_change(speed) and abs(speed.held.missed) > _least_missed(speed)


@inner
def _makes_up(speed, value, period, acceleration):
    """Whether this new value (m/s) leaps by what was missed while it said the same."""
    missed = speed.held.missed + acceleration * period
    off = abs(value - speed.last - missed)
    return speed.held.same > 0 and abs(missed) > _least_missed(speed) and off < UNLIKE * abs(missed)


@inner
def was_held(speed, value, period, acceleration):
    """Whether the speed was held until this new `value` (m/s): it said the same for longer than its
    noise lets it by chance, or leaps by what it missed meanwhile."""
    noisy = not is_noiseless(speed.roughness)
    beyond_chance = noisy and is_beyond_chance(speed.held.repetition, speed.held.same)
    return beyond_chance or _makes_up(speed, value, period, acceleration)


@inner
def speed_seems_held(speed, agrees_with_then, is_unlikely):
    """Whether it may be held by now, so that its derivative tells nothing; also that of a car that
    seems to stand.

    So it is where it has said the same for longer than it usually does; or for a moment, while what
    is felt agrees with the derivative from before; or for a moment or while it missed a change, if
    the lead says that the speed `is_unlikely` to be right.
    """
    for_a_moment = speed.held.same >= speed.held.repetition.least
    missed = for_a_moment or abs(speed.held.missed) > _least_missed(speed)
    may_be = (for_a_moment and agrees_with_then) or (missed and is_unlikely)
    return may_be or is_seldom(speed.held.repetition, speed.held.same)


@inner
def _should_have_changed(speed):
    """Whether it had reason to change while it said the same."""
    missed = max(MISSED, MISSED_STEPS * resolution_of(speed.roughness))
    if abs(speed.last) <= SLOW:
        missed = MISSED_SLOW
    missed += SLOPE_DOUBT * max(speed.held.same_for - 1.0, 0.0)
    return abs(speed.held.missed) > missed and not seems_to_stand(speed)


@inner
def look_for_hold(speed):
    """Whether it is held; takes note of whether it had reason to change."""
    changed = _should_have_changed(speed)
    note_change(speed.held.repetition, changed)
    silent = abs(speed.last) <= SLOW or is_noiseless(speed.roughness)
    tells = changed or not silent
    return tells and is_frozen(speed.held.repetition, changed)


@inner
def convict_held(speed, value):
    """It says the same `value` (m/s) again and again."""
    run = speed.held.repetition.run + 1
    convict(speed, Kind.HOLD, np.nan, Ground.SPEED_HELD, value, run, 0.0)
    speed.held.still = True
