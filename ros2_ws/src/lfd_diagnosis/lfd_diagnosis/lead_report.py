"""What the lead says of its own acceleration (V2V): whether it can serve as evidence."""

from math import isnan, nan

from lfd_diagnosis.healthy_signal import is_new
from lfd_diagnosis.host_speed import share_of
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_mpc.horizon import Horizon
from lfd_mpc.settings import STEP_S

FILTER = 0.3
"""Time constant in s through which what the lead says and what is seen of it are compared."""

DISAGREEMENT = 1.5
"""Least difference in m/s^2 that is called one."""

POSSIBLE_JERK = 15.0
"""m/s^3 that a lead may reach."""

DISAGREEING = 0.3
"""Seconds of disagreement after which what the lead says is not believed."""


class LeadReport:
    """Trusted once it has agreed for a while with what radar and host make of the lead."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self._share = share_of(FILTER)
        self._limit = max(DISAGREEMENT, 5.0 * settings.lead_report_std)
        self.restart()

    def restart(self) -> None:
        """Nothing that was said before counts."""
        self.faulty, self.because = False, ""
        self.off = self._filtered = nan
        self._agreeing = self._disagreeing = 0.0
        self.acceleration = nan
        self.heard = False
        self._last_at = nan

    @property
    def limit(self) -> float:
        """Difference in m/s^2 beyond which what the lead says disagrees."""
        return self._limit

    @property
    def trusted(self) -> bool:
        """Whether `acceleration` (m/s^2) is evidence now."""
        return self.heard and not self.faulty and self._agreeing >= self._settings.requalify_time

    def _check_jump(self, value: float, period: float) -> None:
        """No car changes its acceleration as fast; what jumps is not believed, seen or not."""
        limit = 5.0 * self._settings.lead_report_std + POSSIBLE_JERK * period
        if abs(value - self.acceleration) > limit:
            self._agreeing = 0.0
            self.faulty = True
            self.because = (
                f"it jumped from {self.acceleration:.2f} to {value:.2f} m/s^2 (limit {limit:.2f})"
            )

    def step(self, horizon: Horizon, seen: float) -> None:
        """Take one step; `seen`: the lead's acceleration in m/s^2 without it, NaN = not known."""
        settings = self._settings
        age = horizon.lead_acceleration_age
        self.heard = settings.use_lead_report and -1.0 < age <= settings.lead_report_timeout
        if not self.heard:
            self.acceleration = self._filtered = self._last_at = nan
            self._agreeing = self._disagreeing = 0.0
            return
        at = horizon.stamp * 1e-9 - age
        if is_new(at, self._last_at):
            self._check_jump(horizon.measured_lead_acceleration, at - self._last_at)
        self._last_at = at
        self.acceleration = horizon.measured_lead_acceleration
        if isnan(seen):
            return
        difference = self.acceleration - seen
        if isnan(self._filtered):
            self._filtered = difference
        self._filtered += self._share * (difference - self._filtered)
        self.off = self._filtered
        if abs(self.off) <= self._limit:
            self._disagreeing = 0.0
            self._agreeing += STEP_S
            if self.faulty and self._agreeing >= settings.requalify_time:
                self.faulty, self.because = False, ""
            return
        self._disagreeing += STEP_S
        if self._disagreeing >= DISAGREEING:
            self._agreeing = 0.0
            self.faulty = True
            self.because = (
                f"it says {self.acceleration:.2f} m/s^2, radar and host make it "
                f"{self.acceleration - self.off:.2f} (limit {self._limit:.2f})"
            )
