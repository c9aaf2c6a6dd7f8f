"""The bank of observers: acceleration limits from several reconstructions (eqs 22 to 24)."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_mpc.compiled import borrowing, entry, make_state
from lfd_mpc.horizon import Horizon
from lfd_observer.prediction_store import (
    STORE,
    check_shape,
    follow,
    predicted_now,
    push_solution,
)
from lfd_observer.settings import BankSettings
from lfd_observer.sliding_mode_observer import OBSERVER, OBSERVERS, observe, observers_common

BANK = np.dtype(
    [
        ("common", OBSERVERS),
        ("store", STORE),
        ("lead_lower", "f8"),
        ("lead_upper", "f8"),
        ("ready", "?"),
        ("acceleration_index", "f8"),
    ],
    align=True,
)
"""State of the bank, and what it said last: `ready` and `acceleration_index`."""


class BankArrays(NamedTuple):
    """Arrays of L observers and a store of N solutions: `observers` (L,), `solutions` (N, N, 2),
    `lags` and `weights` (L,)."""

    observers: NDArray[np.void]
    solutions: Array
    lags: NDArray[np.int32]
    weights: Array


class BankAnswer(NamedTuple):
    """Arrays (L,) of one answer: `values` (4, L) are relative acceleration, output error, lower
    and upper acceleration limit."""

    values: Array
    outside: NDArray[np.bool_]


@borrowing
def bank_step(bank, arrays, horizon, states, answer):
    """Answer one horizon, whose prediction is `states` (N, 2)."""
    store, solutions = bank.store, arrays.solutions
    follow(store, solutions, horizon)
    values, outside = answer.values, answer.outside
    index = 0.0
    for i in range(len(arrays.lags)):
        lag, observer = arrays.lags[i], arrays.observers[i]
        if store.anew:
            observer.started = False
        # The present step as the solution of so many steps ago predicted it, or as measured.
        if lag == 0:
            clearance, relative_velocity = horizon.clearance, horizon.relative_velocity
        else:
            clearance = predicted_now(store, solutions, lag, 0)
            relative_velocity = predicted_now(store, solutions, lag, 1)
        acceleration = observe(bank.common, observer, clearance, relative_velocity)
        lower, upper = bank.lead_lower - acceleration, bank.lead_upper - acceleration
        values[0, i], values[1, i] = acceleration, observer.output_error
        values[2, i], values[3, i] = lower, upper
        outside[i] = horizon.acceleration < lower or horizon.acceleration > upper
        if outside[i]:
            index += arrays.weights[i]
    bank.ready = store.complete
    counts = store.complete and not horizon.acceleration_stale
    bank.acceleration_index = index if counts else np.nan
    if horizon.valid:
        push_solution(store, solutions, states)


@entry
def _bank_step(bank, arrays, horizon, states, answer):
    bank_step(bank[0], arrays, horizon[0], states, answer)


@dataclass(slots=True)
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


def check_bank(bank: BankState) -> None:
    """Raises ValueError for an answer that no bank makes: nothing can be judged by it."""
    arrays = (bank.relative_acceleration, bank.acceleration_lower, bank.acceleration_upper)
    if any(len(values) != len(bank.lags) for values in (*arrays, bank.outside)):
        raise ValueError("arrays of different lengths")
    if not len(bank.lags):
        raise ValueError("no observer")
    if bank.ready and not all(np.isfinite(values).all() for values in arrays):
        raise ValueError("an answer that is not finite")


class ObserverBank:
    """Observers of several lags over one store of predictions."""

    def __init__(self, settings: BankSettings) -> None:
        lags = np.array(settings.lags, dtype=np.int32)
        decay = settings.weight_decay ** np.arange(len(lags))
        n = settings.prediction_steps
        self.arrays = BankArrays(
            np.zeros(len(lags), OBSERVER), np.full((n, n, 2), np.nan), lags, decay / decay.sum()
        )
        self.state = make_state(BANK)
        self.state["common"] = observers_common(
            settings.injection_gain,
            settings.injection_filter_time,
            settings.boundary_layer,
            settings.restart_error,
        )
        # Views of what every step reads: finding a field takes longer than reading it.
        self._ready, self._index = self.state["ready"], self.state["acceleration_index"]
        self.state["lead_lower"], self.state["lead_upper"] = settings.lead_acceleration_limits

    def new_answer(self) -> BankAnswer:
        """Room for one answer."""
        n = len(self.arrays.lags)
        return BankAnswer(np.empty((4, n)), np.empty(n, dtype=bool))

    def step(self, horizon: Horizon) -> BankState:
        """Answer one horizon. Raises ValueError when its length is not the bank's."""
        if horizon.valid:
            check_shape(horizon.states, len(self.arrays.solutions))
        answer = self.new_answer()
        _bank_step(self.state, self.arrays, horizon.record, horizon.states, answer)
        return self.bank_state(horizon.stamp, horizon.step, answer)

    def bank_state(self, stamp: int, step: int, answer: BankAnswer) -> BankState:
        """What was said last, of the step `step` at `stamp` (ns)."""
        acceleration, output_error, lower, upper = answer.values
        return BankState(
            stamp=stamp,
            step=step,
            ready=self._ready.item(),
            lags=self.arrays.lags,
            weights=self.arrays.weights,
            relative_acceleration=acceleration,
            output_error=output_error,
            acceleration_lower=lower,
            acceleration_upper=upper,
            outside=answer.outside,
            acceleration_index=self._index.item(),
        )
