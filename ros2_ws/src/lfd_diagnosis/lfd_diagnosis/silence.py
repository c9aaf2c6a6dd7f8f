"""Whether nothing arrives at all, judged by a wall clock that a paused replay can hold."""

from collections import deque

LIMIT = 0.1
"""Seconds without a step after which the sensors count as silent, where steps come steadily."""

LONGEST = 0.5
"""The same at most, where steps come in bursts: inputs may be slow."""

BURSTS, OFTEN, MEMORY = 1.5, 3, 2.0
"""Times between bursts that make the limit, how many must be as long, and for how many seconds they
are remembered: one pause alone is none that may come again."""

CLOCK_LOST = 2.0
"""Seconds without a /clock message after which simulated time no longer holds the wall clock; where
none ever came, since the last step: before the first one it may be that a replay has not begun."""


class SilenceWatch:
    """Watches for steps. In simulated time a pause is no silence, as long as its clock lives."""

    def __init__(self, wall: float) -> None:
        """`wall`: present wall time in s."""
        self._heard = wall
        self._pauses: deque[tuple[float, float]] = deque(maxlen=100)
        self._stepped = self._suspected = False
        self._clock_heard: float | None = None
        self._simulated = 0.0
        self._simulated_heard: float | None = None

    def clock(self, wall: float, simulated: float) -> None:
        """Simulated time was told to be `simulated` (s) at wall time (s)."""
        self._clock_heard, self._simulated = wall, simulated
        if self._simulated_heard is None or simulated < self._simulated_heard:
            # Where it went back what comes next is missed from then on.
            self._simulated_heard = simulated

    def heard(self, wall: float) -> None:
        """A step was answered at wall time (s)."""
        pause = wall - self._heard
        if LIMIT / 2.0 < pause < LONGEST:
            self._pauses.append((wall, pause))
        self._heard = wall
        self._stepped, self._suspected = True, False
        self._simulated_heard = self._simulated

    @property
    def limit(self) -> float:
        """Seconds without a step that are silence."""
        while self._pauses and self._heard - self._pauses[0][0] > MEMORY:
            self._pauses.popleft()
        if len(self._pauses) < OFTEN:
            return LIMIT
        usual = sorted(pause for _, pause in self._pauses)[-OFTEN]
        return min(max(LIMIT, BURSTS * usual), LONGEST)

    def since_heard(self, wall: float) -> float:
        """Seconds since the last step was answered, or since the watch began."""
        return wall - self._heard

    def silent(self, wall: float, simulated_time: bool) -> bool:
        """Whether to say now that nothing arrives; `simulated_time`: /clock is to be followed.

        It takes two looks, with time between them to take what is waiting: where this process
        itself had stalled, steps are not missing but late.
        """
        before, self._suspected = self._suspected, self._is_silent(wall, simulated_time)
        return before and self._suspected

    def _is_silent(self, wall: float, simulated_time: bool) -> bool:
        if self.since_heard(wall) <= self.limit:
            return False
        if not simulated_time:
            return True
        if self._clock_heard is None or self._simulated_heard is None:
            return self._stepped and self.since_heard(wall) > CLOCK_LOST
        if wall - self._clock_heard > CLOCK_LOST:
            return True
        return self._simulated - self._simulated_heard > self.limit
