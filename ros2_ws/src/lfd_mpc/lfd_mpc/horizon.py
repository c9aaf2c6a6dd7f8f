"""Samples in, prediction horizons out: the whole controller without ROS."""

import time
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from math import inf, isfinite, isnan
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.box_qp import NOT_FOUND, SOLVED, SOLVED_EXACTLY
from lfd_mpc.compiled import borrowing, entry, inner, make_state
from lfd_mpc.controller import (
    Controller,
    desired_or_own,
    linear_cost,
    plan_inputs,
    roll_out,
)
from lfd_mpc.samples import ACCELERATION, Sample, ScalarSample
from lfd_mpc.sampling import Sampler, is_due, next_step, take_clock
from lfd_mpc.settings import MpcSettings
from lfd_mpc.step_inputs import STEP_INPUTS, restart_reason

NOTHING = np.empty(0)


class Status(IntEnum):
    """How a step's problem was solved, or why there was none."""

    SOLVED = 0
    SOLVED_EXACTLY = 1
    NOT_FOUND = 2
    NO_CLEARANCE = 3
    NO_RELATIVE_VELOCITY = 4
    NO_TARGET = 5
    NOT_MEASURED_YET = 6


STATUS_TEXTS = {
    Status.SOLVED: SOLVED,
    Status.SOLVED_EXACTLY: SOLVED_EXACTLY,
    Status.NOT_FOUND: NOT_FOUND,
    Status.NO_CLEARANCE: "no clearance",
    Status.NO_RELATIVE_VELOCITY: "no relative velocity",
    Status.NO_TARGET: "no target",
    Status.NOT_MEASURED_YET: "clearance or relative velocity not measured yet",
}
"""A horizon's `solver_status`."""


class Progress(IntEnum):
    """What came of asking for the next step."""

    NO_STEP = 0
    DONE = 1
    UNSOLVED = 2


_FIELDS = {
    "i8": (
        "stamp",
        "step",
        "late_samples",
        "refused_samples",
        "bad_samples",
        "fallbacks",
        "track_id",
        "sensor_flags",
    ),
    "f8": (
        "measured_clearance",
        "measured_relative_velocity",
        "measured_acceleration",
        "measured_host_speed",
        "measured_lead_acceleration",
        "clearance_age",
        "relative_velocity_age",
        "acceleration_age",
        "host_speed_age",
        "lead_acceleration_age",
        "clearance",
        "relative_velocity",
        "acceleration",
        "host_speed",
        "residual",
        "solve_time",
        "command",
        "desired_clearance",
    ),
    "?": (
        "restart",
        "without_acceleration",
        "has_target",
        "clearance_stale",
        "relative_velocity_stale",
        "acceleration_stale",
        "host_speed_stale",
        "lead_acceleration_stale",
        "valid",
    ),
}

HORIZON_FIELDS = tuple(name for names in _FIELDS.values() for name in names)
"""Fields of a horizon that are neither text nor arrays."""

HORIZON = np.dtype([(name, kind) for kind, names in _FIELDS.items() for name in names], align=True)
"""These fields as a record, as compiled functions take it; its arrays go beside it."""

MPC_STATE = np.dtype(
    [("inputs", STEP_INPUTS), ("horizon", HORIZON), ("status", "i8"), ("fallbacks", "i8")],
    align=True,
)
"""The step that was made last."""


@dataclass
class Horizon:
    """One step; the fields, units and meanings of `lfd_msgs/PredictionHorizon`.

    `stamp` in ns. `predicted_clearance`, `predicted_relative_velocity` and `input_sequence` have
    shape (N,) for 1..N steps ahead, or (0,) where `valid` is false.
    """

    stamp: int
    step: int
    restart: bool
    restart_reason: str
    without_acceleration: bool
    late_samples: int
    refused_samples: int
    bad_samples: int
    fallbacks: int
    has_target: bool
    track_id: int
    sensor_flags: int
    sensor_text: str
    measured_clearance: float
    measured_relative_velocity: float
    measured_acceleration: float
    measured_host_speed: float
    measured_lead_acceleration: float
    clearance_age: float
    relative_velocity_age: float
    acceleration_age: float
    host_speed_age: float
    lead_acceleration_age: float
    clearance_stale: bool
    relative_velocity_stale: bool
    acceleration_stale: bool
    host_speed_stale: bool
    lead_acceleration_stale: bool
    clearance: float
    relative_velocity: float
    acceleration: float
    host_speed: float
    valid: bool
    solver_status: str
    residual: float
    solve_time: float
    command: float
    desired_clearance: float
    predicted_clearance: NDArray[np.float64]
    predicted_relative_velocity: NDArray[np.float64]
    input_sequence: NDArray[np.float64]

    @cached_property
    def states(self) -> NDArray[np.float64]:
        """The prediction as (N, 2) in m and m/s, or (0, 2)."""
        states = np.empty((len(self.predicted_clearance), 2))
        states[:, 0] = self.predicted_clearance
        states[:, 1] = self.predicted_relative_velocity
        return states

    @cached_property
    def record(self) -> NDArray[np.void]:
        """The fields of `HORIZON` as an array of one, for compiled functions."""
        made = np.zeros(1, HORIZON)
        made[0] = _record_values(self)
        return made


