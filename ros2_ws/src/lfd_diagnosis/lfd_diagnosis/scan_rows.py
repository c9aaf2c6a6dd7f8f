"""Rows that but repeat the last scan: tables are often filled up to the rate of the fastest sensor.

Such a row says nothing new. Taken for a scan it would make a clearance that moves in steps look
held, and one outlier like many.
"""

from math import isfinite

import numpy as np

from lfd_diagnosis.healthy_signal import RING, append, at, is_full, start_ring
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
now and then, as coarse signals do, does not tell."""

SCAN_ROWS = np.dtype(
    [
        ("gaps", RING),
        ("changed_at", "f8"),
        ("scanned_at", "f8"),
        ("period", "f8"),
        ("taken", "i8"),
        ("told", "?"),
    ],
    align=True,
)
"""Seconds between the last changes (`gaps`), times (s) of the last one and of the last row that
was a scan, and the `period` (s) in which no message follows another, 0 where that is not known;
how many rows that but repeat were `taken` for scans until it was first `told`."""


@inner
def start_scan_rows(rows):
    """Begin with nothing."""
    start_ring(rows.gaps, CHANGES)
    rows.period, rows.taken, rows.told = 0.0, 0, False
    restart_scan_rows(rows)


@inner
def restart_scan_rows(rows):
    """The next row is a scan; how often they come is known as before."""
    rows.changed_at = rows.scanned_at = -np.inf


@inner
def is_scan(rows, time, repeats):
    """Take a row of a time in s, which repeats the one before or does not; whether it is a scan."""
    if repeats and time - rows.scanned_at < rows.period:
        return False
    rows.scanned_at = time
    if repeats:
        rows.taken += 1
    else:
        if isfinite(rows.changed_at):
            append(rows.gaps, time - rows.changed_at)
            rows.period = _shortest(rows.gaps)
        rows.changed_at = time
    return True


@inner
def begins_to_tell(rows):
    """Whether it is known from now on that about every other row, or more, was no scan."""
    if rows.told or rows.period == 0.0:
        return False
    rows.told = True
    return rows.taken >= CHANGES


@inner
def _shortest(gaps):
    """Seconds in which no message follows another, 0 where that is not known."""
    if not is_full(gaps):
        return 0.0
    shortest, close = np.inf, 0
    for i in range(gaps.count):
        shortest = min(shortest, at(gaps, i))
    for i in range(gaps.count):
        close += at(gaps, i) <= REGULAR * shortest
    return min(SOON * shortest, MESSAGE) if close >= MANY else 0.0
