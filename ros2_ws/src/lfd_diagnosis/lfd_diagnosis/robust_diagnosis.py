"""The robust diagnosis: every signal against independent evidence, and reasons for each verdict."""

from math import isfinite, isnan, nan

from lfd_diagnosis.acceleration_monitor import AccelerationMonitor
from lfd_diagnosis.lead_report import LeadReport
from lfd_diagnosis.radar_monitor import READY_SCANS, RadarMonitor, RadarSignal
from lfd_diagnosis.report_book import ReportBook, silent
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import (
    EVIDENCE,
    Event,
    Kind,
    Outcome,
    Reconstruction,
    Report,
    SignalVerdict,
    State,
)
from lfd_mpc.horizon import Horizon
from lfd_mpc.settings import STEP_NS
from lfd_observer.bank import BankState

INDEX_LIMIT = 0.5
"""Where a residual equals its limit, the index is one half."""

LARGEST_GAP = 30
"""Horizons that may be lost on the way before everything starts anew."""

VALID_CLEARANCE_STD, VALID_VELOCITY_STD = 2.0, 1.5
"""Standard deviations in m and m/s up to which a coasted signal is offered."""


class RobustDiagnosis:
    """Lead track, host's speed, observers and V2V as evidence."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self._book = ReportBook()
        self._start()

    def _start(self) -> None:
        self._radar = RadarMonitor(self._settings)
        self._acceleration = AccelerationMonitor(self._settings)
        self._lead = LeadReport(self._settings)
        self._last_stamp: int | None = None
        self._anew_because = ""
        self._heard_lead = False

    def reset(self) -> None:
        """Forget every fault and all that was learnt: everything is judged anew."""
        self._start()
        self._anew_because = "reset"

    def step(self, horizon: Horizon, bank: BankState | None) -> Outcome:
        """Answer one horizon with the bank's answer to the same one, None if it was lost."""
        radar, acceleration = self._radar, self._acceleration
        self._follow_time(horizon)
        acceleration.follow(horizon)
        lead = self._lead
        told = lead.acceleration if lead.trusted else nan
        radar.step(horizon, acceleration.acceleration, told, self._host_moves(horizon))
        relative = self._relative_acceleration(bank)
        acceleration.judge(horizon, relative, lead)
        lead.step(horizon, self._lead_seen())
        self._heard_lead |= lead.heard
        report, events = self._book.publish(
            horizon.stamp,
            horizon.step,
            {
                "clearance": self._judge_radar(
                    horizon,
                    "clearance",
                    radar.clearance,
                    horizon.clearance_stale,
                    horizon.clearance_age,
                ),
                "relative_velocity": self._judge_radar(
                    horizon,
                    "relative_velocity",
                    radar.velocity,
                    horizon.relative_velocity_stale,
                    horizon.relative_velocity_age,
                ),
                "acceleration": self._judge_acceleration(horizon),
                "host_speed": self._judge_host_speed(horizon),
                "lead_acceleration": self._judge_lead(horizon),
            },
        )
        return Outcome(report, events, self._reconstruct(horizon, relative))

    def silence(self, stamp: int) -> tuple[Report, list[Event]]:
        """Nothing arrives at all: the report (of no step) that says so at `stamp` (ns)."""
        names = ("clearance", "relative_velocity", "acceleration", *EVIDENCE)
        reason = "nothing arrives at all"
        return self._book.publish(
            stamp, 0, {n: self._verdict(stamp, n, State.NO_DATA, reason) for n in names}
        )

    def _follow_time(self, horizon: Horizon) -> None:
        """Start anew where time does; a new lead alone is the radar's business."""
        last, self._last_stamp = self._last_stamp, horizon.stamp
        steps = None if last is None else (horizon.stamp - last) // STEP_NS
        new_lead = horizon.restart and steps == 1
        if steps is not None and 1 <= steps <= LARGEST_GAP and (not horizon.restart or new_lead):
            for _ in range(steps - 1):
                self._radar.coast(self._acceleration.acceleration)
            return
        if last is not None or horizon.restart:
            self._anew_because = horizon.restart_reason or "horizons were lost on the way"
        self._radar.restart()
        self._acceleration.restart()
        self._lead.restart()

    def _host_moves(self, horizon: Horizon) -> bool:
        """Whether the car surely moves, so that equal samples mean something."""
        return horizon.host_speed_stale or self._acceleration.speed.moving

    def _relative_acceleration(self, bank: BankState | None) -> float:
        """What the observers reconstruct, in m/s^2; NaN where the radar is not to be believed."""
        if bank is None or self._radar.faulty or not self._radar.ready:
            return nan
        return float(bank.relative_acceleration[0])

    def _lead_seen(self) -> float:
        """The lead's acceleration as radar and host make it, in m/s^2."""
        acceleration = self._acceleration
        if self._radar.faulty or not self._radar.ready:
            return nan
        if acceleration.faulty and not acceleration.speed.usable:
            return nan
        assert self._radar.track is not None
        return self._radar.track.acceleration

    def _verdict(self, stamp: int, name: str, state: State, reason: str, **more) -> SignalVerdict:
        values = {
            "index": nan,
            "threshold": INDEX_LIMIT,
            "confidence": 0,
            "confidence_threshold": 1,
            **more,
        }
        if state == State.FAULT:
            # A fault that is latched is no less certain for agreeing meanwhile.
            values["confidence"] = max(values["confidence"], values["confidence_threshold"])
        since = self._book.since(stamp, name, state)
        return SignalVerdict(state=state, since=since, reason=reason, **values)

    def _judge_radar(
        self, horizon: Horizon, name: str, signal: RadarSignal, stale: bool, age: float
    ) -> SignalVerdict:
        radar = self._radar
        kind, size, size_std = Kind.UNKNOWN, nan, nan
        index = nan
        if stale:
            state, reason, kind = _no_data(age)
        elif not horizon.has_target:
            state, reason = State.NO_TARGET, "the radar sees no lead"
        elif signal.faulty:
            state, reason = State.FAULT, self._fault_reason(signal)
            kind = signal.kind
            size, size_std = signal.size, self._size_std(signal)
            index = signal.index
        elif not radar.ready or isnan(signal.residual):
            state, reason = State.NOT_READY, self._filling()
        else:
            state = State.SUSPECT if signal.confidence else State.OK
            index = signal.index
            reason = f"{signal.text()}; scan {age * 1000:.0f} ms old"
            if signal.outliers:
                reason += f"; {signal.outliers} single outliers rejected so far"
        if horizon.sensor_text:
            reason += f"; the radar says: {horizon.sensor_text}"
        return self._verdict(
            horizon.stamp,
            name,
            state,
            reason,
            index=index,
            confidence=signal.confidence,
            confidence_threshold=self._settings.scan_confidence_threshold,
            kind=kind,
            size=size,
            size_std=size_std,
        )

    def _fault_reason(self, signal: RadarSignal) -> str:
        reason = f"{signal.kind.name.lower()} by {signal.because}"
        if self._radar.lost_since is not None:
            needed = self._settings.requalify_time
            return f"{reason}; reference lost: a new target must agree for {needed:g} s"
        reason += f"; now {signal.text()}"
        if not signal.tellable:
            reason += "; can no longer be told from a healthy signal"
        return reason

    def _size_std(self, signal: RadarSignal) -> float:
        """How well the size of a fault is known."""
        track = self._radar.track
        if track is None or isnan(signal.size):
            return nan
        return signal.deviation(track.variance(signal is self._radar.velocity))

    def _filling(self) -> str:
        because = f" after: {self._anew_because}" if self._anew_because else ""
        scans = min(self._radar.scans, READY_SCANS)
        return f"{scans} of {READY_SCANS} scans of this target{because}"

    def _judge_acceleration(self, horizon: Horizon) -> SignalVerdict:
        monitor = self._acceleration
        kind, size, size_std, index = Kind.UNKNOWN, nan, nan, nan
        check = monitor.check
        if check is not None and isfinite(check.residual):
            off = abs(check.residual)
            index = off / (off + check.limit)
        if horizon.acceleration_stale:
            state, reason, kind = _no_data(horizon.acceleration_age)
        elif monitor.faulty:
            state = State.FAULT
            kind, size, size_std = monitor.kind, monitor.size, monitor.size_std
            reason = f"{kind.name.lower()} by {monitor.because}; now {monitor.evidence()}"
        elif check is None:
            state, reason = State.NOT_READY, f"neither host speed nor lead: {self._filling()}"
        else:
            state = State.SUSPECT if monitor.confidence else State.OK
            reason = f"{monitor.evidence()}; sample {horizon.acceleration_age * 1000:.0f} ms old"
        if monitor.speed.faulty:
            reason += f"; host speed is not used: {monitor.speed.because}"
        if self._lead.faulty:
            reason += f"; the lead's word is not used: {self._lead.because}"
        return self._verdict(
            horizon.stamp,
            "acceleration",
            state,
            reason,
            index=index,
            confidence=monitor.confidence,
            confidence_threshold=self._settings.acceleration_steps,
            kind=kind,
            size=size,
            size_std=size_std,
        )

    def _judge_host_speed(self, horizon: Horizon) -> SignalVerdict:
        speed = self._acceleration.speed
        kind, size = Kind.UNKNOWN, nan
        age = horizon.host_speed_age
        if not self._settings.use_host_speed:
            state, reason = State.NOT_READY, "not used (parameter use_host_speed)"
        elif horizon.host_speed_stale:
            state, reason, kind = _no_data(age)
        elif speed.faulty:
            state, kind, size = State.FAULT, speed.kind, speed.size
            reason = f"{kind.name.lower()} by {speed.because}; not used as evidence"
        elif not speed.usable:
            state, reason = State.NOT_READY, "its derivative is settling"
        else:
            state = State.OK
            reason = f"derivative {speed.derivative:.2f} m/s^2; sample {age * 1000:.0f} ms old"
        return self._verdict(horizon.stamp, "host_speed", state, reason, kind=kind, size=size)

    def _judge_lead(self, horizon: Horizon) -> SignalVerdict:
        lead, kind = self._lead, Kind.UNKNOWN
        if not self._settings.use_lead_report:
            state, reason = State.NOT_READY, "not used (parameter use_lead_report)"
        elif not lead.heard:
            state, reason, _ = _no_data(horizon.lead_acceleration_age)
            # An age is known of messages that were never fit to be used, too.
            kind = Kind.DROPOUT if self._heard_lead else Kind.UNKNOWN
        elif lead.faulty:
            state, reason = State.FAULT, f"{lead.because}; not used as evidence"
        elif not lead.trusted:
            state, reason = State.NOT_READY, "must agree with radar and host for a while first"
        else:
            state = State.OK
            reason = f"off by {lead.off:.2f} m/s^2 from radar and host (limit {lead.limit:.2f})"
        size = lead.off if state == State.FAULT else nan
        return self._verdict(
            horizon.stamp, "lead_acceleration", state, reason, kind=kind, size=size
        )

    def _reconstruct(self, horizon: Horizon, relative: float) -> Reconstruction:
        """Each signal from everything but a faulty one."""
        radar, acceleration = self._radar, self._acceleration
        track = radar.track if radar.ready and radar.lost_since is None else None
        missing = []
        clearance_std, velocity_std = radar.deviations()
        if track is None:
            missing.append(f"radar signals: {self._filling()}")
        else:
            if clearance_std > VALID_CLEARANCE_STD:
                missing.append(f"clearance: not known better than to {clearance_std:.1f} m")
            if velocity_std > VALID_VELOCITY_STD:
                missing.append(
                    f"relative velocity: not known better than to {velocity_std:.1f} m/s"
                )
        clearance_ok = track is not None and clearance_std <= VALID_CLEARANCE_STD
        velocity_ok = track is not None and velocity_std <= VALID_VELOCITY_STD
        acceleration_ok = acceleration.speed.usable or (
            isfinite(acceleration.expected) and not isnan(relative)
        )
        if not acceleration_ok:
            missing.append("acceleration: neither host speed nor lead tells it")
        return Reconstruction(
            stamp=horizon.stamp,
            step=horizon.step,
            clearance_valid=clearance_ok,
            clearance=track.clearance if clearance_ok else nan,
            clearance_std=clearance_std if clearance_ok else nan,
            relative_velocity_valid=velocity_ok,
            relative_velocity=track.velocity if velocity_ok else nan,
            relative_velocity_std=velocity_std if velocity_ok else nan,
            relative_acceleration_valid=not isnan(relative),
            relative_acceleration=relative,
            acceleration_valid=acceleration_ok,
            acceleration=acceleration.expected if acceleration_ok else nan,
            acceleration_std=acceleration.std if acceleration_ok else nan,
            reason="; ".join(missing),
        )


def _no_data(age: float) -> tuple[State, str, Kind]:
    """What is said of a signal whose newest sample is that old, in s; NaN = there was none."""
    kind = Kind.UNKNOWN if isnan(age) else Kind.DROPOUT
    return State.NO_DATA, f"transport: {silent(age)}", kind
