"""What happens to healthy sensors now and then: a radar loses its lead, repeats itself or gives it
another id, and a sensor says nothing for a while. None of it is a fault of what they say."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample
from lfd_replay.faults import FaultInjector, parse_faults

FIRST, BETWEEN = (2.0, 20.0), (5.0, 20.0)
"""Seconds before the first mishap and between two, evenly drawn."""

UNSEEN = (0.2, 0.42)
"""Seconds for which a lead is not seen."""

REPEATED, MOST = 0.01, 4
"""Share of scans after which a radar repeats itself, and how often at most."""

IDS, PARTS, SEEN = 3, (0.0, 0.6), (0.05, 3.0)
"""Ids that a radar gives in turn to the parts of one car, m by which these lie farther off, and
seconds for which each is seen."""

SILENCES = (0.1, 0.2, 0.4, 0.8, 1.5, 3.0, 6.0)
"""Seconds for which a sensor says nothing; one of them."""


def loses_its_lead(samples: Sequence[Sample], generator: np.random.Generator) -> list[Sample]:
    """A radar goes on from what it knew of a target that it does not see: its relative velocity
    stays and its clearance goes on by it."""
    made: list[Sample] = []
    knew: RadarSample | None = None
    times = _times(samples, generator, lambda: generator.uniform(*UNSEEN))
    for sample in samples:
        if isinstance(sample, RadarSample):
            at = (sample.stamp - samples[0].stamp) * 1e-9
            unseen = any(begin <= at < end for begin, end in times)
            if unseen and knew and sample.has_target and knew.track_id == sample.track_id:
                velocity = knew.relative_velocity
                gone = velocity * (sample.stamp - knew.stamp) * 1e-9
                clearance = round(max(knew.clearance + gone, 0.0), 2)
                sample = replace(sample, clearance=clearance, relative_velocity=velocity)
            else:
                knew = sample if sample.has_target else None
        made.append(sample)
    return made


def repeats_itself(samples: Sequence[Sample], generator: np.random.Generator) -> list[Sample]:
    """A radar's last message comes again, under new stamps."""
    made: list[Sample] = []
    said: RadarSample | None = None
    more = 0
    for sample in samples:
        if isinstance(sample, RadarSample) and sample.has_target:
            if more and said and said.track_id == sample.track_id:
                more -= 1
                sample = replace(said, stamp=sample.stamp)
            else:
                said = sample
                again = generator.random() < REPEATED
                more = int(generator.integers(1, MOST + 1)) if again else 0
        made.append(sample)
    return made


def changes_its_id(samples: Sequence[Sample], generator: np.random.Generator) -> list[Sample]:
    """A radar sees now this, now that part of the car, each under an id of its own."""
    made: list[Sample] = []
    parts = np.round(generator.uniform(*PARTS, size=IDS), 2)
    part, until = 0, samples[0].stamp
    for sample in samples:
        if isinstance(sample, RadarSample) and sample.has_target:
            if sample.stamp >= until:
                part = int(generator.integers(IDS))
                until = sample.stamp + round(generator.uniform(*SEEN) * 1e9)
            clearance = round(sample.clearance + float(parts[part]), 2)
            track_id = IDS * (sample.track_id + 1) + part
            sample = replace(sample, clearance=clearance, track_id=track_id)
        made.append(sample)
    return made


def falls_silent(
    samples: Sequence[Sample], generator: np.random.Generator, name: str
) -> list[Sample]:
    """The sensor of that input says nothing now and then: dropouts, but none that anyone looks
    for."""
    times = _times(samples, generator, lambda: generator.choice(SILENCES))
    dropouts = parse_faults(f"dropout:{name}@{begin:.4f}-{end:.4f}" for begin, end in times)
    return FaultInjector(dropouts, samples[0].stamp, 0).apply(samples)


def _times(
    samples: Sequence[Sample], generator: np.random.Generator, seconds: Callable[[], float]
) -> list[tuple[float, float]]:
    """Beginnings and ends of mishaps all along a drive in s of its time; each lasts so long."""
    duration = (samples[-1].stamp - samples[0].stamp) * 1e-9
    times: list[tuple[float, float]] = []
    begin = generator.uniform(*FIRST)
    while begin < duration:
        times.append((begin, begin + seconds()))
        begin = times[-1][1] + generator.uniform(*BETWEEN)
    return times


CHANGING_IDS = "a radar whose ids change"

MISHAPS: dict[str, Callable[[Sequence[Sample], np.random.Generator], list[Sample]]] = {
    "a radar that loses its lead": loses_its_lead,
    "a radar that repeats itself": repeats_itself,
    CHANGING_IDS: changes_its_id,
    "a silent radar": partial(falls_silent, name=RADAR),
    "a silent accelerometer": partial(falls_silent, name=ACCELERATION),
    "a silent host speed": partial(falls_silent, name=HOST_SPEED),
}
"""By name: healthy samples in the order of their stamps, as they are with it."""
