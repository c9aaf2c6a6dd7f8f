"""The model predictive controller: one state in, one input sequence and its prediction out."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.box_qp import (
    SOLVED,
    BoxProblem,
    BoxQp,
    optimality_residual,
    solve_at_limits,
    solve_free,
)
from lfd_mpc.compiled import borrowing, entry, inner
from lfd_mpc.prediction_model import build_prediction_model
from lfd_mpc.settings import STEP_S, MpcSettings


class ControlModel(NamedTuple):
    """Everything that does not change, as compiled functions take it; shapes as in the model."""

    problem: BoxProblem
    f_error: Array
    f_input: Array
    preview_time: float
    minimum_clearance: float
    residual_limit: float
    own_solver: bool
    linear: bool


@borrowing
def desired_clearance(model, clearance, host_speed):
    """In m (eq 1); without a host speed (NaN) the clearance itself, so that only the relative
    velocity is regulated."""
    if np.isnan(host_speed):
        return clearance
    return host_speed * model.preview_time + model.minimum_clearance


@borrowing
def linear_cost(model, error, relative_velocity, acceleration, f):
    """The cost's linear term (N,) of a state (eq 8)."""
    for i in range(len(f)):
        f[i] = (
            model.f_error[i, 0] * error
            + model.f_error[i, 1] * relative_velocity
            + model.f_input[i] * acceleration
        )


@borrowing
def roll_out(model, clearance, relative_velocity, acceleration, plan, states):
    """The prediction (N, 2) in m and m/s for 1..N steps ahead (eqs 3 and 10).

    `acceleration` is the input now and `plan` (N,) those to come, in m/s^2; the linear prediction
    is the same as if neither car accelerated.
    """
    applied = acceleration
    for i in range(len(plan)):
        clearance += STEP_S * relative_velocity
        if not model.linear:
            relative_velocity -= STEP_S * applied
        states[i, 0], states[i, 1] = clearance, relative_velocity
        applied = plan[i]


@inner
def plan_inputs(model, f, plan):
    """Plan (N,) for a cost; its residual in m/s^2, infinite where another solver is to be asked."""
    if solve_free(model.problem, f, plan):
        return optimality_residual(model.problem, plan, f, np.empty(len(plan)))
    return solve_at_limits(model.problem, f, plan) if model.own_solver else np.inf


@entry
def roll_out_entry(model, clearance, relative_velocity, acceleration, plan, states):
    """`roll_out` for callers from outside."""
    roll_out(model, clearance, relative_velocity, acceleration, plan, states)


@entry
def _solve(model, clearance, relative_velocity, acceleration, host_speed, f, plan, states):
    desired = desired_clearance(model, clearance, host_speed)
    linear_cost(model, clearance - desired, relative_velocity, acceleration, f)
    residual = plan_inputs(model, f, plan)
    roll_out(model, clearance, relative_velocity, acceleration, plan, states)
    return desired, residual


@dataclass(frozen=True)
class ControlSolution:
    """Result of one step.

    `inputs` (N,) in m/s^2 and `states` (N, 2) in m and m/s for 1..N steps ahead, or None where
    nothing was found; `desired_clearance` in m; `residual` in m/s^2.
    """

    inputs: Array | None
    states: Array | None
    desired_clearance: float
    status: str
    residual: float
    fell_back: bool

    @property
    def command(self) -> float:
        """Acceleration to apply in m/s^2: the first input; 0 without a solution."""
        return 0.0 if self.inputs is None else float(self.inputs[0])


class Controller:
    """Eqs 1 to 10 with everything that does not change built once."""

    def __init__(self, settings: MpcSettings) -> None:
        """Raises ValueError for weights, limits or a solver that cannot work."""
        model = build_prediction_model(settings)
        n = settings.prediction_steps
        self.steps = n
        self.qp = BoxQp(
            model.P,
            np.full(n, settings.acceleration_lower),
            np.full(n, settings.acceleration_upper),
            settings.solver,
            settings.residual_limit,
        )
        self.model = ControlModel(
            problem=self.qp.problem,
            f_error=np.array(model.f_error),
            f_input=np.array(model.f_input),
            preview_time=settings.preview_time,
            minimum_clearance=settings.minimum_clearance,
            residual_limit=settings.residual_limit,
            own_solver=self.qp.own_solver,
            linear=settings.prediction == "linear",
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
        f, plan, states = np.empty(self.steps), np.empty(self.steps), np.empty((self.steps, 2))
        state = clearance, relative_velocity, acceleration
        speed = np.nan if host_speed is None else host_speed
        desired, residual = _solve(self.model, *state, speed, f, plan, states)
        if residual <= self.model.residual_limit:
            return ControlSolution(plan, states, desired, SOLVED, residual, False)
        solution = self.qp.solve(f)
        if solution.u is None:
            return ControlSolution(
                None, None, desired, solution.status, solution.residual, solution.fell_back
            )
        roll_out_entry(self.model, *state, solution.u, states)
        return ControlSolution(
            solution.u, states, desired, solution.status, solution.residual, solution.fell_back
        )
