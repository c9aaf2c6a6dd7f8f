"""A drive: what the sensors of one car said, in the order in which it is played."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrival import AHEAD_NS, MAX_GAP_NS, MAX_GAP_PERIODS
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample

LATEST = 2**31
"""Stamps are below so many s: a message's seconds are a signed number of 32 bits."""


@dataclass(frozen=True)
class Drive:
    """`samples` in playing order; `zero` is the drive's time zero in ns: its earliest stamp."""

    name: str
    samples: Sequence[Sample]
    warnings: Sequence[str] = field(default=())

    @cached_property
    def zero(self) -> int:
        """Earliest stamp of any input in ns."""
        return min(sample.stamp for sample in self.samples)

    @property
    def duration(self) -> float:
        """From the earliest stamp to the latest one, in s."""
        return (max(sample.stamp for sample in self.samples) - self.zero) * 1e-9

    def count(self, name: str) -> int:
        """How many samples of one input there are."""
        return sum(sample.input == name for sample in self.samples)


def in_nanoseconds(seconds: float) -> int:
    """A stamp in ns."""
    return round(float(seconds) * 1e9)


def stamps_of(samples: Iterable[Sample]) -> NDArray[np.int64]:
    """Stamps (n,) of samples in ns."""
    return np.array([sample.stamp for sample in samples], np.int64)


def streams_of(samples: Iterable[Sample]) -> dict[str, list[Sample]]:
    """Samples by input, each in the order in which they are played."""
    streams: dict[str, list[Sample]] = {}
    for sample in samples:
        streams.setdefault(sample.input, []).append(sample)
    return streams


def make_drive(name: str, streams: dict[str, list[Sample]]) -> Drive:
    """Merge streams, each in the order of its recording, into one drive.

    Raises UserError where there is no radar or no acceleration sample at all.
    """
    for needed in (RADAR, ACCELERATION):
        lack = nothing_of(needed, streams)
        if lack:
            counts = {k: sum(map(_says_something, v)) for k, v in streams.items()}
            there = ", ".join(f"{count} of {k}" for k, count in counts.items() if count)
            raise UserError(
                f"{name}: {lack}; a drive needs radar and acceleration, "
                f"this one has {there or 'nothing'}"
            )
    return Drive(name, tuple(_merge(streams)), tuple(_oddities(streams)))


def _merge(streams: dict[str, list[Sample]]) -> list[Sample]:
    """All samples by stamp, within each stretch of time (`_epochs`)."""
    stamps = {name: stamps_of(own) for name, own in streams.items()}
    if all((np.diff(own) >= 0).all() for own in stamps.values()):
        # As nearly every drive is: nothing to be sorted out before it is sorted.
        samples = [sample for own in streams.values() for sample in own]
        last = np.repeat([name == ACCELERATION for name in streams], [*map(len, streams.values())])
        order = np.lexsort((last, np.concatenate([*stamps.values()])))
        return [samples[k] for k in order.tolist()]
    epochs = _epochs(streams)
    keyed = []
    for name, stream in streams.items():
        newest, epoch = 0, -1
        for i, (sample, own_epoch) in enumerate(zip(stream, epochs[name], strict=True)):
            # A stamp that does not fit stays where it was recorded; the sampler judges it.
            if own_epoch != epoch:
                newest, epoch = sample.stamp, own_epoch
            elif not _skips_ahead(sample.stamp, newest, stream[i + 1 : i + 2]):
                newest = max(newest, sample.stamp)
            keyed.append((epoch, newest, name == ACCELERATION, len(keyed), sample))
    keyed.sort(key=lambda entry: entry[:4])
    return [entry[4] for entry in keyed]


def _skips_ahead(stamp: int, newest: int, following: Sequence[Sample]) -> bool:
    """Whether one stamp alone lies far ahead of its neighbours."""
    return stamp > newest + AHEAD_NS and any(s.stamp < stamp - AHEAD_NS for s in following)


