"""What is said about one signal, and the names of its states."""

from dataclasses import dataclass
from enum import IntEnum
from math import nan


class State(IntEnum):
    """States of a signal; the values are those of `lfd_msgs/SignalFault`."""

    NOT_READY = 0
    OK = 1
    SUSPECT = 2
    FAULT = 3
    NO_DATA = 4
    NO_TARGET = 5


class Kind(IntEnum):
    """Kinds of fault; the values are those of `lfd_msgs/SignalFault`."""

    UNKNOWN = 0
    OFFSET = 1
    RAMP = 2
    NOISE = 3
    HOLD = 4
    ZERO = 5
    DROPOUT = 6


SIGNALS = ("clearance", "relative_velocity", "radar", "acceleration")
"""The sensors under diagnosis: names of their verdicts in a report."""

EVIDENCE = ("host_speed", "lead_acceleration")
"""What else is judged, because it serves as evidence."""

VERDICTS = (*SIGNALS, *EVIDENCE)
"""All verdicts in a report, in the order in which events are published."""


@dataclass(frozen=True)
class SignalVerdict:
    """The fields, units and meanings of `lfd_msgs/SignalFault`; `since` in ns."""

    state: State
    index: float
    threshold: float
    confidence: int
    confidence_threshold: int
    since: int
    reason: str
    kind: Kind = Kind.UNKNOWN
    size: float = nan
    size_std: float = nan


@dataclass(frozen=True)
class Report:
    """The fields and meanings of `lfd_msgs/FaultReport`; `stamp` in ns."""

    stamp: int
    step: int
    clearance: SignalVerdict
    relative_velocity: SignalVerdict
    radar: SignalVerdict
    acceleration: SignalVerdict
    host_speed: SignalVerdict
    lead_acceleration: SignalVerdict


@dataclass(frozen=True)
class Event:
    """The fields and meanings of `lfd_msgs/FaultEvent`; `stamp` and `old_since` in ns."""

    stamp: int
    signal: str
    old_state: State
    old_since: int
    fault: SignalVerdict


@dataclass(frozen=True)
class Reconstruction:
    """The fields, units and meanings of `lfd_msgs/ReconstructedState`; `stamp` in ns."""

    stamp: int
    step: int
    clearance_valid: bool
    clearance: float
    clearance_std: float
    relative_velocity_valid: bool
    relative_velocity: float
    relative_velocity_std: float
    relative_acceleration_valid: bool
    relative_acceleration: float
    acceleration_valid: bool
    acceleration: float
    acceleration_std: float
    reason: str


@dataclass(frozen=True)
class Outcome:
    """Everything that the diagnosis says after one step."""

    report: Report
    events: list[Event]
    reconstruction: Reconstruction
