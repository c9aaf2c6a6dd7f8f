"""How the lead of a generated drive moves, and what the road does.

The accelerations are our own; only their statistics are the paper's: over the 27 normal drives
the lead's acceleration has the mean and standard deviation of section 4 (below eq 22), and
data-3 brakes to -2.5 m/s^2 at 20 s (Fig 23). Braking comes on with 12 m/s^3, as an emergency
brake does; the speed at which it lets go is an assumption.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.errors import UserError
from lfd_observer.settings import LeadMotion

OverTime = Callable[[Array], Array]

NORMAL = tuple(f"normal-{number:02d}" for number in range(1, 28))
"""Fault-free drives at low congestion with smooth changes of speed, as the paper's 27 sets."""

TRAFFIC = tuple(f"traffic-{number:02d}" for number in range(1, 100))
"""Fault-free drives as in traffic: stops, hard braking, cars that cut in and leave, slopes."""

HILLY = tuple(f"hilly-{number:02d}" for number in range(1, 67))
"""Fault-free drives among hills, half of them in a town's steep streets."""

NEW_TRAFFIC = tuple(f"traffic-{number}" for number in range(100, 199))
NEW_HILLY = tuple(f"hilly-{number}" for number in range(67, 133))
"""More of both, that no parameter was chosen on and no rule was made after: seeds change what the
sensors say, but the leads and roads of the others are those that were looked at."""

IN_TRAFFIC = frozenset((*TRAFFIC, *NEW_TRAFFIC, *HILLY, *NEW_HILLY))
"""All of them."""

SLOWEST, FASTEST = 7.0, 36.0
"""Speeds in m/s that the leads of normal drives keep between."""

ONSET = 12.0
"""Jerk in m/s^3 with which emergency braking comes on."""


@dataclass(frozen=True)
class Change:
    """Another car becomes the lead at `time` (s): `gap` times as far away, `faster` in m/s."""

    time: float
    gap: float
    faster: float
    track_id: int


@dataclass(frozen=True)
class Profile:
    """A drive of `duration` s: the lead's first speed in m/s and its acceleration in m/s^2.

    `grade` is the slope of the road (1 = 45 degrees) over time, `road` that over the way in m, to
    be added; `bumps` are times in s.
    """

    duration: float
    speed: float
    acceleration: OverTime
    changes: tuple[Change, ...] = ()
    grade: OverTime = np.zeros_like
    road: OverTime = np.zeros_like
    bumps: tuple[float, ...] = ()


def _waves(*waves: tuple[float, float, float]) -> OverTime:
    """Sum of (amplitude in m/s^2, period in s, phase in rad)."""

    def acceleration(time: Array) -> Array:
        return sum((a * np.sin(2 * np.pi * time / p + f) for a, p, f in waves), np.zeros(len(time)))

    return acceleration


def _with_braking(
    calm: OverTime, start: float, peak: float, ramps: tuple[float, float, float]
) -> OverTime:
    """Braking to `peak` (m/s^2) at `start` (s): `ramps` are s of onset, of holding, of release."""
    onset, hold, release = ramps

    def acceleration(time: Array) -> Array:
        later = time - start
        braking = np.clip(later / onset, 0, 1) - np.clip((later - onset - hold) / release, 0, 1)
        return calm(time) * (1 - braking) + peak * braking

    return acceleration


def _pulses(*pulses: tuple[float, float, float]) -> OverTime:
    """Smooth changes of speed: (start in s, duration in s, change in m/s)."""

    def acceleration(time: Array) -> Array:
        total = np.zeros(len(time))
        for start, duration, change in pulses:
            phase = np.clip((time - start) / duration, 0.0, 1.0)
            total += change / duration * (1.0 - np.cos(2 * np.pi * phase))
        return total

    return acceleration


def _slope(grade: float, start: float, end: float, curve: float) -> OverTime:
    """A slope from `start` to `end` s, coming on and going away over `curve` s."""

    def at(time: Array) -> Array:
        rise = np.clip((time - start) / curve, 0, 1) - np.clip((time - end) / curve, 0, 1)
        return grade * rise

    return at


_CALM = _waves((0.5, 38.0, 0.3), (0.25, 17.0, 2.0), (0.1, 7.0, 4.0))
_STEADY = _waves((0.3, 31.0, 0.0), (0.15, 13.0, 1.0))

