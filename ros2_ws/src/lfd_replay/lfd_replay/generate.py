"""Generated drives: a lead profile, a human-like follower and the sensors of a car.

Where the figures come from:
- The follower is the intelligent driver model with a reaction time (Treiber, Kesting: Traffic Flow
  Dynamics, chapters 11 and 12); the powertrain is a first-order lag.
- The radar `esr`: 0.1 m and 0.01 m/s are the resolutions of the Delphi ESR's CAN frames. Noise of
  0.056 m and 0.023 m/s and scans every 44 to 58 ms, 50 ms on average, were read off a recorded
  radar. Single scans that are off, about once a minute, are an assumption.
- The accelerometer deviates slowly from the derivative of speed, by 0.3 m/s^2 rms on the recorded
  drive, mostly from road grade; this flatter road gets 0.15. Its bias, its noise and the 8 s over
  which the deviation changes are assumptions.
- The host speed comes at 83 Hz as on the recorded drive; its steps of 0.01 m/s, its lag of 50 ms
  and the wheel radius being off by up to 1 % are assumptions.
"""

from collections.abc import Callable
from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.errors import UserError
from lfd_mpc.sampling import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample, ScalarSample
from lfd_replay.drive import Drive, make_drive

Array = NDArray[np.float64]

DT = 0.01
"""Step of the simulation in s."""


@dataclass(frozen=True)
class Driver:
    """Intelligent driver model with reaction time."""

    desired_speed: float = 33.0  # m/s
    time_gap: float = 1.4  # s
    standstill_gap: float = 4.0  # m
    acceleration: float = 1.4  # m/s^2
    comfortable_braking: float = 2.0  # m/s^2
    reaction_time: float = 0.6  # s
    powertrain_lag: float = 0.3  # s

    def wanted(self, gap: float, speed: float, relative_velocity: float) -> float:
        """Acceleration in m/s^2 for a gap in m and speeds in m/s."""
        braking = 2.0 * np.sqrt(self.acceleration * self.comfortable_braking)
        dynamic = speed * self.time_gap - speed * relative_velocity / braking
        wanted_gap = self.standstill_gap + max(0.0, dynamic)
        return self.acceleration * (
            1.0 - (speed / self.desired_speed) ** 4 - (wanted_gap / max(gap, 0.1)) ** 2
        )

    def equilibrium_gap(self, speed: float) -> float:
        """Gap in m at which the driver neither accelerates nor brakes at a speed in m/s."""
        free = 1.0 - (speed / self.desired_speed) ** 4
        return (self.standstill_gap + speed * self.time_gap) / np.sqrt(free)


@dataclass(frozen=True)
class Truth:
    """What really happens, every 10 ms: arrays of equal length in s, m, m/s and m/s^2."""

    time: Array
    clearance: Array
    relative_velocity: Array
    host_speed: Array
    host_acceleration: Array
    lead_acceleration: Array


@dataclass(frozen=True)
class Profile:
    """A lead: duration in s, first speed in m/s and its acceleration over time in m/s^2."""

    duration: float
    speed: float
    acceleration: Callable[[Array], Array]


def _waves(*waves: tuple[float, float, float]) -> Callable[[Array], Array]:
    """Sum of (amplitude in m/s^2, period in s, phase in rad)."""

    def acceleration(time: Array) -> Array:
        return sum((a * np.sin(2 * np.pi * time / p + f) for a, p, f in waves), np.zeros(len(time)))

    return acceleration


def _with_braking(
    calm: Callable[[Array], Array], start: float, peak: float
) -> Callable[[Array], Array]:
    """Abrupt braking down to `peak` (m/s^2, negative) at `start` (s), ended 1.5 s later."""

    def acceleration(time: Array) -> Array:
        ramps = np.clip((time - start) / 0.4, 0, 1) - np.clip((time - start - 1.5) / 0.6, 0, 1)
        return calm(time) * (1 - ramps) + peak * ramps

    return acceleration


