"""Which of a radar's tracks is the lead: one rule for logs, bags and live topics.

1. Where the radar itself names the track that drives ahead in its path, that is the lead, and
   there is none where it says so.
2. Of a radar that never says, the lead is the nearest moving track in the host's path: within
   `HALF_PATH` of a path that is curved as the yaw rate says, straight where that is not known.
3. A lead stays the lead while its track is measured near the path. A nearer track takes over only
   when it has been nearer for `CONFIRMED` scans, so that clutter and duplicates of one car do not
   swap; a car that takes over is another lead and gets another track id.
4. A track that continues the lead's motion is the same car, whatever its number: the id stays.
5. A lead that is not measured (coasted, invalid, or gone) is waited for during `PATIENCE`: the
   scan then holds no measurement, and that is no change of lead. After it the next one is chosen.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite, nan

from lfd_mpc.samples import UNKNOWN_TRACK, RadarSample

HALF_PATH = 1.8
"""Half the width of the host's path in m."""

LEAVES_PATH = 2.4
"""Distance from the middle of the path in m at which a lead has left it."""

LEAST_SPEED = 2.0
"""Speed over ground in m/s from which on a track moves."""

LEAST_HOST_SPEED = 3.0
"""Host speed in m/s below which the yaw rate tells no curvature."""

CONFIRMED = 3
"""Scans in a row for which a new lead must have been seen."""

PATIENCE_NS = 500_000_000
"""How long a lead that is not measured is waited for."""

NO_MEASUREMENT = 1e6
"""m and m/s from which a number of a track is none that a radar measures, whatever its unit."""

SAME_CLEARANCE, SAME_VELOCITY = 2.5, 1.5
"""Two tracks are one car when they differ by less, in m and m/s."""


@dataclass(frozen=True)
class Track:
    """One radar track of one scan: distances in m, `lateral` positive to the left.

    `relative_velocity` in m/s, positive where the gap opens. `measured` is false for a coasted or
    invalid one. `moving` is what the radar says of it, None where it says nothing.
    """

    number: int
    clearance: float
    lateral: float
    relative_velocity: float
    measured: bool = True
    moving: bool | None = None

    @property
    def is_possible(self) -> bool:
        """Whether a radar may have measured that: each number is one, and not absurd."""
        numbers = (self.clearance, self.lateral, self.relative_velocity)
        return all(abs(number) < NO_MEASUREMENT for number in numbers)


@dataclass
class HostMotion:
    """How the host moves, as last heard from whatever says so; None = not known.

    `speed` in m/s, `yaw_rate` in rad/s, positive to the left.
    """

    speed: float | None = None
    yaw_rate: float | None = None

    def hear(self, speed: float | None = None, yaw_rate: float | None = None) -> None:
        """Take what one message says; what is not finite says nothing."""
        if speed is not None and isfinite(speed):
            self.speed = speed
        if yaw_rate is not None and isfinite(yaw_rate):
            self.yaw_rate = yaw_rate


