"""The radar's two signals held against the lead's track, scan by scan (robust profile)."""

from collections import deque
from dataclasses import dataclass, field
from math import exp, inf, isfinite, nan, sqrt
from statistics import median

import numpy as np

from lfd_diagnosis.healthy_signal import LearntNoise, Repetition, Roughness
from lfd_diagnosis.lead_track import LeadTrack
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind
from lfd_mpc.horizon import Horizon
from lfd_mpc.sampling import UNKNOWN_TRACK
from lfd_mpc.settings import STEP_S

GRADUAL = 0.6
"""Share of its limit that a residual has before a fault that came on gradually."""

READY_SCANS = 3
"""Scans of one target after which it is judged."""

BAD, GOOD = 2, 1
"""How much one disagreeing scan adds to the confidence, and one agreeing scan takes away."""

STEP_SEARCH = 0.3
"""Seconds around the onset of a contradiction in which a step of the velocity is looked for."""

DOUBT = 0.75
"""Ratio of two explanations' errors above which neither is clearly better."""

HELD_SCANS, HELD_PATH = 6, 0.3
"""Equal scans of the clearance, and m that the relative velocity says were travelled meanwhile."""

LEARNING = 40.0
"""Scans over which limits come down from thrice to once their width while noise is learnt."""

CORRELATION = 3.0
"""Seconds over which the lead's acceleration is known when it is not measured."""

SLOW = 0.5
"""Seconds over which the lead's acceleration is averaged before it is relied on for long."""

MEMORY = 0.6
"""Seconds for which a target is remembered under its track id."""

LOST_AFTER = 1.0
"""Seconds of silence after which a target that disagrees is another one, not a fault."""

VELOCITY_BIAS = 0.05
"""m/s by which the relative velocity may be off for good; a coasted clearance drifts with it."""


@dataclass
class RadarSignal:
    """What is known about one of the radar's signals; lengths in its own unit (m or m/s)."""

    name: str
    unit: str
    floor: float
    noise: LearntNoise
    roughness: Roughness
    repetition: Repetition
    confidence: int = 0
    faulty: bool = False
    kind: Kind = Kind.UNKNOWN
    because: str = ""
    residual: float = nan
    limit: float = nan
    before: float = 0.0
    mean: float = 0.0
    returning: bool = False
    recent: deque[float] = field(default_factory=lambda: deque(maxlen=5))
    history: deque[tuple[float, float]] = field(default_factory=deque)
    tellable: bool = True
    outliers: int = 0
    onset: float = nan
    agreeing: float = 0.0
    came_back: bool = False
    coasted: float = 0.0
    last: float = nan
    last_at: float = -inf
    residuals: list[tuple[float, float]] = field(default_factory=list)

    @property
    def bad(self) -> bool:
        """Whether the newest scan left its limits."""
        return not abs(self.residual) <= self.limit

    @property
    def index(self) -> float:
        """Residual against limit, 0..1; one half at the limit. NaN before anything was judged."""
        return abs(self.residual) / (abs(self.residual) + self.limit)

    def size(self) -> tuple[float, float]:
        """Mean of the residuals since onset and its standard deviation."""
        if not self.residuals:
            return nan, nan
        values = [value for _, value in self.residuals]
        mean = sum(values) / len(values)
        return mean, 0.0

    def forget_fault(self) -> None:
        """Healthy from now on."""
        self.faulty, self.confidence, self.kind, self.because = False, 0, Kind.UNKNOWN, ""
        self.residuals, self.onset, self.tellable = [], nan, True
        self.agreeing, self.came_back, self.coasted = 0.0, False, 0.0


