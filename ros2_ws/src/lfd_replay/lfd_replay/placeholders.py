"""Ranges that a radar seems to give where it has no lead: 0, -1, 255, ... in place of a blank.

Each is taken for a car. What is at exactly the same range again and again, and is there and gone
with a jump each time, is none; nor is what is at zero or less while the host moves.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_mpc.samples import HOST_SPEED, RADAR, RadarSample, Sample, ScalarSample
from lfd_replay.drive import stamps_of

Truth = NDArray[np.bool_]

LEAST_RUNS, LEAST_SCANS = 3, 2
"""How often such a value comes back, and for how many scans in a row: a fault of a sensor may stay
at a value once or twice, and a spike is one scan."""

JUMP_M, LONGEST_PERIOD_S = 6.0, 1.0
"""By more than this the range changes from one scan to the next, within so long a time."""

MOVING, NEAREST_M = 2.0, 2.0
"""Host speed in m/s from which on a car at zero or less is none, and how far from there every car
is: a range that has an offset, and ends at zero, comes there little by little."""

NEARLY_ALL = 0.9
"""Share of the ranges at zero or less that the value must have: noise has many values."""


def placeholders(streams: dict[str, list[Sample]]) -> Iterator[str]:
    """What seems to stand for no lead: a line for each such range."""
    scans = [s for s in streams.get(RADAR, ()) if isinstance(s, RadarSample) and s.has_target]
    ranges = np.array([scan.clearance for scan in scans], float)
    finite = np.isfinite(ranges)
    ranges, times = ranges[finite], stamps_of(scans)[finite] * 1e-9
    if not len(ranges):
        return
    nothing = ranges[ranges <= 0.0]
    values, counts = np.unique(nothing, return_counts=True)
    suspects = [float(value) for value in values[counts >= NEARLY_ALL * len(nothing)]]
    if ranges.max() > 0.0:
        suspects.append(float(ranges.max()))
    for value in suspects:
        runs, rows = _runs(value, times, ranges, streams)
        if runs >= LEAST_RUNS:
            yield (
                f"clearance: {rows} of {len(scans)} scans with a lead say exactly {value:g} m, "
                f"{runs} times for a while, as a placeholder where there is none; each time it is "
                "taken for a car: leave the range blank in those rows (in a bag: has_target false)"
            )


def _runs(
    value: float, times: Array, ranges: Array, streams: dict[str, list[Sample]]
) -> tuple[int, int]:
    """How often the range is at a value as no car is, and in how many scans it is at it."""
    at = ranges == value
    starts = np.flatnonzero(at & ~np.concatenate([[False], at[:-1]]))
    ends = np.flatnonzero(at & ~np.concatenate([at[1:], [False]]))
    change = np.where(np.diff(times) < LONGEST_PERIOD_S, np.abs(np.diff(ranges)), 0.0)
    # Before the first scan, and after the last one, nobody knows.
    change = np.concatenate([[np.inf], change, [np.inf]])
    least = np.full(len(starts), JUMP_M)
    if value <= 0.0:
        moves = _moves(times[starts], streams) & _moves(times[ends], streams)
        least[moves] = NEAREST_M
    odd = np.minimum(change[starts], change[ends + 1]) > least
    return int((odd & (ends - starts + 1 >= LEAST_SCANS)).sum()), int(at.sum())


def _moves(times: Array, streams: dict[str, list[Sample]]) -> Truth:
    """Whether the host is known to move at these times (s)."""
    known = [s for s in streams.get(HOST_SPEED, ()) if isinstance(s, ScalarSample)]
    if not known:
        return np.zeros(len(times), bool)
    speed = np.array([sample.value for sample in known], float)
    after = np.searchsorted(stamps_of(known) * 1e-9, times, side="right")
    return speed[np.maximum(after - 1, 0)] >= MOVING