_NAMED = {
    "data-1": Profile(80.0, 14.0, _waves((0.6, 31.0, 0.0), (0.3, 13.0, 1.0), (0.12, 6.0, 2.5))),
    "data-2": Profile(80.0, 14.0, _waves((0.7, 43.0, 5.5), (0.3, 19.0, 1.1), (0.1, 8.0, 1.7))),
    "data-3": Profile(80.0, 18.0, _with_braking(_CALM, 20.0, -2.5, (0.25, 0.45, 0.5))),
    "cut-in": Profile(
        80.0, 22.0, _STEADY, changes=(Change(25.0, 0.55, -0.5, 2), Change(55.0, 1.7, 1.0, 3))
    ),
    "stop-and-go": Profile(
        100.0,
        13.0,
        _pulses((12, 9, -13), (32, 12, 11), (50, 6, -6), (58, 7, -6), (75, 12, 13)),
    ),
    "hill": Profile(80.0, 18.0, _STEADY, grade=_slope(0.06, 25.0, 50.0, 5.0)),
    "bumps": Profile(80.0, 14.0, _STEADY, bumps=(12.0, 19.5, 20.2, 33.0, 41.0, 41.6, 58.0, 70.0)),
}

BRAKING = "braking"
PEAKS = (-8.0, -0.5)
"""Hardest and softest peak of a braking drive in m/s^2."""

NAMES = (*_NAMED, BRAKING, *NORMAL)
"""Every drive there is, but for those of `IN_TRAFFIC`."""

NAMES_IN_WORDS = ", ".join(
    (
        *_NAMED,
        BRAKING,
        f"{NORMAL[0]} to {NORMAL[-1]}",
        f"{TRAFFIC[0]} to {NEW_TRAFFIC[-1]}",
        f"{HILLY[0]} to {NEW_HILLY[-1]}",
    )
)
"""Every drive there is, in words."""


def lead_profile(name: str, peak: float | None = None) -> Profile:
    """A profile by name; `peak` in m/s^2 belongs to `braking`.

    Raises UserError for an unknown name or an unfit peak.
    """
    if name == BRAKING:
        return _braking(-6.0 if peak is None else peak)
    if peak is not None:
        raise UserError(f"a peak belongs to '{BRAKING}', not to '{name}'")
    if name in NORMAL:
        return _normal(name)
    if name in (*TRAFFIC, *NEW_TRAFFIC):
        return _traffic(name)
    if name in (*HILLY, *NEW_HILLY):
        return _hilly(name)
    if name not in _NAMED:
        raise UserError(f"unknown drive '{name}'; there are: {NAMES_IN_WORDS}")
    return _NAMED[name]


def _braking(peak: float) -> Profile:
    if not PEAKS[0] <= peak <= PEAKS[1]:
        raise UserError(f"peak {peak:g}: {PEAKS[0]:g} to {PEAKS[1]:g} m/s^2 expected")
    speed, slower = 22.0, 14.0
    onset = -peak / ONSET
    # It lets go when the lead has lost so much speed, the ramps included.
    hold = max(slower / -peak - (onset + 0.5) / 2, 0.2)
    return Profile(
        60.0, speed, _with_braking(_waves((0.2, 23.0, 0.0)), 20.0, peak, (onset, hold, 0.5))
    )


def _number(name: str) -> int:
    return int(name.rpartition("-")[2])


def _traffic(name: str) -> Profile:
    """Two minutes of a lead that changes its speed every few seconds, now and then to rest."""
    generator = np.random.default_rng([29, _number(name)])
    first, speeds = _changing_speeds(generator, FASTEST)
    changes = tuple(
        Change(time, float(generator.choice((0.5, 0.7, 1.5, 2.0))), generator.uniform(-2, 2), 2 + k)
        for k, time in enumerate(sorted(generator.uniform(10.0, 110.0, generator.integers(4))))
    )
    grade = _slope(generator.uniform(-0.07, 0.07), 30.0, 60.0, generator.uniform(2.0, 6.0))
    return Profile(120.0, first, speeds, changes, grade)


