"""The recorded car as if it had other sensors.

Its acceleration as others felt or derived it, and everything joined into one table, as many
recordings are.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    RadarSample,
    Sample,
    ScalarSample,
    playing_order,
)
from lfd_mpc.settings import STEP_NS
from lfd_replay.drive import Drive
from lfd_replay.drive_csv import ACCEL, scalar_stream
from lfd_replay.evaluation.cases import RECORDED
from lfd_replay.import_drive import extra_column

PHONE = "imu_phone.csv:acc_forward_mps2"
"""A phone on the windscreen: it shakes, and is off for good."""

WHEELS = "can_accel_0x228.csv:acc_mps2"
"""What the car makes of its wheels' speed: it feels no road."""

DERIVED = "derived"
"""The speed's own derivative, from sample to sample."""


def joined(samples: Sequence[Sample], every: int) -> list[Sample]:
    """Each `every`-th scan, with the last value of everything else at its time."""
    made: list[Sample] = []
    last: dict[str, float] = {}
    scans = 0
    for sample in samples:
        if not isinstance(sample, RadarSample):
            last[sample.input] = sample.value
            continue
        if scans % every == 0:
            made.append(sample)
            made += [ScalarSample(name, sample.stamp, value) for name, value in last.items()]
        scans += 1
    return made


def filled(samples: Sequence[Sample]) -> list[Sample]:
    """A row every 10 ms: the last value of everything, whether it is new or not, and a clearance in
    steps of 0.1 m."""
    made: list[Sample] = []
    last: dict[str, Sample] = {}
    stamp = samples[0].stamp
    for sample in samples:
        while stamp < sample.stamp:
            made += [replace(known, stamp=stamp) for known in last.values()]
            stamp += STEP_NS
        if isinstance(sample, RadarSample):
            sample = replace(sample, clearance=round(10.0 * sample.clearance) / 10.0)
        last[sample.input] = sample
    return sorted(made, key=playing_order)


def interpolated(samples: Sequence[Sample]) -> list[Sample]:
    """A row every 10 ms, everything on lines from one value to the next, also from one target to
    another; the target is the one that was last seen."""
    scans = [s for s in samples if isinstance(s, RadarSample)]
    stamps = np.array([s.stamp for s in scans])
    rows = np.arange(stamps[0], stamps[-1], STEP_NS)
    seen = np.searchsorted(stamps, rows, side="right") - 1
    lines = {
        name: np.interp(rows, stamps, [getattr(s, name) for s in scans])
        for name in ("clearance", "relative_velocity")
    }
    made: list[Sample] = [
        replace(
            scans[scan],
            stamp=int(stamp),
            clearance=float(clearance),
            relative_velocity=float(velocity),
        )
        for scan, stamp, clearance, velocity in zip(seen, rows, *lines.values(), strict=True)
    ]
    for name in (ACCELERATION, HOST_SPEED):
        known = [s for s in samples if s.input == name]
        values = np.interp(rows, [s.stamp for s in known], [s.value for s in known])
        made += [ScalarSample(name, int(t), float(v)) for t, v in zip(rows, values, strict=True)]
    return sorted(made, key=playing_order)


Table = Callable[[Sequence[Sample]], list[Sample]]
"""What makes one table of everything that the sensors say."""


@dataclass(frozen=True)
class View:
    """Other sensors: the `accelerometer` (the recorded one if empty), and the `table` that
    everything is in (None: all sensors speak for themselves)."""

    accelerometer: str = ""
    table: Table | None = None


AT_20_HZ, AT_10_HZ = partial(joined, every=1), partial(joined, every=2)

VIEWS = {
    "phone": View(PHONE),
    "wheels": View(WHEELS),
    "joined at 20 Hz": View(table=AT_20_HZ),
    "joined at 10 Hz": View(table=AT_10_HZ),
    "phone, joined at 20 Hz": View(PHONE, AT_20_HZ),
    "phone, joined at 10 Hz": View(PHONE, AT_10_HZ),
    "derived, joined at 10 Hz": View(DERIVED, AT_10_HZ),
    "filled up to 100 Hz": View(table=filled),
    "interpolated to 100 Hz": View(table=interpolated),
}
"""By name, among the names of sensor suites."""

PHONES = tuple(name for name, view in VIEWS.items() if view.accelerometer == PHONE)
"""Those that feel what a phone does."""


def seen_by(name: str, drive: Drive, folder: Path) -> Drive:
    """A drive of the recorded car as one of `VIEWS` sees it. Raises UserError."""
    view = VIEWS[name]
    return Drive(f"{drive.name}, {name}", tabled(view, felt_by(view, drive.samples, folder)))


def felt_by(view: View, samples: Sequence[Sample], folder: Path) -> list[Sample]:
    """Samples of the recorded car, with another accelerometer's. Raises UserError."""
    if view.accelerometer in ("", DERIVED):
        return list(samples)
    return _with(samples, _recorded(view.accelerometer, folder))


def tabled(view: View, samples: Sequence[Sample]) -> list[Sample]:
    """Samples as a view's table says them."""
    made = view.table(samples) if view.table else list(samples)
    return _with(made, _derived(made)) if view.accelerometer == DERIVED else made


def _recorded(file: str, folder: Path) -> list[Sample]:
    return scalar_stream(*extra_column(f"{folder / RECORDED}.{file}", ACCEL), ACCELERATION)


def _derived(samples: Sequence[Sample]) -> list[Sample]:
    speeds = [s for s in samples if isinstance(s, ScalarSample) and s.input == HOST_SPEED]
    stamps = np.array([s.stamp for s in speeds])
    values = np.gradient([s.value for s in speeds], stamps * 1e-9)
    return [
        ScalarSample(ACCELERATION, int(t), float(v)) for t, v in zip(stamps, values, strict=True)
    ]


def _with(samples: Sequence[Sample], accelerations: list[Sample]) -> list[Sample]:
    """Another accelerometer, for as long as the drive's own one spoke."""
    stamps = [s.stamp for s in samples if s.input == ACCELERATION]
    within = [s for s in accelerations if stamps[0] <= s.stamp <= stamps[-1]]
    others = [s for s in samples if s.input != ACCELERATION]
    return sorted([*others, *within], key=playing_order)
