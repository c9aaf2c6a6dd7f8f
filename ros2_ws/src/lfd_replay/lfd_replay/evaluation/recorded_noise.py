"""Generated leads as the recorded car's own sensors would see them: hours of real sensors.

What the recorded radar, accelerometer and speed are off by is taken from the recording and put on
generated drives: wandering from one part of a car to another, steps, bumps and crests as they were.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, ScalarSample
from lfd_replay.drive import Drive, make_drive
from lfd_replay.evaluation.cases import RECORDED, load_drive
from lfd_replay.evaluation.recorded_tracks import recorded_tracks
from lfd_replay.evaluation.recorded_views import View, felt_by, tabled
from lfd_replay.generated.generate import drive_truth
from lfd_replay.generated.lead_profiles import IN_TRAFFIC
from lfd_replay.generated.sensor_models import FeltPlan, Radar, SensorSuite, Speedometer, SpeedPlan

RECORDED_SENSORS = "recorded"
"""The recorded sensors, among the names of sensor suites."""

ROUGHER_SENSORS = "recorded, rougher"
"""The same on a worse road, behind leads that are harder to see."""

FARTHER_OFF = {RECORDED_SENSORS: 1.0, ROUGHER_SENSORS: 1.5}
"""How many times farther they are off than recorded."""

SUITE = SensorSuite(
    radar=Radar(clearance_step=0.04, velocity_step=0.025, outlier_period=None),
    speedometer=Speedometer(step=0.0028),
)
"""Their steps in m and m/s; what they are off by is not drawn."""

LASTING = 150
"""Scans that a track must last to tell how it wanders."""

SMOOTH_SCANS, SMOOTH_SPEEDS = 13, 45
"""Samples of the relative velocity and of the speed that a parabola is put through: their noise is
what lies beside it."""

LOST, GAPS, GAP_SCANS = 0.01, 0.0008, (2, 30)
"""Share of a radar's scans that are lost in traffic one by one, share from which some more are, and
how many."""

JOINED = 600
"""Scans over which one track's wandering goes over into the next one's."""

ROAD, ROLLING = 1.0, 2.0
"""Seconds of which the mean is no road's shaking, and m/s from which on a road shakes as it did."""

AS_RECORDED = View()
"""The recorded car's own accelerometer, every sensor speaking for itself."""


def recorded_sensors_drive(
    folder: Path,
    name: str,
    seed: int,
    peak: float | None = None,
    view: View = AS_RECORDED,
    rougher: float = 1.0,
) -> Drive:
    """A generated drive of that name, the same for the same seed; what sensors are off by is so
    many times larger than recorded. Raises UserError."""
    truth = drive_truth(name, peak)
    generator = np.random.default_rng([seed, crc32(name.encode())])
    plan = SUITE.plan(float(truth.time[-1]), len(truth.bumps), seed, name)
    clearance, velocity = _joined(_tracks_off(folder), len(plan.radar.times), generator)
    at = np.interp(plan.radar.times, truth.time, truth.clearance)
    clearance = _before_the_bumper(rougher * clearance, at)
    (felt_at, slow, shaking), speed = _host_off(folder, view)
    begin = generator.uniform(0.0, 2.0 * felt_at[-1])
    times, slow = _mirrored(felt_at, slow, begin, truth.time[-1], 1.0)
    _, shaking = _mirrored(felt_at, shaking, begin, truth.time[-1], 1.0)
    rolling = np.interp(times, truth.time, truth.host_speed / ROLLING).clip(max=1.0)
    felt_plan = FeltPlan(
        times, rolling * rougher * shaking, rougher * slow, plan.acceleration.swings
    )
    times, noise = _mirrored(*speed, begin, truth.time[-1], -1.0)
    scans = SUITE.radar.scans(
        truth, replace(plan.radar, clearance_noise=clearance, velocity_noise=rougher * velocity)
    )
    if name in IN_TRAFFIC:
        seen = _seen(len(scans), generator)
        scans = [scan for scan, there in zip(scans, seen, strict=True) if there]
    drive = make_drive(
        name,
        {
            RADAR: scans,
            ACCELERATION: SUITE.accelerometer.samples(truth, felt_plan),
            HOST_SPEED: SUITE.speedometer.samples(truth, SpeedPlan(times, rougher * noise, 1.0)),
        },
    )
    return Drive(drive.name, tabled(view, drive.samples))


