"""Samples in, prediction horizons out: the whole controller without ROS."""

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, nan

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.controller import Controller, ControlSolution
from lfd_mpc.sampling import Sample, Sampler, StepInputs
from lfd_mpc.settings import MpcSettings

NOTHING = np.empty(0)


@dataclass(frozen=True)
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


class Mpc:
    """The controller behind its sampler."""

    def __init__(self, settings: MpcSettings) -> None:
        """Raises ValueError for settings that cannot work."""
        self._controller = Controller(settings)
        self._sampler = Sampler()
        self._fallbacks = 0

    def push(self, sample: Sample) -> list[Horizon]:
        """Take one sample; returns the steps that it releases."""
        return [self._step(inputs) for inputs in self._sampler.push(sample)]

    def clock(self, stamp: int) -> list[Horizon]:
        """The clock has reached `stamp` (ns); returns the steps that this releases."""
        return [self._step(inputs) for inputs in self._sampler.clock(stamp)]

    def _step(self, sampled: StepInputs) -> Horizon:
        acceleration = 0.0 if sampled.acceleration.stale else sampled.acceleration.measured
        host_speed = nan if sampled.host_speed.stale else sampled.host_speed.measured
        missing = _missing(sampled)
        if missing:
            clearance = relative_velocity = nan
            solution = ControlSolution(None, None, nan, missing, nan, 0.0, False)
        else:
            clearance, relative_velocity = sampled.clearance_now, sampled.relative_velocity.measured
            solution = self._controller.solve(
                clearance,
                relative_velocity,
                acceleration,
                host_speed if isfinite(host_speed) else None,
            )
        self._fallbacks += solution.fell_back
        states, inputs = solution.states, solution.inputs
        return Horizon(
            stamp=sampled.stamp,
            step=sampled.step,
            restart=bool(sampled.restart_reason),
            restart_reason=sampled.restart_reason,
            without_acceleration=sampled.without_acceleration,
            late_samples=sampled.late_samples,
            refused_samples=sampled.refused_samples,
            bad_samples=sampled.bad_samples,
            fallbacks=self._fallbacks,
            has_target=sampled.has_target,
            track_id=sampled.track_id,
            sensor_flags=sampled.sensor_flags,
            sensor_text=sampled.sensor_text,
            measured_clearance=sampled.clearance.measured,
            measured_relative_velocity=sampled.relative_velocity.measured,
            measured_acceleration=sampled.acceleration.measured,
            measured_host_speed=sampled.host_speed.measured,
            measured_lead_acceleration=sampled.lead_acceleration.measured,
            clearance_age=sampled.clearance.age,
            relative_velocity_age=sampled.relative_velocity.age,
            acceleration_age=sampled.acceleration.age,
            host_speed_age=sampled.host_speed.age,
            lead_acceleration_age=sampled.lead_acceleration.age,
            clearance_stale=sampled.clearance.stale,
            relative_velocity_stale=sampled.relative_velocity.stale,
            acceleration_stale=sampled.acceleration.stale,
            host_speed_stale=sampled.host_speed.stale,
            lead_acceleration_stale=sampled.lead_acceleration.stale,
            clearance=clearance,
            relative_velocity=relative_velocity,
            acceleration=acceleration,
            host_speed=host_speed,
            valid=states is not None,
            solver_status=solution.status,
            residual=solution.residual,
            solve_time=solution.seconds,
            command=solution.command,
            desired_clearance=solution.desired_clearance,
            predicted_clearance=NOTHING if states is None else states[:, 0],
            predicted_relative_velocity=NOTHING if states is None else states[:, 1],
            input_sequence=NOTHING if inputs is None else inputs,
        )


def _missing(sampled: StepInputs) -> str:
    """Why there is nothing to solve; empty = all is there."""
    if sampled.clearance.stale:
        return "no clearance"
    if sampled.relative_velocity.stale:
        return "no relative velocity"
    if not sampled.has_target:
        return "no target"
    if not isfinite(sampled.clearance_now):
        return "clearance or relative velocity not measured yet"
    return ""
