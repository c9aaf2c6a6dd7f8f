"""What is learnt of a healthy signal: its noise, how rough it is, how long it repeats itself."""

from collections import deque
from math import inf, log, sqrt

LEARNT = 400
"""Samples over which noise is averaged once so many are known, where nothing else is stated."""

PRIOR = 20
"""Samples that the parameter file's value counts for."""

GIVE = 3.0
"""Deviations beyond which a sample does not add to what is learnt."""

SAME_STAMP = 1e-4
"""Seconds below which two stamps are the same."""

EQUAL = 1e-6
"""Differences below it are rounding, not resolution."""

STEPS = 0.6
"""Steps of a signal's resolution that its second differences are at least taken for."""


def is_new(at: float, last_at: float) -> bool:
    """Whether a sample of time `at` (s) is another one than that of `last_at`."""
    return at > last_at + SAME_STAMP


class LearntNoise:
    """Standard deviation of a signal's noise, from a first value on, within limits."""

    def __init__(
        self, first: float, lowest: float, highest: float, learn: bool, memory: int = LEARNT
    ) -> None:
        """All three in the signal's unit; without `learn` the first value stays."""
        self._memory = memory
        self._variance = first * first
        self._range = lowest * lowest, highest * highest
        self._learn = learn
        self.count = 0

    @property
    def variance(self) -> float:
        """In the square of the signal's unit."""
        return self._variance

    @property
    def deviation(self) -> float:
        """In the signal's unit."""
        return sqrt(self._variance)

    def take(self, innovation: float, predicted_variance: float) -> None:
        """Learn from one innovation whose prediction was as uncertain as stated."""
        self.count += 1
        if not self._learn:
            return
        spread = predicted_variance + self._variance
        excess = min(innovation * innovation, GIVE * GIVE * spread) - predicted_variance
        share = 1.0 / min(self.count + PRIOR, self._memory)
        lowest, highest = self._range
        self._variance += share * (excess - self._variance)
        self._variance = min(max(self._variance, lowest), highest)


class Roughness:
    """Whether a signal jumps up and down from sample to sample far more than it used to.

    Second differences: smooth motion, however fast, hardly has any.
    """

    ratio, needed = 5.0, 0.4
    """Rough: so many usual deviations are exceeded by such a share of the last samples."""

    def __init__(self, window: int) -> None:
        """`window`: how many samples the share is taken of."""
        self._recent: deque[bool] = deque([False] * window, maxlen=window)
        self._count = 0
        self._before: tuple[float, ...] = ()
        self._usual = 0.0
        self._resolution = inf
        self._known = 0

    @property
    def rough(self) -> bool:
        """Whether it is so now."""
        return self._count >= self.needed * len(self._recent)

    @property
    def share(self) -> float:
        """Share of the window's samples that exceed their limit."""
        return self._count / len(self._recent)

    @property
    def deviation(self) -> float:
        """Usual standard deviation of one sample, as if its noise were white."""
        return sqrt(self._usual / 6.0)

    @property
    def resolution(self) -> float:
        """Smallest step seen between two samples; infinite before any was seen."""
        return self._resolution

    def restart(self) -> None:
        """The next sample has nothing to do with those before."""
        self._before = ()

    def take(self, value: float, healthy: bool) -> None:
        """Take one sample; only healthy ones are learnt from."""
        if len(self._before) < 2:
            self._before = (*self._before, value)
            return
        first = abs(value - self._before[1])
        if EQUAL < first < self._resolution and healthy:
            self._resolution = first
        second = value - 2.0 * self._before[1] + self._before[0]
        self._before = (self._before[1], value)
        square = second * second
        known = self._known >= 3 * len(self._recent)
        usual = max(self._usual, (STEPS * self._resolution) ** 2)
        exceeds = known and square > self.ratio * self.ratio * usual
        self._count += exceeds - self._recent[0]
        self._recent.append(exceeds)
        if healthy:
            self._known += 1
            if known:
                square = min(square, GIVE * GIVE * self._usual)
            self._usual += (square - self._usual) / min(self._known, 5 * LEARNT)


class Repetition:
    """How long a signal has said the very same number, and whether that is longer than it may."""

    chance = 1e-7
    """Probability below which a run of equal samples is no coincidence."""
    enough = 100
    """Samples that must be known before anything is called too long."""

    def __init__(self, least: int) -> None:
        """`least`: equal samples in a row that are never suspect."""
        self._least = least
        self._value: float | None = None
        self._longest = 0
        self._equal = self._samples = 0
        self.run = 0

    @property
    def limit(self) -> float:
        """Length of a run from which on it is no coincidence; infinite while little is known."""
        if self._samples < self.enough:
            return float("inf")
        share = min(max(self._equal / self._samples, 0.01), 0.99)
        return max(self._least, 2 * self._longest + 2, log(self.chance) / log(share))

    @property
    def frozen(self) -> bool:
        """Whether the run is longer than any healthy one could be."""
        return self.run >= self.limit

    def restart(self) -> None:
        """The next sample has nothing to do with those before."""
        self._value, self.run = None, 0

    def take(self, value: float, healthy: bool) -> bool:
        """Take one sample, only healthy ones are learnt from; whether it equals the one before."""
        equal = value == self._value
        if healthy:
            self._samples += 1
            self._equal += equal
            if not equal:
                self._longest = max(self._longest, self.run)
        self._value = value
        self.run = self.run + 1 if equal else 0
        return equal
