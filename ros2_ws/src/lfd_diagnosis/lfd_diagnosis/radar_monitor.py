"""The radar's two signals held against the lead's track, scan by scan (robust profile)."""

from dataclasses import dataclass
from math import exp, inf, isfinite, nan

from lfd_diagnosis.healthy_signal import LearntNoise, Repetition, Roughness, is_new
from lfd_diagnosis.lead_track import LeadTrack
from lfd_diagnosis.radar_signal import RadarSignal
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.travelled_path import TravelledPath
from lfd_diagnosis.verdict import Kind
from lfd_mpc.horizon import Horizon
from lfd_mpc.sampling import UNKNOWN_TRACK
from lfd_mpc.settings import STEP_S

READY_SCANS = 3
"""Scans of one target after which it is judged."""

LEARNING = 40.0
"""Scans over which limits come down from thrice to once their width while noise is learnt."""

CORRELATION = 3.0
"""Seconds over which the lead's acceleration is known when it is not measured."""

SLOW, SLOW_STD = 0.5, 0.35
"""Seconds over which the lead's acceleration is averaged before it is relied on for long, and how
well it is known then, in m/s^2."""

MEMORY = 0.6
"""Seconds for which a target is remembered under its track id."""

LOST_AFTER = 1.0
"""Seconds of silence after which a target that disagrees is another one, not a fault."""

VELOCITY_BIAS = 0.02
"""m/s by which the relative velocity may be off for good; a coasted clearance drifts with it."""

GRADUAL = 0.6
"""Share of its limit that a residual has before a fault that came on gradually."""

HELD_PATH, HELD_SIGMA, HELD_STEPS = 0.45, 4.0, 3.0
"""What must have been travelled while the clearance repeats itself: m, deviations of its noise, and
steps of its resolution."""

CLEARANCE_STD, VELOCITY_STD = 0.22, 0.3
"""How well a track is known, in m and m/s, that a contradiction was explained with."""


@dataclass(frozen=True)
class Measured:
    """One signal at a step: whether it is new, its time in s, its value and its age in s."""

    new: bool
    at: float
    value: float
    age: float


