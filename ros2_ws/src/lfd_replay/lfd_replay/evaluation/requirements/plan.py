"""Which drives and faults the requirements are measured on."""

from dataclasses import dataclass, replace

from lfd_replay.evaluation.cases import BLAMED_FOR_S, RECORDED, RECORDED_RADAR_FIRST, phases
from lfd_replay.evaluation.fault_windows import (
    LENGTH,
    PAPER,
    PAUSE,
    WARM_UP,
    Values,
    fault_starts,
    fault_texts,
)
from lfd_replay.evaluation.recorded_noise import RECORDED_SENSORS
from lfd_replay.evaluation.recorded_tracks import BACKWARD, TRACK, TRACK_COUNT
from lfd_replay.evaluation.recorded_views import PHONES, VIEWS
from lfd_replay.evaluation.requirements.windows import NEAREST, Run
from lfd_replay.generated.lead_profiles import NORMAL, TRAFFIC, lead_profile

TABLE_3 = {
    "clearance and relative velocity": PAPER[:2],
    "acceleration": PAPER[2:],
    "all three": PAPER,
}
"""Table 3's faults by title."""

OFFSETS = {
    "clearance": (2.0, 4.0),
    "relative_velocity": (2.0, 5.0, 10.0),
    "acceleration": (1.5, 2.0, 4.0),
}
"""Offsets of one signal alone, of both signs, in m, m/s and m/s^2."""

RAMPS = {"clearance": 0.5, "relative_velocity": 0.5, "acceleration": 0.5}
"""Ramps in m/s, m/s^2 and m/s^3."""

SLIPS = {"host_speed": 3.0}
"""Ramp in m/s^2 of the speed of wheels that spin or lock."""

RAMP_LENGTH, LONG_LENGTH = 8.0, 8.0
"""Seconds of a ramp, and of a fault that nothing but coasting tells to its end."""

NOISE = {"clearance": 0.056, "relative_velocity": 0.023, "acceleration": 0.31}
"""Noise of the generated sensors in m, m/s and m/s^2, with the acceleration's slow deviation."""

BRAKING_PEAKS = (-2.5, -4.0, -6.0, -8.0)
"""m/s^2"""

SPECIAL = ("data-1", "data-2", "data-3", "cut-in", "stop-and-go", "hill", "bumps")
"""Healthy drives beside the normal ones."""

OTHER_SENSORS = ("coarse", "gnss", "exact")


@dataclass(frozen=True)
class Extent:
    """How much is run. Parameters were chosen on even seeds; these are odd."""

    normal: tuple[str, ...]
    seeds: tuple[int, ...]
    few: tuple[str, ...]
    starts: int
    healthy_seeds: tuple[int, ...]
    ablation: bool


def plain_extent() -> Extent:
    """What fits in a few minutes."""
    return Extent(NORMAL[6::14], (1,), NORMAL[13:14], 2, (1,), False)


def full_extent() -> Extent:
    """At least 500 windows of each offset."""
    return Extent(NORMAL, (1, 3), NORMAL[::5], 10, (1, 3, 5), True)


def spread(
    kind: str,
    values: Values,
    drives: tuple[str, ...],
    seeds: tuple[int, ...],
    length: float = LENGTH,
    signed: bool = True,
    **more,
) -> list[Run]:
    """Runs of one fault over normal drives; `signed`: every other one has the opposite sign."""
    runs = []
    for drive in drives:
        for seed in seeds:
            key = f"{drive}/{kind}/{values}"
            starts = fault_starts(key, seed, lead_profile(drive).duration, length)
            texts = fault_texts(kind, values, signed, starts, length)
            runs.append(Run(drive, seed, tuple(texts), **more))
    return runs


def table_3_runs(extent: Extent, values: Values, recorded: bool) -> list[Run]:
    """One of Table 3's faults on its drives, starts spread over the scan phase."""
    first = {"data-1": 40.0, "data-2": 40.0, "data-3": 40.0}
    if recorded:
        first[RECORDED] = RECORDED_RADAR_FIRST + 20.0
    return [
        Run(drive, 1, tuple(fault_texts("offset", values, False, [start + phase], 15.0)))
        for drive, start in first.items()
        for phase in phases(extent.starts)
    ]


def _braking(extent: Extent) -> list[Run]:
    return [
        Run("braking", seed, peak=peak) for seed in extent.healthy_seeds for peak in BRAKING_PEAKS
    ]


def healthy(extent: Extent, recorded: bool) -> list[Run]:
    """Drives on which nothing is to be found."""
    runs = [Run(name, seed) for seed in extent.healthy_seeds for name in (*extent.normal, *SPECIAL)]
    runs += _braking(extent)
    if recorded:
        runs += [Run(RECORDED, 0), Run(NEAREST, 0)]
    return runs


def recorded_sensors_healthy(extent: Extent) -> list[Run]:
    """Generated drives as the recorded sensors see them."""
    runs = [run for run in healthy(extent, False) if run.drive != "bumps"]
    return [replace(run, sensor=RECORDED_SENSORS) for run in runs]


