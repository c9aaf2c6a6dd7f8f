"""How a node or a sensor is doing, for /diagnostics; knows nothing of ROS.

| level | a sensor | a node |
|---|---|---|
| OK | OK, NO_TARGET, or an optional input that was never there | answers steps |
| WARN | NOT_READY, SUSPECT | waits for its first step; missed steps, solved anew or slowly; \
refused messages or samples |
| ERROR | FAULT | |
| STALE | NO_DATA | no step for `SILENT` s |
"""

from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

from lfd_mpc.arrival import AHEAD_NS
from lfd_mpc.settings import STEP_NS, STEP_S

PERIOD = 1.0
"""Seconds between two statuses, and over which rates and times are taken."""

SILENT = 0.5
"""Seconds without a step after which a node's status is stale."""


class Level(IntEnum):
    """Levels; the values are those of `diagnostic_msgs/DiagnosticStatus`."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


BADNESS = {Level.OK: 0, Level.WARN: 1, Level.STALE: 2, Level.ERROR: 3}
"""Which of two levels is shown where both were there since the last status."""


@dataclass(frozen=True)
class Health:
    """One status: what it is of, the hardware behind it, and key values with their units."""

    name: str
    hardware: str
    level: Level
    message: str
    values: dict[str, str] = field(default_factory=dict)


class StepHealth:
    """Steps of one node: how many in the last second, how long they take, which were missed."""

    def __init__(self) -> None:
        self._recent: deque[tuple[float, float]] = deque()
        self._last_stamp: int | None = None
        self._last_wall = 0.0
        self._missed = self._jumps = self._fallbacks = self._misfits = self._refused = 0
        self._missed_before = self._fallbacks_before = self._refused_before = 0
        self._bad = self._misfits_before = self._bad_before = 0
        self._refused_because = ""

    def step(
        self,
        wall: float,
        stamp: int,
        duration: float,
        fallbacks: int = 0,
        misfits: int = 0,
        bad: int = 0,
    ) -> None:
        """A step of that stamp (ns) was answered at wall time (s) and took `duration` s.

        `fallbacks`: how many steps so far were solved anew by another solver; `misfits`: how many
        samples so far were refused, whose stamps fit no other input; `bad`: how many were no
        numbers.
        """
        if self._last_stamp is not None:
            ahead = stamp - self._last_stamp
            if 0 < ahead <= AHEAD_NS:
                self._missed += ahead // STEP_NS - 1
            else:
                self._jumps += 1
        self._last_stamp, self._last_wall = stamp, wall
        self._fallbacks, self._misfits, self._bad = fallbacks, misfits, bad
        self._recent.append((wall, duration))
        self._forget(wall)

    def refuse(self, because: str) -> None:
        """A message was refused."""
        self._refused += 1
        self._refused_because = because

    def _forget(self, wall: float) -> None:
        while self._recent and wall - self._recent[0][0] > PERIOD:
            self._recent.popleft()

    def health(self, name: str, wall: float, values: dict[str, str]) -> Health:
        """The status at wall time (s), with further `values`; begins a new period."""
        self._forget(wall)
        longest = max((duration for _, duration in self._recent), default=0.0)
        mean = sum(duration for _, duration in self._recent) / max(len(self._recent), 1)
        missed = self._missed - self._missed_before
        fallbacks = self._fallbacks - self._fallbacks_before
        refused = self._refused - self._refused_before
        self._missed_before, self._fallbacks_before = self._missed, self._fallbacks
        misfits = self._misfits - self._misfits_before
        bad = self._bad - self._bad_before
        self._refused_before, self._misfits_before = self._refused, self._misfits
        self._bad_before = self._bad
        age = wall - self._last_wall
        if refused:
            level = Level.WARN
            message = f"{refused} messages refused in the last second: {self._refused_because}"
        elif self._last_stamp is None:
            level, message = Level.WARN, "waiting for the first step"
        elif age > SILENT:
            level, message = Level.STALE, f"no step for {age:.1f} s (limit {SILENT:g} s)"
        elif misfits:
            text = f"{misfits} samples refused in the last second: stamps that fit no other input"
            level, message = Level.WARN, text
        elif bad:
            text = f"{bad} samples in the last second are no numbers: they count as not received"
            level, message = Level.WARN, text
        elif missed:
            level, message = Level.WARN, f"{missed} steps missed in the last second"
        elif fallbacks:
            level, message = Level.WARN, f"{fallbacks} steps solved anew in the last second"
        elif longest > STEP_S:
            level, message = Level.WARN, f"a step took {longest * 1e3:.1f} ms (limit 10 ms)"
        else:
            level, message = Level.OK, f"{len(self._recent)} steps in the last second"
        known = self._last_stamp is not None
        own = {
            "rate [1/s]": f"{len(self._recent)}",
            "age of the last step [s]": f"{age:.3f}" if known else "none",
            "time of a step, mean [ms]": f"{mean * 1e3:.3f}",
            "time of a step, longest [ms]": f"{longest * 1e3:.3f}",
            "missed steps": f"{self._missed}",
            "jumps of time": f"{self._jumps}",
            "refused messages": f"{self._refused}",
        }
        return Health(name, "", level, message, {**own, **values})
