"""What one step has to work with, as a record for compiled functions and as an object."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from lfd_mpc.samples import INPUTS, LEAD_ACCELERATION, SensorTexts


class Restart(IntEnum):
    """Why a step restarts."""

    NONE = 0
    START = 1
    TIME_WENT_BACK = 2
    GAP = 3
    NEW_LEAD = 4


READING = np.dtype([("measured", "f8"), ("age", "f8"), ("stale", "?")], align=True)
"""A signal at a step: newest sample `measured`, its `age` in s (both NaN = none), `stale`."""

STEP_INPUTS = np.dtype(
    [
        ("step", "i8"),
        ("stamp", "i8"),
        ("restart", "i8"),
        ("restart_values", "f8", (2,)),
        ("restart_tracks", "i8", (2,)),
        ("without_acceleration", "?"),
        ("has_target", "?"),
        ("track_id", "i8"),
        ("sensor_flags", "i8"),
        ("text", "i8"),
        ("clearance", READING),
        ("relative_velocity", READING),
        ("acceleration", READING),
        ("host_speed", READING),
        ("lead_acceleration", READING),
        ("clearance_now", "f8"),
        ("late_samples", "i8"),
        ("refused_samples", "i8"),
        ("bad_samples", "i8"),
    ],
    align=True,
)
"""What one step has to work with: the fields of `StepInputs`."""


def restart_reason(inputs: np.void) -> str:
    """Why a step (a record of `STEP_INPUTS`) restarts, in words; empty where it does not."""
    if not inputs["restart"]:
        return ""
    first, second = inputs["restart_values"]
    before, after = inputs["restart_tracks"]
    return {
        Restart.START: "start",
        Restart.TIME_WENT_BACK: f"time went back by {first:.3f} s",
        Restart.GAP: f"no input for {first:.3f} s (limit {second:.3f} s)",
        Restart.NEW_LEAD: f"new lead: track {before} became {after}",
    }[int(inputs["restart"])]


@dataclass(frozen=True)
class Reading:
    """A signal at a step: newest sample `measured`, its `age` in s (both NaN = none), `stale`."""

    measured: float
    age: float
    stale: bool


@dataclass(frozen=True)
class StepInputs:
    """What one step has to work with; `stamp` in ns, `clearance_now` in m carried to the step."""

    step: int
    stamp: int
    restart_reason: str
    without_acceleration: bool
    has_target: bool
    track_id: int
    sensor_flags: int
    sensor_text: str
    clearance: Reading
    relative_velocity: Reading
    acceleration: Reading
    host_speed: Reading
    lead_acceleration: Reading
    clearance_now: float
    late_samples: int
    refused_samples: int
    bad_samples: int


def step_inputs(inputs: np.void, texts: SensorTexts) -> StepInputs:
    """A record of `STEP_INPUTS` as an object; `texts` know what its sensor said of itself."""
    values = dict(zip(STEP_INPUTS.names or (), inputs.item(), strict=True))
    values["restart_reason"] = restart_reason(inputs)
    values["sensor_text"] = texts.text(values["text"])
    for name in ("restart", "restart_values", "restart_tracks", "text"):
        del values[name]
    for name in (*INPUTS[1:], "clearance", "relative_velocity", LEAD_ACCELERATION):
        values[name] = Reading(*values[name])
    return StepInputs(**values)
