"""Stacked predictions: what earlier solutions said about now (Fig 10)."""

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.compiled import entry, inner, make_state

STORE = np.dtype(
    [
        ("newest", "i8"),
        ("count", "i8"),
        ("last_step", "i8"),
        ("followed", "?"),
        ("complete", "?"),
        ("anew", "?"),
    ],
    align=True,
)
"""Keeps solutions in step with the horizons of one controller; the solutions themselves are an
array (N, N, 2) beside it.

After `follow`: `complete`, whether every lead time has a prediction for the present step; `anew`,
whether nothing from before this step counts.
"""


@inner
def predicted_now(store, solutions, ago, column):
    """What the solution of `ago` steps ago (1..N) said about the step that is about to be stored.

    `column` 0 in m, 1 in m/s; NaN where there is none yet.
    """
    if ago > store.count:
        return np.nan
    n = len(solutions)
    return solutions[(store.newest - (ago - 1)) % n, ago - 1, column]


@inner
def clear_store(store):
    """Forget every solution."""
    store.count = 0


@inner
def push_solution(store, solutions, states):
    """Store the solution (N, 2) of the present step."""
    n = len(solutions)
    store.newest = (store.newest + 1) % n
    solutions[store.newest] = states
    store.count = min(store.count + 1, n)


@inner
def follow(store, solutions, horizon):
    """Take note of a horizon, before its own solution is stored by `push_solution`.

    The one place that decides when stored predictions are worth nothing: at a restart, at a step
    without a solution, and where a horizon was lost on the way.
    """
    lost = store.followed and horizon.step != store.last_step + 1
    store.last_step, store.followed = horizon.step, True
    store.anew = lost or horizon.restart or not horizon.valid
    if store.anew:
        clear_store(store)
    store.complete = store.count == len(solutions)


@entry
def _for_now(stores, solutions, rows):
    for i in range(len(rows)):
        rows[i, 0] = predicted_now(stores[0], solutions, i + 1, 0)
        rows[i, 1] = predicted_now(stores[0], solutions, i + 1, 1)


@entry
def _push(store, solutions, states):
    push_solution(store[0], solutions, states)


@entry
def _follow(store, solutions, horizon):
    follow(store[0], solutions, horizon[0])


class PredictionStore:
    """The last N solutions of N steps each."""

    def __init__(self, steps: int) -> None:
        """`steps` is N."""
        self.state = make_state(STORE)
        self.solutions = np.full((steps, steps, 2), np.nan)

    @property
    def count(self) -> int:
        """How many solutions are stored, at most N."""
        return int(self.state["count"][0])

    def for_now(self) -> NDArray[np.float64]:
        """Predictions (N, 2) in m and m/s for the step that is about to be stored.

        Row i-1 is what the solution of i steps ago said; NaN where there is none yet.
        """
        rows = np.empty((len(self.solutions), 2))
        _for_now(self.state, self.solutions, rows)
        return rows

    def push(self, states: NDArray[np.float64]) -> None:
        """Store the solution (N, 2) of the present step. Raises ValueError for another shape."""
        check_shape(states, len(self.solutions))
        _push(self.state, self.solutions, np.ascontiguousarray(states))

    def follow(self, horizon: NDArray[np.void]) -> None:
        """Take note of a horizon (an array of one record), before its own solution is stored."""
        _follow(self.state, self.solutions, horizon)


def check_shape(states: NDArray[np.float64], steps: int) -> None:
    """Raises ValueError unless a solution has shape (`steps`, 2)."""
    if states.shape != (steps, 2):
        raise ValueError(
            f"a horizon of {steps} steps is expected, got an array of shape {states.shape}"
        )