_record_values = attrgetter(*HORIZON_FIELDS)


@inner
def _missing(inputs):
    """Why there is nothing to solve; `SOLVED` where all is there."""
    if inputs.clearance.stale:
        return Status.NO_CLEARANCE
    if inputs.relative_velocity.stale:
        return Status.NO_RELATIVE_VELOCITY
    if not inputs.has_target:
        return Status.NO_TARGET
    if not isfinite(inputs.clearance_now):
        return Status.NOT_MEASURED_YET
    return Status.SOLVED


@inner
def _carry_over(inputs, horizon):
    """What a horizon says of the samples that it rests on."""
    horizon.stamp, horizon.step = inputs.stamp, inputs.step
    horizon.restart = inputs.restart != 0
    horizon.without_acceleration = inputs.without_acceleration
    horizon.late_samples = inputs.late_samples
    horizon.refused_samples = inputs.refused_samples
    horizon.bad_samples = inputs.bad_samples
    horizon.has_target, horizon.track_id = inputs.has_target, inputs.track_id
    horizon.sensor_flags = inputs.sensor_flags
    horizon.measured_clearance = inputs.clearance.measured
    horizon.clearance_age = inputs.clearance.age
    horizon.clearance_stale = inputs.clearance.stale
    horizon.measured_relative_velocity = inputs.relative_velocity.measured
    horizon.relative_velocity_age = inputs.relative_velocity.age
    horizon.relative_velocity_stale = inputs.relative_velocity.stale
    horizon.measured_acceleration = inputs.acceleration.measured
    horizon.acceleration_age = inputs.acceleration.age
    horizon.acceleration_stale = inputs.acceleration.stale
    horizon.measured_host_speed = inputs.host_speed.measured
    horizon.host_speed_age = inputs.host_speed.age
    horizon.host_speed_stale = inputs.host_speed.stale
    horizon.measured_lead_acceleration = inputs.lead_acceleration.measured
    horizon.lead_acceleration_age = inputs.lead_acceleration.age
    horizon.lead_acceleration_stale = inputs.lead_acceleration.stale
    horizon.acceleration = 0.0 if inputs.acceleration.stale else inputs.acceleration.measured
    horizon.host_speed = np.nan if inputs.host_speed.stale else inputs.host_speed.measured


@borrowing
def mpc_step(sampler, model, state, f, plan, states):
    """The next step that is released: into `state`, `plan` (N,) and `states` (N, 2).

    Where the plan is not for the compiled solver to make, its cost is in `f` (N,), and
    `finish_step` is to be called with what another solver says.
    """
    inputs, horizon = state.inputs, state.horizon
    if not next_step(sampler, inputs):
        return Progress.NO_STEP
    _carry_over(inputs, horizon)
    state.status = _missing(inputs)
    horizon.solve_time = 0.0
    if state.status != Status.SOLVED:
        horizon.clearance = horizon.relative_velocity = horizon.desired_clearance = np.nan
        _without_solution(state)
        return Progress.DONE
    horizon.clearance = inputs.clearance_now
    horizon.relative_velocity = inputs.relative_velocity.measured
    desired = desired_or_own(model, horizon.clearance, horizon.host_speed)
    horizon.desired_clearance = desired
    linear_cost(
        model, horizon.clearance - desired, horizon.relative_velocity, horizon.acceleration, f
    )
    horizon.residual = plan_inputs(model, f, plan)
    if not horizon.residual <= model.residual_limit:
        return Progress.UNSOLVED
    _with_solution(model, state, plan, states)
    return Progress.DONE


@inner
def _without_solution(state):
    horizon = state.horizon
    horizon.valid = False
    horizon.residual = np.nan
    horizon.command = 0.0
    horizon.fallbacks = state.fallbacks


@borrowing
def _with_solution(model, state, plan, states):
    horizon = state.horizon
    horizon.valid = True
    horizon.command = plan[0]
    horizon.fallbacks = state.fallbacks
    roll_out(
        model,
        horizon.clearance,
        horizon.relative_velocity,
        horizon.acceleration,
        plan,
        states,
    )


@inner
def finish_step(model, state, status, residual, fell_back, plan, states):
    """Take what another solver says of a step that is unsolved."""
    state.status = status
    state.fallbacks += fell_back
    if status == Status.NOT_FOUND:
        _without_solution(state)
        return
    state.horizon.residual = residual
    _with_solution(model, state, plan, states)


@entry
def _mpc_step(sampler, model, state, f, plan, states):
    progress = mpc_step(sampler[0], model, state[0], f, plan, states)
    return progress, is_due(sampler[0])


@entry
def _finish_step(model, state, status, residual, fell_back, plan, states):
    finish_step(model, state[0], status, residual, fell_back, plan, states)


