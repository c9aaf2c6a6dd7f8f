"""Rows that are no scans: tables are often filled up to the rate of the fastest sensor.

Such a row repeats the last scan, or lies on the line from one to the next. Taken for a scan it
would make a clearance that moves in steps look held, one outlier like many, and a line between two
cars like a fault.
"""

from math import isfinite

import numpy as np

from lfd_diagnosis.ring import RING, append, at, is_full, start_ring
from lfd_diagnosis.sample import is_new
from lfd_mpc.compiled import inner

CHANGES = 16
"""Changes by which it is known how often a radar scans."""

SOON = 0.95
"""Share of the shortest time between two scans after which the next one may come."""

MESSAGE = 0.045
"""Seconds after which a row is one of the radar's own messages, though it say the same again: a
fault must be told by the second one."""

REGULAR, MANY = 1.5, 5
"""Times the shortest time between two changes within which so many of them must lie: what changes
now and then, as coarse signals do, does not tell, nor do some that came sooner."""

ON_LINE, HUNDREDTHS = 2e-3, 2e-2
"""m and m/s by which a row lies beside a line that is rounded to three decimals, or to two."""

LINES, ROUNDED, SHARE = 0.12, 0.95, 0.02
"""Share of the rows that must lie on lines where a table is interpolated, and must have two
decimals where it is rounded to those; so much of it each row counts."""

FAST, MOST = 0.025, 0.1
"""Seconds in which no radar scans twice, and in which a row that says nothing new is taken for a
scan all the same."""

SCAN_ROWS = np.dtype(
    [
        ("lately", "f8", (2, 3)),
        ("gaps", RING),
        ("changed_at", "f8"),
        ("scanned_at", "f8"),
        ("shortest", "f8"),
        ("changes", "i8"),
        ("lines", "f8"),
        ("hundredths", "f8"),
        ("taken", "i8"),
        ("told", "?"),
    ],
    align=True,
)
"""Time (s), clearance (m) and relative velocity (m/s) of the last two rows (`lately`); seconds
between the last changes (`gaps`), the `shortest` of them, 0 where that is not known, times (s) of
the last change and of the last row that was a scan; how many `changes` followed one another; share
of rows on `lines`, and of those in `hundredths`; how many rows that say nothing new were `taken`
for scans until it was first `told`."""


@inner
def start_scan_rows(rows):
    """Begin with nothing."""
    start_ring(rows.gaps, CHANGES)
    rows.shortest = rows.lines = rows.hundredths = 0.0
    rows.taken, rows.told = 0, False
    restart_scan_rows(rows)


@inner
def restart_scan_rows(rows):
    """The next row is a scan; how often they come is known as before."""
    rows.changed_at = rows.scanned_at = -np.inf
    rows.changes = 0
    rows.lately[:] = np.nan
    rows.lately[:, 0] = -np.inf


@inner
def is_scan(rows, time, clearance, velocity, same_target):
    """Take a row: time (s), clearance (m), relative velocity (m/s), and whether it is of the target
    that the one before was of; whether it is a scan."""
    if not is_new(time, rows.lately[1, 0]):
        # Taken in another step.
        return False
    fast = time - rows.lately[1, 0] < FAST
    repeats = clearance == rows.lately[1, 1] and velocity == rows.lately[1, 2]
    on_line = fast and not repeats and _is_on_line(rows, time, clearance, velocity)
    rows.lines += SHARE * (on_line - rows.lines)
    rows.hundredths += SHARE * (
        (_is_rounded(clearance) and _is_rounded(velocity)) - rows.hundredths
    )
    rows.lately[0] = rows.lately[1]
    rows.lately[1, 0], rows.lately[1, 1], rows.lately[1, 2] = time, clearance, velocity
    says_nothing = repeats or on_line
    if says_nothing:
        rows.changes = 0
    else:
        _note_change(rows, time)
    soon = min(REGULAR * rows.shortest, MOST) if fast else min(SOON * rows.shortest, MESSAGE)
    between = fast and rows.lines > LINES and (on_line or _is_after_bend(rows))
    if same_target and (repeats or between) and time - rows.scanned_at < soon:
        return False
    rows.scanned_at = time
    rows.taken += says_nothing
    return True


@inner
def _note_change(rows, time):
    """A row says something new."""
    rows.changes += 1
    if rows.lines > LINES and _is_after_bend(rows):
        return
    if isfinite(rows.changed_at):
        append(rows.gaps, time - rows.changed_at)
        rows.shortest = _shortest(rows.gaps)
    rows.changed_at = time


@inner
def _is_after_bend(rows):
    """Whether a row may leave the line only because that bends between the two rows before it."""
    return rows.changes > 0 and rows.changes % 2 == 0


@inner
def begins_to_tell(rows):
    """Whether it is known from now on that about every other row, or more, was no scan."""
    if rows.told or rows.shortest == 0.0:
        return False
    rows.told = True
    return rows.taken >= CHANGES


@inner
def _is_rounded(value):
    """Whether a value has two decimals."""
    return abs(100.0 * value - round(100.0 * value)) < 1e-6


@inner
def _is_on_line(rows, time, clearance, velocity):
    """Whether a row lies on the line through the last two."""
    last, before = rows.lately[1], rows.lately[0]
    off = HUNDREDTHS if rows.hundredths > ROUNDED else ON_LINE
    share = (time - last[0]) / (last[0] - before[0])
    off_clearance = clearance - last[1] - share * (last[1] - before[1])
    off_velocity = velocity - last[2] - share * (last[2] - before[2])
    return abs(off_clearance) <= off and abs(off_velocity) <= off


@inner
def _shortest(gaps):
    """Seconds between two scans at least, 0 where that is not known."""
    shortest = 0.0
    if is_full(gaps):
        for i in range(gaps.count):
            gap = at(gaps, i)
            close = 0
            for k in range(gaps.count):
                close += gap <= at(gaps, k) <= REGULAR * gap
            if close >= MANY and (gap < shortest or shortest == 0.0):
                shortest = gap
    return shortest
