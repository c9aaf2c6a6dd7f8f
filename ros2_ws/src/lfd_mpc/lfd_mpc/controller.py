"""The model predictive controller: one state in, one input sequence and its prediction out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.box_qp import BoxQp
from lfd_mpc.prediction_model import build_prediction_model
from lfd_mpc.settings import MpcSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ControlSolution:
    """Result of one step.

    `inputs` (N,) in m/s^2 and `states` (N, 2) in m and m/s for 1..N steps ahead, or None where
    nothing was found; `desired_clearance` in m; `residual` in m/s^2; `seconds` of wall time.
    """

    inputs: Array | None
    states: Array | None
    desired_clearance: float
    status: str
    residual: float
    seconds: float
    fell_back: bool

    @property
    def command(self) -> float:
        """Acceleration to apply in m/s^2: the first input; 0 without a solution."""
        return 0.0 if self.inputs is None else float(self.inputs[0])


class Controller:
    """Eqs 1 to 10 with everything that does not change built once."""

    def __init__(self, settings: MpcSettings) -> None:
        """Raises ValueError for weights, limits or a solver that cannot work."""
        self._settings = settings
        self._model = build_prediction_model(settings)
        n = settings.prediction_steps
        self._qp = BoxQp(
            self._model.P,
            np.full(n, settings.acceleration_lower),
            np.full(n, settings.acceleration_upper),
            settings.solver,
            settings.residual_limit,
        )

    def solve(
        self,
        clearance: float,
        relative_velocity: float,
        acceleration: float,
        host_speed: float | None,
    ) -> ControlSolution:
        """Solve one step for finite inputs in m, m/s, m/s^2 and m/s.

        Without a host speed the clearance itself is the desired one, so that only the relative
        velocity is regulated.
        """
        settings = self._settings
        desired = clearance
        if host_speed is not None:
            desired = host_speed * settings.preview_time + settings.minimum_clearance
        error = np.array([clearance - desired, relative_velocity])
        f = self._model.f_error @ error + self._model.f_input * acceleration
        solution = self._qp.solve(f)
        states = None
        if solution.u is not None:
            if settings.prediction == "linear":
                states = self._model.predict_linear(error)
            else:
                states = self._model.predict(error, solution.u, acceleration)
            states[:, 0] += desired
        return ControlSolution(
            inputs=solution.u,
            states=states,
            desired_clearance=desired,
            status=solution.status,
            residual=solution.residual,
            seconds=solution.seconds,
            fell_back=solution.fell_back,
        )
