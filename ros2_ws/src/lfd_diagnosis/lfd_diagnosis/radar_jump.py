"""Whether a radar signal that jumped away has jumped back since, or elsewhere."""

from math import isfinite

import numpy as np

from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_residual import least_limit
from lfd_diagnosis.radar_signal import (
    FIRST,
    RECENT,
    began_with,
    forget_recent,
    largest_jump,
    restart_agreement,
)
from lfd_diagnosis.ring import append, at, is_full, mean_of, start_ring
from lfd_diagnosis.roughness import resolution_of
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

FEW_BEFORE, FEW_AFTER, FEW_DOUBT = 6, 3, 5.4
"""Residuals before a jump back, and after it, that it is told by, and four deviations of the size
that is then found for it, in deviations of the sensor's noise."""

BEFORE, AFTER, DOUBT = 12, 5, 3.9
"""The same where the noise is not small against the jump."""

MANY_AFTER, MANY_DOUBT = 8, 2.9
MANY_BEFORE = RECENT - MANY_AFTER
"""The same where even so it could not be told from the noise."""

LAST, SEEN = 3, 0.5
"""Residuals just before a jump back, and share of the fault by which the new ones must differ from
these: a line drawn through many may be drawn wrong."""

TOLERANCE, MOST_DOUBT = 0.3, 0.6
"""Share of a jump by which the jump back may differ from it, and share that noise may be of it."""

UNDONE_AT_ONCE = 0.5
"""Share of a jump that must be undone from one scan to the next if it is to be undone at once."""

GRADUAL = 0.9
"""Share of its limit that a signal which leaves it little by little goes at most from one scan to
the next."""

AGAIN, AGAIN_SIGMA = 3, 6.0
"""Scans after which a faulty signal has surely jumped elsewhere, and deviations of its noise by
which such a jump steps at least, from one scan to the next."""

END_UNSEEN = 60.0
"""Seconds in which a jump back may be the end of an offset that is believed since another target
came."""


