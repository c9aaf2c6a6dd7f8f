"""Whether the road bends up or down: then gravity changes what the accelerometer feels.

That is slower than a sensor jumps and faster than it drifts.
"""

import numpy as np

from lfd_diagnosis.acceleration_jump import came_at_once, jump_noise
from lfd_diagnosis.ring import RING, append, is_full, mean_of, range_of, start_ring
from lfd_mpc.compiled import inner

EVERY, KEPT, MEAN = 5, 24, 4
"""Steps between two values that are kept, how many are (over 1.2 s), and how many of them a mean is
made of: its newest and its oldest one are a second apart."""

MOST_DRIFT, FASTER, FLAT = 0.5, 0.65, 0.25
"""m/s^2 that a drift may change within that second, that none does, and up to which the road does
not bend any more."""

LEAST_AFTER, MOST_AFTER, PROVEN_AFTER = 10, 40, 60
"""Values after a bend that tell whether it was one, as a drift goes on; and after it was left until
nothing says any more that it was none."""

SURE = 0.5
"""m/s^2 of a bend beyond what a drift may have made of it from which on it surely is one."""

STEADY = 2.5
"""m/s^2 by which the host's acceleration may change meanwhile: a manoeuvre shows every lag, and
looks like a bend."""

SLOWEST_BEND, FASTEST_BEND = 1.0, 15.0
"""m/s from which on a car surely goes round a bend, and up to which roads bend so sharply."""

ROAD_BEND = np.dtype(
    [
        ("differences", RING),
        ("derivatives", RING),
        ("felts", RING),
        ("steps", "i8"),
        ("since", "i8"),
        ("bent", "f8"),
        ("level", "f8"),
        ("slope_before", "f8"),
        ("over_for", "i8"),
    ],
    align=True,
)
"""What lately differed between accelerometer and speed (`differences`), the speed's `derivatives`,
and what was felt (`felts`), every `EVERY` steps, in m/s^2; `steps` so far.

`since`: values since a bend, 0 where there was none; `bent` (m/s^2): how much more the road did
bend than a drift makes; `level` (m/s^2): the mean difference when it last bent; `slope_before`
(m/s^2): the slope when it began to, `over_for`: values since it is over.
"""


@inner
def start_bend(bend):
    """Begin with nothing."""
    start_ring(bend.differences, KEPT)
    start_ring(bend.derivatives, KEPT)
    start_ring(bend.felts, KEPT)
    bend.steps = bend.since = 0
    bend.bent = 0.0
    bend.over_for = PROVEN_AFTER


@inner
def is_unproven(bend):
    """Whether the road bends, or may not have lately, so that the slope before it still counts."""
    return bend.over_for < PROVEN_AFTER


@inner
def slope_now(bend):
    """The mean of the newest differences (m/s^2)."""
    count = bend.differences.count
    return mean_of(bend.differences, count - MEAN, count)


@inner
def follow_bend(bend, jump, difference, derivative, felt, speed, steepest):
    """Take one step's difference and derivative (m/s^2) at that speed (m/s); returns by how much
    the slope of the road is known to have changed (m/s^2), none being steeper than `steepest`."""
    bend.steps += 1
    if bend.steps % EVERY:
        return 0.0
    append(bend.differences, difference)
    append(bend.derivatives, derivative)
    append(bend.felts, felt)
    bend.over_for = 0 if bend.since else bend.over_for + 1
    if not is_full(bend.differences):
        return 0.0
    if bend.since:
        bend.since += 1
    now = slope_now(bend)
    before = mean_of(bend.differences, 0, MEAN)
    if bend.bent >= SURE and bend.since < KEPT - MEAN:
        # What is older than a bend says nothing of how the road goes on from there.
        before = bend.level
    changed = now - before
    if abs(changed) < FASTER + jump_noise(jump) or abs(now) > steepest:
        return 0.0
    if not (SLOWEST_BEND <= speed <= FASTEST_BEND and _is_steady(bend, abs(changed))):
        return 0.0
    if came_at_once(jump, changed):
        return 0.0
    bend.since, bend.over_for = 1, 0
    bend.bent += abs(changed) - MOST_DRIFT
    if bend.bent < SURE:
        changed -= MOST_DRIFT if changed > 0.0 else -MOST_DRIFT
    bend.level = now
    differences = bend.differences
    for i in range(KEPT - MEAN):
        differences.values[(differences.next + i) % KEPT] += changed
    return changed


@inner
def _is_steady(bend, changed):
    """Whether the host is in no manoeuvre, by its speed and by what is felt: a late or smoothed
    speed tells of a manoeuvre when it is half over. What is felt has `changed` by the bend, too."""
    felt = range_of(bend.felts) <= STEADY + changed
    return felt and range_of(bend.derivatives) <= STEADY


@inner
def has_bent(bend):
    """Whether the road surely bends just now, or just bent and does not go on, as a drift would."""
    if bend.steps % EVERY or not bend.since:
        return False
    if bend.since == 1:
        return bend.bent >= SURE
    return _goes_straight_on(bend)


@inner
def _goes_straight_on(bend):
    """Whether the road has not bent any more for long enough since it did."""
    changed = slope_now(bend) - mean_of(bend.differences, 0, MEAN)
    flat = bend.since > LEAST_AFTER and abs(changed) < FLAT
    return flat and _is_steady(bend, bend.bent + MOST_DRIFT)


@inner
def leave_bend(bend):
    """Forget a bend that is over, and one after which too much came to tell what it was."""
    if bend.steps % EVERY or bend.since <= 1:
        return
    if bend.since > MOST_AFTER or _goes_straight_on(bend):
        bend.since, bend.bent = 0, 0.0
