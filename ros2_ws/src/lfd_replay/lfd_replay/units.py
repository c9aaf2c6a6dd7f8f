"""Units and signs that inputs seem to be in: two pairs of them tell the same motion twice.

A clearance changes by what its relative velocity makes of it, and a speed by what the acceleration
makes. Where one of a pair is a steady multiple of the other, it is in another unit, or its sign is
another one; a sensor's fault is no such thing all along.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample
from lfd_replay.drive import stamps_of

KM_PER_H, MPH, FOOT, STANDARD_GRAVITY = 1.0 / 3.6, 0.44704, 0.3048, 9.80665
"""Units in m/s, m and m/s^2."""

WINDOW_S = 2.0
"""Time over which the two are compared."""

LONGEST_PERIOD_S = 0.25
"""A window with a longer silence tells nothing."""

LEAST_WINDOWS, LEAST_CHANGE, MOVING = 15, 0.5, 0.3
"""Windows that are needed, and by how many m or m/s, as it is said, such a share of them changes.
"""

KEPT, ROUNDS = 0.8, 4
"""Share of the windows that is fitted, as a radar may go over from car to car, and how often those
that fit best are sought."""

EXPLAINED = 0.8
"""Share of their squares that the ratio must explain."""

NEAR_ONE = (0.4, 1.9)
"""Ratios that a calibration, a slope or a delay may make."""

KNOWN = 0.25
"""Share by which a ratio may differ from that of a unit that it is taken for."""

OF_RADAR = {
    KM_PER_H: "as if it was in km/h",
    MPH: "as if it was in mph",
    FOOT: "as if it was in feet/s, or the clearance not in m",
    1.0 / FOOT: "as if the clearance was in feet",
}
"""How much of what the relative velocity says the clearance changes by, and what that looks like.
"""

OF_HOST = {
    1.0 / KM_PER_H: "as if the speed was in km/h",
    1.0 / MPH: "as if the speed was in mph",
    STANDARD_GRAVITY: "as if the acceleration was in g",
    STANDARD_GRAVITY / KM_PER_H: "as if the speed was in km/h and the acceleration in g",
    KM_PER_H: "as if the acceleration was in km/h per s",
}
"""The same for speed and acceleration."""


def odd_units(streams: dict[str, list[Sample]]) -> Iterator[str]:
    """What contradicts the units and signs that are expected: a line for each pair that does."""
    said, made = _radar_changes(streams.get(RADAR, ()))
    ratio = _usual_ratio(said, made) if _changes(made) else None
    words = _named(ratio, OF_RADAR)
    if words:
        yield (
            f"relative_velocity: the clearance changes by {ratio:.2f} of what it says, {words}; "
            "m/s are expected, negative where the lead comes nearer"
        )
    said, made = _host_changes(streams)
    # It is the accelerometer that is noisy.
    inverse = _usual_ratio(made, said) if _changes(made) else None
    ratio = 1.0 / inverse if inverse else None
    words = _named(ratio, OF_HOST)
    if words:
        yield (
            f"acceleration: the host speed changes by {ratio:.2f} of what it says, {words}; "
            "m/s^2 and m/s are expected, positive forward"
        )


def _changes(made: Array) -> bool:
    """Whether enough windows change by enough."""
    return len(made) >= LEAST_WINDOWS and (np.abs(made) >= LEAST_CHANGE).mean() >= MOVING


# Of values that no sensor gives, sums may be too large for a number: there is no ratio then.
_of_any_size = np.errstate(over="ignore", invalid="ignore")


@_of_any_size
def _usual_ratio(known: Array, noisy: Array) -> float | None:
    """By what `noisy` (n,) is a steady multiple of what is `known` better (n,); None where there is
    no such ratio."""
    count, ratio, off = int(KEPT * len(noisy)), 0.0, np.abs(noisy)
    for _ in range(ROUNDS):
        kept = np.argsort(off)[:count]
        square = float(known[kept] @ known[kept])
        if not square:
            return None
        ratio = float(known[kept] @ noisy[kept]) / square
        off = np.abs(noisy - ratio * known)
    left, all_of_it = float(off[kept] @ off[kept]), float(noisy[kept] @ noisy[kept])
    return ratio if left <= (1.0 - EXPLAINED) * all_of_it else None


def _named(ratio: float | None, units: dict[float, str]) -> str:
    """What a ratio looks like; nothing for one that is as expected."""
    if ratio is None:
        return ""
    size = abs(ratio)
    near = min(units, key=lambda unit: abs(size / unit - 1.0))
    said = []
    if ratio < 0.0:
        said.append("the other way round")
    if abs(size / near - 1.0) <= KNOWN:
        said.append(units[near])
    elif not NEAR_ONE[0] <= size <= NEAR_ONE[1]:
        said.append("as in no unit that is known")
    return ", ".join(said)


@_of_any_size
def _radar_changes(stream: Sequence[Sample]) -> tuple[Array, Array]:
    """By what the relative velocity says that the clearance changes, and by what it does, in
    windows of one target (m)."""
    scans = [s for s in stream if isinstance(s, RadarSample) and s.has_target]
    times = stamps_of(scans) * 1e-9
    values = np.array([(s.clearance, s.relative_velocity) for s in scans], float).reshape(-1, 2)
    ids = np.array([s.track_id for s in scans], np.int64)
    finite = np.isfinite(values).all(axis=1)
    times, values, ids = times[finite], values[finite], ids[finite]
    path = _integral(times, values[:, 1])
    first, last = _windows(times, np.diff(ids) != 0)
    return path[last] - path[first], values[last, 0] - values[first, 0]


@_of_any_size
def _host_changes(streams: dict[str, list[Sample]]) -> tuple[Array, Array]:
    """What the acceleration says of how the speed changes, and what it does, from one window to the
    next (m/s)."""
    felt_at, felt = _scalars(streams.get(ACCELERATION, ()))
    if len(felt) < 2:
        return np.empty(0), np.empty(0)
    # What steps back, or far ahead, is left out.
    forward = felt_at >= np.maximum.accumulate(felt_at)
    felt_at, felt = felt_at[forward], felt[forward]
    times, speed = _scalars(streams.get(HOST_SPEED, ()))
    first, last = _windows(times, np.zeros(max(len(times) - 1, 0), bool))
    begin, end = times[first], times[last]
    count = np.searchsorted(felt_at, end) - np.searchsorted(felt_at, begin)
    heard = count >= (end - begin) / LONGEST_PERIOD_S
    first, last, begin, end = first[heard], last[heard], begin[heard], end[heard]
    gained = _integral(felt_at, felt)
    said = np.interp(end, felt_at, gained) - np.interp(begin, felt_at, gained)
    # Slopes and mountings are in what is felt, but change slowly.
    return np.diff(said), np.diff(speed[last] - speed[first])


def _scalars(stream: Sequence[Sample]) -> tuple[Array, Array]:
    """Times in s, and finite values."""
    times = stamps_of(stream) * 1e-9
    values = np.array([s.value for s in stream if not isinstance(s, RadarSample)], float)
    finite = np.isfinite(values)
    return times[finite], values[finite]


def _integral(times: Array, values: Array) -> Array:
    """Of values (n,) over times (n,), from the first one on."""
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(times)
    return np.concatenate([np.zeros(min(len(times), 1)), np.cumsum(steps)])


def _windows(times: Array, ends: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First and last index of each window that no silence, step back or other end is in."""
    steps = np.diff(times)
    broken = np.concatenate([[0], np.cumsum(ends | (steps < 0.0) | (steps > LONGEST_PERIOD_S))])
    number = np.floor((times - times[:1]) / WINDOW_S)
    starts = np.flatnonzero(np.diff(number, prepend=-1.0))
    first, last = starts[:-1], starts[1:]
    whole = broken[first] == broken[last]
    return first[whole], last[whole]
