"""The lead: as a generated drive's, as in a recording, in steps, or as it is told live.

`--lead` takes the name of a generated drive's lead (`braking:-6` with its peak in m/s^2), a drive
(recorded: host speed plus relative velocity), or steps in text: `20,-3@10-14,2@20-27` begins at
20 m/s and accelerates with -3 m/s^2 from 10 to 14 s, and with 2 m/s^2 from 20 to 27 s.
"""

import re
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.errors import UserError
from lfd_mpc.samples import HOST_SPEED, RadarSample
from lfd_mpc.settings import STEP_S
from lfd_replay.drive import Drive
from lfd_replay.generated.lead_profiles import NAMES, Change, Profile, lead_profile
from lfd_replay.read_drive import read_drive

FASTEST = 70.0
"""m/s that a car may reach: the lead, and the host at first."""

STRONGEST = 12.0
"""m/s^2 that a lead may accelerate or brake with."""

AFTER_STEPS = 15.0
"""Seconds that go on after the last step."""

WITHOUT_STEPS = 15.0
"""Seconds before these where there is no step."""

LATEST = 3600.0
"""Seconds at which the last step must have ended."""

SMOOTHED = 0.6
"""Seconds over which a recorded lead's speed is smoothed, as it is differentiated."""

LONGEST_GAP = 2.0
"""Seconds between two scans of a recorded lead beyond which nobody knows what it did."""

LEAST_SEEN = 0.5
"""Share of a recording, from the lead's first scan to its last one, in which it must be known."""

_NUMBER = r"[-+]?(?:\d+(?:\.\d*)?|\.\d+)"
_STEP = re.compile(rf"\s*({_NUMBER})@({_NUMBER})-({_NUMBER})\s*")

GRAMMAR = "SPEED[,ACCELERATION@START-END...], e.g. 20,-3@10-14"


@dataclass(frozen=True)
class LeadPlan:
    """What a lead does over `duration` s: `acceleration` (m/s^2) every 10 ms from `speed` (m/s).

    `grade` of the road every 10 ms, `changes` of the lead, and times of `bumps` in s.
    `recording`: what it was read from, None where it was made up.
    """

    name: str
    speed: float
    acceleration: Array
    grade: Array
    changes: tuple[Change, ...] = ()
    bumps: tuple[float, ...] = ()
    recording: Path | None = None

    @property
    def duration(self) -> float:
        """In s."""
        return len(self.acceleration) * STEP_S


class Lead:
    """Drives; nobody drives backwards."""

    def __init__(self, motion: LeadPlan, position: float) -> None:
        """Begin with the rear bumper at `position` (m)."""
        self._motion = motion
        self._changes = {round(change.time / STEP_S): change for change in motion.changes}
        self._told: float | None = None
        self.step_number = 0
        self.position, self.speed, self.track_id = position, motion.speed, 1
        self.acceleration = self._wanted()

    def tell(self, acceleration: float) -> None:
        """Accelerate so from now on, in m/s^2. Raises ValueError for what no car can do."""
        if not (isfinite(acceleration) and abs(acceleration) <= STRONGEST):
            raise ValueError(
                f"the lead cannot accelerate with {acceleration:g} m/s^2; "
                f"-{STRONGEST:g} to {STRONGEST:g} is expected"
            )
        self._told = acceleration

    def step(self, host_position: float) -> None:
        """Go on by 10 ms."""
        speed = min(max(self.speed + STEP_S * self.acceleration, 0.0), FASTEST)
        self.position += 0.5 * STEP_S * (self.speed + speed)
        self.speed = speed
        self.step_number += 1
        change = self._changes.get(self.step_number)
        if change is not None:
            self.position = host_position + change.gap * (self.position - host_position)
            self.speed = max(self.speed + change.faster, 0.0)
            self.track_id = change.track_id
        self.acceleration = self._wanted()

    def _wanted(self) -> float:
        wanted = self._motion.acceleration
        at = min(self.step_number, len(wanted) - 1)
        acceleration = float(wanted[at]) if self._told is None else self._told
        return acceleration if self.speed > 0.0 else max(acceleration, 0.0)


def lead_plan(text: str) -> LeadPlan:
    """A lead as text. Raises UserError that names what was wrong and what is accepted."""
    name, _, peak = text.partition(":")
    if name in NAMES:
        return _generated(text, name, peak)
    if re.fullmatch(rf"\s*{_NUMBER}\s*(,.*)?", text):
        return _in_steps(text)
    if (path := Path(text)).exists():
        return replace(recorded_lead(read_drive(path)), recording=path)
    raise UserError(
        f"lead '{text}': no file, no generated lead ({', '.join(NAMES[:8])}, normal-01 to "
        f"normal-27), and no steps ({GRAMMAR})"
    )