class RadarMonitor:
    """Judges clearance and relative velocity of one radar."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        learn = settings.learn_noise
        r1, r2 = settings.clearance_std, settings.relative_velocity_std

        def signal(name: str, unit: str, floor: float, std: float, lowest: float) -> RadarSignal:
            return RadarSignal(
                name,
                unit,
                floor,
                LearntNoise(std, lowest, 10.0 * std, learn),
                Roughness(16, 5.0, 0.4),
                Repetition(8),
            )

        self.clearance = signal("clearance", "m", settings.clearance_floor, r1, 0.03)
        self.velocity = signal(
            "relative velocity", "m/s", settings.relative_velocity_floor, r2, 0.015
        )
        self.signals = (self.clearance, self.velocity)
        self._drift_noise = LearntNoise(0.15, 0.02, 2.0, learn, memory=2000)
        self._coast_keep = exp(-STEP_S / CORRELATION)
        self.track: LeadTrack | None = None
        self.scans = 0
        self.lost_since: float | None = None
        self._start_anew()
        self._anew_because = ""

    def _start_anew(self) -> None:
        self.track = None
        self.scans = 0
        self._id = UNKNOWN_TRACK
        self._remembered: dict[int, tuple[float, LeadTrack]] = {}
        self._slow_acceleration = self._settings.lead_acceleration_mean
        self._host = 0.0
        self._path: deque[tuple[float, float, float]] = deque()
        self._path_end = -inf, nan, nan
        self._held_path = 0.0
        self._scan_at = -inf
        for signal in self.signals:
            signal.last, signal.last_at = nan, -inf
            signal.residual = signal.limit = nan
            signal.roughness.restart()
            signal.repetition.restart()

    def restart(self) -> None:
        """Nothing from before counts, faults neither; what was learnt of the noise stays."""
        self._start_anew()
        self.lost_since = None
        for signal in self.signals:
            signal.forget_fault()

    @property
    def ready(self) -> bool:
        """Whether the target is known long enough to be judged."""
        return self.track is not None and self.scans >= READY_SCANS

    @property
    def faulty(self) -> bool:
        """Whether either signal is."""
        return self.clearance.faulty or self.velocity.faulty

    def step(self, horizon: Horizon, host_acceleration: float) -> None:
        """Take one step's measurements; the host's acceleration in m/s^2 as best known."""
        now = horizon.stamp * 1e-9
        if not horizon.has_target:
            self._lose("the radar sees no lead", now)
            return
        if self.track is not None:
            self._predict(host_acceleration)
        self._host = host_acceleration
        fresh = []
        for signal, age, stale, measured in (
            (
                self.clearance,
                horizon.clearance_age,
                horizon.clearance_stale,
                horizon.measured_clearance,
            ),
            (
                self.velocity,
                horizon.relative_velocity_age,
                horizon.relative_velocity_stale,
                horizon.measured_relative_velocity,
            ),
        ):
            at = now - age if isfinite(age) else -inf
            new = not stale and isfinite(measured) and at > signal.last_at + 1e-4
            fresh.append((new, at, measured, age))
        if fresh[0][0] or fresh[1][0]:
            self._scan(now, horizon.track_id, fresh)

    def _predict(self, host_acceleration: float) -> None:
        track, settings = self.track, self._settings
        assert track is not None
        if self.velocity.faulty:
            keep, jerk = self._coast_keep, settings.coasting_jerk_density
        else:
            keep, jerk = 1.0, settings.jerk_density
        track.predict(
            STEP_S, host_acceleration, keep, settings.lead_acceleration_mean, jerk
        )
        for signal in self.signals:
            signal.coasted = signal.coasted + STEP_S if signal.faulty else 0.0
        if self.clearance.faulty:
            track.cc += 2.0 * VELOCITY_BIAS**2 * self.clearance.coasted * STEP_S
        if not self.faulty:
            self._slow_acceleration += (
                STEP_S / SLOW * (track.acceleration - self._slow_acceleration)
            )

    def _scan(self, now: float, track_id: int, fresh: list) -> None:
        """One scan, or the one signal of it that is there."""
        (new_c, at_c, clearance, age_c), (new_v, at_v, velocity, _) = fresh
        same_c = new_c and self.clearance.repetition.take(clearance, not self.faulty)
        same_v = new_v and self.velocity.repetition.take(velocity, not self.faulty)
        at = max(at_c if new_c else -inf, at_v if new_v else -inf)
        age = now - at
        before, self._scan_at = self._scan_at, at
        if self.track is None:
            if new_c and new_v:
                self._begin(clearance + velocity * age, velocity, at)
                self._id = track_id
                self._note(fresh)
            return
        if new_c and new_v and self._changed_target(track_id, at, clearance, velocity, age):
            self._note(fresh)
            return
        self._id = track_id
        self.scans += 1
        repeated = (
            same_c and same_v and self.clearance.repetition.run == 1
        )  # a sensor that says everything twice
        self._judge(now, at, before, fresh, repeated, age)
        self._note(fresh)

    def _note(self, fresh: list) -> None:
        for signal, (new, at, measured, _) in zip(self.signals, fresh, strict=True):
            if new:
                signal.last, signal.last_at = measured, at

    def _begin(self, clearance: float, velocity: float, at: float) -> None:
        noise = self.clearance.noise.deviation, self.velocity.noise.deviation
        self.track = LeadTrack.start(
            clearance, velocity, self._settings.lead_acceleration_mean, noise
        )
        self._slow_acceleration = self._settings.lead_acceleration_mean
        self.scans = 1
        self._path.clear()
        for signal in self.signals:
            signal.roughness.restart()
            signal.residual = signal.limit = nan
            if not signal.faulty:
                signal.confidence = 0

    def _widening(self) -> float:
        """How much wider limits are while the noise is being learnt."""
        return 1.0 + 2.0 * exp(-self.clearance.noise.count / LEARNING)

    def _limits(self, track: LeadTrack) -> tuple[float, float]:
        """Limits of clearance (m) and relative velocity (m/s) around the track."""
        wide, sigma = self._widening(), self._settings.gate_sigma
        return (
            wide * max(self.clearance.floor, sigma * sqrt(track.cc + self.clearance.noise.variance)),
            wide * max(self.velocity.floor, sigma * sqrt(track.vv + self.velocity.noise.variance)),
        )

    def _agrees(self, track: LeadTrack, clearance: float, velocity: float) -> bool:
        limits = self._limits(track)
        return (
            abs(clearance - track.clearance) <= limits[0]
            and abs(velocity - track.velocity) <= limits[1]
        )

    def _changed_target(
        self, track_id: int, at: float, clearance: float, velocity: float, age: float
    ) -> bool:
        """Sort out a new track id, or a silence; whether the track was started anew."""
        assert self.track is not None
        now_clearance = clearance + velocity * age
        silent = at - max(self.clearance.last_at, self.velocity.last_at) > LOST_AFTER
        changed = track_id != self._id and UNKNOWN_TRACK not in (track_id, self._id)
        if not changed and not silent:
            return False
        if not self._settings.same_car:
            self._lose("new target", at)
            self._begin(now_clearance, velocity, at)
            self._id = track_id
            return True
        if changed and not self.faulty:
            self._remembered[self._id] = at, self.track.copy()
        self._remembered = {
            k: (t, track) for k, (t, track) in self._remembered.items() if at - t < MEMORY
        }
        if self._agrees(self.track, now_clearance, velocity):
            self._cut_path()
            return False
        continuing = (
            self.faulty
            and abs(clearance - self.clearance.last) <= self.clearance.floor
            and abs(velocity - self.velocity.last) <= self.velocity.floor
        )
        if continuing:
            self._cut_path()
            return False
        if changed and track_id in self._remembered and not self.faulty:
            then, track = self._remembered.pop(track_id)
            if at > then:
                track.predict(
                    at - then,
                    self._host,
                    1.0,
                    self._settings.lead_acceleration_mean,
                    self._settings.jerk_density,
                )
            self.track = track
            self._cut_path()
            return False
        if self.faulty:
            self.lost_since = at
        self._begin(now_clearance, velocity, at)
        self._id = track_id
        return True

    def _cut_path(self) -> None:
        """The clearance may have stepped for a good reason."""
        self._path.clear()
        for signal in self.signals:
            signal.roughness.restart()

    def _lose(self, because: str, now: float) -> None:
        if self.track is not None and self.faulty:
            self.lost_since = now
        self._anew_because = because
        self._start_anew()

    def _judge(
        self, now: float, at: float, before: float, fresh: list, repeated: bool, age: float
    ) -> None:
        track, settings = self.track, self._settings
        assert track is not None
        limits = self._limits(track)
        relative = track.acceleration - self._host
        expected = (
            track.clearance - age * (track.velocity - 0.5 * age * relative),
            track.velocity - age * relative,
        )
        variances = track.cc, track.vv
        if not repeated:
            for signal, (new, _, measured, _), prediction, limit in zip(
                self.signals, fresh, expected, limits, strict=True
            ):
                if new:
                    signal.residual, signal.limit = measured - prediction, limit
        was_faulty = self.clearance.faulty, self.velocity.faulty
        for signal, (new, _, measured, _) in zip(self.signals, fresh, strict=True):
            if new:
                healthy = not self.faulty and not signal.bad
                signal.roughness.take(measured, healthy)
                self._count(signal, at)
                if signal.faulty:
                    self._classify(signal)
                    self._requalify(signal, measured, at)
        clearance, velocity = self.signals
        if self.velocity.faulty and not was_faulty[1]:
            track.believe(self._slow_acceleration, 0.4)
        if repeated:
            return
        all_good = all(
            not s.faulty and not s.bad for s, (new, *_) in zip(self.signals, fresh) if new
        )
        for signal, (new, *_), variance in zip(self.signals, fresh, variances, strict=True):
            if new and all_good:
                signal.noise.take(signal.residual, variance)
        if fresh[0][0] and not clearance.faulty and not clearance.bad:
            track.correct_clearance(clearance.residual, clearance.noise.variance)
        if fresh[1][0] and not velocity.faulty and not velocity.bad:
            residual = fresh[1][2] - (track.velocity - age * (track.acceleration - self._host))
            track.correct_velocity(residual, velocity.noise.variance)
        followed = not clearance.bad or self._gradual
        if all(new for new, *_ in fresh) and followed and not velocity.bad and not self.faulty:
            self._follow_path(at, fresh[0][2], fresh[1][2])

    def _count(self, signal: RadarSignal, at: float) -> None:
        """Confidence in a fault of one signal, by scans (eq 26 with scans for steps)."""
        settings = self._settings
        if signal.bad:
            if signal.confidence == 0:
                signal.onset = at
                signal.residuals = []
            signal.confidence = min(signal.confidence + BAD, settings.scan_confidence_max)
            if len(signal.residuals) < 40:
                signal.residuals.append((at, signal.residual))
        else:
            signal.before = signal.residual
            if signal.confidence == BAD and not signal.faulty:
                signal.outliers += 1
            signal.confidence = max(signal.confidence - GOOD, 0)
        if signal.faulty or not self.ready:
            return
        if signal.confidence >= settings.scan_confidence_threshold:
            if signal is self.clearance and self._gradual and len(self._path) > 9:
                self._blame_drift(signal.residual, signal.limit, at)
                return
            self._convict(signal, Kind.OFFSET, "prediction residual", at)
        elif settings.check_roughness and signal.roughness.rough:
            self._convict(signal, Kind.NOISE, "roughness", at)
        elif settings.check_repetition and self._frozen(signal):
            kind = Kind.ZERO if signal.last == 0.0 else Kind.HOLD
            self._convict(signal, kind, f"the same value {signal.repetition.run + 1} times", at)

    def _frozen(self, signal: RadarSignal) -> bool:
        if signal is self.clearance:
            moved = max(
                HELD_PATH, 4.0 * signal.noise.deviation, 1.5 * signal.roughness.resolution
            )
            run = signal.repetition.run
            if run >= max(HELD_SCANS, signal.repetition.longest + 1):
                return abs(self._held_path) > moved
        return signal.repetition.frozen and self.moving

    moving = True

    def _classify(self, signal: RadarSignal) -> None:
        """A jump may turn out to be something else."""
        if signal.kind in (Kind.OFFSET, Kind.RAMP):
            if signal.last == 0.0 and signal.repetition.run >= 3:
                signal.kind = Kind.ZERO
            elif signal.repetition.run >= HELD_SCANS and signal.repetition.frozen:
                signal.kind = Kind.HOLD
            elif signal.roughness.rough and signal.kind is Kind.OFFSET:
                signal.kind = Kind.NOISE

    @property
    def _gradual(self) -> bool:
        """Whether the clearance went out of its limits little by little."""
        signal = self.clearance
        return (
            self._settings.check_drift
            and signal.before * signal.residual > 0
            and abs(signal.before) > GRADUAL * signal.limit
        )

    def _convict(self, signal: RadarSignal, kind: Kind, because: str, at: float) -> None:
        signal.faulty, signal.kind, signal.because = True, kind, because
        signal.confidence = self._settings.scan_confidence_max
        signal.agreeing, signal.came_back, signal.coasted = 0.0, False, 0.0
        signal.mean, signal.returning = signal.residual, False
        signal.history.clear()
        signal.recent.clear()
        self._path.clear()

    def _requalify(self, signal: RadarSignal, measured: float, at: float) -> None:
        """Whether a faulty signal is to be believed again."""
        settings = self._settings
        period = at - signal.last_at
        size = max((abs(r) for _, r in signal.residuals), default=0.0)
        signal.tellable = signal.limit < max(0.7 * size, 1.5 * signal.floor)
        step = measured - signal.last
        if signal is self.clearance and self.track is not None:
            step -= self.track.velocity * period
        jumped = abs(step) > max(0.8 * signal.floor, 0.4 * size)
        if signal.kind is Kind.OFFSET and self.lost_since is None:
            self._look_for_return(signal, measured)
        symptom = signal.roughness.rough or (
            signal.repetition.frozen and signal.kind in (Kind.HOLD, Kind.ZERO)
        )
        if signal.kind is Kind.RAMP and self._has_stopped(signal, at):
            self._rebase(signal, measured)
            signal.forget_fault()
            return
        bound = signal.limit
        if signal.kind in (Kind.OFFSET, Kind.RAMP):
            # What is known to be off by so much has not come back while it is off by half of it.
            bound = min(bound, max(0.5 * abs(signal.mean), 3.0 * self._deviation(signal)))
        if signal.bad or symptom or abs(signal.residual) > bound:
            if signal.bad or abs(signal.residual) > bound:
                signal.mean += min(period / 0.3, 1.0) * (signal.residual - signal.mean)
            signal.agreeing, signal.came_back = 0.0, False
            if self.lost_since is not None:
                self.lost_since = at
            return
        if jumped:
            signal.came_back, signal.agreeing = True, 0.0
        signal.agreeing += min(period, 0.2)
        if self.lost_since is not None:
            if at - self.lost_since >= settings.requalify_time:
                signal.forget_fault()
        elif signal.agreeing >= settings.clear_time * (1.6 if signal.kind is Kind.NOISE else 1.0) and (
            signal.tellable or signal.came_back or not settings.latch
        ):
            signal.forget_fault()
        if not self.faulty:
            self.lost_since = None

    def _look_for_return(self, signal: RadarSignal, measured: float) -> None:
        """A jump as large as the one that made the fault, and back, ends it.

        Also where the reference has become too uncertain, or wrong, to say so. One scan alone may
        be an outlier: the next one must not undo it.
        """
        first = [residual for _, residual in signal.residuals[:10]]
        offset = sum(first) / len(first)
        tolerance = max(0.3 * abs(offset), 0.5 * signal.floor, 4.0 * signal.noise.deviation)
        back = len(signal.recent) == signal.recent.maxlen and (
            abs(signal.residual - median(signal.recent) + offset) < tolerance < abs(offset)
        )
        if not back:
            signal.recent.append(signal.residual)
        elif signal.returning:
            self._rebase(signal, measured)
            signal.recent.clear()
            signal.came_back, signal.agreeing = True, 0.0
        signal.returning = back

    def _has_stopped(self, signal: RadarSignal, at: float) -> bool:
        """Whether a drift has not gone on for so long that nothing contradicts anything now."""
        history = signal.history
        history.append((at, signal.residual))
        while history[-1][0] - history[0][0] > self._settings.requalify_time:
            history.popleft()
        values = [value for _, value in history]
        return (
            history[-1][0] - history[0][0] > 0.9 * self._settings.requalify_time
            and max(values) - min(values) < 0.6 * signal.floor + 4.0 * signal.noise.deviation
        )

    def _deviation(self, signal: RadarSignal) -> float:
        """Standard deviation of what the track says of a signal, its noise included."""
        assert self.track is not None
        variance = self.track.cc if signal is self.clearance else self.track.vv
        return sqrt(variance + signal.noise.variance)

    def _rebase(self, signal: RadarSignal, measured: float) -> None:
        """The jump that made a fault was undone: the signal is the reference again."""
        track = self.track
        assert track is not None
        if signal is self.clearance:
            track.clearance, track.cc, track.cv, track.ca = measured, signal.noise.variance, 0.0, 0.0
        else:
            track.velocity, track.vv, track.cv, track.va = measured, signal.noise.variance, 0.0, 0.0
        signal.residual = 0.0

    def _follow_path(self, at: float, clearance: float, velocity: float) -> None:
        """Clearance against the path that the relative velocity says was travelled."""
        settings = self._settings
        path = self._path
        then, last_clearance, last_velocity = self._path_end
        self._path_end = at, clearance, velocity
        if not path or at - then > 0.5:
            path.clear()
            path.append((at, 0.0, 0.0))
            return
        travelled = 0.5 * (velocity + last_velocity) * (at - then)
        off = path[-1][1] + clearance - last_clearance - travelled
        path.append((at, off, self.velocity.residual))
        if clearance == last_clearance:
            self._held_path += travelled
        else:
            self._held_path = 0.0
        while path[-1][0] - path[0][0] > settings.drift_window + 1.0:
            path.popleft()
        if path[-1][0] - path[0][0] < 1.0:
            return
        recent, old, n, m = 0.0, 0.0, 0, 0
        start = path[-1][0] - settings.drift_window
        for t, off, _ in path:
            if t > at - 0.25:
                recent, n = recent + off, n + 1
            elif t >= start and t <= max(start, path[0][0]) + 0.25:
                old, m = old + off, m + 1
        if not n or not m:
            return
        drift = recent / n - old / m
        limit = self._widening() * max(settings.drift_limit, 5.0 * self._drift_noise.deviation)
        if abs(drift) <= limit:
            if abs(drift) <= 0.6 * limit:
                self._drift_noise.take(drift, 0.0)
        elif settings.check_drift:
            self._blame_drift(drift, limit, at)

    def _blame_drift(self, drift: float, limit: float, at: float) -> None:
        """Clearance and relative velocity contradict each other: which of them is wrong?

        A clearance that drifts leaves its path in a straight line; a relative velocity that drifts
        bends it.
        """
        track = self.track
        assert track is not None
        points = np.array(self._path)
        times, off = points[:, 0] - points[-1, 0], points[:, 1]
        best = {}
        for power in (1, 2):
            for onset in np.linspace(times[0], -0.5, 12):
                shape = (times - onset).clip(min=0.0) ** power
                design = np.column_stack([np.ones_like(shape), shape])
                solution, *_ = np.linalg.lstsq(design, off, rcond=None)
                wrong = float(np.sum((design @ solution - off) ** 2))
                if power not in best or wrong < best[power][0]:
                    best[power] = wrong, onset, solution
        held = self.clearance.repetition
        if held.run >= max(HELD_SCANS, held.longest + 1):
            power = 1
        else:
            power = 1 if best[1][0] <= best[2][0] else 2
            doubt = best[power][0] > DOUBT * best[3 - power][0]
            if doubt and abs(drift) < 1.6 * limit:
                return
        kind = Kind.HOLD if power == 1 and held.run >= HELD_SCANS else Kind.RAMP
        _, onset, (base, slope) = best[power]
        reason = f"clearance left the path of the relative velocity by {drift:.2f} m"
        clearance, velocity = self._path_end[1:]
        if power == 1 and kind is not Kind.HOLD:
            # A step of the relative velocity, too small for its limits, leaves a straight line, too.
            near = np.abs(times - onset) <= STEP_SEARCH
            if np.any(points[near, 2] * -np.sign(slope) > 0.6 * abs(slope)):
                power, kind = 0, Kind.OFFSET
        if power == 1:
            error = float(off[-1] - base)
            signal = self.clearance
            track.clearance, track.cc, track.cv, track.ca = clearance - error, 0.05, 0.0, 0.0
        else:
            error = float(2.0 * slope * onset) if power else float(-slope)
            signal = self.velocity
            track.clearance, track.cc, track.cv, track.ca = clearance, 0.05, 0.0, 0.0
            track.velocity, track.vv, track.va = velocity - error, 0.09, 0.0
            track.believe(self._slow_acceleration, 0.6)
            self.clearance.confidence, self.clearance.residual = 0, 0.0
            self.clearance.residuals = []
        signal.residual, signal.onset = error, at + onset
        signal.residuals = [(at, error)]
        self._convict(signal, kind, reason, at)
