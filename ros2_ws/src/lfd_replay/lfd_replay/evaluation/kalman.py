"""A Kalman filter with innovation gating, as people would write it for a radar."""

from dataclasses import dataclass

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_replay.evaluation.detectors import Exceedance
from lfd_replay.evaluation.trace import Trace


@dataclass(frozen=True)
class LeadModel:
    """The lead's acceleration as Singer's model: mean and deviation in m/s^2, correlation in s."""

    mean: float
    deviation: float
    correlation: float = 2.0


class KalmanGate(Exceedance):
    """State: clearance, relative velocity, lead acceleration; input: the host's acceleration.

    Score of a radar signal: its squared innovation in units of its variance, the lower one of two
    scans in a row, so that a single outlier is no fault. Score of the acceleration: the squared
    distance of the estimated lead acceleration from normal driving, in units of its variance.
    """

    name = "Kalman filter"
    settings = tuple(np.geomspace(1.0, 1e5, 61).tolist())

    gate = 18.4
    """Innovations beyond it are not taken: chi-square of two degrees of freedom, 1 in 10,000."""
    give_up = 1.0
    """Seconds without an innovation inside the gate after which the filter starts anew."""

    def __init__(self, noise: tuple[float, float], lead: LeadModel) -> None:
        """`noise`: standard deviations of the radar's clearance (m) and relative velocity (m/s)."""
        self._noise, self._lead = noise, lead

    def scores(self, trace: Trace) -> dict[str, Array]:
        """Scores (n,), held from scan to scan."""
        squared = np.full((len(trace.stamps), 3), np.nan)
        scans = trace.new_scans()
        squared[scans] = self._innovations(trace, scans)
        for column in squared.T:
            _hold(column)
        squared[np.isnan(squared)] = 0.0
        return {
            "clearance": squared[:, 0],
            "relative_velocity": squared[:, 1],
            "acceleration": squared[:, 2],
        }

    def _innovations(self, trace: Trace, scans: NDArray[np.intp]) -> Array:
        """Scores (m, 3) at the scans (m,)."""
        scores = np.zeros((len(scans), 3))
        lead = self._lead
        kalman = KalmanFilter(dim_x=3, dim_z=2, dim_u=2)
        kalman.H = np.eye(2, 3)
        kalman.R = np.diag(np.square(self._noise))
        before = np.full(2, np.inf)
        times = trace.scans[scans] * 1e-9
        acceleration = np.nan_to_num(trace.used[:, 2])
        rejected = np.inf
        for k, step in enumerate(scans):
            measured = trace.measured[step][:, None]
            dt = times[k] - times[k - 1] if k else np.inf
            if rejected > self.give_up or dt > self.give_up:
                kalman.x = np.array([[measured[0, 0]], [measured[1, 0]], [lead.mean]])
                kalman.P = np.diag([*np.square(self._noise), lead.deviation**2])
                rejected, before = 0.0, np.zeros(2)
                continue
            applied = acceleration[scans[k - 1] : step].mean()
            self._predict(kalman, dt, applied)
            innovation = (measured - kalman.H @ kalman.x)[:, 0]
            spread = kalman.H @ kalman.P @ kalman.H.T + kalman.R
            squared = innovation**2 / np.diag(spread)
            scores[k, :2] = np.minimum(squared, before)
            before = squared
            if innovation @ np.linalg.solve(spread, innovation) <= self.gate:
                kalman.update(measured)
                rejected = 0.0
            else:
                rejected += dt
            scores[k, 2] = ((kalman.x[2, 0] - lead.mean) / lead.deviation) ** 2
        return scores

    def _predict(self, kalman: KalmanFilter, dt: float, applied: float) -> None:
        lead = self._lead
        keep = np.exp(-dt / lead.correlation)
        transition = np.array([[1.0, dt, 0.5 * dt**2], [0.0, 1.0, dt], [0.0, 0.0, keep]])
        inputs = np.array([[-0.5 * dt**2, 0.0], [-dt, 0.0], [0.0, 1.0 - keep]])
        pushed = np.array([0.5 * dt**2, dt, 1.0])
        noise = np.outer(pushed, pushed) * lead.deviation**2 * (1.0 - keep**2)
        kalman.predict(u=np.array([[applied], [lead.mean]]), B=inputs, F=transition, Q=noise)


def _hold(column: Array) -> None:
    """Fill each NaN of `column` (n,) with the value before it."""
    known = np.where(np.isnan(column), 0, np.arange(len(column)))
    column[:] = column[np.maximum.accumulate(known)]
