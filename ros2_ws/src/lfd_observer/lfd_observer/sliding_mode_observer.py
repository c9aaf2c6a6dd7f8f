"""Sliding mode observers of the relative acceleration (eqs 11 to 21), vectorised."""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.settings import STEP_S

Array = NDArray[np.float64]

A = np.array([[0.0, 1.0], [0.0, 0.0]])
G = np.array([0.0, 1.0])
C = np.array([1.0, 1.0])
"""System, injection and output matrix for x = [clearance, relative velocity] (eqs 12, 13)."""


@dataclass(frozen=True)
class SlidingModeDesign:
    """What makes the observer converge.

    `transform` (2, 2) is T_c (eq 15) and `transformed_A` (2, 2) is T_c A T_c^-1 (eq 16);
    `reduced_eigenvalue` in 1/s is that of the error that slides (eq 20).
    """

    transform: Array
    transformed_A: Array
    transformed_G: Array
    reduced_eigenvalue: float


def design() -> SlidingModeDesign:
    """Carry out the transformation and the stability check of eqs 14 to 20."""
    null_space = np.linalg.svd(C[None, :])[2][1]
    T = np.vstack([null_space, C])
    Ac = T @ A @ np.linalg.inv(T)
    Gc = T @ G
    eigenvalue = Ac[0, 0] - Gc[0] / Gc[1] * Ac[1, 0]
    return SlidingModeDesign(T, Ac, Gc, float(eigenvalue))


def reachability_margin(gain: float, relative_acceleration: float, sliding_error: float) -> float:
    """Margin eta in m/s^2 of the reachability condition `e_y e_y' <= -eta |e_y|` near `e_y = 0`.

    `gain` is rho and `relative_acceleration` the largest to be followed, in m/s^2;
    `sliding_error` is the largest |e_1| of eq 17. Positive: the surface is reached and kept.
    """
    return gain - abs(relative_acceleration) - abs(design().transformed_A[1, 0] * sliding_error)


class SlidingModeObservers:
    """Any number of observers side by side, one step of 10 ms at a time."""

    def __init__(
        self,
        count: int,
        gain: float,
        filter_time: float,
        boundary_layer: float,
        restart_error: float = 0.0,
    ) -> None:
        """`gain` rho in m/s^2, `filter_time` in s, `boundary_layer` in m + m/s (0 = sign).

        An output error beyond `restart_error` (m + m/s, 0 = none) is a jump of what is measured,
        not motion: the observer goes on from there with the relative acceleration that it had.
        """
        self._restart_error = restart_error
        self._gain = gain
        self._blend = STEP_S / (filter_time + STEP_S)
        self._boundary_layer = boundary_layer
        self._state = np.zeros((count, 2))
        self._equivalent = np.zeros(count)
        self.started = np.zeros(count, dtype=bool)
        self._all_started = False

    def restart(self) -> None:
        """Forget everything: each observer starts again at its next measurement."""
        self.started[:] = False
        self._all_started = False

    def step(self, measured: Array) -> tuple[Array, Array]:
        """Feed `measured` (n, 2) in m and m/s; an observer whose row is NaN does not move.

        Returns relative accelerations (n,) in m/s^2 (equivalent injection, eq 21) and output
        errors (n,), NaN where an observer has not started.
        """
        output_error = (measured - self._state) @ C
        if self._restart_error:
            jumped = np.abs(output_error) > self._restart_error
            if jumped.any():
                self._state[jumped] = measured[jumped]
                output_error[jumped] = 0.0
        # Nearly always every observer runs and is fed; only else some need to be picked out.
        if self._all_started and isfinite(output_error.sum()):
            injection = self._injection(output_error)
            derivative = self._state @ A.T
            derivative[:, 1] += injection
            self._state += STEP_S * derivative
            self._equivalent += self._blend * (injection - self._equivalent)
            return self._equivalent.copy(), output_error
        return self._step_some(measured)

    def _injection(self, output_error: Array) -> Array:
        """The discontinuous injection (eq 18) in m/s^2, or its stand-in in a boundary layer."""
        if self._boundary_layer > 0.0:
            return self._gain * np.clip(output_error / self._boundary_layer, -1.0, 1.0)
        return self._gain * np.sign(output_error)

    def _step_some(self, measured: Array) -> tuple[Array, Array]:
        """A step in which some observers start, or are not fed."""
        fed = np.isfinite(measured).all(axis=1)
        starting = fed & ~self.started
        self._state[starting] = measured[starting]
        self._equivalent[starting] = 0.0
        self.started |= fed
        self._all_started = bool(self.started.all())
        output_error = (measured - self._state) @ C
        injection = self._injection(output_error)[fed]
        state = self._state[fed]
        self._state[fed] = state + STEP_S * (state @ A.T + np.outer(injection, G))
        self._equivalent[fed] += self._blend * (injection - self._equivalent[fed])
        return np.where(self.started, self._equivalent, np.nan), output_error
