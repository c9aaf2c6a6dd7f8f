"""Stacked predictions: what earlier solutions said about now (Fig 10)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.horizon import Horizon

Array = NDArray[np.float64]


class PredictionStore:
    """The last N solutions of N steps each."""

    def __init__(self, steps: int) -> None:
        """`steps` is N."""
        self._steps = steps
        self._states = np.full((steps, steps, 2), np.nan)
        ago = np.arange(steps)
        # For each place of the newest solution: where the one of 1..N steps ago speaks of now.
        self._diagonals = [((newest - ago) % steps) * steps + ago for newest in range(steps)]
        self._newest = 0
        self._count = 0

    @property
    def steps(self) -> int:
        """N: how many solutions are kept, and how many steps each one looks ahead."""
        return self._steps

    @property
    def count(self) -> int:
        """How many solutions are stored, at most N."""
        return self._count

    @property
    def full(self) -> bool:
        """Whether every lead time has a prediction for the present step."""
        return self._count == self.steps

    def clear(self) -> None:
        """Forget every solution."""
        self._states.fill(np.nan)
        self._count = 0

    def for_now(self) -> Array:
        """Predictions (N, 2) in m and m/s for the step that is about to be stored.

        Row i-1 is what the solution of i steps ago said; NaN where there is none yet.
        """
        return self._states.reshape(-1, 2).take(self._diagonals[self._newest], axis=0)

    def push(self, states: Array) -> None:
        """Store the solution (N, 2) of the present step. Raises ValueError for another shape."""
        if states.shape != (self.steps, 2):
            raise ValueError(
                f"a horizon of {self.steps} steps is expected, got an array of shape {states.shape}"
            )
        self._newest = (self._newest + 1) % self.steps
        self._states[self._newest] = states
        self._count = min(self._count + 1, self.steps)


@dataclass(frozen=True)
class Predicted:
    """What earlier solutions said about the present step.

    `states` (N, 2) in m and m/s, row i-1 from i steps ago, NaN where unknown; `complete` where all
    are known; `anew` where nothing from before this step counts.
    """

    states: Array
    complete: bool
    anew: bool


class HorizonFollower:
    """Keeps the store in step with the horizons of one controller.

    The one place that decides when stored predictions are worth nothing: at a restart, at a step
    without a solution, and where a horizon was lost on the way.
    """

    def __init__(self, prediction_steps: int) -> None:
        self._store = PredictionStore(prediction_steps)
        self._last_step: int | None = None

    def take(self, horizon: Horizon) -> Predicted:
        """Take one horizon; returns what was known about it beforehand, then stores it.

        Raises ValueError when the horizon has another length than the store.
        """
        lost = self._last_step is not None and horizon.step != self._last_step + 1
        self._last_step = horizon.step
        anew = lost or horizon.restart or not horizon.valid
        if anew:
            self._store.clear()
        predicted = Predicted(self._store.for_now(), self._store.full, anew)
        if horizon.valid:
            self._store.push(horizon.states)
        return predicted
