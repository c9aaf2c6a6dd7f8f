"""What the decision node tells the controller: how bad it is, and which values to drive by."""

from dataclasses import dataclass
from enum import IntEnum
from math import isfinite


class FaultLevel(IntEnum):
    """How much of automated driving is left; the values are those of `lfd_msgs/Decision`."""

    NORMAL = 0
    DEGRADED = 1
    TAKE_OVER = 2
    EMERGENCY = 3


class Action(IntEnum):
    """What the controller is to do; the values are those of `lfd_msgs/Decision`."""

    FOLLOW = 0
    FOLLOW_FROM_AFAR = 1
    WARN = 2
    STOP = 3
    BRAKE = 4


LEAST_ROOM = 0.5
"""m that braking is reckoned with at least: nearer, or too near already, it would be infinite."""


@dataclass(slots=True)
class Decision:
    """The fields, units and meanings of `lfd_msgs/Decision`; `stamp` and `since` in ns."""

    stamp: int
    step: int
    level: FaultLevel
    action: Action
    since: int
    reason: str
    deceleration: float
    clearance_usable: bool
    relative_velocity_usable: bool
    acceleration_usable: bool
    host_speed_usable: bool
    clearance: float
    relative_velocity: float
    relative_acceleration: float
    acceleration: float


def braking_needed(clearance: float, relative_velocity: float, room: float) -> float:
    """Deceleration in m/s^2 that keeps `room` m behind a lead of constant speed; 0 where the lead
    does not come nearer, or is not seen."""
    if not (isfinite(clearance) and isfinite(relative_velocity)) or relative_velocity >= 0.0:
        return 0.0
    return relative_velocity * relative_velocity / (2.0 * max(clearance - room, LEAST_ROOM))
