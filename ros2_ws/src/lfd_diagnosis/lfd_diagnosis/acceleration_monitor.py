"""The host's accelerometer against its speed, the observers and the lead's word (robust profile).

With the host's speed: the accelerometer and the derivative of the speed go through the same filter;
their difference is gravity on a slope, which changes slowly, and some noise. A fault is a sudden
change of the difference, or more of it than any road makes.

Without it: no car changes its acceleration by metres per second squared within a tenth of a second
and keeps it there, unless the lead seems to do the very same (then it is the accelerometer).
"""

from collections import deque
from dataclasses import dataclass
from math import exp, inf, isfinite, isnan, nan, sqrt

from lfd_diagnosis.healthy_signal import LearntNoise, Repetition, Roughness, is_new
from lfd_diagnosis.host_speed import ROUGH_TIME, HostSpeed, share_of
from lfd_diagnosis.lead_report import LeadReport
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind
from lfd_mpc.horizon import Horizon
from lfd_mpc.settings import STEP_S

BASELINE, BASELINE_DELAY = 0.7, 30
"""Time constant in s and delay in steps of what the difference was a moment ago."""

WARM_UP = 3.0
"""Seconds over which the limits come down from thrice to once their width."""

LARGEST_LAG = 0.3
"""Largest lag in s between accelerometer and speed that is learnt."""

LAG_MEMORY, LAG_PRIOR = 1000, 40.0
"""Samples that the lag is learnt over, and how much jerk (m^2/s^6) it takes to move it."""

SLOPE_TIME = 4.0
"""Time constant in s of the slow mean, as far as its rate allows."""

BURST = 0.15
"""Share of a shaking's rms by which limits widen."""

SHAKEN = 0.1
"""Share of rough samples above which the road shakes a sensor."""

SHAKEN_LIMIT = 1.6
"""How much larger a jump must be while the road shakes the sensor."""

ROUGH_TIME_ALONE = 1.5
"""Seconds of roughness that make a fault where nothing tells a bad road from a bad sensor."""

SMOOTH = 0.3
"""Time constant in s through which an acceleration is rebuilt from the relative one."""

SLOPE_DRIFT, DRIFT_TIME = 0.12, 10.0
"""What a road's slope makes of the difference: m/s^2 per square root of a second, for so long."""

SIZE_FROM, SIZE_TO = 30, 130
"""Steps after conviction over which the size of a jump is averaged."""

SHARP, SHARP_GAP = 8, 4
"""Steps that are averaged before and after a jump, and steps between them."""

JUMP_MEMORY = 25
"""Steps after a jump in which it is held against the observers."""

RADAR_GONE = 30
"""Steps for which the last relative acceleration stands in for one that is no longer known."""

OWN_SHARE = 0.7
"""Share of its difference from the lead's word that the accelerometer must have made itself."""

LEAD_MEMORY = 2.0
"""Seconds over which the lead's acceleration is known when it is not measured."""

BACK, BACK_STEPS = 0.65, 5
"""Share of a fault by which it must jump back, and for how many steps, to be over."""

BLIND_STD = 0.7
"""m/s^2 to which an acceleration is known from the lead's alone: how much that varies."""

LEAST = 0.6
"""m/s^2 within which an acceleration that jumped must come back."""


@dataclass
class Check:
    """What one kind of evidence says: how far off, how far it may be, and since what."""

    name: str
    residual: float
    limit: float
    kind: Kind
    reference: float = nan

    @property
    def exceeded(self) -> bool:
        """Whether the acceleration disagrees with this evidence."""
        return abs(self.residual) > self.limit

    def text(self) -> str:
        """In words, with figures."""
        return f"{self.name}: off by {self.residual:.2f} m/s^2 (limit {self.limit:.2f})"


