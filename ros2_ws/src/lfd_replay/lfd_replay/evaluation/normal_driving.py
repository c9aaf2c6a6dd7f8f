"""Normal, fault-free driving: the lead, the noise of the radar, the indices (Table 1)."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from lfd_diagnosis.verdict import SIGNALS, State
from lfd_mpc.arrays import Array
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR
from lfd_replay.drive import Drive
from lfd_replay.evaluation.trace import JUDGED, Trace
from lfd_replay.score import hours_of, intervals

SMOOTHING = 1.0
"""Window in s over which speeds are differentiated."""

LEAST_SCANS = 5
"""Scans over which speeds are differentiated at least, however slow the radar is."""

COVERED = 0.9973
"""Share of all deviations within three standard deviations of a normal distribution."""


@dataclass(frozen=True)
class Following:
    """Scans (n,) of one lead without a gap: times in s, clearance in m, velocity in m/s."""

    time: Array
    clearance: Array
    relative_velocity: Array


def following(drive: Drive) -> list[Following]:
    """The stretches of a drive in which the radar follows one lead."""
    scans = [s for s in drive.samples if s.input == RADAR]
    if len(scans) < 2:
        return []
    zero = drive.zero
    time = np.array([(s.stamp - zero) * 1e-9 for s in scans])
    clearance = np.array([s.clearance for s in scans])
    velocity = np.array([s.relative_velocity for s in scans])
    track = np.array([s.track_id for s in scans])
    there = np.isfinite(clearance) & np.isfinite(velocity) & [s.has_target for s in scans]
    step = np.diff(time)
    usual = float(np.median(step))
    apart = (step <= 0) | (step > 3 * usual) | (track[1:] != track[:-1]) | (there[1:] != there[:-1])
    pieces = np.split(np.arange(len(time)), np.flatnonzero(apart) + 1)
    return [
        Following(time[own], clearance[own], velocity[own])
        for own in pieces
        if there[own[0]] and len(own) * usual > 2 * SMOOTHING
    ]


def lead_acceleration(drive: Drive) -> Array:
    """Acceleration of the lead in m/s^2, at the scans at which it can be told.

    From host speed plus relative velocity; without host speed, from the host's acceleration plus
    the derivative of the relative velocity. A stretch of fewer scans than these are smoothed over
    tells none.
    """
    speed_time, speed = _series(drive, HOST_SPEED)
    host_time, host = _series(drive, ACCELERATION)
    found = [np.empty(0)]
    for part in following(drive):
        count = len(part.time)
        if count < LEAST_SCANS:
            continue
        time = np.linspace(part.time[0], part.time[-1], count)
        period = time[1] - time[0]
        window = max(LEAST_SCANS, round(SMOOTHING / period)) | 1
        if count < window:
            continue
        velocity = np.interp(time, part.time, part.relative_velocity)
        if len(speed):
            velocity = velocity + np.interp(time, speed_time, speed)
        derivative = savgol_filter(velocity, window, 2, deriv=1, delta=period)
        if not len(speed):
            derivative += savgol_filter(np.interp(time, host_time, host), window, 2)
        found.append(derivative)
    return np.concatenate(found)


def _series(drive: Drive, name: str) -> tuple[Array, Array]:
    """Times in s and finite values of one scalar input."""
    samples = [s for s in drive.samples if s.input == name and np.isfinite(s.value)]
    zero = drive.zero
    time = np.array([(s.stamp - zero) * 1e-9 for s in samples])
    return time, np.array([s.value for s in samples])


def scan_deviations(drives: Iterable[Drive]) -> tuple[float, float]:
    """Standard deviations of the radar's clearance (m) and relative velocity (m/s).

    Of what a scan adds to the scan before it, carried forward: a third of what 99.73 % of all
    scans stay within, which is what the limits of Fig 10 must cover and single outliers are not.
    """
    clearance, velocity = [np.empty(0)], [np.empty(0)]
    for drive in drives:
        for part in following(drive):
            carried = part.clearance[:-1] + part.relative_velocity[:-1] * np.diff(part.time)
            clearance.append(np.abs(part.clearance[1:] - carried))
            velocity.append(np.abs(np.diff(part.relative_velocity)))
    return _third(np.concatenate(clearance)), _third(np.concatenate(velocity))


def _third(deviations: Array) -> float:
    return float(np.quantile(deviations, COVERED)) / 3.0 if len(deviations) else np.nan


@dataclass(frozen=True)
class IndexStatistics:
    """Table 1: the indices of fault-free driving; dictionaries by signal.

    `zero_share` is of the time with an index, `all` of the time in which every index is zero;
    `mean` and `std` are those of the indices above zero, `values` these themselves;
    `false_events_per_hour` counts the flags raised.
    """

    hours: float
    zero_share: dict[str, float]
    mean: dict[str, float]
    std: dict[str, float]
    values: dict[str, Array]
    false_events: dict[str, int]

    @property
    def false_events_per_hour(self) -> dict[str, float]:
        """False events per hour by signal."""
        return {name: count / self.hours for name, count in self.false_events.items()}


def index_statistics(traces: list[Trace]) -> IndexStatistics:
    """Statistics over the traces of fault-free drives."""
    indices = np.concatenate([trace.indices for trace in traces])
    zero_share, mean, std, values = {}, {}, {}, {}
    for column, signal in zip(indices.T, JUDGED, strict=True):
        known = column[np.isfinite(column)]
        values[signal] = known[known > 0.0]
        zero_share[signal] = float((known == 0.0).mean()) if len(known) else np.nan
        mean[signal] = float(values[signal].mean()) if len(values[signal]) else np.nan
        std[signal] = float(values[signal].std()) if len(values[signal]) else np.nan
    known = np.isfinite(indices).all(axis=1)
    zero_share["all"] = float((indices[known] == 0.0).all(axis=1).mean()) if known.any() else np.nan
    hours = hours_of(sum(len(trace.stamps) for trace in traces))
    false_events = {
        signal: sum(
            len(intervals(trace.stamps, trace.state(signal) == State.FAULT)) for trace in traces
        )
        for signal in SIGNALS
    }
    return IndexStatistics(hours, zero_share, mean, std, values, false_events)
