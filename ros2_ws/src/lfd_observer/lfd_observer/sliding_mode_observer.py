"""Sliding mode observers of the relative acceleration (eqs 11 to 21)."""

from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

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
    reduced_eigenvalue: float


def design() -> SlidingModeDesign:
    """Carry out the transformation and the stability check of eqs 14 to 20."""
    null_space = np.linalg.svd(C[None, :])[2][1]
    T = np.vstack([null_space, C])
    Ac = T @ A @ np.linalg.inv(T)
    Gc = T @ G
    eigenvalue = Ac[0, 0] - Gc[0] / Gc[1] * Ac[1, 0]
    return SlidingModeDesign(T, Ac, float(eigenvalue))


def reachability_margin(gain: float, relative_acceleration: float, sliding_error: float) -> float:
    """Margin eta in m/s^2 of the reachability condition `e_y e_y' <= -eta |e_y|` near `e_y = 0`.

    `gain` is rho and `relative_acceleration` the largest to be followed, in m/s^2;
    `sliding_error` is the largest |e_1| of eq 17. Positive: the surface is reached and kept.
    """
    return gain - abs(relative_acceleration) - abs(design().transformed_A[1, 0] * sliding_error)


OBSERVERS = np.dtype(
    [("gain", "f8"), ("blend", "f8"), ("boundary_layer", "f8"), ("restart_error", "f8")],
    align=True,
)
"""What all observers of a bank have in common."""

OBSERVER = np.dtype(
    [
        ("clearance", "f8"),
        ("relative_velocity", "f8"),
        ("equivalent", "f8"),
        ("output_error", "f8"),
        ("started", "?"),
    ],
    align=True,
)
"""State of one observer: `equivalent` injection in m/s^2 (eq 21), `output_error` NaN where it was
not fed."""


@inner
def _injection(common, output_error):
    """The discontinuous injection (eq 18) in m/s^2, or its stand-in in a boundary layer."""
    if common.boundary_layer > 0.0:
        return common.gain * min(max(output_error / common.boundary_layer, -1.0), 1.0)
    if output_error == 0.0:
        return 0.0
    return common.gain if output_error > 0.0 else -common.gain


@inner
def observe(common, observer, clearance, relative_velocity):
    """Feed one observer for a step; it does not move where the measurement is NaN.

    Returns its relative acceleration in m/s^2, NaN as long as it has not started.
    """
    if not (isfinite(clearance) and isfinite(relative_velocity)):
        observer.output_error = np.nan
        return observer.equivalent if observer.started else np.nan
    if not observer.started:
        observer.clearance, observer.relative_velocity = clearance, relative_velocity
        observer.equivalent = 0.0
        observer.started = True
    error = (clearance - observer.clearance) + (relative_velocity - observer.relative_velocity)
    if common.restart_error > 0.0 and abs(error) > common.restart_error:
        observer.clearance, observer.relative_velocity = clearance, relative_velocity
        error = 0.0
    injection = _injection(common, error)
    observer.clearance += STEP_S * observer.relative_velocity
    observer.relative_velocity += STEP_S * injection
    observer.equivalent += common.blend * (injection - observer.equivalent)
    observer.output_error = error
    return observer.equivalent


def observers_common(
    gain: float, filter_time: float, boundary_layer: float, restart_error: float
) -> NDArray[np.void]:
    """Array of one of `OBSERVERS`: `gain` rho in m/s^2, `filter_time` in s, `boundary_layer`
    in m + m/s (0 = sign).

    An output error beyond `restart_error` (m + m/s, 0 = none) is a jump of what is measured, not
    motion: the observer goes on from there with the relative acceleration that it had.
    """
    common = np.zeros(1, OBSERVERS)
    common[0] = gain, share_of(filter_time), boundary_layer, restart_error
    return common
