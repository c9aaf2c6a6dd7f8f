"""Settings: one frozen model per node; every field carries its unit, meaning and source.

The same models declare the ROS parameters, check a parameter file offline and make the parameter
files of `lfd_bringup`, so that a parameter is described in one place.
"""

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

STEP_NS = 10_000_000
"""One step of the algorithm in nanoseconds of stamp time."""

STEP_S = STEP_NS * 1e-9
"""One step of the algorithm, `dt`, in seconds."""

GRAVITY = 9.81
"""m/s^2, by which slopes accelerate and accelerometers feel them."""


def share_of(time: float) -> float:
    """What a first-order filter of that time constant (s) takes of a new value each step."""
    return STEP_S / (time + STEP_S)


def desired_clearance(minimum_clearance: float, preview_time: float, host_speed: float) -> float:
    """In m at a host speed in m/s, the preview in s (eq 1)."""
    return minimum_clearance + preview_time * host_speed


def setting(
    default: Any, unit: str, text: str, source: str, fixed: bool = False, **limits: Any
) -> Any:
    """One field of a settings model.

    `unit` is the field's unit ("1" = none), `source` where the default comes from; `fixed` ones
    cannot be changed while a node runs; `limits` are pydantic's (`ge`, `gt`, `le`, `lt`).
    """
    extra = {"unit": unit, "source": source, "fixed": fixed}
    return Field(default, description=text, json_schema_extra=extra, **limits)


def is_fixed(field: Any) -> bool:
    """Whether a field of settings cannot be changed while a node runs."""
    return field.json_schema_extra["fixed"]


