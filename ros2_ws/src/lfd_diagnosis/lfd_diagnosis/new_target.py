"""Another target under the same id: radars give the id of a target that is gone to the next one.

Both signals jump then, as they do when both are faulty. But a target's clearance goes on as its
relative velocity says; where that is faulty, it goes on as it did before.
"""

from math import sqrt

import numpy as np

from lfd_mpc.compiled import inner

CERTAIN, CLEARLY = 4.0, 0.35
"""Deviations of the difference of two clearances that a way must be off to be wrong, and share of
that which the other way may be off."""

FAR, MOVED, LEAST_MOVED = 6.0, 3.0, 0.15
"""m by which a target is another one where scans were missed before, or the relative velocity moves
in the same scan, by so many deviations, and m/s at least: that much a calm lead changes its own."""

FAR_STANDING = 12.0
"""m by which something else that stands is another target: it is all equally fast."""

SURELY_FAR, SURELY_SHARE = 15.0, 0.4
"""m by which it surely is, of a radar that gives no ids, where the relative velocity moves, too; or
where that is more than such a share of the clearance: most of its targets begin like that."""

LONGEST = 0.3
"""Seconds after which a target that is as far away is taken for another one, were it in doubt."""

LEAP = np.dtype(
    [
        ("scans", "i8"),
        ("since", "f8"),
        ("far", "?"),
        ("surely", "?"),
        ("waits", "?"),
        ("clearance", "f8"),
        ("way", "f8"),
        ("beside", "f8"),
        ("then", "f8"),
        ("velocity", "f8"),
        ("off", "f8"),
    ],
    align=True,
)
"""What became of a jump of either signal, over `scans` since a time in s: the `clearance` (m) that
was measured first, the `way` (m) that the relative velocity makes since, and how far that is
`beside` the one that was expected; the last scan's `velocity` (m/s) and how far that is `off`.

`far`: no sensor is off by so much and in both signals, `surely` not even if it goes on as the
former target did; `waits`: whether it is in doubt for a moment."""


@inner
def is_far(off):
    """Whether a clearance is too far off (m) to be that of the same target."""
    return abs(off) > FAR


@inner
def forget_leap(leap):
    """Nothing has jumped."""
    leap.scans, leap.waits = 0, False


@inner
def follow_leap(leap, at, clearance, velocity, jump, off, deviation, stands, has_id):
    """Take one scan that disagrees: time (s), its clearance (m) and relative velocity (m/s), by how
    much it leaves the former one (m) and is off in velocity (m/s), of which a healthy one deviates
    by so much; whether it stands, and has an id."""
    if not leap.scans:
        far = is_far(jump) and abs(off) > max(MOVED * deviation, LEAST_MOVED)
        much = abs(jump) > SURELY_SHARE * (clearance - jump)
        leap.surely = (far or much) and abs(jump) > SURELY_FAR and not has_id
        leap.since = at
        leap.far = far or leap.surely or (stands and abs(jump) > FAR_STANDING)
        _restart_leap(leap, clearance)
    else:
        period = at - leap.then
        leap.way += 0.5 * (velocity + leap.velocity) * period
        leap.beside += 0.5 * (off + leap.off) * period
        leap.scans += 1
        # Targets may follow one another at once.
        if is_far(clearance - leap.clearance - leap.way):
            _restart_leap(leap, clearance)
    leap.then, leap.velocity, leap.off = at, velocity, off


@inner
def _restart_leap(leap, clearance):
    leap.scans, leap.clearance = 1, clearance
    leap.way = leap.beside = 0.0


@inner
def judge_leap(leap, clearance, noise, resolution, velocity_jumped):
    """Decide what jumped: true for another target; where that is in doubt the leap `waits`.

    Clearance, the deviation of its noise and its resolution in m; whether the relative velocity has
    left its limits, too. A clearance of exactly zero is no target.
    """
    leap.waits = leap.far and leap.then - leap.since < LONGEST
    if leap.scans < 2:
        return False
    doubt = CERTAIN * sqrt(2.0) * noise + resolution
    off_own = abs(clearance - leap.clearance - leap.way)
    off_former = abs(clearance - leap.clearance - leap.way + leap.beside)
    goes_on = off_former < CLEARLY * off_own and (off_own > doubt or not leap.far)
    if clearance == 0.0 or (goes_on and not leap.surely):
        # The first scan of a target may lie anywhere: the third tells.
        leap.waits = leap.waits and clearance != 0.0 and leap.scans == 2
        return False
    if off_former > doubt and off_own < CLEARLY * off_former:
        return True
    if off_own > doubt:
        _restart_leap(leap, clearance)
        # It wanders about either way: no longer than others are doubted.
        return leap.far and not leap.waits
    leap.waits = leap.waits and velocity_jumped
    return leap.far and not leap.waits