def playing_times(samples: Sequence[Sample]) -> list[int]:
    """When each sample of a drive is played, in ns since the first one; never decreasing.

    Where time starts again the new stretch follows at once; single wrong stamps do not count.
    """
    times: list[int] = []
    newest = samples[0].stamp if samples else 0
    elapsed = 0
    for i, sample in enumerate(samples):
        following = samples[i + 1 : i + 2]
        starts_again = sample.stamp < newest - AHEAD_NS and all(
            s.stamp < newest - AHEAD_NS for s in following
        )
        if starts_again:
            newest = sample.stamp
        elif sample.stamp > newest and not _skips_ahead(sample.stamp, newest, following):
            elapsed += sample.stamp - newest
            newest = sample.stamp
        times.append(elapsed)
    return times


def _epochs(streams: dict[str, list[Sample]]) -> dict[str, list[int]]:
    """For each sample how often time has started again before it.

    Time starts again where radar and acceleration step back by over a second, as in a looped
    recording; any other input has its part in as many of the loops as it steps back in itself.
    """
    steps_back = {
        name: [
            i
            for i in range(1, len(stream))
            if stream[i].stamp < stream[i - 1].stamp - AHEAD_NS
            and (i + 1 == len(stream) or stream[i + 1].stamp < stream[i - 1].stamp)
        ]
        for name, stream in streams.items()
        if stream
    }
    loops = min(len(steps_back[name]) for name in (RADAR, ACCELERATION))
    epochs = {}
    for name, stream in streams.items():
        boundaries = set(steps_back.get(name, [])[:loops])
        epoch, own = 0, []
        for i in range(len(stream)):
            epoch += i in boundaries
            own.append(epoch)
        epochs[name] = own
    return epochs


def _oddities(streams: dict[str, list[Sample]]) -> Iterable[str]:
    """What is accepted, counted and warned of."""
    for name, stream in streams.items():
        bad = sum(not _finite(sample) for sample in stream)
        if bad:
            yield f"{bad} {name} samples are NaN or infinite and count as no sample"
        gaps = np.diff(stamps_of(stream))
        for what, count in (("backward", (gaps < 0).sum()), ("repeated", (gaps == 0).sum())):
            if count:
                yield f"{count} {name} stamps are {what}"
        long = gaps[gaps > _longest_usual(gaps)]
        if len(long):
            yield f"{name} has {len(long)} gaps of up to {long.max() * 1e-9:.2f} s"


def _longest_usual(gaps: NDArray[np.int64]) -> float:
    """Time in ns between stamps beyond which it is a gap: across one in all inputs no step is
    made."""
    forward = gaps[gaps > 0]
    period = float(np.median(forward)) if len(forward) else 0.0
    return min(max(MAX_GAP_NS, MAX_GAP_PERIODS * period), AHEAD_NS)


def partly_there(streams: dict[str, list[Sample]]) -> Iterable[str]:
    """Inputs of the car itself that begin late or end early, in words.

    First and last are those recorded so: one wrong stamp between them does not count.
    """
    spans = {
        name: (stream[0].stamp, stream[-1].stamp)
        for name in (RADAR, ACCELERATION, HOST_SPEED)
        if (stream := streams.get(name))
    }
    begin = min((first for first, _ in spans.values()), default=0)
    end = max((last for _, last in spans.values()), default=0)
    for name, (first, last) in spans.items():
        if first - begin > AHEAD_NS:
            yield f"{name} begins {(first - begin) * 1e-9:.2f} s after the drive does"
        if end - last > AHEAD_NS:
            yield f"{name} ends {(end - last) * 1e-9:.2f} s before the drive does"


def nothing_of(name: str, streams: dict[str, list[Sample]]) -> str:
    """That there is no sample of an input, in words; empty where there is one."""
    stream = streams.get(name, ())
    if any(map(_says_something, stream)):
        return ""
    empty = f": each of its {len(stream)} is NaN or infinite, which is none" if stream else ""
    return f"no {name} sample at all{empty}"


def _says_something(sample: Sample) -> bool:
    """Whether there is anything finite in a sample; that the road is empty is something, too."""
    if isinstance(sample, RadarSample):
        said = (sample.clearance, sample.relative_velocity)
        return not sample.has_target or any(map(isfinite, said))
    return isfinite(sample.value)


def _finite(sample: Sample) -> bool:
    if isinstance(sample, RadarSample):
        return not sample.has_target or (
            isfinite(sample.clearance) and isfinite(sample.relative_velocity)
        )
    return isfinite(sample.value)
