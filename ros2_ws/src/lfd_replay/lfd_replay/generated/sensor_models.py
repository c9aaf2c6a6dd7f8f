"""The sensors of a car: what they say of what really happens.

Where the figures come from. "Read off" means: off the recorded drive that the tests hold these
figures against (a Toyota RAV4 of 2016-18: radar, accelerometer 0x24, wheel speed, 60 s).

- Radar `esr`: 0.1 m and 0.01 m/s are the resolutions of the Delphi ESR's CAN frames. Read off: a
  deviation of 0.056 m and 0.023 m/s from a smooth curve, each with a correlation from scan to
  scan (0.5 and 0.33); scans that lie on a 50 ms grid and come late by 1.1 ms on average, at most
  6 ms, so that 44 to 56 ms lie between them. Assumed: 20 ms from measurement to stamp, and single
  scans that are off by 1.5 m about once a minute.
- Accelerometer: read off: a noise of 0.08 m/s^2 rms where the road is smooth, most of it between
  8 and 25 Hz where the body shakes, and a slow deviation from the derivative of speed of
  0.3 m/s^2 rms with a correlation time of 7 s. Gravity is felt through the road's grade and the
  body's pitch; the pitch of 0.003 rad per m/s^2 is an assumption, as is the bias. A bump is a
  burst at 12 Hz: the recorded windshield phone shows such bursts up to 9 m/s^2; a third of it is
  assumed for a sensor at the centre of the car. Rough road is left to the drive `bumps`.
- Host speed: read off: 83 Hz and a noise of 0.013 m/s, most of it below 13 Hz. Steps of 0.01 m/s,
  a lag of 50 ms and a wheel radius off by up to 1 % are assumptions.
- `coarse`: a camera or older radar: 10 Hz messages with 1 m and 0.29 m/s steps, new values at
  5 Hz, and an acceleration that lags by 0.2 s. `gnss`: two cars with satellite positioning, all
  at 10 Hz, and the acceleration differentiated from speed. Their noises are assumptions.
- `exact`: what a simulator says of its own world, to three decimals.
"""

from dataclasses import dataclass
from zlib import crc32

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample, ScalarSample
from lfd_mpc.settings import GRAVITY
from lfd_replay.drive import in_nanoseconds
from lfd_replay.generated.car_following import Truth

SETTLING = 400
"""Samples after which filtered noise no longer knows of its start."""


@dataclass(frozen=True)
class Noise:
    """Coloured noise: `white` rms on every sample, and `shaking` rms within `band` (Hz)."""

    white: float
    shaking: float = 0.0
    band: tuple[float, float] = (1.0, 2.0)

    def draw(self, count: int, rate: float, generator: np.random.Generator) -> Array:
        """Noise (count,) at `rate` Hz."""
        noise = generator.normal(0.0, self.white, count)
        if self.shaking:
            # Imported where it is needed: it takes longer than all else of a replay's start.
            from scipy.signal import butter, sosfilt

            sections = butter(1, self.band, "band", fs=rate, output="sos")
            shaking = sosfilt(sections, generator.normal(size=count + SETTLING))[SETTLING:]
            impulse = np.zeros(4000)
            impulse[0] = 1.0
            gain = np.sqrt(np.sum(sosfilt(sections, impulse) ** 2))
            noise += self.shaking / gain * shaking
        return noise


@dataclass(frozen=True)
class RadarPlan:
    """Scans to come, arrays of equal length: `times` of their stamps and when what they say was
    `measured`, in s; what they are off by, in m and m/s."""

    times: Array
    measured: Array
    clearance_noise: Array
    velocity_noise: Array
    outliers: Array


@dataclass(frozen=True)
class SamplePlan:
    """Samples to come of one number, arrays of equal length: `times` in s, and their `noise`."""

    times: Array
    noise: Array


