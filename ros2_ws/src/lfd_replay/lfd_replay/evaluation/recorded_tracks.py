"""Every track of the recorded radar as a drive of its own: many cars, real radar, one host."""

import csv
from dataclasses import dataclass, replace
from functools import cache
from math import nan
from pathlib import Path

from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, RadarSample, Sample, playing_order
from lfd_replay.drive import Drive
from lfd_replay.evaluation.cases import RECORDED, load_drive

TRACK = "track "
"""A track of the recorded radar by itself; its number follows."""

TRACK_ID = "id "
"""All that the recorded radar saw under one of its ids, one target after another; it follows."""

TRACK_IDS = tuple(range(528, 542))
"""Those ids."""

LANE = "lane "
"""The nearest target in a lane, and nothing where there is none: where its middle lies to the right
in m, and how far from there to either side, follow."""

LANES = tuple(
    f"{LANE}{middle} {half}"
    for middle in (-7.0, -5.4, -3.6, -1.8, 1.8, 3.6, 5.4, 7.0)
    for half in (1.0, 1.8, 3.0)
)
"""Lanes beside the own one, and wider and narrower ones."""

BACKWARD = "backward "
"""A recorded drive played from its end to its beginning; its name follows."""

TRACK_COUNT = 33
"""Tracks of the recorded radar that are long enough."""

SHORTEST, GAP, JUMP = 3.0, 0.3, 6.0
"""Seconds that a track must last; s of silence, and m between two scans, that end it: the radar
gives its few track ids again and again."""


@dataclass(frozen=True)
class _Seen:
    """One target of one scan; `lateral` in m to the right, `is_first`: the radar calls it new."""

    sample: RadarSample
    lateral: float
    is_first: bool


@cache
def _all_seen(folder: Path) -> list[_Seen]:
    """Every target of every scan."""
    with (folder / f"{RECORDED}.radar_alltracks.csv").open() as file:
        return [
            _Seen(
                RadarSample(
                    stamp=round(float(row["t_s"]) * 1e9),
                    has_target=True,
                    clearance=float(row["range_m"]),
                    relative_velocity=float(row["range_rate_mps"]),
                    track_id=int(row["track_addr"]),
                ),
                float(row["lateral_m"]),
                row["new_track"] == "1",
            )
            for row in csv.DictReader(file)
        ]


@cache
def _scans_by_id(folder: Path) -> dict[int, list[tuple[RadarSample, bool]]]:
    """Every scan of every id, and whether the radar calls it a new target's first."""
    by_id: dict[int, list[tuple[RadarSample, bool]]] = {}
    for seen in _all_seen(folder):
        by_id.setdefault(seen.sample.track_id, []).append((seen.sample, seen.is_first))
    return by_id


@cache
def recorded_tracks(folder: Path) -> list[list[RadarSample]]:
    """The tracks, longest first; stamps in the time of the recording's files."""
    tracks: list[list[RadarSample]] = []
    for scans in _scans_by_id(folder).values():
        last = None
        for sample, is_first in scans:
            if (
                last is None
                or is_first
                or sample.stamp - last.stamp > GAP * 1e9
                or abs(sample.clearance - last.clearance) > JUMP
            ):
                tracks.append([])
            tracks[-1].append(sample)
            last = sample
    lasting = [t for t in tracks if t[-1].stamp - t[0].stamp > SHORTEST * 1e9]
    return sorted(lasting, key=lambda t: t[0].stamp - t[-1].stamp)


def track_drive(folder: Path, number: int) -> Drive:
    """A drive behind one track, 0 = the longest. Raises UserError for a number there is not."""
    tracks = recorded_tracks(folder)
    if number >= len(tracks):
        raise UserError(f"{folder}: track {number} of {len(tracks)} in the recording")
    return _followed(f"{TRACK}{number}", folder, tracks[number])


def track_id_drive(folder: Path, track_id: int) -> Drive:
    """A drive behind whatever the radar gives that id, one of `TRACK_IDS`."""
    scans = [sample for sample, _ in _scans_by_id(folder)[track_id]]
    return _followed(f"{TRACK_ID}{track_id}", folder, scans)


def lane_drive(folder: Path, name: str) -> Drive:
    """A drive behind whatever is nearest in a lane, one of `LANES`."""
    middle, half = map(float, name.removeprefix(LANE).split())
    nearest: dict[int, RadarSample] = {}
    for seen in _all_seen(folder):
        sample = seen.sample
        nothing = RadarSample(sample.stamp, False, nan, nan)
        best = nearest.setdefault(sample.stamp, nothing)
        inside = abs(seen.lateral - middle) < half
        if inside and not best.clearance <= sample.clearance:
            nearest[sample.stamp] = sample
    return _followed(name, folder, list(nearest.values()))


def _followed(name: str, folder: Path, track: list[RadarSample]) -> Drive:
    """The recorded host behind a track."""
    first, last = track[0].stamp, track[-1].stamp
    host = [s for s in load_drive(RECORDED, folder).samples if not isinstance(s, RadarSample)]
    samples: list[Sample] = [*(s for s in host if first <= s.stamp <= last), *track]
    return Drive(name, sorted(samples, key=playing_order))


def backward(drive: Drive) -> Drive:
    """A drive from its end to its beginning: another drive, with the same sensors.

    What came nearer goes away, what braked speeds up. Clearances and speeds stay what they are, so
    that real sensors keep their noise, their steps and their wandering.
    """
    first, last = drive.zero, drive.zero + round(drive.duration * 1e9)
    samples: list[Sample] = []
    for sample in drive.samples:
        stamp = first + last - sample.stamp
        if isinstance(sample, RadarSample):
            velocity = -sample.relative_velocity
            samples.append(replace(sample, stamp=stamp, relative_velocity=velocity))
        elif sample.input == ACCELERATION:
            samples.append(replace(sample, stamp=stamp, value=-sample.value))
        else:
            samples.append(replace(sample, stamp=stamp))
    return Drive(f"{BACKWARD}{drive.name}", sorted(samples, key=playing_order))
