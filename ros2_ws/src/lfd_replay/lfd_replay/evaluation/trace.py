"""A drive through the graph as arrays: what the detectors and the statistics work on."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.verdict import SIGNALS
from lfd_mpc.arrays import Array

JUDGED = ("clearance", "relative_velocity", "acceleration")
"""The signals that have an index of their own."""


@dataclass(frozen=True)
class Trace:
    """n steps; `stamps` (n,) in ns of drive time.

    `states` (n, 4) in the order of `SIGNALS`; `indices` (n, 3) in the order of `JUDGED`.
    `used` (n, 3): clearance (m), relative velocity (m/s) and acceleration (m/s^2) as used, NaN
    where there was none. `predicted` (n, 2) in m and m/s: what the oldest solution that reaches a
    step said about it. `relative_acceleration` (n,) in m/s^2: of the observer of lag 0.
    `measured` (n, 2) in m and m/s: the newest scan, taken at `scans` (n,) in ns of drive time.
    """

    stamps: NDArray[np.int64]
    states: NDArray[np.int8]
    indices: Array
    used: Array
    predicted: Array
    relative_acceleration: Array
    measured: Array
    scans: NDArray[np.int64]

    def index(self, signal: str) -> Array:
        """The fault index (n,) of one signal."""
        return self.indices[:, JUDGED.index(signal)]

    def state(self, signal: str) -> NDArray[np.int8]:
        """The state (n,) of one signal."""
        return self.states[:, SIGNALS.index(signal)]

    def new_scans(self) -> NDArray[np.intp]:
        """Steps (m,) at which a scan is seen for the first time."""
        fresh = np.append(True, np.diff(self.scans) != 0) & np.isfinite(self.measured).all(axis=1)
        return np.flatnonzero(fresh)

    def save(self, path: Path) -> None:
        """Write the arrays into a file."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("wb") as file:
            np.savez(file, **vars(self))


def load_trace(path: Path) -> Trace:
    """Read what `Trace.save` wrote."""
    with np.load(path) as arrays:
        return Trace(**arrays)


def record_trace(rows: Iterable[NDArray[np.void]], zero: int) -> Trace:
    """Collect the rows of an offline graph, of a drive whose time zero is `zero` in ns."""
    parts: list[tuple] = []
    for part in rows:
        horizon, outcome = part["horizon"], part["outcome"]
        now = outcome["reconstructed"]
        stamps = horizon["stamp"] - zero
        age = horizon["clearance_age"]
        scanned = np.isfinite(age)
        scans = stamps - np.round(np.where(scanned, age, 0.0) * 1e9).astype(np.int64)
        acceleration = horizon["acceleration"].copy()
        acceleration[horizon["acceleration_stale"]] = np.nan
        parts.append(
            (
                stamps,
                np.stack([outcome[name]["state"] for name in SIGNALS], axis=1),
                np.stack([outcome[name]["index"] for name in JUDGED], axis=1),
                _columns(horizon["clearance"], horizon["relative_velocity"], acceleration),
                _columns(now["clearance"], now["relative_velocity"]),
                now["relative_acceleration"].copy(),
                _columns(horizon["measured_clearance"], horizon["measured_relative_velocity"]),
                np.where(scanned, scans, -1),
            )
        )
    return Trace(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _columns(*columns: Array) -> Array:
    return np.stack(columns, axis=1)
