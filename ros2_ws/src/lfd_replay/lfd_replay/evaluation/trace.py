"""A drive through the graph as arrays: what the detectors and the statistics work on."""

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.verdict import SIGNALS
from lfd_replay.offline import GraphStep

Array = NDArray[np.float64]

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


def record_trace(steps: Iterable[GraphStep], zero: int) -> Trace:
    """Collect the steps of a drive whose time zero is `zero` in ns."""
    stamps, states, indices, used, predicted, relative, measured, scans = ([] for _ in range(8))
    for step in steps:
        horizon, report, now = step.horizon, step.outcome.report, step.outcome.reconstruction
        stamp = horizon.stamp - zero
        age = horizon.clearance_age
        stamps.append(stamp)
        states.append([getattr(report, name).state for name in SIGNALS])
        indices.append([getattr(report, name).index for name in JUDGED])
        used.append(
            (
                horizon.clearance,
                horizon.relative_velocity,
                nan if horizon.acceleration_stale else horizon.acceleration,
            )
        )
        predicted.append((now.clearance, now.relative_velocity))
        relative.append(now.relative_acceleration)
        measured.append((horizon.measured_clearance, horizon.measured_relative_velocity))
        scans.append(-1 if age != age else stamp - round(age * 1e9))
    return Trace(
        np.array(stamps, dtype=np.int64),
        np.array(states, dtype=np.int8).reshape(-1, len(SIGNALS)),
        np.array(indices, dtype=float).reshape(-1, len(JUDGED)),
        np.array(used, dtype=float).reshape(-1, 3),
        np.array(predicted, dtype=float).reshape(-1, 2),
        np.array(relative, dtype=float),
        np.array(measured, dtype=float).reshape(-1, 2),
        np.array(scans, dtype=np.int64),
    )