class LeadSelector:
    """The rule above, scan after scan."""

    def __init__(self, counts: Counter[str] | None = None) -> None:
        """`counts` is where tracks are noted that are left out."""
        self._counts: Counter[str] = Counter() if counts is None else counts
        self._lead: Track | None = None
        self._seen = 0
        self._track_id = 0
        self._candidate: int | None = None
        self._confirmed = 0
        self._before: dict[int, int] = {}

    def select(
        self,
        stamp: int,
        tracks: Sequence[Track],
        host_speed: float | None = None,
        yaw_rate: float | None = None,
        in_path: int | None = None,
    ) -> RadarSample:
        """The lead of one scan at `stamp` (ns).

        `host_speed` in m/s and `yaw_rate` in rad/s, positive to the left; `in_path` is the number
        of the track that the radar takes for the lead, 0 = none, None = it does not say.
        """
        said = [t for t in tracks if t.measured]
        # As of one whose rolling count is stuck: a single odd track costs nobody the scan.
        possible = [t for t in said if t.is_possible]
        self._counts["tracks with an impossible position or rate"] += len(said) - len(possible)
        measured = [t for t in possible if t.clearance > 0.0]
        if self._lead is not None and not -PATIENCE_NS <= stamp - self._seen <= PATIENCE_NS:
            self._lead = None
        if in_path is None:
            lead = self._by_path(stamp, measured, host_speed, yaw_rate)
        else:
            lead = next((t for t in measured if t.number == in_path), None)
        self._before = {t.number: self._before.get(t.number, 0) + 1 for t in measured}

        if lead is not None:
            if self._lead is None or not self._continues(lead, stamp):
                self._track_id += 1
            self._lead, self._seen = lead, stamp
            return RadarSample(stamp, True, lead.clearance, lead.relative_velocity, self._track_id)
        if self._lead is not None and in_path != 0:
            # Still there, for all we know, and not measured.
            return RadarSample(stamp, True, nan, nan, self._track_id)
        self._lead = None
        return RadarSample(stamp, False, nan, nan, UNKNOWN_TRACK)

    def _by_path(
        self,
        stamp: int,
        measured: list[Track],
        host_speed: float | None,
        yaw_rate: float | None,
    ) -> Track | None:
        curvature = 0.0
        if host_speed is not None and yaw_rate is not None and host_speed > LEAST_HOST_SPEED:
            curvature = yaw_rate / host_speed

        def aside(track: Track) -> float:
            return abs(track.lateral - 0.5 * curvature * track.clearance**2)

        inside = [t for t in measured if aside(t) < HALF_PATH and self._moves(t, host_speed)]
        nearest = min(inside, key=lambda t: t.clearance, default=None)
        kept = self._kept(stamp, [t for t in measured if aside(t) < LEAVES_PATH])
        if nearest is None or (kept is not None and self._one_car(kept, nearest)):
            self._candidate = None
            return kept
        if kept is not None and nearest.clearance > kept.clearance:
            self._candidate = None
            return kept
        # Somebody else: believed when seen often enough.
        same = nearest.number == self._candidate
        self._candidate = nearest.number
        self._confirmed = self._confirmed + 1 if same else 1
        if kept is None and self._lead is None:
            self._confirmed = max(self._confirmed, self._before.get(nearest.number, 0) + 1)
        return nearest if self._confirmed >= CONFIRMED else kept

    def _kept(self, stamp: int, near: list[Track]) -> Track | None:
        """The present lead in this scan, under its own number or another one."""
        lead = self._lead
        if lead is None:
            return None
        continuing = [t for t in near if self._continues(t, stamp)]
        own = next((t for t in continuing if t.number == lead.number), None)
        if own is not None:
            return own
        return min(continuing, key=lambda t: abs(t.clearance - self._expected(stamp)), default=None)

    def _expected(self, stamp: int) -> float:
        """Where the lead should be by now, in m."""
        assert self._lead is not None
        return self._lead.clearance + self._lead.relative_velocity * (stamp - self._seen) * 1e-9

    def _continues(self, track: Track, stamp: int) -> bool:
        """Whether a track goes on where the lead was."""
        lead = self._lead
        return (
            lead is not None
            and abs(track.clearance - self._expected(stamp)) < SAME_CLEARANCE
            and abs(track.relative_velocity - lead.relative_velocity) < SAME_VELOCITY
        )

    def _moves(self, track: Track, host_speed: float | None) -> bool:
        """Whether a track moves over ground; a lead that has stopped is still the lead."""
        if track.moving is not None:
            return track.moving
        if host_speed is None:
            return True
        return abs(host_speed + track.relative_velocity) > LEAST_SPEED

    def _one_car(self, one: Track, other: Track) -> bool:
        return (
            one.number == other.number
            or abs(one.clearance - other.clearance) < SAME_CLEARANCE
            and abs(one.relative_velocity - other.relative_velocity) < SAME_VELOCITY
        )
