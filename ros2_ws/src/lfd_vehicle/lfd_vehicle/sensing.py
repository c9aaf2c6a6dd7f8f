"""The simulated car's sensors, sample by sample: the models of the generated drives."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from lfd_mpc.samples import Sample, playing_order
from lfd_mpc.settings import STEP_S
from lfd_replay.generated.car_following import Truth
from lfd_replay.generated.sensor_models import SensorSuite

REMEMBERED = 100
"""Steps that a sensor may look back."""


@dataclass
class Moment:
    """What really is at one step, in m, m/s, m/s^2 and rad; `grade` 1 = 45 degrees."""

    clearance: float
    relative_velocity: float
    host_speed: float
    host_acceleration: float
    lead_acceleration: float
    grade: float
    pitch: float
    track_id: int


class Sensing:
    """Senses what has happened since it was last asked."""

    def __init__(
        self, suite: SensorSuite, duration: float, bumps: tuple[float, ...], seed: int, name: str
    ) -> None:
        """For `duration` s at most; the same noise for the same seed and name."""
        self._bumps = bumps
        plan = suite.plan(duration, len(bumps), seed, name)
        self._plans = (
            (plan.radar, suite.radar.scans),
            (plan.acceleration, suite.accelerometer.samples),
            (plan.host_speed, suite.speedometer.samples),
        )
        self._next = [0, 0, 0]
        names = [field.name for field in fields(Moment)]
        self._past = {name: np.zeros(2 * REMEMBERED) for name in names}
        self._time = np.zeros(2 * REMEMBERED)
        self._count = 0
        self._steps = 0

    def sense(self, moment: Moment) -> list[Sample]:
        """The samples of the 10 ms that end now, in playing order."""
        truth = self._remember(moment)
        now = float(truth.time[-1])
        made: list[Sample] = []
        for number, (plan, values) in enumerate(self._plans):
            begin = end = self._next[number]
            times: Any = plan.times
            while end < len(times) and times[end] <= now:
                end += 1
            if end > begin:
                made += values(truth, _stretch(plan, begin, end))
                self._next[number] = end
        return sorted(made, key=playing_order)

    def _remember(self, moment: Moment) -> Truth:
        if self._count == 2 * REMEMBERED:
            for past in (self._time, *self._past.values()):
                past[:REMEMBERED] = past[REMEMBERED:]
            self._count = REMEMBERED
        at = self._count
        self._time[at] = self._steps * STEP_S
        for name, past in self._past.items():
            past[at] = getattr(moment, name)
        self._count += 1
        self._steps += 1
        known = {name: past[: at + 1] for name, past in self._past.items()}
        return Truth(time=self._time[: at + 1], bumps=self._bumps, **known)


def _stretch(plan: Any, begin: int, end: int) -> Any:
    """The part of a plan from one sample to another."""
    cut = {
        field.name: getattr(plan, field.name)[begin:end]
        for field in fields(plan)
        if field.name not in ("swings", "scale")
    }
    return replace(plan, **cut)
