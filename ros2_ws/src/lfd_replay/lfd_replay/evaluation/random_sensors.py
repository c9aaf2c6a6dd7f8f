"""Traffic as cars with sensors of their own see it: every drive draws other ones.

Rates, delays, noises, steps and habits that sensors of cars have, each drawn by itself between what
is good and what is bad.
"""

from dataclasses import dataclass, replace
from math import nan
from typing import TypeVar
from zlib import crc32

import numpy as np

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample
from lfd_replay.drive import Drive, make_drive
from lfd_replay.evaluation.recorded_views import joined
from lfd_replay.generated.generate import drive_truth
from lfd_replay.generated.sensor_models import (
    Accelerometer,
    Noise,
    Radar,
    SensorSuite,
    Speedometer,
)

Value = TypeVar("Value")

RANDOM_SENSORS = "random"
"""Such sensors, among the names of sensor suites."""

BUMP_PERIOD = 20.0
"""Seconds between two bumps, on average."""


@dataclass(frozen=True)
class _Draw:
    """Numbers between two limits: evenly spread, or their logarithms; or one of some."""

    generator: np.random.Generator

    def even(self, least: float, most: float) -> float:
        return float(self.generator.uniform(least, most))

    def ratio(self, least: float, most: float) -> float:
        return float(np.exp(self.generator.uniform(np.log(least), np.log(most))))

    def one(self, *values: Value) -> Value:
        return values[int(self.generator.integers(len(values)))]


@dataclass(frozen=True)
class Habits:
    """What sensors do beside being noisy.

    `lost`: share of scans in which the radar sees no lead; `felt_step`: the accelerometer's step in
    m/s^2; `dead`: m/s below which the speed says zero; `in_table`: whether everything is joined
    into one table at the times of the scans.
    """

    lost: float
    felt_step: float
    dead: float
    in_table: bool


def draw_sensors(generator: np.random.Generator) -> tuple[SensorSuite, Habits]:
    """The sensors of one car."""
    draw = _Draw(generator)
    radar = Radar(
        period=draw.one(0.04, 0.05, 0.05, 1 / 15, 0.1),
        lateness=draw.ratio(0.0003, 0.003),
        delay=draw.even(0.0, 0.15),
        clearance_noise=draw.ratio(0.02, 0.2),
        clearance_memory=draw.even(0.0, 0.8),
        clearance_step=draw.one(0.01, 0.04, 0.0625, 0.1, 0.125, 0.25),
        velocity_noise=draw.ratio(0.01, 0.12),
        velocity_memory=draw.even(0.0, 0.7),
        velocity_step=draw.one(0.01, 0.025, 0.0625, 0.125, 0.25),
        outlier_period=draw.one((10.0, 20.0), (45.0, 75.0)),
        outlier=draw.ratio(0.5, 5.0),
    )
    period = draw.one(0.01, 0.01, 0.012, 0.02, 0.04, 0.05)
    fastest = min(20.0, 0.45 / period)
    accelerometer = Accelerometer(
        period=period,
        noise=Noise(
            draw.ratio(0.01, 0.25), draw.ratio(0.02, 0.3), (draw.even(0.3, 0.6) * fastest, fastest)
        ),
        bias=draw.even(-0.5, 0.5),
        wander=draw.ratio(0.05, 0.4),
        wander_time=draw.ratio(3.0, 20.0),
        pitch=draw.even(0.0, 0.005),
        bump=draw.ratio(0.5, 4.0),
        lag=draw.even(0.0, 0.12),
    )
    period = draw.one(0.01, 0.012, 0.012, 0.02, 0.05, 0.1)
    noise = draw.ratio(0.003, 0.04)
    speedometer = Speedometer(
        period=period,
        lag=draw.even(0.0, 0.12),
        scale=0.02,
        noise=Noise(0.5 * noise, 0.85 * noise, (1.5, min(13.0, 0.45 / period))),
        step=draw.one(0.0028, 0.01, 0.01, 0.0625, 0.1, 1 / 3.6),
    )
    habits = Habits(
        lost=draw.one(0.0, 0.0, 0.01, 0.03),
        felt_step=draw.one(0.0, 0.0, 0.01, 0.05, 0.1),
        dead=draw.one(0.0, 0.0, 0.3, 0.6, 1.0),
        in_table=draw.one(False, False, False, True),
    )
    return SensorSuite(radar, accelerometer, speedometer), habits


def random_sensors_drive(name: str, seed: int, peak: float | None = None) -> Drive:
    """A generated drive of that name, the same for the same seed. Raises UserError."""
    generator = np.random.default_rng([seed, crc32(f"{RANDOM_SENSORS}/{name}".encode())])
    suite, habits = draw_sensors(generator)
    truth = drive_truth(name, peak)
    bumps = generator.uniform(0.0, truth.time[-1], generator.poisson(truth.time[-1] / BUMP_PERIOD))
    truth = replace(truth, bumps=tuple(np.sort(bumps).tolist()))
    sensed = suite.sense(truth, seed, name)
    lost = generator.random(len(sensed[RADAR])) < habits.lost
    sensed[RADAR] = [
        RadarSample(scan.stamp, False, nan, nan) if gone else scan
        for scan, gone in zip(sensed[RADAR], lost, strict=True)
    ]
    if habits.felt_step:
        sensed[ACCELERATION] = [_stepped(s, habits.felt_step) for s in sensed[ACCELERATION]]
    sensed[HOST_SPEED] = [
        replace(s, value=0.0 if s.value < habits.dead else s.value) for s in sensed[HOST_SPEED]
    ]
    drive = make_drive(name, sensed)
    return Drive(drive.name, joined(drive.samples, 1)) if habits.in_table else drive


def _stepped(sample: Sample, step: float) -> Sample:
    return replace(sample, value=round(sample.value / step) * step)
