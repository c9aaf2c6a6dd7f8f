"""Segments of the comma2k19 data set, as they are downloaded: a folder of numpy arrays.

The layout is described in the README of that data set. Each log holds times in `t` (s) and values
in `value`; the radar's rows are forward distance (m), left distance (m), relative speed (m/s),
two unused columns, the track's address, and whether it is a new track. The windshield phone's
accelerometer gives forward, right and down.
"""

from collections import Counter
from math import isfinite
from pathlib import Path

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, Sample, ScalarSample
from lfd_replay.drive import LATEST, in_nanoseconds
from lfd_replay.recordings.lead_selection import HostMotion, LeadSelector, Track
from lfd_replay.recordings.recorded_messages import Mounting

LOG = "processed_log"
SPEED = ("CAN/speed", "CAN/car_speed")
RADAR_TRACKS = ("CAN/radar",)
ACCELEROMETER = ("IMU/accelerometer", "IMU/acceleration")
YAW = ("IMU/gyro", "IMU/gyro_uncalibrated")
"""Where each signal is, under its names in the data and in its description."""

DISTANCE, LEFT, RATE, ADDRESS = 0, 1, 2, 5
"""Columns of the radar."""

SCAN_GAP = 0.02
"""Tracks further apart in s belong to two scans."""


def is_segment(path: Path) -> bool:
    """Whether a folder is a segment, or its processed log."""
    return (path / LOG).is_dir() or (path / "CAN").is_dir()


def read_segment_streams(
    path: Path, mounting: Mounting
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The streams of a segment, and what is to be said of it.

    Raises UserError where a log is missing or damaged.
    """
    folder = path / LOG if (path / LOG).is_dir() else path
    counts: Counter[str] = Counter()
    speed_time, speed = _log(folder, SPEED, 1)
    streams: dict[str, list[Sample]] = {
        RADAR: _radar(folder, mounting, speed_time, speed[:, 0], counts),
        HOST_SPEED: [
            ScalarSample(HOST_SPEED, in_nanoseconds(t), float(v))
            for t, v in zip(speed_time, speed[:, 0], strict=True)
        ],
        ACCELERATION: [],
    }
    if _there(folder, ACCELEROMETER) is not None:
        time, felt = _log(folder, ACCELEROMETER, 3)
        # Forward, right, down; a sensor in a car is forward, left, up.
        streams[ACCELERATION] = [
            ScalarSample(ACCELERATION, in_nanoseconds(t), mounting.forward(x, -y, -z))
            for t, (x, y, z) in zip(time, felt[:, :3].tolist(), strict=True)
        ]
    return streams, [f"{count} {what}" for what, count in counts.items() if count]


def _radar(
    folder: Path, mounting: Mounting, speed_time: Array, speed: Array, counts: Counter[str]
) -> list[Sample]:
    time, tracks = _log(folder, RADAR_TRACKS, ADDRESS + 1)
    selector, motion, samples = LeadSelector(counts), HostMotion(), []
    yaw_time, yaw = np.empty(0), np.empty(0)
    if _there(folder, YAW) is not None:
        yaw_time, gyro = _log(folder, YAW, 3)
        # About forward, right and down, as the accelerometer.
        yaw = np.array([mounting.yaw_rate(x, -y, -z) for x, y, z in gyro[:, :3].tolist()])
    for rows in np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > SCAN_GAP) + 1):
        if not len(rows):
            continue
        now = time[rows[-1]]
        scan = [
            Track(int(row[ADDRESS]), row[DISTANCE], row[LEFT], row[RATE])
            for row in tracks[rows].tolist()
            if isfinite(row[DISTANCE]) and isfinite(row[ADDRESS])
        ]
        motion.hear(
            float(np.interp(now, speed_time, speed)) if len(speed) else None,
            float(np.interp(now, yaw_time, yaw)) if len(yaw) else None,
        )
        samples.append(selector.select(in_nanoseconds(now), scan, motion.speed, motion.yaw_rate))
    return samples


def _there(folder: Path, names: tuple[str, ...]) -> Path | None:
    return next((folder / name for name in names if (folder / name / "t").is_file()), None)


def _log(folder: Path, names: tuple[str, ...], columns: int) -> tuple[Array, Array]:
    """Times of one log and its values, in rows of at least so many columns. Raises UserError."""
    log = _there(folder, names)
    if log is None:
        there = ", ".join(
            sorted(str(file.parent.relative_to(folder)) for file in folder.glob("*/*/t"))
        )
        raise UserError(f"{folder}: no log {names[0]}; there are: {there or 'none'}")
    try:
        time = np.load(log / "t", allow_pickle=False).astype(float)
        value = np.load(log / "value", allow_pickle=False).astype(float)
    except Exception as error:  # whatever a damaged file makes a parser raise
        detail = " ".join(str(error).split())[:200]
        raise UserError(f"{log}: cannot be read as numpy arrays ({detail})") from error
    if value.size == 0:
        value = np.empty((0, columns))
    elif value.ndim == 1:
        value = value[:, None]
    if time.ndim != 1 or value.ndim != 2 or value.shape[1] < columns:
        raise UserError(
            f"{log}: times of shape {time.shape} and values of shape {value.shape}; a row of times "
            f"and rows of at least {columns} values are expected"
        )
    if len(time) != len(value):
        raise UserError(f"{log}: {len(time)} times and {len(value)} values; as many are expected")
    wrong = np.flatnonzero(~(np.abs(time) < LATEST))
    if len(wrong):
        raise UserError(
            f"{log}: time {wrong[0] + 1} is {time[wrong[0]]}; s, finite and below {LATEST}, are "
            "expected"
        )
    return time, value
