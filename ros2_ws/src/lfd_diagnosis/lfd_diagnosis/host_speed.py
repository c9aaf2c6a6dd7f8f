"""The host's speed as evidence: its derivative, and whether it can be believed."""

from math import inf, isfinite, isnan, nan

from lfd_diagnosis.healthy_signal import LearntNoise, Repetition, Roughness, is_new
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind
from lfd_mpc.settings import STEP_S

STANDING = 0.3
"""Host speed in m/s below which the car may as well stand: equal samples mean nothing."""

JUMP = 0.5
"""Least jump in m/s between two samples that no car makes."""

POSSIBLE_ACCELERATION = 15.0
"""m/s^2 that a car may reach, a crash apart."""

JERK_FILTER = 0.15
"""Time constant in s of the filter whose derivative is the jerk."""

ROUGH_TIME = 0.3
"""Seconds of roughness that make a fault."""

SETTLING = 4.0
"""Filter times after which the derivative counts."""


def share_of(time: float) -> float:
    """What a first-order filter of that time constant (s) takes of a new value each step."""
    return STEP_S / (time + STEP_S)


class HostSpeed:
    """Derivative and jerk from samples of the host's speed, as long as they make sense."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self._noise = LearntNoise(0.03, 0.003, 1.0, settings.learn_noise)
        self.roughness = Roughness(32)
        self._repetition = Repetition(10)
        self._filter_time = settings.host_speed_filter_time
        self._share = share_of(self._filter_time)
        self._jerk_share = share_of(JERK_FILTER)
        self.restart()

    def restart(self) -> None:
        """Nothing from before counts but what was learnt."""
        self._believe()
        self._off = 0.0
        self._quiet = 0.0
        self.roughness.restart()
        self._repetition.restart()
        self.lose()

    def _believe(self) -> None:
        self.faulty, self.kind, self.because = False, Kind.UNKNOWN, ""
        self.size = nan

    def lose(self) -> None:
        """No sample, or none that is new enough."""
        self.last, self._last_at = nan, -inf
        self._rough_for = 0.0
        self._stop_following()

    def _stop_following(self) -> None:
        self._filtered = self.derivative = self._slow_derivative = nan
        self._followed = 0.0

    @property
    def usable(self) -> bool:
        """Whether `derivative` (m/s^2) is evidence now."""
        return self._followed >= SETTLING * self._filter_time

    @property
    def moving(self) -> bool:
        """Whether the car surely moves."""
        return abs(self.last) > STANDING

    @property
    def jerk(self) -> float:
        """m/s^3, filtered."""
        return (self.derivative - self._slow_derivative) / JERK_FILTER

    def step(self, at: float, value: float, acceleration: float, shaken: bool) -> None:
        """One step: newest sample in m/s of time `at` in s, the host accelerating as stated.

        `shaken`: the accelerometer feels a bad road.
        """
        if is_new(at, self._last_at):
            self._take(at, value, acceleration, shaken)
        if self.faulty:
            self._stop_following()
            return
        if isnan(self._filtered):
            # As if the host had gone on like this for long.
            self._slow_derivative = acceleration
            self._filtered = value - acceleration * self._filter_time
        self._filtered += self._share * (value - self._filtered)
        self.derivative = (value - self._filtered) / self._filter_time
        self._slow_derivative += self._jerk_share * (self.derivative - self._slow_derivative)
        self._followed += STEP_S

    def _take(self, at: float, value: float, acceleration: float, shaken: bool) -> None:
        settings = self._settings
        healthy = not self.faulty
        self.roughness.take(value, healthy)
        self._repetition.take(value, healthy)
        period = min(at - self._last_at, 1.0)
        if isfinite(self.last):
            self._check_jump(value, period, acceleration)
        self.last, self._last_at = value, at
        self._rough_for = self._rough_for + period if self.roughness.rough else 0.0
        if settings.check_repetition and self._repetition.frozen and self.moving:
            run = self._repetition.run + 1
            self._convict(Kind.HOLD, nan, f"{value:.2f} m/s for {run} samples on end")
        elif settings.check_roughness and self._rough_for >= ROUGH_TIME and not shaken:
            share = self.roughness.share
            self._convict(Kind.NOISE, nan, f"{share:.0%} of its samples far rougher than before")
        else:
            self._quiet += period
        # A speed that jumped and goes on smoothly is as good for its derivative, but who knows.
        needed = settings.requalify_time if self._off else settings.clear_time
        if self.faulty and self._quiet >= needed:
            self._believe()
            self._off = 0.0

    def _check_jump(self, value: float, period: float, acceleration: float) -> None:
        jump = value - self.last - acceleration * period
        limit = max(JUMP, 8.0 * self._noise.deviation) + POSSIBLE_ACCELERATION * period
        if abs(jump) <= limit:
            if not self.faulty:
                self._noise.take(jump, 0.0)
            return
        self._off += jump
        if self.faulty and abs(self._off) <= limit:
            self._off = 0.0
        kind = Kind.ZERO if value == 0.0 else Kind.OFFSET
        reason = f"a jump of {jump:.2f} m/s in {period * 1000:.0f} ms (limit {limit:.2f})"
        self._convict(kind, jump, reason)

    def _convict(self, kind: Kind, size: float, because: str) -> None:
        self._quiet = 0.0
        if not self.faulty:
            self.faulty, self.kind, self.size, self.because = True, kind, size, because
