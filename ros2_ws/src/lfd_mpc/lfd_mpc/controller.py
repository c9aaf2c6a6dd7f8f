"""The model predictive controller: what one step computes, and what is built once for it."""

from typing import NamedTuple

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.box_qp import (
    BoxProblem,
    BoxQp,
    optimality_residual,
    solve_at_limits,
    solve_free,
)
from lfd_mpc.compiled import borrowing, entry, inner
from lfd_mpc.prediction_model import build_prediction_model
from lfd_mpc.settings import STEP_S, MpcSettings, desired_clearance


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


_desired_at = inner(desired_clearance)


@borrowing
def desired_or_own(model, clearance, host_speed):
    """The desired clearance in m; without a host speed (NaN) the clearance itself, so that only the
    relative velocity is regulated."""
    if np.isnan(host_speed):
        return clearance
    return _desired_at(model.minimum_clearance, model.preview_time, host_speed)


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