@cache
def _tracks_off(folder: Path) -> list[tuple[Array, Array]]:
    """By how much each lasting track's clearance (m) lies beside the path that its relative
    velocity makes, a straight line taken out, and the relative velocity (m/s) beside itself."""
    from scipy.signal import detrend, savgol_filter

    found = []
    for track in recorded_tracks(folder):
        if len(track) < LASTING:
            continue
        times = np.array([scan.stamp for scan in track]) * 1e-9
        velocity = np.array([scan.relative_velocity for scan in track])
        path = np.append(0.0, np.cumsum(np.diff(times) * (velocity[1:] + velocity[:-1]) / 2))
        beside = detrend(np.array([scan.clearance for scan in track]) - path)
        found.append((beside, velocity - savgol_filter(velocity, SMOOTH_SCANS, 2)))
    return found


@cache
def _host_off(folder: Path, view: View) -> tuple[tuple[Array, Array, Array], tuple[Array, Array]]:
    """By how much the accelerometer (m/s^2) is off the smooth speed's derivative, slowly and as the
    road shakes it, and the speed (m/s) off the smooth one: times in s from a common zero, and
    values."""
    from scipy.ndimage import uniform_filter1d
    from scipy.signal import savgol_filter

    samples = felt_by(view, load_drive(RECORDED, folder).samples, folder)
    samples = [s for s in samples if isinstance(s, ScalarSample)]
    (felt_at, felt), (speed_at, speed) = (
        np.array([(s.stamp * 1e-9, s.value) for s in samples if s.input == name]).T
        for name in (ACCELERATION, HOST_SPEED)
    )
    period = SUITE.speedometer.period
    grid = np.arange(speed_at[0], speed_at[-1], period)
    even = np.interp(grid, speed_at, speed)
    smooth = savgol_filter(even, SMOOTH_SPEEDS, 2)
    derivative = savgol_filter(even, SMOOTH_SPEEDS, 2, deriv=1, delta=period)
    first, last = grid[SMOOTH_SPEEDS], grid[-SMOOTH_SPEEDS]
    cut = []
    for at, off in (
        (felt_at, felt - np.interp(felt_at, grid, derivative)),
        (speed_at, speed - np.interp(speed_at, grid, smooth)),
    ):
        inside = (at >= first) & (at <= last)
        cut.append((at[inside] - first, off[inside]))
    felt_at, off = cut[0]
    slow = uniform_filter1d(off, round(ROAD / np.diff(felt_at).mean()))
    return (felt_at, slow, off - slow), cut[1]


def _joined(
    parts: list[tuple[Array, Array]], count: int, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Tracks one after the other, forward or backward, nearer or farther; each goes on from where
    the one before ended."""
    clearance, velocity = np.zeros(1), np.zeros(1)
    while len(clearance) <= count:
        beside, noise = parts[generator.integers(len(parts))]
        way = int(generator.choice((-1, 1)))
        beside = generator.choice((-1.0, 1.0)) * beside[::way]
        fading = np.exp(-np.arange(len(beside)) / JOINED)
        beside = beside + (clearance[-1] - beside[0]) * fading
        clearance = np.append(clearance, beside)
        velocity = np.append(velocity, noise[::way])
    return clearance[1 : count + 1], velocity[1 : count + 1]


def _seen(count: int, generator: np.random.Generator) -> NDArray[np.bool_]:
    """Which of so many scans are not lost."""
    seen = generator.random(count) >= LOST
    for first in np.flatnonzero(generator.random(count) < GAPS):
        seen[first : first + generator.integers(*GAP_SCANS)] = False
    return seen


def _before_the_bumper(beside: Array, clearance: Array) -> Array:
    """No part of a car that is seen lies nearer than half of its clearance."""
    free = 0.25 * clearance
    return np.maximum(beside, -free - free * np.tanh((-beside - free).clip(0.0) / free))


def _mirrored(
    times: Array, values: Array, begin: float, duration: float, back: float
) -> tuple[Array, Array]:
    """So many s of samples from `begin` on, forward and back again and so on, those of the way back
    times `back`: the speed's -1, so that its derivative goes with what was felt both ways."""
    whole = times[-1]
    there_and_back = np.append(times, 2.0 * whole - times[-2:0:-1])
    rounds = int((begin + duration) / (2.0 * whole)) + 1
    at = np.concatenate([there_and_back + 2.0 * whole * k for k in range(rounds)]) - begin
    said = np.tile(np.append(values, back * values[-2:0:-1]), rounds)
    inside = (at > 0.0) & (at < duration)
    return at[inside], said[inside]
