"""Samples of the inputs: what a drive is made of and what a controller takes.

Stamps are integer nanoseconds.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from math import nan
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

RADAR, ACCELERATION, HOST_SPEED = "radar", "acceleration", "host_speed"
INPUTS = (RADAR, ACCELERATION, HOST_SPEED)

LEAD_ACCELERATION = "lead_acceleration"
"""What the lead itself says of its acceleration (V2V). Its stamps are another car's: it neither
releases steps nor takes part in deciding what time it is, and a lost one makes no gap."""

UNKNOWN_TRACK = -1

KNOWN_TEXTS = 1000
"""Different texts of a sensor that are remembered."""


class Input(IntEnum):
    """Inputs as compiled functions know them."""

    RADAR = 0
    ACCELERATION = 1
    HOST_SPEED = 2
    LEAD_ACCELERATION = 3


INPUT_NUMBERS = {
    RADAR: int(Input.RADAR),
    ACCELERATION: int(Input.ACCELERATION),
    HOST_SPEED: int(Input.HOST_SPEED),
    LEAD_ACCELERATION: int(Input.LEAD_ACCELERATION),
}


@dataclass(frozen=True, slots=True)
class RadarSample:
    """One scan: `clearance` in m and `relative_velocity` in m/s, NaN = not measured.

    `sensor_flags` and `sensor_text` are what the sensor says of itself.
    """

    stamp: int
    has_target: bool
    clearance: float
    relative_velocity: float
    track_id: int = UNKNOWN_TRACK
    sensor_flags: int = 0
    sensor_text: str = ""
    input: ClassVar[str] = RADAR


@dataclass(frozen=True, slots=True)
class ScalarSample:
    """One value of `input`: an acceleration in m/s^2, or host speed in m/s."""

    input: str
    stamp: int
    value: float


Sample = RadarSample | ScalarSample


def playing_order(sample: Sample) -> tuple[int, bool]:
    """Sort key: by stamp, and at equal stamps the acceleration last, since it releases the step."""
    return sample.stamp, sample.input == ACCELERATION


SAMPLE = np.dtype(
    [
        ("stamp", "i8"),
        ("value", "f8"),
        ("relative_velocity", "f8"),
        ("track_id", "i8"),
        ("sensor_flags", "i8"),
        ("text", "i8"),
        ("input", "i1"),
        ("has_target", "?"),
    ],
    align=True,
)
"""Any sample as a record: `value` is a scan's clearance, or the value of the other inputs; `text`
is the number of a sensor's text."""


class SensorTexts:
    """Numbers for what sensors say of themselves; 0 is silence."""

    def __init__(self) -> None:
        self._numbers = {"": 0}
        self._texts = {0: ""}
        self._next = 1

    def number(self, text: str) -> int:
        """The number of a text; the oldest one is forgotten where there are too many."""
        known = self._numbers.get(text)
        if known is not None:
            return known
        if len(self._numbers) >= KNOWN_TEXTS:
            oldest = next(t for t in self._numbers if t)
            del self._texts[self._numbers.pop(oldest)]
        number, self._next = self._next, self._next + 1
        self._numbers[text], self._texts[number] = number, text
        return number

    def text(self, number: int) -> str:
        """The text of a number; empty for one that is forgotten."""
        return self._texts.get(number, "")


def sample_fields(sample: Sample, texts: SensorTexts) -> tuple:
    """A sample as the fields of `SAMPLE`."""
    if isinstance(sample, RadarSample):
        return (
            sample.stamp,
            float(sample.clearance),
            float(sample.relative_velocity),
            sample.track_id,
            sample.sensor_flags,
            texts.number(sample.sensor_text) if sample.sensor_text else 0,
            0,
            bool(sample.has_target),
        )
    number = INPUT_NUMBERS[sample.input]
    return sample.stamp, float(sample.value), nan, UNKNOWN_TRACK, 0, 0, number, False


def sample_array(samples: Iterable[Sample], texts: SensorTexts) -> NDArray[np.void]:
    """Samples as an array (n,) of `SAMPLE`."""
    samples = list(samples)
    made = np.zeros(len(samples), SAMPLE)
    made["input"] = [INPUT_NUMBERS[sample.input] for sample in samples]
    # Column by column, and most samples have but three fields: that takes a third of the time.
    scans = np.flatnonzero(made["input"] == Input.RADAR)
    fields = zip(*[sample_fields(samples[k], texts) for k in scans.tolist()], strict=True)
    for name, column in zip(SAMPLE.fields or (), fields, strict=False):
        made[name][scans] = column
    others = np.flatnonzero(made["input"] != Input.RADAR)
    chosen = [samples[k] for k in others.tolist()]
    made["stamp"][others] = [sample.stamp for sample in chosen]
    made["value"][others] = [sample.value for sample in chosen]
    return made