@inner
def _levels(recent, before, after):
    """The newest `after` values against the `before` ones before them: how far the new ones lie off
    the line through the old ones, where they lie, how far apart from each other, how far off the
    last few old ones, and how much the old ones rose from one to the next. All are medians: single
    outliers on either side do not count."""
    first = recent.count - before - after
    old, new = np.empty(before), np.empty(after)
    rises = np.empty(before * (before - 1) // 2)
    for i in range(before):
        old[i] = at(recent, first + i)
    count = 0
    for i in range(before):
        for j in range(i):
            rises[count] = (old[i] - old[j]) / (i - j)
            count += 1
    for i in range(after):
        new[i] = at(recent, first + before + i)
    level = np.median(new)
    # A later one may be an outlier itself, the first one may be from before the jump.
    off = np.abs(new - level)
    apart = max(off[0], np.sort(off)[after - 2])
    scans, rise = 0.5 * (before + after), np.median(rises)
    jump = level - (np.median(old) + scans * rise)
    return jump, level, apart, level - np.median(old[-LAST:]), rise


@inner
def _scans_to_tell(signal, offset):
    """How many scans before a jump back of an `offset`, and after it, are needed to tell it: the
    larger the noise, the more. And how far off its size may seem by noise and rounding."""
    noise = deviation(signal.noise)
    before, after, doubt = FEW_BEFORE, FEW_AFTER, FEW_DOUBT * noise
    if doubt > TOLERANCE * abs(offset):
        before, after, doubt = BEFORE, AFTER, DOUBT * noise
    rounding = 0.5 * resolution_of(signal.roughness)
    if doubt + rounding > MOST_DOUBT * abs(offset):
        before, after, doubt = MANY_BEFORE, MANY_AFTER, MANY_DOUBT * noise
    return before, after, doubt + rounding


@inner
def look_for_return(signal, said, repeated):
    """Take note of a scan, and of whether the jump that made the fault was undone, whatever became
    of the reference: some scans lie as far off those before as the first ones did, the other way.

    `said`: a clearance's residual, or a relative velocity itself; `repeated`: the scan says nothing
    new. Returns where it is now, off its reference, and how much it rose before from scan to scan;
    NaN if it did not return. Of the scans the median: the newest may be an outlier.
    """
    if signal.kind != Kind.OFFSET:
        return np.nan, np.nan
    recent = signal.recent
    if not repeated:
        append(recent, signal.residual)
        append(signal.said, said)
    offset = began_with(signal)
    before, after, doubt = _scans_to_tell(signal, offset)
    tolerance = max(TOLERANCE * abs(offset), 0.5 * signal.floor, doubt)
    told = doubt <= MOST_DOUBT * abs(offset) and tolerance < abs(offset)
    if recent.count < before + after or not told:
        return np.nan, np.nan
    jump, level, apart, seen, drift = _levels(recent, before, after)
    if abs(jump + offset) >= tolerance or apart >= tolerance:
        return np.nan, np.nan
    # What jumped back before and now jumps away that way is off anew, to the other side.
    if signal.returned and abs(level) > abs(level - jump):
        return np.nan, np.nan
    # The reference itself may have jumped: one that is coasted follows the other signal's noise.
    itself, _, _, _, rise = _levels(signal.said, before, after)
    if -itself * offset < SEEN * offset * offset:
        return np.nan, np.nan
    # Against a reference that is known well, a line that was drawn wrong is no jump.
    if signal.tellable and -seen * offset < SEEN * offset * offset:
        return np.nan, np.nan
    largest = 0.0
    for i in range(recent.count - before - after + 1, recent.count):
        largest = max(largest, abs(at(recent, i) - at(recent, i - 1)))
    signal.at_once = largest > UNDONE_AT_ONCE * abs(offset)
    # What was undone is what it must be told from now.
    signal.estimate = signal.size = offset
    forget_recent(signal)
    signal.came_back, signal.returned = True, signal.at_once
    restart_agreement(signal)
    # The median lies in their middle; a reference that was coasted has gone on since, by no more
    # than they lie apart.
    gone_on = 0.5 * (after - 1) * drift
    return level + max(-apart, min(apart, gone_on)), rise


@inner
def move_reference(signal, by):
    """The reference of a faulty signal moved `by` so much: that is no jump of the signal."""
    for values in (signal.recent.values, signal.said.values):
        for i in range(len(values)):
            values[i] -= by


@inner
def follow_step(signal, period, step):
    """Take note of a scan, `period` s after the one before: whether it steps by enough to undo the
    jump at once, and that way. `step`: from that scan to this one, beyond the lead's own motion."""
    if abs(step) > UNDONE_AT_ONCE * largest_jump(signal):
        signal.at_once = True
        back = step * signal.size < 0.0
        signal.jumped_back_at = signal.last_at + period if back else np.nan


@inner
def _begin_again(signal):
    """The fault's jump was undone before: the newest one, `again`, is the beginning of another."""
    signal.returned, signal.jumped_back_at = False, np.nan
    start_ring(signal.first, FIRST)
    for i in range(signal.again.count):
        append(signal.first, at(signal.again, i))


@inner
def follow_jump(signal, step):
    """Take note of a scan that is off; whether an offset has jumped elsewhere, or may have: then
    its new size is taken from its newest residuals alone. `step` as in `follow_step`."""
    again = signal.again
    if signal.kind != Kind.OFFSET:
        return False
    least = max(least_limit(signal), AGAIN_SIGMA * deviation(signal.noise))
    if abs(step) > least:
        if not 0 < again.count < AGAIN:
            # What its reference had wandered by is no part of the fault.
            signal.astray = 0.0 if signal.agreeing > 0.0 else signal.estimate - signal.size
        start_ring(again, FIRST)
    elif not again.count or is_full(again):
        return False
    append(again, signal.residual)
    if again.count < AGAIN:
        return True
    level = mean_of(again, 0, again.count)
    if again.count == AGAIN and abs(level - signal.astray - signal.size) <= least:
        # It was an outlier, or is back from one.
        start_ring(again, FIRST)
        return False
    if again.count == AGAIN and signal.returned:
        _begin_again(signal)
    signal.estimate, signal.size = level, level - signal.astray
    return True


@inner
def has_not_jumped_back(signal):
    """Whether what jumped away was not seen to jump back: if it agrees, it may still be off."""
    back = signal.came_back or isfinite(signal.jumped_back_at)
    return signal.kind == Kind.OFFSET and not back


@inner
def may_have_shifted(signal, largest):
    """Whether a clearance that agrees again may be off as before, the radar seeing another part of
    the car since: no jump undid the fault at once, and it was within the `largest` distance (m) of
    two such parts."""
    return signal.kind == Kind.OFFSET and not signal.at_once and largest_jump(signal) <= largest


@inner
def came_back_and_shifts(signal, step, largest):
    """Whether a clearance that jumped back goes over to another part of the car now, `step` m since
    the scan before: little by little, and by `largest` m at most."""
    gradual = abs(step) <= GRADUAL * signal.limit
    return signal.came_back and gradual and 0.5 * signal.limit < abs(signal.residual) <= largest


@inner
def note_end(signal, time):
    """A fault is over at a time in s; where another target has come meanwhile and nobody saw the
    signal jump back, keep how far it was off: it may still be."""
    unseen = (signal.lost or signal.carried) and has_not_jumped_back(signal)
    signal.ended_size = began_with(signal) if unseen else np.nan
    signal.ended_at = time


@inner
def ends_the_last(signal):
    """Whether a jump undoes the offset whose end nobody saw: that is its end, and no new fault."""
    off, recent = signal.ended_size, signal.last_at - signal.ended_at < END_UNSEEN
    doubt = max(TOLERANCE * abs(off), 0.5 * signal.floor)
    return recent and abs(signal.residual + off) < doubt
