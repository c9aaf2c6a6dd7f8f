"""Detectors side by side: each turns a trace into scores, and scores into flags by one setting.

The setting of each detector and signal is chosen on normal drives so that all of them raise the
same number of false events there; only then their delays and rates can be compared.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.confidence import confidences
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_mpc.arrays import Array
from lfd_replay.evaluation.trace import JUDGED, Trace
from lfd_replay.score import intervals

PUBLISHED = "paper"
"""The trace of the paper profile as it is; other names are those of its variants."""

ROBUST = "robust profile"
"""The robust profile as it is."""

ROBUST_SET = "robust profile, set alike"
"""The robust profile set on the same smooth drives as the others."""

EQUAL_EVENTS = (0, 3)
"""False events in all, on the normal drives, at which others are held against it."""


def at_equal(name: str, events: int) -> str:
    """Name of a detector that is set to so many false events."""
    return f"{name}, {events} false"


def is_at_equal(name: str) -> bool:
    """Whether that is such a name."""
    return name.endswith(" false")


class Detector(ABC):
    """One way to find faults in a trace."""

    name: str
    variant: str = PUBLISHED
    settings: tuple[float, ...]
    """What may be chosen, from nervous to deaf."""

    @abstractmethod
    def scores(self, trace: Trace) -> dict[str, Array]:
        """A score (n,) per judged signal."""

    @abstractmethod
    def flags(self, signal: str, score: Array, setting: float) -> NDArray[np.bool_]:
        """Which steps (n,) are called faulty."""


class CountedIndex(Detector):
    """The paper's decision (eq 26, Table 1); the setting is the confidence that makes a fault."""

    settings = tuple(float(n) for n in (*range(1, 20), *range(20, 50, 3), *range(50, 301, 10)))
    headroom = 10
    """Steps by which the ceiling of the confidence lies above the setting, as in the profile."""

    def __init__(self, name: str, variant: str, diagnosis: DiagnosisSettings) -> None:
        self.name, self.variant = name, variant
        self._thresholds = {s: getattr(diagnosis, f"{s}_threshold") for s in JUDGED}

    def scores(self, trace: Trace) -> dict[str, Array]:
        """The fault indices."""
        return {signal: trace.index(signal) for signal in JUDGED}

    def flags(self, signal: str, score: Array, setting: float) -> NDArray[np.bool_]:
        """Steps at which the confidence has reached the setting."""
        return counted_faults(
            score, self._thresholds[signal], int(setting), int(setting) + self.headroom
        )


def counted_faults(
    index: Array, threshold: float, fault_threshold: int, ceiling: int
) -> NDArray[np.bool_]:
    """Steps (n,) at which the confidence that counts `index` (n,) says fault (eq 26)."""
    return confidences(index, threshold, ceiling) >= fault_threshold


class Exceedance(Detector):
    """A score above its limit is a fault; the setting is the limit."""

    def flags(self, signal: str, score: Array, setting: float) -> NDArray[np.bool_]:
        """Steps whose score reaches the setting."""
        return score >= setting


@dataclass(frozen=True)
class Choice:
    """A detector's setting for one signal, and the false events that it costs on normal drives."""

    setting: float
    false_events: int


def count_false_events(detector: Detector, trace: Trace, allowed: int) -> dict[str, list[int]]:
    """How often a fault-free trace is flagged, per signal, for each of the detector's settings.

    From the deaf end on; once one trace alone exceeds what is `allowed` of all of them, more
    nervous settings are no longer tried and stand with the same number.
    """
    counts = {}
    for signal, score in detector.scores(trace).items():
        found: list[int] = []
        for setting in reversed(detector.settings):
            if not found or found[-1] <= allowed:
                flags = detector.flags(signal, score, setting)
                found.append(len(intervals(trace.stamps, flags)))
            else:
                found.append(found[-1])
        counts[signal] = found[::-1]
    return counts


def choose(detector: Detector, counts: list[int], allowed: int) -> Choice:
    """The most nervous setting from which on no more than `allowed` false events are raised."""
    setting, events = detector.settings[-1], counts[-1]
    for candidate, count in zip(reversed(detector.settings), reversed(counts), strict=True):
        if count > allowed:
            break
        setting, events = candidate, count
    return Choice(setting, events)
