"""A CUSUM on the prediction residuals, as people would write it for any residual."""

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_replay.evaluation.detectors import Detector
from lfd_replay.evaluation.trace import JUDGED, Trace


def residuals(trace: Trace, lead_acceleration_mean: float) -> Array:
    """Residuals (n, 3) in m, m/s and m/s^2; NaN where nothing was predicted.

    Radar signals against the prediction made one horizon before; the acceleration against the one
    that is reconstructed when the lead drives as on average (eq 22).
    """
    radar = trace.used[:, :2] - trace.predicted
    expected = lead_acceleration_mean - trace.relative_acceleration
    return np.column_stack([radar, trace.used[:, 2] - expected])


class Cusum(Detector):
    """Two-sided cumulative sum of normalised residuals; the setting is its decision limit."""

    name = "CUSUM"
    settings = tuple(np.geomspace(1.0, 1e5, 41).tolist())

    drift = 1.0
    """Standard deviations that a residual may be off for good without being counted."""
    headroom = 2.0
    """The sum is held below so many limits, so that it comes down again after a fault."""

    def __init__(self, lead_acceleration_mean: float, centre: Array, deviation: Array) -> None:
        """`centre` and `deviation` (3,): of the residuals on normal drives, in m, m/s, m/s^2."""
        self._mean, self._centre, self._deviation = lead_acceleration_mean, centre, deviation

    def scores(self, trace: Trace) -> dict[str, Array]:
        """Normalised residuals (n,)."""
        normalised = (residuals(trace, self._mean) - self._centre) / self._deviation
        return dict(zip(JUDGED, normalised.T, strict=True))

    def flags(self, signal: str, score: Array, setting: float) -> NDArray[np.bool_]:
        """Steps at which either sum has reached the limit; no residual starts them anew."""
        ceiling = self.headroom * setting
        high = low = 0.0
        flagged = np.zeros(len(score), dtype=bool)
        for k, residual in enumerate(score.tolist()):
            if residual != residual:
                high = low = 0.0
                continue
            high = min(max(high + residual - self.drift, 0.0), ceiling)
            low = min(max(low - residual - self.drift, 0.0), ceiling)
            flagged[k] = high >= setting or low >= setting
        return flagged
