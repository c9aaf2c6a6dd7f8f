"""Clearance against the path that the relative velocity makes: which of them contradicts?"""

from collections import deque
from dataclasses import dataclass
from math import inf, nan

import numpy as np

from lfd_diagnosis.healthy_signal import LearntNoise
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind

MEAN = 0.25
"""Seconds at both ends of the window that are averaged."""

LEAST_TIME, LEAST_POINTS = 1.0, 10
"""Seconds of path from which on it is judged, and points from which it is explained."""

LARGEST_GAP = 0.5
"""Seconds without a scan after which the path begins anew."""

ONSETS = 12
"""Onsets that are tried for each explanation."""

STEP_SEARCH, STEP_SHARE = 0.3, 0.6
"""Seconds around the onset in which a step of the velocity is looked for, and its least share."""

DOUBT, PATIENCE = 0.75, 1.6
"""Ratio of two explanations' errors above which neither is clearly better, and limits to wait."""

STEPS = 2.5
"""Steps of the clearance's resolution that a drift may seem to have."""

SIGMA = 5.0
"""Learnt standard deviations of the drift that make its limit."""


@dataclass(frozen=True)
class Drift:
    """Who is wrong: the clearance, or else the relative velocity; by how much in its unit."""

    of_clearance: bool
    kind: Kind
    error: float


class TravelledPath:
    """What the clearance is off from the path travelled, over the last seconds."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self._noise = LearntNoise(0.15, 0.02, 2.0, settings.learn_noise, memory=2000)
        self.clear()

    def clear(self) -> None:
        """The path begins anew at the next scan."""
        self._points: deque[tuple[float, float, float]] = deque()
        self._then = -inf
        self.clearance = self.velocity = nan

    @property
    def explainable(self) -> bool:
        """Whether the path is long enough to say who is wrong."""
        return len(self._points) >= LEAST_POINTS

    @property
    def length(self) -> float:
        """Seconds of path that are known."""
        return self._points[-1][0] - self._points[0][0] if self._points else 0.0

    def limit(self, widening: float, resolution: float) -> float:
        """Drift in m beyond which the two contradict each other, the clearance in such steps."""
        least = max(self._settings.drift_limit, STEPS * resolution)
        return widening * max(least, SIGMA * self._noise.deviation)

    def follow(self, at: float, clearance: float, velocity: float, step: float) -> None:
        """Take one scan; `step`: how far its velocity was off from its prediction, in m/s."""
        points, period = self._points, at - self._then
        if not points or period > LARGEST_GAP:
            points.clear()
            points.append((at, 0.0, 0.0))
        else:
            travelled = 0.5 * (velocity + self.velocity) * period
            points.append((at, points[-1][1] + clearance - self.clearance - travelled, step))
            while at - points[0][0] > self._settings.drift_window + 1.0:
                points.popleft()
        self._then, self.clearance, self.velocity = at, clearance, velocity

    def drift(self, limit: float) -> float:
        """How far the two have come apart over the window in m; 0 while the path is short."""
        points = self._points
        if self.length < LEAST_TIME:
            return 0.0
        now = points[-1][0]
        start = max(now - self._settings.drift_window, points[0][0])
        new = [off for t, off, _ in points if t > now - MEAN]
        old = [off for t, off, _ in points if start <= t <= start + MEAN]
        drift = sum(new) / len(new) - sum(old) / len(old)
        # What is nearly a contradiction is not learnt as healthy.
        if abs(drift) <= 0.6 * limit:
            self._noise.take(drift, 0.0)
        return drift

    def explain(self, excess: float, held: bool) -> Drift | None:
        """Who is wrong, None while that is in doubt.

        A clearance that drifts leaves the path in a straight line; a relative velocity that drifts
        bends it; a step of the velocity, too small for its own limits, leaves a straight line, but
        was seen as a step. `excess`: drift over its limit; `held`: the clearance repeats itself.
        """
        points = np.array(self._points)
        times, off = points[:, 0] - points[-1, 0], points[:, 1]
        line, bend = (self._fit(times, off, power) for power in (1, 2))
        if held:
            return Drift(True, Kind.HOLD, float(off[-1] - line[2]))
        better, worse = sorted((line[0], bend[0]))
        if better > DOUBT * worse and excess < PATIENCE:
            return None
        if bend[0] < line[0]:
            _, onset, _, slope = bend
            return Drift(False, Kind.RAMP, float(2.0 * slope * onset))
        _, onset, base, slope = line
        near = np.abs(times - onset) <= STEP_SEARCH
        if np.any(-np.sign(slope) * points[near, 2] > STEP_SHARE * abs(slope)):
            return Drift(False, Kind.OFFSET, float(-slope))
        return Drift(True, Kind.RAMP, float(off[-1] - base))

    @staticmethod
    def _fit(times: np.ndarray, off: np.ndarray, power: int) -> tuple[float, float, float, float]:
        """Best of `base + slope * (t - onset)^power`: squared error, onset, base, slope."""
        best = inf, 0.0, 0.0, 0.0
        for onset in np.linspace(times[0], -2.0 * MEAN, ONSETS):
            shape = (times - onset).clip(min=0.0) ** power
            centred = shape - shape.mean()
            slope = centred @ off / (centred @ centred)
            base = off.mean() - slope * shape.mean()
            error = float(np.sum((base + slope * shape - off) ** 2))
            if error < best[0]:
                best = error, float(onset), float(base), float(slope)
        return best
