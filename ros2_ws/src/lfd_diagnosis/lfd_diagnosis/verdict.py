"""What is said about one signal, and the names of its states."""

from dataclasses import dataclass
from enum import IntEnum
from math import nan

import numpy as np


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


COVERS = 1.96
"""Published standard deviations within which the truth lies 95 % of the time."""

SIGNALS = ("clearance", "relative_velocity", "radar", "acceleration")
"""The sensors under diagnosis: names of their verdicts in a report."""

EVIDENCE = ("host_speed", "lead_acceleration")
"""What else is judged, because it serves as evidence."""

VERDICTS = (*SIGNALS, *EVIDENCE)
"""All verdicts in a report, in the order in which events are published."""


VERDICT = np.dtype(
    [
        ("state", "i1"),
        ("kind", "i1"),
        ("confidence", "i4"),
        ("confidence_threshold", "i4"),
        ("index", "f8"),
        ("threshold", "f8"),
        ("since", "i8"),
        ("size", "f8"),
        ("size_std", "f8"),
    ],
    align=True,
)
"""The fields of `SignalVerdict` but its reason, which is made from the evidence."""

RECONSTRUCTED = np.dtype(
    [
        ("clearance_valid", "?"),
        ("clearance", "f8"),
        ("clearance_std", "f8"),
        ("relative_velocity_valid", "?"),
        ("relative_velocity", "f8"),
        ("relative_velocity_std", "f8"),
        ("relative_acceleration_valid", "?"),
        ("relative_acceleration", "f8"),
        ("acceleration_valid", "?"),
        ("acceleration", "f8"),
        ("acceleration_std", "f8"),
    ],
    align=True,
)
"""The fields of `Reconstruction` but its reason."""


def outcome_kind(evidence: np.dtype) -> np.dtype:
    """Everything that is said after one step, as a record; `evidence` is the profile's.

    `changed` are the verdicts whose state has, as bits in the order of `VERDICTS`; `old_state`
    and `old_since` what they were before; `starts_anew` where nothing from before this step counts,
    or no more than what was learnt and is faulty; `radar_is_velocity` where the radar's verdict is
    that on the relative velocity.
    """
    return np.dtype(
        [
            ("stamp", "i8"),
            ("step", "i8"),
            *((name, VERDICT) for name in VERDICTS),
            ("reconstructed", RECONSTRUCTED),
            ("changed", "i8"),
            ("old_state", "i1", (len(VERDICTS),)),
            ("old_since", "i8", (len(VERDICTS),)),
            ("starts_anew", "?"),
            ("radar_is_velocity", "?"),
            ("evidence", evidence),
        ],
        align=True,
    )


@dataclass(slots=True)
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


@dataclass(slots=True)
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


@dataclass(slots=True)
class Event:
    """The fields and meanings of `lfd_msgs/FaultEvent`; `stamp` and `old_since` in ns."""

    stamp: int
    signal: str
    old_state: State
    old_since: int
    fault: SignalVerdict


@dataclass(slots=True)
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


@dataclass(slots=True)
class Outcome:
    """Everything that the diagnosis says after one step."""

    report: Report
    events: list[Event]
    reconstruction: Reconstruction