def _generated(text: str, name: str, peak: str) -> LeadPlan:
    try:
        profile: Profile = lead_profile(name, float(peak) if peak else None)
    except ValueError as error:
        raise UserError(f"lead '{text}': '{peak}' is no number of m/s^2") from error
    except UserError as error:
        raise UserError(f"lead '{text}': {error}") from error
    time = np.arange(round(profile.duration / STEP_S)) * STEP_S
    return LeadPlan(
        text,
        profile.speed,
        profile.acceleration(time),
        np.asarray(profile.grade(time), dtype=float),
        profile.changes,
        profile.bumps,
    )


def _in_steps(text: str) -> LeadPlan:
    first, *parts = text.split(",")
    speed, steps = float(first), []
    if not 0.0 <= speed <= FASTEST:
        raise UserError(f"lead '{text}': a speed of 0 to {FASTEST:g} m/s is expected first")
    for part in parts:
        match = _STEP.fullmatch(part)
        if match is None:
            raise UserError(f"lead '{text}': '{part}' is no step; expected {GRAMMAR}")
        acceleration, start, end = map(float, match.groups())
        if not (abs(acceleration) <= STRONGEST and 0.0 <= start < end <= LATEST):
            raise UserError(
                f"lead '{text}': '{part}': an acceleration of -{STRONGEST:g} to {STRONGEST:g} "
                f"m/s^2 and times of 0 to {LATEST:g} s, the start before the end, are expected"
            )
        steps.append((acceleration, round(start / STEP_S), round(end / STEP_S)))
    count = max((end for _, _, end in steps), default=round(WITHOUT_STEPS / STEP_S))
    wanted = np.zeros(count + round(AFTER_STEPS / STEP_S))
    for acceleration, start, end in steps:
        wanted[start:end] = acceleration
    reached = speed + np.cumsum(wanted) * STEP_S
    if reached.max() > FASTEST:
        raise UserError(f"lead '{text}': it would reach {reached.max():.0f} of {FASTEST:g} m/s")
    return LeadPlan(text, speed, wanted, np.zeros(len(wanted)))


def recorded_lead(drive: Drive) -> LeadPlan:
    """The lead of a recording: host speed plus relative velocity, smoothed and differentiated.

    From the lead's first scan to its last one, or to that of the host speed. Raises UserError where
    there is no host speed, too little of both, or no lead for most of that time.
    """
    from scipy.ndimage import gaussian_filter1d

    scans = [
        (scan.stamp, scan.relative_velocity)
        for scan in drive.samples
        if isinstance(scan, RadarSample) and scan.has_target and isfinite(scan.relative_velocity)
    ]
    speeds = [
        (s.stamp, s.value) for s in drive.samples if s.input == HOST_SPEED and isfinite(s.value)
    ]
    if len(speeds) < 2 or len(scans) < 2:
        raise UserError(f"lead '{drive.name}': host speed and a lead are needed to know the lead's")
    zero = scans[0][0]
    end = min(scans[-1][0], speeds[-1][0])
    time = np.arange(0.0, (end - zero) * 1e-9, STEP_S)
    stamps, velocity = np.array(scans).T
    host_stamps, host = np.array(speeds).T
    speed = np.interp(time, (stamps - zero) * 1e-9, velocity)
    speed += np.interp(time, (host_stamps - zero) * 1e-9, host)
    if len(time) < 100:
        raise UserError(f"lead '{drive.name}': less than 1 s of a lead with host speed")
    gaps = np.diff(stamps[stamps <= end]) * 1e-9
    unseen, whole = gaps[gaps > LONGEST_GAP].sum(), time[-1]
    if unseen > (1.0 - LEAST_SEEN) * whole:
        raise UserError(
            f"lead '{drive.name}': no lead for {unseen:.1f} of {whole:.1f} s from its first scan "
            f"on; one that is seen for {LEAST_SEEN:.0%} of that time is expected"
        )
    speed = gaussian_filter1d(speed.clip(0.0, FASTEST), SMOOTHED / 2.0 / STEP_S, mode="nearest")
    acceleration = np.gradient(speed, STEP_S).clip(-STRONGEST, STRONGEST)
    return LeadPlan(drive.name, float(speed[0]), acceleration, np.zeros(len(time)))