def in_traffic(extent: Extent, sensor: str, drives: tuple[str, ...] = TRAFFIC) -> list[Run]:
    """Traffic, or such `drives`, as such sensors see it."""
    names = drives[:: len(NORMAL) // len(extent.normal)]
    return [Run(name, seed, sensor=sensor) for name in names for seed in extent.healthy_seeds]


def faults_in_traffic(
    extent: Extent,
    kind: str,
    values: Values,
    signed: bool,
    length: float = LENGTH,
    *,
    sensor: str,
    drives: tuple[str, ...] = TRAFFIC,
) -> list[Run]:
    """Faults in traffic, or such `drives`, as such sensors see it."""
    names = drives[:: 3 * len(NORMAL) // len(extent.normal)]
    given = {"signed": signed, "sensor": sensor}
    return spread(kind, values, names, extent.seeds[:1], length, **given)


def phones_in_traffic(extent: Extent) -> list[Run]:
    """Traffic as the recorded sensors see it, what a phone feels in the accelerometer's place."""
    return [run for view in PHONES for run in in_traffic(extent, view)]


def faults_by_phones_in_traffic(extent: Extent, values: Values) -> list[Run]:
    """Faults in such traffic."""
    return [
        run
        for view in PHONES
        for run in faults_in_traffic(extent, "offset", values, False, sensor=view)
    ]


def recorded_sensors(extent: Extent, values: Values, signed: bool) -> list[Run]:
    """Faults of normal drives as the recorded sensors see them."""
    given = {"signed": signed, "sensor": RECORDED_SENSORS}
    return spread("offset", values, extent.normal, extent.seeds, **given)


def braking_blind(extent: Extent) -> list[Run]:
    """Braking leads without the host's speed."""
    return [replace(run, host_speed=False) for run in _braking(extent)]


def other_sensors_healthy(extent: Extent, sensor: str) -> list[Run]:
    """Healthy drives as other sensors see them."""
    names = (*extent.few, "data-1", "data-2", "stop-and-go", "hill", "cut-in")
    return [Run(name, seed, sensor=sensor) for name in names for seed in extent.healthy_seeds[:2]]


def faults_of_other_sensors(extent: Extent, sensor: str, values: Values) -> list[Run]:
    """Faults of few normal drives as other sensors see them."""
    given = {"signed": False, "sensor": sensor}
    return spread("offset", values, extent.few, extent.seeds[:1], **given)


NEAREST_FAULTS = (14.0, 22.0, 30.0, 38.0, 46.0)
"""Starts of faults in the recorded drive's nearest target in s, each 5 s long."""


def nearest(values: Values) -> list[Run]:
    """Table 3's faults where the radar's ids change all the time."""
    texts = fault_texts("offset", values, False, NEAREST_FAULTS, 5.0)
    return [Run(NEAREST, 0, (text,)) for text in texts]


REAL = {
    RECORDED: (RECORDED_RADAR_FIRST, 59.9),
    **{f"{TRACK}{k}": (0.0, end) for k, end in enumerate((52.7, 47.8, 40.7, 26.3, 22.8, 21.1))},
}
"""Recorded leads that are followed for long enough: from when to when, in s of drive time."""

SHIFTS = (0.0, 3.0, 6.0)
"""Seconds by which faults are shifted, so that they lie all along a drive."""


def real(
    extent: Extent, kind: str, values: Values, signed: bool, length: float = LENGTH
) -> list[Run]:
    """Faults all along every recorded lead, forward and backward."""
    runs = []
    # Offsets are looked at more closely where not everything is run.
    shifts = extent.starts if kind == "offset" else extent.starts // 3 + 1
    for drive, (first, last) in REAL.items():
        for shift in SHIFTS[:shifts]:
            for view, begin in (("", first), (BACKWARD, 0.0)):
                starts = []
                start = begin + WARM_UP + shift
                while start + length + BLAMED_FOR_S < begin + last - first:
                    starts.append(start)
                    start += length + PAUSE
                if starts:
                    texts = fault_texts(kind, values, signed, starts, length)
                    runs.append(Run(f"{view}{drive}", 1, tuple(texts)))
    return runs


def views(extent: Extent) -> list[Run]:
    """The recorded car behind all its leads, as if it had other sensors."""
    leads = (RECORDED, *(f"{TRACK}{k}" for k in range(TRACK_COUNT)))
    return [Run(lead, 0, sensor=view) for view in VIEWS for lead in leads[:: 10 // extent.starts]]


def faults_in_views(extent: Extent, values: Values) -> list[Run]:
    """Faults all along those of its leads that last."""
    runs = as_driven(real(extent, "offset", values, signed=False))
    return [replace(run, sensor=view) for view in VIEWS for run in runs]


def as_driven(runs: list[Run]) -> list[Run]:
    """Those that are not played backward: what coasting relies on is how people drive."""
    return [run for run in runs if not run.drive.startswith(BACKWARD)]