@dataclass(frozen=True)
class Radar:
    """A radar, or what stands for one."""

    period: float = 0.05  # s
    lateness: float = 0.0011  # s, on average
    latest: float = 0.006  # s
    delay: float = 0.02  # s from measurement to stamp
    refresh: int = 1  # messages that carry the same values
    clearance_noise: float = 0.056  # m
    clearance_memory: float = 0.5  # correlation from scan to scan
    clearance_step: float = 0.1  # m
    velocity_noise: float = 0.023  # m/s
    velocity_memory: float = 0.33
    velocity_step: float = 0.01  # m/s
    outlier_period: tuple[float, float] | None = (45.0, 75.0)  # s, evenly spread
    outlier: float = 1.5  # m, nearer or farther

    def plan(self, duration: float, generator: np.random.Generator) -> RadarPlan:
        """When it will scan within `duration` s, and by how much it will be off."""
        grid = np.arange(0.0, duration - self.latest, self.period)
        late = generator.exponential(self.lateness, len(grid)) if self.lateness else 0.0 * grid
        times = grid + late.clip(max=self.latest)
        measured = (times - self.delay).clip(min=0.0)
        measured = np.repeat(measured[:: self.refresh], self.refresh)[: len(times)]
        count = -(-len(times) // self.refresh)
        noise = [
            np.repeat(_remembering(count, rms, memory, generator), self.refresh)[: len(times)]
            for rms, memory in (
                (self.clearance_noise, self.clearance_memory),
                (self.velocity_noise, self.velocity_memory),
            )
        ]
        outliers = np.zeros(len(times))
        for k in self._outliers(times, generator):
            outliers[k] += self.outlier * generator.choice((-1.0, 1.0))
        return RadarPlan(times, measured, noise[0], noise[1], outliers)

    def scans(self, truth: Truth, plan: RadarPlan) -> list[Sample]:
        """What is seen of the truth at the planned times."""
        times, measured = plan.times, plan.measured
        clearance = np.interp(measured, truth.time, truth.clearance)
        velocity = np.interp(measured, truth.time, truth.relative_velocity)
        # Across a change of lead nothing is interpolated.
        seen = np.searchsorted(truth.time, measured + 1e-9, side="right") - 1
        changed = truth.track_id[seen] != truth.track_id[(seen + 1).clip(max=len(truth.time) - 1)]
        clearance[changed] = truth.clearance[seen[changed]]
        velocity[changed] = truth.relative_velocity[seen[changed]]
        clearance = clearance + plan.clearance_noise + plan.outliers
        velocity = velocity + plan.velocity_noise
        clearance = _quantised(clearance.clip(min=0.0), self.clearance_step)
        velocity = _quantised(velocity, self.velocity_step)
        return [
            RadarSample(in_nanoseconds(t), True, float(c), float(v), track_id=int(i))
            for t, c, v, i in zip(times, clearance, velocity, truth.track_id[seen], strict=True)
        ]

    def _outliers(self, times: Array, generator: np.random.Generator) -> list[int]:
        """Indices of the scans that are off; far apart, so that each one stands alone."""
        if self.outlier_period is None:
            return []
        # The first one may come at any time, as if the radar had been on before the drive.
        time = generator.uniform(0.0, self.outlier_period[1])
        found = []
        while time < times[-1]:
            found.append(int(np.searchsorted(times, time)))
            time += generator.uniform(*self.outlier_period)
        return found


@dataclass(frozen=True)
class FeltPlan(SamplePlan):
    """Samples of an accelerometer: what each is `off` by slowly besides the bias, and the bumps'
    first swings (of another length), in m/s^2."""

    off: Array
    swings: Array


@dataclass(frozen=True)
class Accelerometer:
    """What feels the host's acceleration, or is computed from its speed."""

    period: float = 0.01  # s
    jitter: float = 0.0005  # s
    noise: Noise = Noise(0.035, 0.07, (9.0, 20.0))  # m/s^2
    bias: float = 0.05  # m/s^2
    wander: float = 0.3  # m/s^2 rms
    wander_time: float = 7.0  # s
    pitch: float = 0.003  # rad per m/s^2
    bump: float = 3.0  # m/s^2 at the first swing
    lag: float = 0.0  # s
    differentiated: bool = False

    def plan(self, duration: float, bumps: int, generator: np.random.Generator) -> FeltPlan:
        """When it will speak within `duration` s, and by how much it will be off."""
        ideal = np.arange(round(duration / self.period)) * self.period
        times = ideal + generator.uniform(0.0, self.jitter, len(ideal))
        off, swings = np.zeros(len(times)), np.zeros(0)
        if not self.differentiated:
            # The road does not become uneven at the start of the drive only.
            keep = np.exp(-self.period / self.wander_time)
            off = _remembering(len(times), self.wander, keep, generator)
            swings = np.array([self.bump * generator.uniform(0.6, 1.0) for _ in range(bumps)])
        noise = self.noise.draw(len(times), 1 / self.period, generator)
        return FeltPlan(times, noise, off, swings)

    def samples(self, truth: Truth, plan: FeltPlan) -> list[Sample]:
        """What is felt of the truth at the planned times."""
        times = plan.times
        if self.differentiated:
            speed = np.interp(times, truth.time, truth.host_speed)
            value = np.gradient(speed, times)
        else:
            value = self._felt(truth, times) + self.bias + plan.off
            for bump, swing in zip(truth.bumps, plan.swings, strict=True):
                later = times - bump
                burst = np.exp(-later.clip(min=0.0) / 0.12) * np.sin(2 * np.pi * 12.0 * later)
                value += swing * np.where(later > 0, burst, 0.0)
        value += plan.noise
        return [
            ScalarSample(ACCELERATION, in_nanoseconds(t), float(v))
            for t, v in zip(times, value, strict=True)
        ]

    def _felt(self, truth: Truth, times: Array) -> Array:
        moved = np.interp(times - self.lag, truth.time, truth.host_acceleration)
        slope = np.arctan(np.interp(times, truth.time, truth.grade))
        if truth.pitch is None:
            slope = slope + self.pitch * moved
        else:
            slope = slope + np.interp(times, truth.time, truth.pitch)
        return moved + GRAVITY * np.sin(slope)


@dataclass(frozen=True)
class SpeedPlan(SamplePlan):
    """Samples of a speedometer, whose wheel radius is off by a factor `scale`."""

    scale: float


@dataclass(frozen=True)
class Speedometer:
    """What tells the host's speed."""

    period: float = 0.012  # s
    lag: float = 0.05  # s
    scale: float = 0.01  # largest relative error of the wheel radius
    noise: Noise = Noise(0.006, 0.011, (1.5, 13.0))  # m/s
    step: float = 0.01  # m/s

    def plan(self, duration: float, generator: np.random.Generator) -> SpeedPlan:
        """When it will speak within `duration` s, and by how much it will be off."""
        scale = 1.0 + generator.uniform(-self.scale, self.scale)
        times = np.arange(self.period, duration, self.period)
        return SpeedPlan(times, self.noise.draw(len(times), 1 / self.period, generator), scale)

    def samples(self, truth: Truth, plan: SpeedPlan) -> list[Sample]:
        """What is said of the truth at the planned times."""
        times = plan.times
        speed = plan.scale * np.interp(times - self.lag, truth.time, truth.host_speed)
        # A wheel that stands does not shake.
        turning = np.clip(speed / 2.0, 0.0, 1.0)
        speed += turning * plan.noise
        return [
            ScalarSample(HOST_SPEED, in_nanoseconds(t), float(v))
            for t, v in zip(times, _quantised(speed.clip(min=0.0), self.step), strict=True)
        ]


@dataclass(frozen=True)
class SensorPlan:
    """What the sensors of a car will be off by, whatever happens."""

    radar: RadarPlan
    acceleration: FeltPlan
    host_speed: SpeedPlan


@dataclass(frozen=True)
class SensorSuite:
    """The sensors of one car."""

    radar: Radar = Radar()
    accelerometer: Accelerometer = Accelerometer()
    speedometer: Speedometer = Speedometer()

    def plan(self, duration: float, bumps: int, seed: int, name: str) -> SensorPlan:
        """All samples of `duration` s with `bumps` on the way, reproducibly from seed and name."""
        return SensorPlan(
            self.radar.plan(duration, _generator(seed, name, RADAR)),
            self.accelerometer.plan(duration, bumps, _generator(seed, name, ACCELERATION)),
            self.speedometer.plan(duration, _generator(seed, name, HOST_SPEED)),
        )

    def sense(self, truth: Truth, seed: int, name: str) -> dict[str, list[Sample]]:
        """What the sensors say about a drive, reproducibly from seed and name."""
        plan = self.plan(float(truth.time[-1]), len(truth.bumps), seed, name)
        return {
            RADAR: self.radar.scans(truth, plan.radar),
            ACCELERATION: self.accelerometer.samples(truth, plan.acceleration),
            HOST_SPEED: self.speedometer.samples(truth, plan.host_speed),
        }


SENSORS = {
    "esr": SensorSuite(),
    "coarse": SensorSuite(
        radar=Radar(
            period=0.1, refresh=2, delay=0.05, clearance_noise=0.2, clearance_memory=0.0,
            clearance_step=1.0, velocity_noise=0.05, velocity_memory=0.0, velocity_step=0.29,
            outlier_period=None,
        ),
        accelerometer=Accelerometer(lag=0.2),
    ),
    "gnss": SensorSuite(
        radar=Radar(
            period=0.1, lateness=0.0, delay=0.0, clearance_noise=0.02, clearance_memory=0.9,
            clearance_step=0.001, velocity_noise=0.02, velocity_memory=0.5, velocity_step=0.001,
            outlier_period=None,
        ),
        accelerometer=Accelerometer(period=0.1, jitter=0.0, noise=Noise(0.05), differentiated=True),
        speedometer=Speedometer(period=0.1, lag=0.0, scale=0.0, noise=Noise(0.01), step=0.001),
    ),
    "exact": SensorSuite(
        radar=Radar(
            lateness=0.0, delay=0.0, clearance_noise=0.0, clearance_step=0.001,
            velocity_noise=0.0, velocity_step=0.001, outlier_period=None,
        ),
        accelerometer=Accelerometer(
            jitter=0.0, noise=Noise(0.0), bias=0.0, wander=0.0, pitch=0.0, bump=0.0,
        ),
        speedometer=Speedometer(period=0.01, lag=0.0, scale=0.0, noise=Noise(0.0), step=0.001),
    ),
}  # fmt: skip
"""Sensor suites by name."""


def _remembering(count: int, rms: float, keep: float, generator: np.random.Generator) -> Array:
    """Noise (count,) of which a share `keep` stays from sample to sample, `rms` from the start."""
    from scipy.signal import lfilter

    pushes = generator.normal(0.0, rms * np.sqrt(1.0 - keep**2), count)
    if count:
        pushes[0] = generator.normal(0.0, rms)
    return lfilter([1.0], [1.0, -keep], pushes)


def _generator(seed: int, *names: str) -> np.random.Generator:
    """A generator of its own for each signal; the checksum is the same in every process."""
    sequence = np.random.SeedSequence([seed, crc32("/".join(names).encode())])
    return np.random.default_rng(sequence)


def _quantised(values: Array, step: float) -> Array:
    return np.round(values / step) * step
