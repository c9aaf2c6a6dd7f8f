"""The predictive fault indices of the radar (eq 25)."""

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.settings import DiagnosisSettings
from lfd_mpc.arrays import Array
from lfd_mpc.compiled import entry, inner
from lfd_mpc.settings import STEP_S


@inner
def is_outside(measured, predicted, lower, upper):
    """Whether a measurement leaves the limits around a prediction; false where that is NaN."""
    deviation = measured - predicted
    return deviation < lower or deviation > upper


@entry
def _outside(measured, predicted, lower, upper, marked):
    for i in range(len(predicted)):
        for k in range(2):
            marked[i, k] = is_outside(measured[k], predicted[i, k], lower[i, k], upper[i, k])


class PredictionLimits:
    """How far a measurement may be from what was predicted 1..N steps ago.

    `lower` and `upper` (N, 2) in m and m/s, to be added to the prediction (below eq 24, Fig 10).
    """

    def __init__(self, settings: DiagnosisSettings) -> None:
        tau = STEP_S * np.arange(1, settings.prediction_steps + 1)
        growth = np.column_stack([0.5 * tau**2, tau])
        noise = settings.n_sigma * np.array(
            [settings.clearance_std, settings.relative_velocity_std]
        )
        slowest, fastest = settings.lead_acceleration_limits
        self.lower = slowest * growth - noise
        self.upper = fastest * growth + noise

    def outside(self, measured: Array, predicted: Array) -> NDArray[np.bool_]:
        """Whether `measured` (2,) leaves the limits around `predicted` (N, 2); shape (N, 2)."""
        marked = np.empty(predicted.shape, dtype=bool)
        _outside(measured, predicted, self.lower, self.upper, marked)
        return marked
