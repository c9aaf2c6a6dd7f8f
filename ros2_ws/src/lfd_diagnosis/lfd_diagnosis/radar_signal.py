"""One of the radar's two signals: how it stands against its prediction, and what its fault is."""

from collections import deque
from dataclasses import dataclass, field
from math import inf, isfinite, nan, sqrt
from statistics import median

from lfd_diagnosis.healthy_signal import LearntNoise, Repetition, Roughness
from lfd_diagnosis.verdict import Kind

BAD, GOOD = 2, 1
"""How much a disagreeing scan adds to the confidence, and an agreeing one takes away: two
disagreeing scans of three make a fault, one alone is an outlier."""

FIRST = 10
"""Residuals from which the size of a jump is taken."""

SIZE_TIME = 0.3
"""Time constant in s of the size of a fault."""

TOLERANCE = 0.3
"""Share of a jump by which the jump back may differ from it."""

STEPS = 1.5
"""Steps of its resolution that a signal may be off from its prediction."""

HELD_SCANS = 6
"""Equal scans below which nothing is thought of it."""

NOISE_CLEARS = 1.6
"""A noise leaves its limits now and then only: it must agree for so many times longer."""


@dataclass
class RadarSignal:
    """State of one signal; lengths in its own unit (m or m/s), times in s."""

    name: str
    unit: str
    floor: float
    noise: LearntNoise
    roughness: Roughness
    repetition: Repetition
    residual: float = nan
    limit: float = nan
    residual_before: float = 0.0
    last: float = nan
    last_at: float = -inf
    confidence: int = 0
    outliers: int = 0
    faulty: bool = False
    kind: Kind = Kind.UNKNOWN
    because: str = ""
    tellable: bool = True
    coasted: float = 0.0
    _size: float = nan
    _agreeing: float = 0.0
    _came_back: bool = False
    _returning: bool = False
    _first: list[float] = field(default_factory=list)
    _recent: deque[float] = field(default_factory=lambda: deque(maxlen=5))
    _history: deque[tuple[float, float]] = field(default_factory=deque)

    @property
    def bad(self) -> bool:
        """Whether the newest scan left its limits."""
        return not abs(self.residual) <= self.limit

    @property
    def index(self) -> float:
        """Residual against limit, 0..1; one half at the limit. NaN before anything was judged."""
        return abs(self.residual) / (abs(self.residual) + self.limit)

    @property
    def size(self) -> float:
        """How far a faulty signal is off; NaN where that says nothing."""
        return self._size if self.kind in (Kind.OFFSET, Kind.RAMP) else nan

    @property
    def least(self) -> float:
        """Least limit: a coarse sensor may be off by its resolution, and some noise."""
        return max(self.floor, STEPS * self.resolution)

    @property
    def resolution(self) -> float:
        """Its resolution as far as known, else 0."""
        resolution = self.roughness.resolution
        return resolution if isfinite(resolution) else 0.0

    @property
    def held(self) -> bool:
        """Whether it repeats itself for longer than a moment, though maybe by coincidence."""
        return self.repetition.run >= HELD_SCANS

    def deviation(self, variance: float) -> float:
        """Standard deviation of a measurement about a prediction of that variance."""
        return sqrt(variance + self.noise.variance)

    def restart(self) -> None:
        """The next scan has nothing to do with those before."""
        self.last, self.last_at = nan, -inf
        self.residual = self.limit = nan
        self.roughness.restart()
        self.repetition.restart()

    def text(self) -> str:
        """How it stands, in words."""
        return f"prediction residual: {self.residual:.2f} {self.unit} (limit {self.limit:.2f})"

    def count(self, ceiling: int) -> None:
        """Confidence in a fault, by scans (eq 26 with scans for steps)."""
        if self.bad:
            if not self.confidence:
                self._first = []
            self.confidence = min(self.confidence + BAD, ceiling)
            if len(self._first) < FIRST:
                self._first.append(self.residual)
            return
        self.residual_before = self.residual
        self.outliers += self.confidence == BAD and not self.faulty
        self.confidence = max(self.confidence - GOOD, 0)

    def acquit(self) -> None:
        """What it did wrong was another signal's fault."""
        self.confidence, self.residual, self._first = 0, 0.0, []

    def convict(self, kind: Kind, because: str, confidence: int) -> None:
        """Faulty from now on."""
        self.faulty, self.kind, self.because = True, kind, because
        self.confidence = confidence
        self._size = self.residual
        self._first = self._first or [self.residual]
        self._agreeing, self._came_back, self._returning = 0.0, False, False
        self._recent.clear()
        self._history.clear()

    def forgive(self) -> None:
        """Healthy from now on."""
        self.faulty, self.kind, self.because = False, Kind.UNKNOWN, ""
        self.confidence, self.tellable, self._first = 0, True, []

    def classify(self) -> None:
        """What began as a jump may turn out to be something else."""
        if self.kind not in (Kind.OFFSET, Kind.RAMP):
            return
        if self.last == 0.0 and self.repetition.run >= 3:
            self.kind = Kind.ZERO
        elif self.held and self.repetition.frozen:
            self.kind = Kind.HOLD
        elif self.roughness.rough and self.kind is Kind.OFFSET:
            self.kind = Kind.NOISE

    def has_returned(self, step: float) -> bool:
        """Whether the jump that made the fault was undone, whatever became of the reference.

        `step` since the scan before, beyond the lead's own motion. One scan alone may be an
        outlier: what jumps back must not come from one, and the next scan must not undo it.
        """
        if self.kind is not Kind.OFFSET:
            return False
        offset = sum(self._first) / len(self._first)
        tolerance = max(TOLERANCE * abs(offset), 0.5 * self.floor, 4.0 * self.noise.deviation)
        tolerance += self.resolution
        if self._returning:
            self._returning = False
            if abs(step) < tolerance:
                self._recent.clear()
                self._came_back, self._agreeing = True, 0.0
                return True
        level = len(self._recent) == self._recent.maxlen and (
            abs(self._recent[-1] - median(self._recent)) < tolerance
        )
        self._returning = level and abs(step + offset) < tolerance < abs(offset)
        self._recent.append(self.residual)
        return False

    def has_stopped(self, at: float, duration: float) -> bool:
        """Whether a drift has not gone on for `duration`: nothing contradicts anything now."""
        if self.kind is not Kind.RAMP:
            return False
        history = self._history
        history.append((at, self.residual))
        while history[-1][0] - history[0][0] > duration:
            history.popleft()
        values = [value for _, value in history]
        return (
            history[-1][0] - history[0][0] > 0.9 * duration
            and max(values) - min(values) < 0.6 * self.floor + 4.0 * self.noise.deviation
        )

    def agrees_again(
        self, period: float, step: float, deviation: float, clear_time: float, latch: bool
    ) -> bool | None:
        """Whether a faulty signal agrees for long enough to be believed; None = it does not agree.

        `period` since the scan before and `step` since then beyond the lead's own motion;
        `deviation` of a healthy measurement about the reference.
        """
        size = max(map(abs, self._first), default=0.0)
        self.tellable = self.limit < max(0.7 * size, 1.5 * self.floor)
        bound = self.limit
        if self.kind in (Kind.OFFSET, Kind.RAMP):
            # What is known to be off by so much has not come back while it is off by half of it.
            bound = min(bound, max(0.5 * abs(self._size), 3.0 * deviation))
        off = self.bad or abs(self.residual) > bound
        if off:
            share = min(period / SIZE_TIME, 1.0)
            self._size += share * (self.residual - self._size)
        frozen = self.repetition.frozen and self.kind in (Kind.HOLD, Kind.ZERO)
        if off or frozen or self.roughness.rough:
            self._agreeing, self._came_back = 0.0, False
            return None
        if self.kind is not Kind.OFFSET and abs(step) > max(0.8 * self.floor, 0.4 * size):
            self._came_back, self._agreeing = True, 0.0
        self._agreeing += min(period, 0.2)
        needed = clear_time * (NOISE_CLEARS if self.kind is Kind.NOISE else 1.0)
        # Agreement with limits as wide as the fault is large says nothing: it takes a jump back.
        return self._agreeing >= needed and (self.tellable or self._came_back or not latch)