_JUDGED = ("clearance", "relative_velocity", "acceleration", "host_speed", "lead_acceleration")
_OF_LEAD = _JUDGED[:2]
"""Inputs that are judged, and those of them that a lead may not have yet (NaN)."""


def check_horizon(horizon: Horizon) -> None:
    """Raises ValueError for a horizon that no controller makes: nothing can be judged by it."""
    for name in _JUDGED:
        if getattr(horizon, f"{name}_stale"):
            continue
        value, age = getattr(horizon, f"measured_{name}"), getattr(horizon, f"{name}_age")
        known = isfinite(value) or (name in _OF_LEAD and isnan(value))
        if not (known and 0.0 <= age < inf):
            raise ValueError(f"{name} of {value:g}, {age:g} s old, is not stale")
    lengths = len(horizon.predicted_clearance), len(horizon.predicted_relative_velocity)
    if lengths[0] != lengths[1]:
        raise ValueError(f"predictions of {lengths[0]} clearances and {lengths[1]} velocities")
    used = horizon.clearance, horizon.relative_velocity, horizon.acceleration
    if horizon.valid and not (all(map(isfinite, used)) and np.isfinite(horizon.states).all()):
        raise ValueError("a valid prediction that is not finite")
    try:
        horizon.record  # noqa: B018
    except OverflowError as error:
        raise ValueError(f"a number is too large: {error}") from error


_STATUS = {text: status for status, text in STATUS_TEXTS.items()}


def first_horizon() -> Horizon:
    """A horizon with nothing in it, for cores to be called with before the first real one.

    What was compiled is loaded at the first call; no message needs to wait for that.
    """
    return Mpc(MpcSettings()).push(ScalarSample(ACCELERATION, 0, 0.0))[0]


class Mpc:
    """The controller behind its sampler."""

    def __init__(self, settings: MpcSettings) -> None:
        """Raises ValueError for settings that cannot work."""
        self.controller = Controller(settings)
        self.sampler = Sampler()
        self.state = make_state(MPC_STATE)
        self._f = np.empty(self.controller.steps)
        # Views of what every step reads: finding a field takes longer than reading it.
        self._inputs, self._made = self.state["inputs"], self.state["horizon"]
        self._text, self._restart = self._inputs["text"], self._inputs["restart"]
        self._status, self._solve_time = self.state["status"], self._made["solve_time"]

    def change(self, settings: MpcSettings) -> None:
        """Plan with other settings from the next step on; the horizon stays as long as it is.

        Raises ValueError for settings that cannot work; the old ones are then kept.
        """
        self.controller = Controller(settings)

    def push(self, sample: Sample) -> list[Horizon]:
        """Take one sample; returns the steps that it releases."""
        return self._steps() if self.sampler.take(sample) else []

    def clock(self, stamp: int) -> list[Horizon]:
        """The clock has reached `stamp` (ns); returns the steps that this releases."""
        take_clock(self.sampler.state, stamp)
        return self._steps()

    def solve_outside(self, f: NDArray, plan: NDArray, states: NDArray) -> None:
        """Let the chosen solver, or the exact one, plan the step that is unsolved."""
        solution = self.controller.qp.solve(f)
        if solution.u is not None:
            plan[:] = solution.u
        _finish_step(
            self.controller.model,
            self.state,
            int(_STATUS[solution.status]),
            solution.residual,
            solution.fell_back,
            plan,
            states,
        )

    def _steps(self) -> list[Horizon]:
        made: list[Horizon] = []
        due = True
        n = self.controller.steps
        while due:
            plan, states = np.empty(n), np.empty((n, 2))
            start = time.perf_counter()
            progress, due = _mpc_step(
                self.sampler.state, self.controller.model, self.state, self._f, plan, states
            )
            if progress == Progress.NO_STEP:
                break
            if progress == Progress.UNSOLVED:
                self.solve_outside(self._f, plan, states)
            self._solve_time[0] = time.perf_counter() - start
            made.append(self._horizon(plan, states))
        return made

    def _horizon(self, plan: NDArray, states: NDArray) -> Horizon:
        """The step that was made last, with its plan (N,) and prediction (N, 2)."""
        values = dict(zip(HORIZON_FIELDS, self._made.item(), strict=True))
        valid = values["valid"]
        made = Horizon.__new__(Horizon)
        # All fields at once: one after the other they would take longer than the step itself.
        vars(made).update(
            values,
            restart_reason=restart_reason(self._inputs[0]) if self._restart[0] else "",
            sensor_text=self.sampler.texts.text(self._text.item()),
            solver_status=STATUS_TEXTS[self._status.item()],
            predicted_clearance=states[:, 0] if valid else NOTHING,
            predicted_relative_velocity=states[:, 1] if valid else NOTHING,
            input_sequence=plan if valid else NOTHING,
            record=np.frombuffer(bytearray(self._made.tobytes()), HORIZON),
        )
        if valid:
            vars(made)["states"] = states
        return made
