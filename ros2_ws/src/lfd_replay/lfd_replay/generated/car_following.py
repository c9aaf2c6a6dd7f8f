"""A driver behind a lead: the intelligent driver model with reaction time, engine and brakes.

The model and its figures are Treiber and Kesting's (Traffic Flow Dynamics, chapters 11 and 12).
The lags of powertrain and brakes are first-order and of the size of production cars'.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.arrays import Array
from lfd_mpc.settings import STEP_S
from lfd_replay.generated.lead_profiles import Profile


@dataclass(frozen=True)
class Driver:
    """Intelligent driver model with reaction time."""

    desired_speed: float = 40.0  # m/s
    time_gap: float = 1.4  # s
    standstill_gap: float = 4.0  # m
    acceleration: float = 1.4  # m/s^2
    comfortable_braking: float = 2.0  # m/s^2
    hardest_braking: float = -9.0  # m/s^2
    reaction_time: float = 0.6  # s
    powertrain_lag: float = 0.3  # s
    brake_lag: float = 0.15  # s

    def wanted(self, gap: float, speed: float, relative_velocity: float) -> float:
        """Acceleration in m/s^2 for a gap in m and speeds in m/s."""
        braking = 2.0 * (self.acceleration * self.comfortable_braking) ** 0.5
        dynamic = speed * self.time_gap - speed * relative_velocity / braking
        wanted_gap = self.standstill_gap + max(0.0, dynamic)
        wanted = self.acceleration * (
            1.0 - (speed / self.desired_speed) ** 4 - (wanted_gap / max(gap, 0.1)) ** 2
        )
        return max(wanted, self.hardest_braking)

    def equilibrium_gap(self, speed: float) -> float:
        """Gap in m at which the driver neither accelerates nor brakes at a speed in m/s."""
        free = 1.0 - (speed / self.desired_speed) ** 4
        return (self.standstill_gap + speed * self.time_gap) / free**0.5


@dataclass(frozen=True)
class Truth:
    """What really happens, every 10 ms: arrays of equal length in s, m, m/s and m/s^2.

    `grade` is the slope of the road (1 = 45 degrees), `track_id` tells the leads apart, `bumps`
    are times in s. `pitch` of the body in rad, nose up; None = in proportion to the acceleration.
    """

    time: Array
    clearance: Array
    relative_velocity: Array
    host_speed: Array
    host_acceleration: Array
    lead_acceleration: Array
    grade: Array
    track_id: NDArray[np.int64]
    bumps: tuple[float, ...]
    pitch: Array | None = None


def simulate(profile: Profile, driver: Driver) -> Truth:
    """Drive the follower behind the lead."""
    count = round(profile.duration / STEP_S) + 1
    time = np.arange(count) * STEP_S
    wanted_lead = profile.acceleration(time).tolist()
    delay = round(driver.reaction_time / STEP_S)
    changes = {round(change.time / STEP_S): change for change in profile.changes}
    gap = [driver.equilibrium_gap(profile.speed)] * count
    host, lead = [profile.speed] * count, [profile.speed] * count
    host_acceleration, lead_acceleration = [0.0] * count, [0.0] * count
    track = [1] * count
    for k in range(count):
        if k in changes:
            change = changes[k]
            gap[k] *= change.gap
            lead[k] += change.faster
            track[k:] = [change.track_id] * (count - k)
        # Nobody drives backwards.
        lead_acceleration[k] = wanted_lead[k] if lead[k] > 0.0 else max(wanted_lead[k], 0.0)
        if k + 1 == count:
            break
        seen = max(k - delay, 0)
        wanted = driver.wanted(gap[seen], host[seen], lead[seen] - host[seen])
        applied = host_acceleration[k]
        lag = driver.powertrain_lag if wanted > applied else driver.brake_lag
        following = applied + STEP_S / lag * (wanted - applied)
        host[k + 1] = max(host[k] + STEP_S * applied, 0.0)
        # The brakes hold the car; they do not push it back.
        host_acceleration[k + 1] = following if host[k + 1] > 0.0 else max(following, 0.0)
        lead[k + 1] = max(lead[k] + STEP_S * lead_acceleration[k], 0.0)
        gap[k + 1] = gap[k] + STEP_S * (lead[k] - host[k])
    speed = np.array(host)
    return Truth(
        time,
        np.array(gap),
        np.array(lead) - speed,
        speed,
        np.array(host_acceleration),
        np.array(lead_acceleration),
        np.asarray(profile.grade(time) + profile.road(np.cumsum(speed) * STEP_S), dtype=float),
        np.array(track),
        profile.bumps,
    )