_CALM = _waves((0.5, 38.0, 0.3), (0.25, 17.0, 2.0), (0.1, 7.0, 4.0))

PROFILES = {
    "data-1": Profile(80.0, 14.0, _waves((0.6, 31.0, 0.0), (0.3, 13.0, 1.0), (0.12, 6.0, 2.5))),
    "data-2": Profile(80.0, 14.0, _waves((0.7, 43.0, 5.5), (0.3, 19.0, 1.1), (0.1, 8.0, 1.7))),
    "data-3": Profile(80.0, 18.0, _with_braking(_CALM, start=20.0, peak=-2.5)),
}
"""Lead profiles: two of normal car following, and one with abrupt braking at 20 s."""


def simulate(profile: Profile, driver: Driver) -> Truth:
    """Drive the follower behind the lead."""
    time = np.arange(0.0, profile.duration + DT / 2, DT)
    wanted_lead = profile.acceleration(time)
    delay = round(driver.reaction_time / DT)
    count = len(time)
    gap, host, lead = (np.empty(count) for _ in range(3))
    host_acceleration, lead_acceleration = np.zeros(count), np.empty(count)
    gap[0] = driver.equilibrium_gap(profile.speed)
    host[0] = lead[0] = profile.speed
    for k in range(count):
        # Nobody drives backwards.
        lead_acceleration[k] = wanted_lead[k] if lead[k] > 0.0 else max(wanted_lead[k], 0.0)
        if k + 1 == count:
            break
        seen = max(k - delay, 0)
        wanted = driver.wanted(gap[seen], host[seen], lead[seen] - host[seen])
        applied = host_acceleration[k]
        host_acceleration[k + 1] = applied + DT / driver.powertrain_lag * (wanted - applied)
        host[k + 1] = max(host[k] + DT * applied, 0.0)
        lead[k + 1] = max(lead[k] + DT * lead_acceleration[k], 0.0)
        gap[k + 1] = gap[k] + DT * (lead[k] - host[k])
    return Truth(time, gap, lead - host, host, host_acceleration, lead_acceleration)