class RadarMonitor:
    """Judges clearance and relative velocity of one radar."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings

        def signal(name: str, unit: str, floor: float, std: float, lowest: float) -> RadarSignal:
            noise = LearntNoise(std, lowest, 10.0 * std, settings.learn_noise)
            return RadarSignal(name, unit, floor, noise, Roughness(16), Repetition(8))

        self.clearance = signal(
            "clearance", "m", settings.clearance_floor, settings.clearance_std, 0.03
        )
        self.velocity = signal(
            "relative velocity",
            "m/s",
            settings.relative_velocity_floor,
            settings.relative_velocity_std,
            0.015,
        )
        self.signals = self.clearance, self.velocity
        self._path = TravelledPath(settings)
        self._coast_keep = exp(-STEP_S / CORRELATION)
        self._host_moves = True
        self.lost_since: float | None = None
        self._start_anew()

    def _start_anew(self) -> None:
        self.track: LeadTrack | None = None
        self.scans = 0
        self._id = UNKNOWN_TRACK
        self._remembered: dict[int, tuple[float, LeadTrack]] = {}
        self._slow_acceleration = self._settings.lead_acceleration_mean
        self._host = 0.0
        self._travelled_while_held = 0.0
        self._path.clear()
        for signal in self.signals:
            signal.restart()

    def restart(self) -> None:
        """Nothing from before counts, faults neither; what was learnt of the noise stays."""
        self._start_anew()
        self.lost_since = None
        for signal in self.signals:
            signal.forgive()

    @property
    def ready(self) -> bool:
        """Whether the target is known long enough to be judged."""
        return self.track is not None and self.scans >= READY_SCANS

    @property
    def faulty(self) -> bool:
        """Whether either signal is."""
        return self.clearance.faulty or self.velocity.faulty

    def deviations(self) -> tuple[float, float]:
        """Standard deviations of healthy measurements about the track, in m and m/s."""
        track = self.track
        if track is None:
            return inf, inf
        return self.clearance.deviation(track.cc), self.velocity.deviation(track.vv)

    def coast(self, host_acceleration: float) -> None:
        """One step that nothing is known of, the host accelerating as stated (m/s^2)."""
        if self.track is not None:
            self._predict(self.track, host_acceleration, nan)

    def step(
        self,
        horizon: Horizon,
        host_acceleration: float,
        lead_acceleration: float,
        host_moves: bool,
    ) -> None:
        """Take one step's measurements.

        The host's acceleration in m/s^2 as best known; the lead's, NaN unless the lead says it;
        whether the host surely moves, so that equal samples mean something.
        """
        now = horizon.stamp * 1e-9
        self._host_moves = host_moves
        if not horizon.has_target:
            if self.track is not None and self.faulty:
                self.lost_since = now
            self._start_anew()
            return
        if self.track is not None:
            self._predict(self.track, host_acceleration, lead_acceleration)
        self._host = host_acceleration
        clearance = self._measured(
            now,
            self.clearance,
            nan if horizon.clearance_stale else horizon.measured_clearance,
            horizon.clearance_age,
        )
        velocity = self._measured(
            now,
            self.velocity,
            nan if horizon.relative_velocity_stale else horizon.measured_relative_velocity,
            horizon.relative_velocity_age,
        )
        if clearance.new or velocity.new:
            self._scan(horizon.track_id, clearance, velocity)

    @staticmethod
    def _measured(now: float, signal: RadarSignal, value: float, age: float) -> Measured:
        new = isfinite(value) and is_new(now - age, signal.last_at)
        return Measured(new, now - age, value, age)

    def _predict(
        self, track: LeadTrack, host_acceleration: float, lead_acceleration: float
    ) -> None:
        settings = self._settings
        keep, jerk = 1.0, settings.jerk_density
        if self.velocity.faulty:
            keep, jerk = self._coast_keep, settings.coasting_jerk_density
            if isfinite(lead_acceleration):
                track.inform(lead_acceleration, settings.lead_report_std)
        track.predict(STEP_S, host_acceleration, keep, settings.lead_acceleration_mean, jerk)
        if self.clearance.faulty:
            self.clearance.coasted += STEP_S
            track.cc += 2.0 * VELOCITY_BIAS**2 * self.clearance.coasted * STEP_S
        if not self.faulty:
            off = track.acceleration - self._slow_acceleration
            self._slow_acceleration += STEP_S / SLOW * off

    def _scan(self, track_id: int, clearance: Measured, velocity: Measured) -> None:
        """One scan, or the one signal of it that is there."""
        measured = clearance, velocity
        same = [
            m.new and signal.repetition.take(m.value, not self.faulty)
            for signal, m in zip(self.signals, measured, strict=True)
        ]
        whole = clearance.new and velocity.new
        if same[0] and self.track is not None and not self.velocity.faulty:
            period = clearance.at - self.clearance.last_at
            self._travelled_while_held += self.track.velocity * period
        else:
            self._travelled_while_held = 0.0
        if self.track is None:
            if whole:
                self._begin(track_id, clearance, velocity)
        elif not (whole and self._is_another(track_id, clearance, velocity)):
            self._id = track_id
            self.scans += 1
            # A sensor that says everything twice has nothing new to say the second time.
            repeated = all(same) and self.clearance.repetition.run == 1
            self._judge(self.track, measured, repeated)
        for signal, m in zip(self.signals, measured, strict=True):
            if m.new:
                signal.last, signal.last_at = m.value, m.at

    def _begin(self, track_id: int, clearance: Measured, velocity: Measured) -> None:
        """A target that nothing is known of."""
        mean = self._settings.lead_acceleration_mean
        self.track = LeadTrack.start(
            clearance.value + velocity.value * clearance.age,
            velocity.value,
            mean,
            (self.clearance.noise.deviation, self.velocity.noise.deviation),
        )
        self._id, self.scans = track_id, 1
        self._slow_acceleration = mean
        self._cut_path()
        for signal in self.signals:
            signal.residual = signal.limit = nan
            if not signal.faulty:
                signal.confidence = 0

    def _cut_path(self) -> None:
        """The clearance may have stepped for a good reason."""
        self._path.clear()
        for signal in self.signals:
            signal.roughness.restart()

    def _is_another(self, track_id: int, clearance: Measured, velocity: Measured) -> bool:
        """Sort out a new track id, or a silence; whether a new target was begun."""
        silent = clearance.at - max(s.last_at for s in self.signals) > LOST_AFTER
        changed = track_id != self._id and UNKNOWN_TRACK not in (track_id, self._id)
        if not changed and not silent:
            return False
        if self._settings.same_car and self._knows(track_id, changed, clearance, velocity):
            self._cut_path()
            return False
        if self.faulty:
            self.lost_since = clearance.at
        self._begin(track_id, clearance, velocity)
        return True

    def _knows(self, track_id: int, changed: bool, clearance: Measured, velocity: Measured) -> bool:
        """Whether a target under another id, or after a silence, is a car that is known."""
        assert self.track is not None
        at = clearance.at
        if changed and not self.faulty:
            self._remembered[self._id] = at, self.track.copy()
        self._remembered = {
            known: entry for known, entry in self._remembered.items() if at - entry[0] < MEMORY
        }
        limits = self._limits(self.track)
        now = clearance.value + velocity.value * clearance.age
        if (
            abs(now - self.track.clearance) <= limits[0]
            and abs(velocity.value - self.track.velocity) <= limits[1]
        ):
            return True
        if self.faulty:
            # The faulty signals go on as they were: the car is the same, its reference still good.
            return (
                abs(clearance.value - self.clearance.last) <= self.clearance.floor
                and abs(velocity.value - self.velocity.last) <= self.velocity.floor
            )
        if track_id in self._remembered and changed:
            then, track = self._remembered.pop(track_id)
            settings = self._settings
            if at > then:
                mean = settings.lead_acceleration_mean
                track.predict(at - then, self._host, 1.0, mean, settings.jerk_density)
            self.track = track
            return True
        return False

    def _widening(self) -> float:
        """How much wider limits are while the noise is being learnt."""
        return 1.0 + 2.0 * exp(-self.clearance.noise.count / LEARNING)

    def _limits(self, track: LeadTrack) -> tuple[float, float]:
        """Limits of clearance (m) and relative velocity (m/s) around the track."""
        wide, sigma = self._widening(), self._settings.gate_sigma
        c, v = self.clearance.deviation(track.cc), self.velocity.deviation(track.vv)
        return (
            wide * max(self.clearance.least, sigma * c),
            wide * max(self.velocity.least, sigma * v),
        )

    def _judge(self, track: LeadTrack, measured: tuple[Measured, Measured], repeated: bool) -> None:
        """Hold a scan against the track, then teach the track what is good of it."""
        clearance, velocity = self.signals
        age = max(m.age for m in measured if m.new)
        relative = track.acceleration - self._host
        expected = (
            track.clearance - age * (track.velocity - 0.5 * age * relative),
            track.velocity - age * relative,
        )
        limits, variances = self._limits(track), (track.cc, track.vv)
        new = [
            (signal, m, *rest)
            for signal, m, *rest in zip(
                self.signals, measured, expected, limits, variances, strict=True
            )
            if m.new
        ]
        if not repeated:
            for signal, m, prediction, limit, _ in new:
                signal.residual, signal.limit = m.value - prediction, limit
        velocity_was_faulty = velocity.faulty
        for signal, m, *_ in new:
            signal.roughness.take(m.value, not self.faulty and not signal.bad)
            signal.count(self._settings.scan_confidence_max)
            if signal.faulty:
                signal.classify()
                self._requalify(track, signal, m)
            elif self.ready:
                self._suspect(track, signal)
        if velocity.faulty and not velocity_was_faulty:
            track.believe(self._slow_acceleration, SLOW_STD)
        if repeated:
            return
        if all(not signal.faulty and not signal.bad for signal, *_ in new):
            for signal, _, _, _, variance in new:
                signal.noise.take(signal.residual, variance)
        if measured[0].new and not clearance.faulty and not clearance.bad:
            track.correct_clearance(clearance.residual, clearance.noise.variance)
        if measured[1].new and not velocity.faulty and not velocity.bad:
            now = track.velocity - age * (track.acceleration - self._host)
            track.correct_velocity(measured[1].value - now, velocity.noise.variance)
        if len(new) == 2 and not self.faulty:
            self._follow_path(track, measured)
        elif len(new) == 2 and clearance.faulty and velocity.faulty:
            self._look_for_another(measured)

    def _suspect(self, track: LeadTrack, signal: RadarSignal) -> None:
        """Whether a signal that was healthy still is."""
        settings = self._settings
        if signal.confidence >= settings.scan_confidence_threshold:
            if signal is self.clearance and self._is_gradual() and self._path.explainable:
                self._explain(track, signal.residual, signal.limit)
            else:
                self._convict(signal, Kind.OFFSET, signal.text())
        elif settings.check_roughness and signal.roughness.rough:
            share = signal.roughness.share
            because = f"roughness: {share:.0%} of scans far rougher than before"
            self._convict(signal, Kind.NOISE, because)
        elif settings.check_repetition and self._is_frozen(signal):
            kind = Kind.ZERO if signal.last == 0.0 else Kind.HOLD
            run = signal.repetition.run + 1
            self._convict(signal, kind, f"repetition: the same value {run} times")

    def _is_frozen(self, signal: RadarSignal) -> bool:
        """A value repeated for too long, or while the relative velocity says that it changed."""
        if signal is self.clearance and signal.held:
            return abs(self._travelled_while_held) > max(
                HELD_PATH,
                HELD_SIGMA * signal.noise.deviation,
                HELD_STEPS * signal.roughness.resolution,
            )
        return signal.repetition.frozen and self._host_moves

    def _is_gradual(self) -> bool:
        """Whether the clearance goes out of its limits little by little."""
        before, signal = self.clearance.residual_before, self.clearance
        return (
            self._settings.check_drift
            and before * signal.residual > 0.0
            and abs(before) > GRADUAL * signal.limit
        )

    def _convict(self, signal: RadarSignal, kind: Kind, because: str) -> None:
        signal.convict(kind, because, self._settings.scan_confidence_max)
        signal.coasted = 0.0
        self._path.clear()

    def _requalify(self, track: LeadTrack, signal: RadarSignal, measured: Measured) -> None:
        """Whether a faulty signal is to be believed again."""
        settings = self._settings
        period = measured.at - signal.last_at
        step = measured.value - signal.last
        if signal is self.clearance:
            step -= track.velocity * period
        if self.lost_since is None:
            if signal.has_returned(step):
                self._rebase(track, signal, measured.value)
            elif signal.has_stopped(measured.at, settings.requalify_time):
                self._rebase(track, signal, measured.value)
                signal.forgive()
                return
        deviation = signal.deviation(track.variance(signal is self.velocity))
        agrees = signal.agrees_again(period, step, deviation, settings.clear_time, settings.latch)
        if self.lost_since is not None:
            # A new target: its own agreement with itself must do, but for longer.
            if agrees is None:
                self.lost_since = measured.at
            agrees = measured.at - self.lost_since >= settings.requalify_time
        if agrees:
            signal.forgive()
            # What was followed while it was faulty tells nothing about it now.
            self._path.clear()
            if not self.faulty:
                self.lost_since = None

    def _rebase(self, track: LeadTrack, signal: RadarSignal, measured: float) -> None:
        """The jump that made a fault was undone: the signal is the reference again."""
        variance = signal.noise.variance
        if signal is self.clearance:
            track.set_clearance(measured, variance)
        else:
            track.set_velocity(measured, variance)
        signal.residual = 0.0

    def _follow_path(self, track: LeadTrack, measured: tuple[Measured, Measured]) -> None:
        """Hold the clearance against the path that the relative velocity makes."""
        clearance, velocity = self.signals
        if velocity.bad or (clearance.bad and not self._is_gradual()):
            return
        path = self._path
        limit = path.limit(self._widening(), clearance.resolution)
        path.follow(measured[0].at, measured[0].value, measured[1].value, velocity.residual)
        drift = path.drift(limit)
        if self._settings.check_drift and abs(drift) > limit and path.explainable:
            self._explain(track, drift, limit)

    def _look_for_another(self, measured: tuple[Measured, Measured]) -> None:
        """A radar that gives no ids: two signals that jumped, but agree with each other since.

        A fault of both leaves them contradicting each other; another car does not.
        """
        if self._id != UNKNOWN_TRACK or self.lost_since is not None:
            return
        path = self._path
        path.follow(measured[0].at, measured[0].value, measured[1].value, 0.0)
        limit = path.limit(1.0, self.clearance.resolution)
        if path.length >= self._settings.drift_window and abs(path.drift(limit)) < 0.5 * limit:
            self.lost_since = measured[0].at
            self._begin(UNKNOWN_TRACK, *measured)

    def _explain(self, track: LeadTrack, drift: float, limit: float) -> None:
        """Clearance and relative velocity contradict each other: convict one of them."""
        path = self._path
        held = self.clearance.held and abs(self._travelled_while_held) > 0.5 * abs(drift)
        wrong = path.explain(abs(drift) / limit, held)
        if wrong is None:
            return
        because = (
            f"path: the clearance left that of the relative velocity by {drift:.2f} m "
            f"(limit {limit:.2f})"
        )
        if wrong.of_clearance:
            signal = self.clearance
            track.set_clearance(path.clearance - wrong.error, CLEARANCE_STD**2)
        else:
            signal = self.velocity
            track.set_clearance(path.clearance, CLEARANCE_STD**2)
            track.set_velocity(path.velocity - wrong.error, VELOCITY_STD**2)
            self.clearance.acquit()
        signal.residual = wrong.error
        self._convict(signal, wrong.kind, because)