class Settings(BaseModel):
    """Base of all settings: unknown names, other types and non-finite numbers are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


def settings_error(error: ValidationError) -> str:
    """One line for settings that pydantic refused."""
    first = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    # What our own checks say begins with pydantic's name of the exception.
    said = first["msg"].removeprefix("Value error, ")
    return f"parameter {where}: {said}, got {first['input']!r}" if where else said


def unknown_parameter(name: str, owner: str, known: Iterable[str]) -> str:
    """One line for a parameter that its owner, a node, does not have."""
    return f"unknown parameter '{name}' for {owner}; known: {', '.join(sorted(known)) or 'none'}"


def as_meant(value: Any, default: Any) -> Any:
    """A parameter's value as its field takes it: a whole number where any number will do, a number
    where a text is expected, a list of any length."""
    if type(value) is int and isinstance(default, float):
        return float(value)
    if type(value) in (int, float) and isinstance(default, str):
        return str(value)
    return tuple(value) if isinstance(value, list) and isinstance(default, tuple) else value


def settings_record(settings: Settings) -> NDArray[np.void]:
    """The numbers and switches of settings by their names, as an array of one record."""
    kinds = {bool: "?", int: "i8", float: "f8"}
    values = {name: getattr(settings, name) for name in type(settings).model_fields}
    fields = [
        (name, kinds[field.annotation])
        for name, field in type(settings).model_fields.items()
        if field.annotation in kinds
    ]
    record = np.zeros(1, np.dtype(fields, align=True))
    record[0] = tuple(values[name] for name, _ in fields)
    return record


class HorizonSettings(Settings):
    """What controller, bank and diagnosis must agree on."""

    prediction_steps: int = setting(
        20,
        "steps",
        "prediction horizon N, steps of 10 ms",
        "section 3, N = 20",
        fixed=True,
        ge=2,
        le=100,
    )


class DrivingSettings(Settings):
    """Settings of the controller where it drives the car (`driving.py`)."""

    driving: bool = setting(
        False,
        "1",
        "drive the car: the command follows the verdicts; off = plan beside a human driver",
        "closed loop",
        fixed=True,
    )
    set_speed: float = setting(
        33.0, "m/s", "speed that is kept where no lead is slower", "120 km/h", ge=0.0, le=70.0
    )
    control_period: float = setting(
        0.2,
        "s",
        "one step of the horizon that the car is driven by",
        "docs/closed-loop.md",
        fixed=True,
        ge=0.02,
        le=0.5,
    )
    control_steps: int = setting(
        25, "steps", "length of that horizon", "docs/closed-loop.md", fixed=True, ge=5, le=60
    )
    control_clearance_weight: float = setting(
        0.1, "1/m^2", "weight of the clearance error", "docs/closed-loop.md", gt=0.0, le=1e3
    )
    control_velocity_weight: float = setting(
        0.4, "s^2/m^2", "weight of the relative velocity", "docs/closed-loop.md", gt=0.0, le=1e3
    )
    control_acceleration_weight: float = setting(
        0.3, "s^4/m^2", "weight of the acceleration", "docs/closed-loop.md", ge=0.0, le=1e3
    )
    control_change_weight: float = setting(
        4.0,
        "s^4/m^2",
        "weight of a change of the command from step to step",
        "docs/closed-loop.md",
        gt=0.0,
        le=1e3,
    )
    actuator_lag: float = setting(
        0.25, "s", "lag of powertrain and brakes", "vehicle model", ge=0.02, le=2.0
    )
    lead_acceleration_time: float = setting(
        1.5,
        "s",
        "time in which the lead's acceleration is expected to fade",
        "docs/closed-loop.md",
        ge=0.05,
        le=20.0,
    )
    comfortable_acceleration: float = setting(
        1.5, "m/s^2", "largest acceleration of the car", "ISO 15622: 2.0 above 20 m/s", gt=0, le=4.0
    )
    comfortable_braking: float = setting(
        1.5,
        "m/s^2",
        "deceleration with which a slower lead is approached",
        "docs/closed-loop.md",
        gt=0.0,
        le=5.0,
    )
    comfortable_jerk: float = setting(
        2.0, "m/s^3", "largest change of the command per second", "ISO 15622: 2.5", gt=0.0, le=20.0
    )
    emergency_jerk: float = setting(
        20.0, "m/s^3", "largest jerk where the lead comes too near", "brakes", gt=0.0, le=100.0
    )
    stopping_deceleration: float = setting(
        2.5,
        "m/s^2",
        "deceleration of a stop because no decision came; a decided stop that is harder comes at "
        "once (emergency_jerk)",
        "ISO 15622",
        gt=0.0,
        le=5.0,
    )
    degraded_gap: float = setting(
        1.3,
        "1",
        "the desired clearance is so many times as large while a sensor is faulty",
        "docs/closed-loop.md",
        ge=1.0,
        le=3.0,
    )
    decision_timeout: float = setting(
        0.15,
        "s",
        "age of the decision above which it is taken for lost: the car is stopped comfortably",
        "docs/closed-loop.md",
        gt=0.02,
        le=5.0,
    )


class MpcSettings(DrivingSettings, HorizonSettings):
    """Settings of the controller, eqs 1 to 10."""

    preview_time: float = setting(
        1.5,
        "s",
        "preview time t_p of the desired clearance",
        "docs/algorithm.md, eq 1",
        ge=0.0,
        le=10.0,
    )
    minimum_clearance: float = setting(
        5.0, "m", "clearance c_0 wanted at standstill", "docs/algorithm.md, eq 1", ge=0.0, le=100.0
    )
    weight_slope: float = setting(
        2.0,
        "1",
        "slope beta of the tanh weights along the horizon",
        "docs/algorithm.md, eq 3",
        gt=0.0,
        le=100.0,
    )
    clearance_weight: float = setting(
        1.0, "1", "weight q1 of the clearance error", "docs/algorithm.md, eq 3", ge=0.0, le=1e6
    )
    relative_velocity_weight: float = setting(
        1.0, "1", "weight q2 of the relative velocity", "docs/algorithm.md, eq 3", ge=0.0, le=1e6
    )
    input_weight: float = setting(
        10.0,
        "1",
        "weight R of changes of the input along the horizon",
        "docs/algorithm.md, eq 4",
        ge=0.0,
        le=1e9,
    )
    acceleration_lower: float = setting(
        -5.0,
        "m/s^2",
        "lower limit of the planned acceleration",
        "docs/algorithm.md, eq 6",
        ge=-20.0,
        le=0.0,
    )
    acceleration_upper: float = setting(
        3.0,
        "m/s^2",
        "upper limit of the planned acceleration",
        "docs/algorithm.md, eq 6",
        ge=0.0,
        le=20.0,
    )
    solver: str = setting(
        "active_set",
        "1",
        "solver of steps where a limit is active: active_set, proxqp, or any name of qpsolvers",
        "own choice",
    )
    prediction: Literal["mpc", "linear"] = setting(
        "mpc",
        "1",
        "published prediction: mpc, or linear (constant relative velocity) to compare with",
        "section 3; section 5 compares both",
    )
    residual_limit: float = setting(
        1e-9,
        "m/s^2",
        "optimality residual above which a problem is solved again exactly",
        "own choice",
        gt=0.0,
        le=1e-3,
    )

    def desired_clearance(self, host_speed: float, gap: float = 1.0) -> float:
        """In m at a speed in m/s; `gap`: how many times as large the preview is."""
        return desired_clearance(self.minimum_clearance, gap * self.preview_time, host_speed)
