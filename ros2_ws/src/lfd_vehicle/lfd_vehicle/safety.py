"""How safe and how comfortable a closed-loop run was."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.decision import FaultLevel
from lfd_mpc.settings import STEP_S

CLOSING = 0.1
"""m/s of closing speed below which there is no time to collision."""

JERK_WINDOW = 20
"""Steps over which the acceleration is averaged before its jerk is taken: what a body feels."""

SETTLED = 1.0
"""Seconds at the beginning that do not count: the car begins at a steady speed."""


@dataclass(frozen=True)
class Safety:
    """Figures of one run: m, s, m/s^2 and m/s^3, decelerations as positive numbers.

    `contact_speed` is the closing speed at which the cars touched, 0 where they did not;
    `intervened` the share of the time at a level above normal, `interventions` how often one began.
    """

    collided: bool
    contact_speed: float
    least_clearance: float
    least_time_to_collision: float
    largest_deceleration: float
    largest_jerk: float
    intervened: float
    interventions: int
    worst_level: int

    def figures(self) -> dict[str, Any]:
        """As JSON; no time to collision is null."""
        values = asdict(self)
        if self.least_time_to_collision == inf:
            values["least_time_to_collision"] = None
        return values

    def texts(self) -> dict[str, str]:
        """In words, for a terminal."""
        time = self.least_time_to_collision
        return {
            "collision": f"at {self.contact_speed:.1f} m/s" if self.collided else "none",
            "least clearance": f"{self.least_clearance:.1f} m",
            "least time to collision": "none" if time == inf else f"{time:.1f} s",
            "largest deceleration": f"{self.largest_deceleration:.1f} m/s^2",
            "largest jerk": f"{self.largest_jerk:.1f} m/s^3",
            "interventions": f"{self.interventions}, {100 * self.intervened:.0f} % of the time, "
            f"worst level {FaultLevel(self.worst_level).name}",
        }


def safety_of(truth: Sequence[Any], levels: Iterable[int], collided: bool) -> Safety:
    """Figures of one run.

    `truth` has `clearance`, `relative_velocity` and `host_acceleration` at each step, of which
    there is one at least; `levels` are the fault levels decided at each step.
    """
    clearance = np.array([moment.clearance for moment in truth])
    velocity = np.array([moment.relative_velocity for moment in truth])
    acceleration = np.array([moment.host_acceleration for moment in truth])
    level = np.fromiter(levels, dtype=int)
    closing = velocity < -CLOSING
    times = clearance[closing] / -velocity[closing]
    felt = acceleration[round(SETTLED / STEP_S) :]
    above = level > FaultLevel.NORMAL
    begins = int(np.count_nonzero(above[1:] & ~above[:-1])) + int(above[:1].any())
    return Safety(
        collided=bool(collided),
        contact_speed=float(max(-velocity[-1], 0.0)) if collided else 0.0,
        least_clearance=0.0 if collided else float(clearance.min()),
        least_time_to_collision=0.0 if collided else float(times.min(initial=inf)),
        largest_deceleration=float(max(-felt.min(initial=0.0), 0.0)),
        largest_jerk=_largest_jerk(felt),
        intervened=float(above.mean()) if len(above) else 0.0,
        interventions=begins,
        worst_level=int(level.max(initial=0)),
    )


def _largest_jerk(felt: NDArray[np.float64]) -> float:
    """In m/s^3, of accelerations (n,) in m/s^2; 0 where they are too few to tell."""
    if len(felt) < 2 * JERK_WINDOW:
        return 0.0
    mean = np.convolve(felt, np.full(JERK_WINDOW, 1.0 / JERK_WINDOW), "valid")
    return float(np.abs(mean[JERK_WINDOW:] - mean[:-JERK_WINDOW]).max() / (JERK_WINDOW * STEP_S))
