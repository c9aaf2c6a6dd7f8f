"""The bank of observers: acceleration limits from several reconstructions (eqs 22 to 24)."""

from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.horizon import Horizon
from lfd_observer.prediction_store import HorizonFollower
from lfd_observer.settings import BankSettings
from lfd_observer.sliding_mode_observer import SlidingModeObservers

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BankState:
    """The bank after one step; the fields, units and meanings of `lfd_msgs/ObserverBank`.

    Arrays have one element per observer, in lag order; `stamp` in ns.
    """

    stamp: int
    step: int
    ready: bool
    lags: NDArray[np.int32]
    weights: Array
    relative_acceleration: Array
    output_error: Array
    acceleration_lower: Array
    acceleration_upper: Array
    outside: NDArray[np.bool_]
    acceleration_index: float


class ObserverBank:
    """Observers of several lags over one store of predictions."""

    def __init__(self, settings: BankSettings) -> None:
        self._lags = np.array(settings.lags, dtype=np.int32)
        decay = settings.weight_decay ** np.arange(len(self._lags))
        self._weights = decay / decay.sum()
        for constant in (self._lags, self._weights):
            constant.flags.writeable = False
        self._lead_lower, self._lead_upper = settings.lead_acceleration_limits
        self._observers = SlidingModeObservers(
            len(self._lags),
            settings.injection_gain,
            settings.injection_filter_time,
            settings.boundary_layer,
            settings.restart_error,
        )
        self._follower = HorizonFollower(settings.prediction_steps)

    def step(self, horizon: Horizon) -> BankState:
        """Answer one horizon. Raises ValueError when its length is not the bank's."""
        predicted = self._follower.take(horizon)
        if predicted.anew:
            self._observers.restart()
        # Row s: the present step as the solution of s steps ago predicted it; row 0 is measured.
        known = np.empty((len(predicted.states) + 1, 2))
        known[0] = horizon.clearance, horizon.relative_velocity
        known[1:] = predicted.states
        acceleration, output_error = self._observers.step(known.take(self._lags, axis=0))
        lower = self._lead_lower - acceleration
        upper = self._lead_upper - acceleration
        outside = (horizon.acceleration < lower) | (horizon.acceleration > upper)
        index = nan
        if predicted.complete and not horizon.acceleration_stale:
            index = 0.0
            for weight, disagrees in zip(self._weights.tolist(), outside.tolist(), strict=True):
                index += weight * disagrees
        return BankState(
            stamp=horizon.stamp,
            step=horizon.step,
            ready=predicted.complete,
            lags=self._lags,
            weights=self._weights,
            relative_acceleration=acceleration,
            output_error=output_error,
            acceleration_lower=lower,
            acceleration_upper=upper,
            outside=outside,
            acceleration_index=index,
        )