class AccelerationMonitor:
    """Judges the acceleration signal, and says how the host really accelerates."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        learn = settings.learn_noise
        self.speed = HostSpeed(settings)
        self._roughness = Roughness(64)
        self._repetition = Repetition(8)
        # Noise of the difference against a moment ago, and against its slow mean.
        self._step_noise = LearntNoise(0.15, 0.03, 1.0, learn, memory=2000)
        self._slow_noise = LearntNoise(0.2, 0.05, 1.0, learn, memory=2000)
        self._share = share_of(settings.host_speed_filter_time)
        self._base_share = share_of(BASELINE)
        self._relative_share = share_of(SMOOTH)
        self._report_noise = LearntNoise(
            max(0.25, settings.lead_report_std), 0.1, 1.0, learn, memory=2000
        )
        self._lag_product, self._lag_square = 0.0, LAG_PRIOR
        self._slope, self._slope_known = 0.0, 0.0
        self._ticks = 0
        self.restart()

    def restart(self) -> None:
        """Nothing from before counts but what was learnt."""
        self.check: Check | None = None
        self._forgive()
        self.speed.restart()
        self._roughness.restart()
        self._repetition.restart()
        self._last_at = -inf
        self._fresh, self._new_samples = False, 0
        self._filtered, self._burst = nan, 0.0
        self._before_jump: deque[float] = deque(maxlen=8)
        self._samples: deque[float] = deque(maxlen=2 * SHARP + SHARP_GAP)
        self._lead, self._lead_slow = nan, nan
        self._lead_recent: deque[float] = deque(maxlen=BASELINE_DELAY)
        self._report_off = 0.0
        self._relative_now = self._relative_slow = self._before = 0.0
        self._relative, self._radar_gone = 0.0, RADAR_GONE
        self._jumped_for, self._jump_sign = 0, 0.0
        self._rough_for = 0.0
        self._shaken = False
        self.acceleration = 0.0

    def _forgive(self) -> None:
        self.faulty, self.kind, self.because = False, Kind.UNKNOWN, ""
        self.confidence, self._agreeing = 0, 0.0
        self._reference = self._lead_reference = nan
        self.size = self.size_std = self._off = nan
        self._settled = 0
        self._baseline, self._recent = nan, deque[float](maxlen=BASELINE_DELAY)
        self._back_for, self._settling = 0, False

    @property
    def std(self) -> float:
        """Standard deviation in m/s^2 of `expected`."""
        if not self.speed.usable:
            return BLIND_STD
        drift = SLOPE_DRIFT**2 * min(self._settled * STEP_S, DRIFT_TIME)
        return sqrt(self._slow_noise.variance + self._step_noise.variance + drift)

    @property
    def expected(self) -> float:
        """What a healthy accelerometer would say, in m/s^2: it feels the slope of the road, too."""
        if self.speed.usable:
            slope = self._slope if isnan(self._reference) else self._reference
            return self.acceleration + slope
        if isnan(self._lead_reference) or isnan(self._lead):
            return self.acceleration
        return self._lead_reference - self._relative_slow

    def follow(self, horizon: Horizon) -> None:
        """Take one step's samples; afterwards `acceleration` is the best that is known."""
        now = horizon.stamp * 1e-9
        settings = self._settings
        if settings.use_host_speed and not horizon.host_speed_stale:
            at = now - horizon.host_speed_age
            self.speed.step(at, horizon.measured_host_speed, self.acceleration, self._shaken)
        else:
            self.speed.lose()
        usable = not horizon.acceleration_stale
        if usable:
            self._follow_samples(now - horizon.acceleration_age, horizon.measured_acceleration)
        if self.speed.usable:
            self.acceleration = self.speed.derivative
        elif usable and not self.faulty:
            # While a jump is being looked into, what was before it.
            if not self._jumped_for:
                self.acceleration = self._before_jump[0]
        else:
            self.acceleration *= exp(-STEP_S / LEAD_MEMORY)

    def _follow_samples(self, at: float, value: float) -> None:
        if isnan(self._filtered):
            self._filtered = value
        self._filtered += self._share * (value - self._filtered)
        self._burst += self._share * ((value - self._filtered) ** 2 - self._burst)
        self._fresh = is_new(at, self._last_at)
        if self._fresh:
            self._roughness.take(value, not self.faulty)
            self._repetition.take(value, not self.faulty)
            self._last_at = at
        self._samples.append(value)
        self._before_jump.append(self._filtered - self._slope)
        # A bad road shakes the wheels, too; a sensor's own noise does not.
        self._shaken = self._roughness.share > SHAKEN
        self._rough_for = self._rough_for + STEP_S if self._roughness.rough else 0.0

    def judge(
        self, horizon: Horizon, relative_acceleration: float, lead_report: LeadReport
    ) -> None:
        """Judge the step; `relative_acceleration` in m/s^2, NaN where the radar tells nothing."""
        settings = self._settings
        if horizon.acceleration_stale:
            self.confidence, self.check = 0, None
            return
        self._ticks += 1
        self._follow_lead(relative_acceleration)
        if self.speed.usable:
            self.check = self._against_speed()
        else:
            self._baseline, self._recent = nan, deque(maxlen=BASELINE_DELAY)
            self.check = self._against_lead(lead_report)
        exceeded = self.check is not None and self.check.exceeded
        self._count(exceeded)
        frozen = (
            settings.check_repetition
            and self._repetition.frozen
            and (self.speed.moving or not self.speed.usable)
        )
        rough = settings.check_roughness and self._is_rough()
        if self.faulty:
            self._requalify(exceeded or frozen or rough)
        elif frozen:
            kind = Kind.ZERO if horizon.measured_acceleration == 0.0 else Kind.HOLD
            self._convict(kind, f"repetition: the same value {self._repetition.run + 1} times")
        elif rough:
            share = self._roughness.share
            self._convict(Kind.NOISE, f"roughness: {share:.0%} of samples rougher than ever")
        elif (
            exceeded
            and self.confidence >= settings.acceleration_steps
            # One sample alone may be an outlier, however many steps hold it.
            and self._new_samples >= 2
        ):
            assert self.check is not None
            self._convict(self.check.kind, self.check.text())

    def _is_rough(self) -> bool:
        if not self.speed.usable:
            return self._rough_for >= ROUGH_TIME_ALONE
        return self._rough_for >= ROUGH_TIME and self.speed.roughness.share <= SHAKEN

    def _count(self, exceeded: bool) -> None:
        """Confidence in a fault, by steps (eq 26)."""
        if exceeded:
            if self.confidence == 0:
                self._new_samples = 0
            self._new_samples += self._fresh
            self.confidence = min(self.confidence + 1, self._settings.confidence_max)
        else:
            self.confidence = max(self.confidence - 1, 0)

    def _convict(self, kind: Kind, because: str) -> None:
        self.faulty, self.kind, self.because = True, kind, because
        self.confidence, self._agreeing = self._settings.confidence_max, 0.0
        if isnan(self._reference):
            self._reference = self._slope
        off = self.check.residual if self.check is not None else 0.0
        self.size = self._off = off
        self.size_std, self._settled = nan, 0
        self._baseline, self._recent = nan, deque(maxlen=BASELINE_DELAY)
        self._back_for, self._settling = 0, False
        self._jumped_for = 0

    def _requalify(self, disagrees: bool) -> None:
        if disagrees:
            self._agreeing = 0.0
            return
        self._agreeing += STEP_S
        if self._agreeing >= self._settings.clear_time:
            self._forgive()

    def _against_speed(self) -> Check:
        """Against the derivative of the host's speed."""
        settings = self._settings
        jerk = self.speed.jerk
        off = self._filtered - self.speed.derivative - self._lag() * jerk
        if self.faulty:
            return self._still_off(off)
        if isnan(self._baseline):
            self._baseline = self._slope if self._slope_known else off
        learning = 1.0 + 2.0 * max(0.0, 1.0 - self._slope_known / WARM_UP)
        allowance = settings.jerk_allowance * abs(jerk) + BURST * self._burst**0.5
        sigma = settings.acceleration_sigma
        step, slow = off - self._baseline, off - self._slope
        step_limit = max(settings.acceleration_step_limit, sigma * self._step_noise.deviation)
        slow_limit = max(settings.acceleration_limit, sigma * self._slow_noise.deviation)
        sudden = Check(
            "host speed", step, learning * step_limit + allowance, Kind.OFFSET, self._baseline
        )
        gradual = Check(
            "host speed", slow, learning * slow_limit + allowance, Kind.RAMP, self._slope
        )
        worse = max(sudden, gradual, key=lambda check: abs(check.residual) / check.limit)
        if worse.exceeded:
            self._reference = worse.reference
        elif not self.confidence:
            self._reference = nan
            self._learn(off, jerk, step if abs(step) < LEAST * step_limit else nan, slow_limit)
        return worse

    def _lag(self) -> float:
        """How much the speed lags behind the accelerometer, in s."""
        if not self._settings.learn_noise:
            return 0.0
        return max(-LARGEST_LAG, min(LARGEST_LAG, self._lag_product / self._lag_square))

    def _learn(self, off: float, jerk: float, step: float, slow_limit: float) -> None:
        """Slope, noise and lag, from a healthy step."""
        self._follow_baseline(off)
        self._slope_known += STEP_S
        slow = off - self._slope
        if self._slope_known < WARM_UP:
            self._slope += STEP_S / self._slope_known * slow
        else:
            rate = self._settings.slope_rate
            self._slope += STEP_S * max(-rate, min(rate, slow / SLOPE_TIME))
        if self._ticks % 10:
            return
        if not isnan(step):
            self._step_noise.take(step, 0.0)
        if abs(slow) < LEAST * slow_limit:
            self._slow_noise.take(slow, 0.0)
        moved = self._filtered - self.speed.derivative - self._baseline
        self._lag_product += jerk * moved - self._lag_product / LAG_MEMORY
        self._lag_square += jerk * jerk - (self._lag_square - LAG_PRIOR) / LAG_MEMORY

    def _follow_baseline(self, off: float) -> None:
        """What the difference was a moment ago."""
        if isnan(self._baseline):
            self._baseline = off
        self._recent.append(off)
        if len(self._recent) == BASELINE_DELAY:
            self._baseline += self._base_share * (self._recent[0] - self._baseline)

    def _still_off(self, off: float) -> Check:
        """A faulty signal against what the difference was before the fault."""
        residual = off - self._reference
        self._off += 3.0 * STEP_S * (residual - self._off)
        self._settled += 1
        self._estimate_size(residual)
        least = LEAST if self.kind is Kind.OFFSET else self._settings.acceleration_limit
        limit = max(0.5 * abs(self._off), least)
        self._follow_baseline(off)
        step = (off - self._baseline) * (1.0 if self._off > 0 else -1.0)
        back = step < -BACK * abs(self._off) and abs(self._off) > LEAST
        self._back_for = self._back_for + 1 if back else 0
        if self._back_for >= BACK_STEPS:
            # What made the fault was undone; how the slope has changed meanwhile nobody knows.
            self._settling = True
        return Check("host speed", 0.0 if self._settling else residual, limit, self.kind)

    def _estimate_size(self, residual: float) -> None:
        """Of a jump just after it, when the slope has hardly changed; of others as they are now."""
        settled = self._settled
        if self.kind is Kind.RAMP or settled < SIZE_FROM:
            self.size = self._off
        elif settled <= SIZE_TO:
            self.size += (residual - self.size) / (settled - SIZE_FROM + 1)
        drift = SLOPE_DRIFT**2 * min(settled * STEP_S, 1.0)
        self.size_std = sqrt(self._step_noise.variance + drift)

    def _follow_lead(self, relative_acceleration: float) -> None:
        """The lead's acceleration as accelerometer and observers make it."""
        if isnan(relative_acceleration):
            self._radar_gone += 1
            if self._radar_gone > RADAR_GONE:
                self._lead = nan
                self._lead_recent.clear()
                return
        else:
            self._radar_gone = 0
            if not self._jumped_for:
                self._relative = relative_acceleration
        now = self._relative if isnan(relative_acceleration) else relative_acceleration
        self._relative_now = now
        self._relative_slow += self._relative_share * (now - self._relative_slow)
        self._lead = self._filtered + now
        if not self.confidence and not self._jumped_for:
            self._lead_recent.append(self._lead)
            if isnan(self._lead_slow):
                self._lead_slow = self._lead
            self._lead_slow += self._base_share * (self._lead_recent[0] - self._lead_slow)

    def _against_lead(self, lead_report: LeadReport) -> Check | None:
        """Without the host's speed: against its own past, the observers and the lead's word."""
        settings = self._settings
        if self.faulty:
            return self._still_off_lead(lead_report)
        if len(self._lead_recent) < BASELINE_DELAY or isnan(self._lead):
            return None
        checks = []
        if lead_report.trusted:
            checks.append(self._against_report(lead_report))
        if settings.use_observers:
            checks.append(self._against_observers())
        return max(checks, key=lambda c: abs(c.residual) / c.limit, default=None)

    def _against_report(self, lead_report: LeadReport) -> Check:
        """Blamed only for what it did itself: the lead's word may be wrong as well."""
        settings = self._settings
        off = self._lead - lead_report.acceleration
        self._report_off += self._share * (off - self._report_off)
        residual = self._report_off
        own = self._lead - self._lead_slow
        sigma = settings.acceleration_sigma
        limit = max(settings.acceleration_limit, sigma * self._report_noise.deviation)
        if abs(residual) < LEAST * limit and self._ticks % 10 == 0:
            self._report_noise.take(residual, 0.0)
        if own * residual < 0.0 or abs(own) < OWN_SHARE * abs(residual):
            residual = 0.0
        check = Check("lead's word", residual, limit, Kind.OFFSET)
        if check.exceeded:
            self._lead_reference = self._lead_slow
        return check

    def _against_observers(self) -> Check:
        settings = self._settings
        samples = list(self._samples)
        jump = 0.0
        if len(samples) == 2 * SHARP + SHARP_GAP:
            jump = (sum(samples[-SHARP:]) - sum(samples[:SHARP])) / SHARP
        # On a bad road, or over a kerb, even the mean of some samples jumps.
        limit = settings.jump_limit * (SHAKEN_LIMIT if self._shaken else 1.0)
        if abs(jump) > limit:
            if not self._jumped_for:
                recent = list(self._lead_recent)[: 2 * BASELINE_DELAY // 3]
                self._lead_reference = sum(recent) / len(recent)
                self._before = sum(samples[:SHARP]) / SHARP
            self._jumped_for, self._jump_sign = JUMP_MEMORY, 1.0 if jump > 0 else -1.0
        if not self._jumped_for:
            return Check("observers", jump, limit, Kind.OFFSET)
        self._jumped_for -= 1
        # A jump that the observers answer with the opposite one is the car's own.
        now = sum(samples[-SHARP:]) / SHARP
        residual = now - self._before + self._relative_now - self._relative
        if residual * self._jump_sign < 0.0:
            residual = 0.0
        return Check("observers", residual, 0.8 * limit, Kind.OFFSET)

    def _still_off_lead(self, lead_report: LeadReport) -> Check | None:
        """A faulty signal against the lead, who goes back to driving as most do."""
        settings = self._settings
        if isnan(self._lead_reference):
            self._lead_reference = self._lead_slow
        self._lead_reference += (
            STEP_S / LEAD_MEMORY * (settings.lead_acceleration_mean - self._lead_reference)
        )
        if lead_report.trusted:
            self._lead_reference = lead_report.acceleration
        if isnan(self._lead) or isnan(self._lead_reference):
            # Nothing to hold it against: it stays what it was.
            self._agreeing = 0.0
            return None
        residual = self._lead - self._lead_reference
        self._settled += 1
        self._off += 3.0 * STEP_S * (residual - self._off)
        self._estimate_size(residual)
        self.size_std = BLIND_STD
        limit = settings.acceleration_limit if lead_report.trusted else settings.jump_limit
        return Check("observers", residual, limit, self.kind)

    def evidence(self) -> str:
        """What the newest check says, in words."""
        if self.check is None or not isfinite(self.check.residual):
            return "nothing to hold it against yet"
        return self.check.text()