def _hilly(name: str) -> Profile:
    """Such a lead in a town built on hills, or on a road through them."""
    number = _number(name)
    generator = np.random.default_rng([31, number])
    town = number % 2 == 1
    first, speeds = _changing_speeds(generator, 14.0 if town else 22.0)
    return Profile(120.0, first, speeds, road=_hills(generator, town))


def _changing_speeds(generator: np.random.Generator, fastest: float) -> tuple[float, OverTime]:
    """The first speed (m/s) of two minutes in which it changes every few seconds."""
    first = speed = float(generator.uniform(3.0, fastest - 3.0))
    pulses: list[tuple[float, float, float]] = []
    start = float(generator.uniform(3.0, 8.0))
    while start < 110.0:
        hasty, stops = generator.random(2) < 0.15
        lasts = float(generator.uniform(2.0, 4.0) if hasty else generator.uniform(3.0, 10.0))
        wanted = 0.0 if stops else float(np.clip(generator.normal(speed, 6.0), 0.0, fastest))
        # A pulse's peak is twice its mean.
        change = float(np.clip(wanted - speed, -4.0 * lasts, 1.5 * lasts))
        pulses.append((start, lasts, change))
        speed += change
        start += lasts + float(generator.uniform(1.0, 8.0))
    return first, _pulses(*pulses)


def _hills(generator: np.random.Generator, town: bool) -> OverTime:
    """Slopes over the way: each goes over into the next one in a curve. A town's streets climb by
    up to 17 % from one crossing to the next, which is flatter; other roads by up to 8 %."""
    curve = generator.uniform(6.0, 12.0) if town else generator.uniform(30.0, 80.0)
    ends, grades, end = [], [], 0.0
    while end < 3000.0:
        grade = generator.uniform(-0.17, 0.17) if town else generator.uniform(-0.08, 0.08)
        end += generator.uniform(80.0, 140.0) if town else generator.uniform(120.0, 400.0)
        ends.append(end)
        grades.append(grade)
        if town:
            end += generator.uniform(12.0, 20.0)
            ends.append(end)
            grades.append(grade * generator.uniform(0.0, 0.4))
    at = np.ravel([(end - curve / 2, end + curve / 2) for end in ends[:-1]])
    slopes = np.ravel(list(zip(grades[:-1], grades[1:], strict=True)))

    def over(way: Array) -> Array:
        return np.interp(way, at, slopes)

    return over


@dataclass(frozen=True)
class _Raw:
    """A normal drive before all of them are brought to the paper's statistics."""

    duration: float
    waves: tuple[tuple[float, float, float], ...]


def _raw(name: str) -> _Raw:
    generator = np.random.default_rng(_number(name))
    periods = np.exp(generator.uniform(np.log(8.0), np.log(40.0), 6))
    # Longer waves change the speed more; drivers keep the change of speed limited.
    amplitudes = generator.uniform(0.7, 1.3) * (periods / 15.0) ** -0.3
    phases = generator.uniform(0.0, 2 * np.pi, len(periods))
    waves = zip(amplitudes.tolist(), periods.tolist(), phases.tolist(), strict=True)
    return _Raw(100.0 + 10.0 * generator.uniform(), tuple(waves))


@cache
def _pooled() -> tuple[float, float]:
    """Mean and standard deviation of all normal drives before they are scaled, in m/s^2."""
    everything = []
    for name in NORMAL:
        raw = _raw(name)
        everything.append(_waves(*raw.waves)(np.arange(0.0, raw.duration, 0.1)))
    values = np.concatenate(everything)
    return float(values.mean()), float(values.std())


def _normal(name: str) -> Profile:
    raw = _raw(name)
    mean, deviation = _pooled()
    wanted = LeadMotion()
    scale = wanted.lead_acceleration_std / deviation
    unscaled = _waves(*raw.waves)

    def acceleration(time: Array) -> Array:
        return wanted.lead_acceleration_mean + scale * (unscaled(time) - mean)

    gained = np.cumsum(acceleration(np.arange(0.0, raw.duration, 0.1))) * 0.1
    # From town to motorway, as far as the changes of speed leave room.
    share = (int(name[-2:]) * 7 % len(NORMAL)) / (len(NORMAL) - 1)
    room = FASTEST - SLOWEST - (gained.max() - gained.min())
    return Profile(raw.duration, SLOWEST - gained.min() + share * max(room, 0.0), acceleration)
