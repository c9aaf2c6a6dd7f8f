"""The controller's prediction model and cost as matrices, built once (eqs 1 to 9)."""

from dataclasses import dataclass

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.settings import STEP_S, MpcSettings


@dataclass(frozen=True)
class PredictionModel:
    """Read-only matrices of the horizon; N = prediction steps.

    `M` (N, 2, 2), `H` (N, 2, N), `F` (N, 2): unweighted prediction of the error
    `e(k+i) = M_i e(k) + H_i u + F_i u(k)` for i = 1..N, in m and m/s (eqs 5, 10).
    `P` (N, N), `f_error` (N, 2), `f_input` (N,): scaled cost
    `1/2 u'Pu + (f_error e + f_input u(k))'u` (eqs 6 to 8); its mean eigenvalue is 1, so
    that solver tolerances mean something.
    `eigenvalues` (N,): of the unscaled `P` (Fig 5), ascending.
    """

    M: Array
    H: Array
    F: Array
    P: Array
    f_error: Array
    f_input: Array
    eigenvalues: Array

    def predict(self, error: Array, inputs: Array, input_now: float) -> Array:
        """Errors (N, 2) in m and m/s for 1..N steps ahead (eq 10), as the cost has them.

        `error` (2,) in m and m/s, `inputs` (N,) and `input_now` in m/s^2.
        """
        return self.M @ error + self.H @ inputs + self.F * input_now


def output_weights(settings: MpcSettings) -> Array:
    """Weights (N, 2) of the outputs, `C_w` of each step of the horizon (below eq 3)."""
    n = settings.prediction_steps
    along = np.tanh(settings.weight_slope * np.arange(1, n + 1) / n)
    return np.outer(along, [settings.clearance_weight, settings.relative_velocity_weight])


def build_prediction_model(settings: MpcSettings) -> PredictionModel:
    """Build the matrices of eqs 3 to 8.

    Raises ValueError when the weights do not make `P` positive definite (eq 9, Fig 5).
    """
    n = settings.prediction_steps
    A = np.array([[1.0, STEP_S], [0.0, 1.0]])
    B = np.array([0.0, -STEP_S])
    powers = [np.linalg.matrix_power(A, i) for i in range(n + 1)]
    M = np.stack(powers[1:])
    F = np.stack([powers[i] @ B for i in range(n)])
    H = np.zeros((n, 2, n))
    for i in range(1, n):
        for j in range(i):
            H[i, :, j] = powers[i - 1 - j] @ B

    weights = output_weights(settings)[:, :, None]
    weighted_H = (weights * H).reshape(2 * n, n)
    weighted_M = (weights * M).reshape(2 * n, 2)
    weighted_F = (weights[:, :, 0] * F).reshape(2 * n)
    D = np.eye(n) - np.eye(n, k=1)
    P = settings.input_weight * D.T @ D + weighted_H.T @ weighted_H

    eigenvalues = np.linalg.eigvalsh(P)
    if eigenvalues[0] <= 1e-12 * max(eigenvalues[-1], 1e-300):
        raise ValueError(
            f"the cost is not positive definite: smallest eigenvalue of P is {eigenvalues[0]:.3g}, "
            f"it must be positive; raise input_weight (now {settings.input_weight:g})"
        )
    scale = n / np.trace(P)
    model = PredictionModel(
        M=M,
        H=H,
        F=F,
        P=scale * P,
        f_error=scale * weighted_H.T @ weighted_M,
        f_input=scale * weighted_H.T @ weighted_F,
        eigenvalues=eigenvalues,
    )
    for matrix in vars(model).values():
        matrix.flags.writeable = False
    return model
