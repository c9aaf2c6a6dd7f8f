"""The host's accelerometer held against its speed, and against the lead (robust profile)."""

from collections import deque
from math import exp, inf, isfinite, isnan, nan

from lfd_diagnosis.healthy_signal import LearntNoise, Repetition, Roughness
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind
from lfd_mpc.horizon import Horizon
from lfd_mpc.settings import STEP_S

JERK_FILTER = 0.15
BASELINE = 0.7
BASELINE_DELAY = 30
WARM_UP = 3.0
ROUGH_TIME, ROUGH_TIME_ALONE = 0.3, 1.5
SHAKEN = 0.1
BACK_STEPS = 5
STANDING = 0.3
SPEED_JUMP = 0.5
POSSIBLE_ACCELERATION = 15.0
SHARP = 6
SHARP_GAP = 4
LEAD_MEMORY = 2.0


def share_of(time: float) -> float:
    """What a first-order filter of that time constant (s) takes of a new value each step."""
    return STEP_S / (time + STEP_S)


class HostSpeed:
    """Whether the measured host speed can serve as evidence."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self.noise = LearntNoise(0.03, 0.003, 1.0, settings.learn_noise)
        self.roughness = Roughness(32, 5.0, 0.4)
        self.repetition = Repetition(10)
        self.faulty, self.kind, self.because = False, Kind.UNKNOWN, ""
        self.size = nan
        self.restart()

    def restart(self) -> None:
        self.last, self.last_at = nan, -inf
        self.quiet = 0.0
        self.offset = 0.0
        self.faulty = False
        self.roughness.restart()
        self.repetition.restart()
        self.rough_for = 0.0

    def take(self, at: float, value: float, acceleration: float, shaken: bool) -> None:
        """One sample in m/s at `at` s, while the host accelerates as stated (m/s^2)."""
        period = at - self.last_at
        healthy = not self.faulty
        self.roughness.take(value, healthy)
        self.repetition.take(value, healthy)
        if isfinite(self.last):
            jump = value - self.last - acceleration * period
            limit = max(SPEED_JUMP, 8.0 * self.noise.deviation) + POSSIBLE_ACCELERATION * period
            if abs(jump) > limit:
                self.offset += jump
                self.quiet = 0.0
                if not self.faulty:
                    self._convict(
                        Kind.OFFSET, f"it jumped by {jump:.2f} m/s in {period * 1000:.0f} ms"
                    )
                elif abs(self.offset) < limit:
                    self.offset = 0.0
            elif healthy:
                self.noise.take(jump, 0.0)
        moving = abs(value) > STANDING
        frozen = self._settings.check_repetition and self.repetition.frozen and moving
        self.rough_for = self.rough_for + period if self.roughness.rough else 0.0
        rough = self._settings.check_roughness and self.rough_for >= ROUGH_TIME and not shaken
        if frozen:
            self.quiet = 0.0
            if not self.faulty:
                self._convict(Kind.HOLD, f"it said {value:.2f} m/s {self.repetition.run + 1} times")
        elif rough:
            self.quiet = 0.0
            if not self.faulty:
                self._convict(Kind.NOISE, "it is far rougher than it was")
        else:
            self.quiet += min(period, 0.5)
        if self.faulty:
            needed = self._settings.clear_time if self.offset == 0.0 else self._settings.requalify_time
            if self.quiet >= needed:
                self.faulty, self.because, self.offset = False, "", 0.0
        self.last, self.last_at = value, at

    def _convict(self, kind: Kind, because: str) -> None:
        if kind is Kind.OFFSET and self.last + self.offset == 0.0:
            kind = Kind.ZERO
        self.faulty, self.kind, self.because = True, kind, because


class HostMonitor:
    """Judges the acceleration signal, and says how the host really accelerates."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self.speed = HostSpeed(settings)
        self.roughness = Roughness(64, 5.0, 0.4)
        self.repetition = Repetition(8)
        self.noise = LearntNoise(0.15, 0.03, 1.0, settings.learn_noise, memory=2000)
        self.slow_noise = LearntNoise(0.2, 0.05, 1.0, settings.learn_noise, memory=2000)
        self._share = share_of(settings.host_speed_filter_time)
        self._jerk_share = share_of(JERK_FILTER)
        self._base_share = share_of(BASELINE)
        self._lag_xy, self._lag_xx = 0.0, 40.0
        self.bias = 0.0
        self._bias_for = 0.0
        self._forget()

    def _forget(self) -> None:
        self.faulty, self.kind, self.because = False, Kind.UNKNOWN, ""
        self.confidence = 0
        self.residual = self.limit = nan
        self.evidence = ""
        self.residuals: list[float] = []
        self.agreeing = 0.0
        self.last_at = -inf
        self._new_since = 0
        self._filtered = nan
        self._filtered_speed = nan
        self._speed_for = 0.0
        self._derivative_slow = 0.0
        self.derivative = nan
        self._baseline = nan
        self._recent: deque[float] = deque(maxlen=BASELINE_DELAY)
        self._burst = 0.0
        self._samples: deque[float] = deque(maxlen=2 * SHARP + SHARP_GAP)
        self._calm: deque[float] = deque(maxlen=8)
        self._lead = nan
        self._lead_recent: deque[float] = deque(maxlen=BASELINE_DELAY)
        self._sharp_for = 0
        self._sharp_sign = 0.0
        self._lead_reference = nan
        self.steps = 0
        self.acceleration = 0.0
        self._reference = nan
        self._tick = 0
        self._rough_for = 0.0
        self._shaken = False

    def restart(self) -> None:
        """Nothing from before counts but what was learnt."""
        self._forget()
        self.roughness.restart()
        self.repetition.restart()
        self.speed.restart()

    @property
    def with_speed(self) -> bool:
        """Whether the host's speed serves as evidence now."""
        return self._speed_for >= 4 * self._settings.host_speed_filter_time

    def follow(self, horizon: Horizon) -> None:
        """Take one step's samples; afterwards `acceleration` is the best that is known."""
        now = horizon.stamp * 1e-9
        settings = self._settings
        if settings.use_host_speed and not horizon.host_speed_stale:
            at = now - horizon.host_speed_age
            if at > self.speed.last_at + 1e-4:
                self.speed.take(at, horizon.measured_host_speed, self.acceleration, self._shaken)
            self._follow_speed(horizon.measured_host_speed)
        else:
            self._speed_for, self._filtered_speed = 0.0, nan
            self.speed.last = nan
        if not horizon.acceleration_stale:
            self._follow_acceleration(now, horizon)
        if self.with_speed:
            self.acceleration = self.derivative
        elif not horizon.acceleration_stale and not self.faulty:
            if not self._sharp_for:
                self.acceleration = self._calm[0] if len(self._calm) else self._filtered
        else:
            self.acceleration *= exp(-STEP_S / LEAD_MEMORY)

    def _follow_speed(self, speed: float) -> None:
        if self.speed.faulty:
            self._speed_for, self._filtered_speed = 0.0, nan
            return
        if isnan(self._filtered_speed):
            self._filtered_speed, self._derivative_slow = speed, self.acceleration
            self._filtered_speed = speed - self.acceleration * self._settings.host_speed_filter_time
        self._filtered_speed += self._share * (speed - self._filtered_speed)
        self.derivative = (speed - self._filtered_speed) / self._settings.host_speed_filter_time
        self._derivative_slow += self._jerk_share * (self.derivative - self._derivative_slow)
        self._speed_for += STEP_S

    def _follow_acceleration(self, now: float, horizon: Horizon) -> None:
        value = horizon.measured_acceleration
        if isnan(self._filtered):
            self._filtered = value
        self._filtered += self._share * (value - self._filtered)
        self._burst += self._share * ((value - self._filtered) ** 2 - self._burst)
        at = now - horizon.acceleration_age
        self.fresh = at > self.last_at + 1e-4
        if self.fresh:
            healthy = not self.faulty
            self.roughness.take(value, healthy)
            self.repetition.take(value, healthy)
            self.last_at = at
        self._samples.append(value)
        self._calm.append(self._filtered - self.bias)
        self.steps += 1

    def judge(self, horizon: Horizon, relative_acceleration: float) -> None:
        """Judge the step; `relative_acceleration` in m/s^2, NaN where the radar tells nothing."""
        if horizon.acceleration_stale:
            self.confidence, self.residual, self.limit = 0, nan, nan
            return
        settings = self._settings
        self._tick += 1
        exceeded = None
        self._judge_lead(relative_acceleration)
        if self.with_speed:
            exceeded = self._judge_speed()
        else:
            self._baseline = nan
            self._recent.clear()
            if settings.use_observers:
                exceeded = self._judge_sharp()
        if exceeded is not None:
            if exceeded:
                if self.confidence == 0:
                    self._new_since = 0
                self._new_since += self.fresh
                self.confidence = min(self.confidence + 1, settings.confidence_max)
            else:
                self.confidence = max(self.confidence - 1, 0)
        moving = not self.with_speed or abs(self.speed.last) > STANDING
        frozen = settings.check_repetition and self.repetition.frozen and moving
        # A bad road shakes the wheels, too; a sensor's own noise does not.
        self._shaken = self.roughness.share > SHAKEN
        self._rough_for = self._rough_for + STEP_S if self.roughness.rough else 0.0
        needed = ROUGH_TIME if self.with_speed else ROUGH_TIME_ALONE
        shaken = self.with_speed and self.speed.roughness.share > SHAKEN
        rough = settings.check_roughness and self._rough_for >= needed and not shaken
        if not self.faulty:
            if frozen:
                kind = Kind.ZERO if horizon.measured_acceleration == 0.0 else Kind.HOLD
                self._convict(kind, f"the same value {self.repetition.run + 1} times")
            elif rough:
                self._convict(Kind.NOISE, f"{self.roughness.share:.0%} of samples rougher")
            elif (
                exceeded
                and self.confidence >= settings.acceleration_confidence_threshold
                and self._new_since >= 2
            ):
                self._convict(self._how, self.evidence)
            return
        if exceeded:
            if len(self.residuals) < 100:
                self.residuals.append(self.residual)
        if exceeded or frozen or rough:
            self.agreeing = 0.0
            return
        self.agreeing += STEP_S
        if self.agreeing >= settings.clear_time:
            self.faulty, self.kind, self.because = False, Kind.UNKNOWN, ""
            self.confidence, self.residuals, self._reference = 0, [], nan
            self._lead_reference = nan
            self._baseline = nan
            self._recent.clear()

    def _convict(self, kind: Kind, because: str) -> None:
        self.faulty, self.kind, self.because = True, kind, because
        self.confidence = self._settings.confidence_max
        self.agreeing = 0.0
        self.residuals = []
        self._size = self.residual if isfinite(self.residual) else 0.0
        self._baseline, self._back_for, self._settling = nan, 0, False
        self._recent.clear()
        if isnan(self._reference):
            self._reference = self.bias

    def _judge_speed(self) -> bool:
        """Against the derivative of the host's speed."""
        settings = self._settings
        jerk = (self.derivative - self._derivative_slow) / JERK_FILTER
        off = self._filtered - self.derivative
        lag = max(-0.3, min(0.3, self._lag_xy / self._lag_xx)) if settings.learn_noise else 0.0
        off -= lag * jerk
        learning = 1.0 + 2.0 * max(0.0, 1.0 - self._bias_for / WARM_UP)
        allowance = settings.jerk_allowance * abs(jerk) + 0.15 * self._burst**0.5
        if self.faulty and not isnan(self._reference):
            self.residual = off - self._reference
            self._size += 3.0 * STEP_S * (self.residual - self._size)
            least = 0.6 if self.kind is Kind.OFFSET else settings.acceleration_limit
            self.limit = max(0.5 * abs(self._size), least)
            self._follow_baseline(off)
            step = (off - self._baseline) * (1.0 if self._size > 0 else -1.0)
            self._back_for = self._back_for + 1 if step < -0.65 * abs(self._size) else 0
            if self._back_for >= BACK_STEPS:
                # What made the fault was undone; the wandering in between is nobody's fault.
                self._settling = True
            if self._settling:
                self.residual = 0.0
            self.evidence = self._say("host speed")
            return abs(self.residual) > self.limit
        if isnan(self._baseline):
            self._baseline = self.bias if self._bias_for else off
        step = off - self._baseline
        step_limit = learning * max(settings.acceleration_step_limit, settings.acceleration_sigma * self.noise.deviation)
        slow = off - self.bias
        slow_limit = learning * max(settings.acceleration_limit, settings.acceleration_sigma * self.slow_noise.deviation)
        step_over = abs(step) / (step_limit + allowance)
        slow_over = abs(slow) / (slow_limit + allowance)
        if step_over >= slow_over:
            self.residual, self.limit, self._how = step, step_limit + allowance, Kind.OFFSET
            reference = self._baseline
        else:
            self.residual, self.limit, self._how = slow, slow_limit + allowance, Kind.RAMP
            reference = self.bias
        exceeded = abs(self.residual) > self.limit
        if exceeded:
            self._reference = reference
            self.evidence = self._say("host speed")
            return True
        if self.confidence:
            return False
        self._reference = nan
        # Only what is surely healthy is learnt from, and only after a while.
        self._follow_baseline(off)
        self._bias_for += STEP_S
        if self._bias_for < WARM_UP:
            self.bias += STEP_S / self._bias_for * (off - self.bias)
        else:
            wanted = (off - self.bias) / 4.0
            rate = max(-settings.bias_rate, min(settings.bias_rate, wanted))
            self.bias += STEP_S * rate
        if self._tick % 10 == 0:
            if abs(step) < 0.6 * step_limit:
                self.noise.take(step, 0.0)
            if abs(slow) < 0.6 * slow_limit:
                self.slow_noise.take(slow, 0.0)
            moved = self._filtered - self.derivative - self._baseline
            self._lag_xy += jerk * moved - 0.001 * self._lag_xy
            self._lag_xx += jerk * jerk - 0.001 * (self._lag_xx - 40.0)
        return False

    def _follow_baseline(self, off: float) -> None:
        """What the difference was a moment ago."""
        if isnan(self._baseline):
            self._baseline = off
        self._recent.append(off)
        if len(self._recent) == BASELINE_DELAY:
            self._baseline += self._base_share * (self._recent[0] - self._baseline)

    def _judge_lead(self, relative_acceleration: float) -> None:
        """The lead's acceleration as accelerometer and observers make it."""
        if isnan(relative_acceleration):
            # Without the radar the lead is taken to keep its acceleration for a while.
            if not self._lead_recent:
                self._lead = nan
                return
            self._radar_gone += STEP_S
            relative_acceleration = self._relative_before
            if self._radar_gone > 0.3:
                self._lead = nan
                return
        else:
            self._radar_gone = 0.0
            if not self._sharp_for:
                self._relative_before = relative_acceleration
        self._lead = self._filtered + relative_acceleration
        if not self.confidence:
            self._lead_recent.append(self._lead)

    def _judge_sharp(self) -> bool:
        """Without the host's speed: no car changes its acceleration as fast as a fault does."""
        settings = self._settings
        if self.faulty:
            if isnan(self._lead_reference):
                self.residual = self.limit = nan
                return False
            mean = settings.lead_acceleration_mean
            self._lead_reference += STEP_S / LEAD_MEMORY * (mean - self._lead_reference)
            if isnan(self._lead):
                return True
            self.residual = self._lead - self._lead_reference
            self.limit = settings.sharp_limit
            self.evidence = self._say("observers")
            return abs(self.residual) > self.limit
        samples = list(self._samples)
        if len(samples) < 2 * SHARP + SHARP_GAP or len(self._lead_recent) < BASELINE_DELAY:
            return False
        sharp = (sum(samples[-SHARP:]) - sum(samples[:SHARP])) / SHARP
        if abs(sharp) > settings.sharp_limit + 0.1 * self._burst**0.5 * 0:
            if not self._sharp_for:
                self._lead_reference = sum(list(self._lead_recent)[:20]) / 20
            self._sharp_for, self._sharp_sign = 25, 1.0 if sharp > 0 else -1.0
        if not self._sharp_for:
            self.residual, self.limit = sharp, settings.sharp_limit
            self._lead_reference = nan
            return False
        self._sharp_for -= 1
        self.residual = self._lead - self._lead_reference
        self.limit = settings.sharp_limit * 0.8
        self.evidence = self._say("observers")
        self._how = Kind.OFFSET
        return self.residual * self._sharp_sign > self.limit

    def _say(self, what: str) -> str:
        return f"{what}: off by {self.residual:.2f} m/s^2 (limit {self.limit:.2f})"

    _how = Kind.UNKNOWN
    _radar_gone = 0.0
    _relative_before = 0.0
    _size = 0.0
    _back_for = 0
    _settling = False
    fresh = False