@dataclass(frozen=True)
class EsrSuite:
    """A car with a Delphi ESR, an accelerometer and wheel speed."""

    scan_period: tuple[float, float, float] = (0.044, 0.048, 0.058)  # s: least, likeliest, most
    clearance_noise: float = 0.056  # m
    clearance_step: float = 0.1  # m
    velocity_noise: float = 0.023  # m/s
    velocity_step: float = 0.01  # m/s
    outlier_period: tuple[float, float] = (45.0, 75.0)  # s, evenly spread
    outlier: float = 1.5  # m, nearer or farther
    acceleration_period: float = 0.01  # s
    acceleration_jitter: float = 0.0005  # s
    acceleration_noise: float = 0.05  # m/s^2
    acceleration_bias: float = 0.05  # m/s^2
    acceleration_wander: float = 0.15  # m/s^2 rms
    acceleration_wander_time: float = 8.0  # s
    speed_period: float = 0.012  # s
    speed_step: float = 0.01  # m/s
    speed_lag: float = 0.05  # s
    speed_scale: float = 0.01  # largest relative error of the wheel radius

    def sense(self, truth: Truth, seed: int, name: str) -> dict[str, list[Sample]]:
        """What the sensors say about a drive, reproducibly from seed and name."""
        return {
            RADAR: self._radar(truth, _generator(seed, name, RADAR)),
            ACCELERATION: self._acceleration(truth, _generator(seed, name, ACCELERATION)),
            HOST_SPEED: self._host_speed(truth, _generator(seed, name, HOST_SPEED)),
        }

    def _radar(self, truth: Truth, generator: np.random.Generator) -> list[Sample]:
        times = self._scan_times(truth.time[-1], generator)
        clearance = np.interp(times, truth.time, truth.clearance)
        velocity = np.interp(times, truth.time, truth.relative_velocity)
        clearance += generator.normal(0.0, self.clearance_noise, len(times))
        velocity += generator.normal(0.0, self.velocity_noise, len(times))
        for k in self._outliers(times, generator):
            clearance[k] += self.outlier * generator.choice((-1.0, 1.0))
        clearance = _quantised(clearance, self.clearance_step)
        velocity = _quantised(velocity, self.velocity_step)
        return [
            RadarSample(_stamp(t), True, float(c), float(v), track_id=1)
            for t, c, v in zip(times, clearance, velocity, strict=True)
        ]

    def _scan_times(self, duration: float, generator: np.random.Generator) -> Array:
        """Times of all scans in s; a triangular spread, since the range is lopsided about 50 ms."""
        count = int(duration / self.scan_period[0])
        times = np.cumsum(generator.triangular(*self.scan_period, size=count))
        return times[times < duration]

    def _outliers(self, times: Array, generator: np.random.Generator) -> list[int]:
        """Indices of the scans that are off; far apart, so that each one stands alone."""
        # The first one may come at any time, as if the radar had been on before the drive.
        time = generator.uniform(0.0, self.outlier_period[1])
        found = []
        while time < times[-1]:
            found.append(int(np.searchsorted(times, time)))
            time += generator.uniform(*self.outlier_period)
        return found

    def _acceleration(self, truth: Truth, generator: np.random.Generator) -> list[Sample]:
        ideal = np.arange(round(truth.time[-1] / self.acceleration_period)) * (
            self.acceleration_period
        )
        times = ideal + generator.uniform(0.0, self.acceleration_jitter, len(ideal))
        value = np.interp(times, truth.time, truth.host_acceleration)
        keep = np.exp(-self.acceleration_period / self.acceleration_wander_time)
        wander = np.empty(len(times))
        # The road does not become uneven at the start of the drive only.
        wander[0] = generator.normal(0.0, self.acceleration_wander)
        pushes = generator.normal(0.0, self.acceleration_wander * np.sqrt(1 - keep**2), len(times))
        for k in range(1, len(times)):
            wander[k] = keep * wander[k - 1] + pushes[k]
        value += self.acceleration_bias + wander
        value += generator.normal(0.0, self.acceleration_noise, len(times))
        return [
            ScalarSample(ACCELERATION, _stamp(t), float(v))
            for t, v in zip(times, value, strict=True)
        ]

    def _host_speed(self, truth: Truth, generator: np.random.Generator) -> list[Sample]:
        scale = 1.0 + generator.uniform(-self.speed_scale, self.speed_scale)
        times = np.arange(self.speed_period, truth.time[-1], self.speed_period)
        speed = scale * np.interp(times - self.speed_lag, truth.time, truth.host_speed)
        return [
            ScalarSample(HOST_SPEED, _stamp(t), float(v))
            for t, v in zip(times, _quantised(speed, self.speed_step), strict=True)
        ]


SENSORS = {"esr": EsrSuite()}
"""Sensor suites by name."""


def generate_drive(name: str, seed: int, sensor: str) -> Drive:
    """A drive by name, the same for the same seed. Raises UserError for an unknown name."""
    if name not in PROFILES:
        raise UserError(f"make_drive: unknown drive '{name}'; there are: {', '.join(PROFILES)}")
    if sensor not in SENSORS:
        raise UserError(f"make_drive: unknown sensor '{sensor}'; there are: {', '.join(SENSORS)}")
    truth = simulate(PROFILES[name], Driver())
    return make_drive(name, SENSORS[sensor].sense(truth, seed, name))


def _generator(seed: int, *names: str) -> np.random.Generator:
    """A generator of its own for each signal; the checksum is the same in every process."""
    sequence = np.random.SeedSequence([seed, crc32("/".join(names).encode())])
    return np.random.default_rng(sequence)


def _quantised(values: Array, step: float) -> Array:
    return np.round(values / step) * step


def _stamp(seconds: float) -> int:
    return round(float(seconds) * 1e9)
