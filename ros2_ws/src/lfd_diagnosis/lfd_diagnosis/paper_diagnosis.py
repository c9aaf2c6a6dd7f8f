"""The paper's diagnosis: indices of what disagrees, counted into confidence (eqs 25, 26)."""

from math import hypot, isnan, nan

import numpy as np

from lfd_diagnosis.confidence import Confidence
from lfd_diagnosis.fault_index import PredictionLimits
from lfd_diagnosis.report_book import ReportBook, silent
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import (
    EVIDENCE,
    Event,
    Outcome,
    Reconstruction,
    Report,
    SignalVerdict,
    State,
)
from lfd_mpc.horizon import Horizon
from lfd_mpc.settings import STEP_S
from lfd_observer.bank import BankState
from lfd_observer.prediction_store import HorizonFollower, Predicted


class PaperDiagnosis:
    """Fault indices, confidence, decision and reconstruction (eqs 25, 26, Table 1)."""

    def __init__(self, settings: DiagnosisSettings) -> None:
        self._settings = settings
        self._follower = HorizonFollower(settings.prediction_steps)
        self._limits = PredictionLimits(settings)
        self._confidence = {
            name: Confidence(
                getattr(settings, f"{name}_threshold"),
                settings.confidence_threshold,
                settings.confidence_max,
            )
            for name in ("clearance", "relative_velocity", "acceleration")
        }
        self._stored = 0
        self._anew_because = ""
        self._book = ReportBook()

    def reset(self) -> None:
        """Forget confidence and stored predictions: everything is judged anew."""
        self._follower = HorizonFollower(self._settings.prediction_steps)
        for confidence in self._confidence.values():
            confidence.value = 0
        self._stored, self._anew_because = 0, "reset"

    def step(self, horizon: Horizon, bank: BankState | None) -> Outcome:
        """Answer one horizon with the bank's answer to the same one, None if it was lost.

        Raises ValueError when the horizon's length is not the diagnosis's.
        """
        predicted = self._follower.take(horizon)
        if predicted.anew:
            self._stored = 0
            self._anew_because = horizon.restart_reason or horizon.solver_status
        clearance, relative_velocity = self._judge_radar(horizon, predicted)
        acceleration = self._judge_acceleration(horizon, bank)
        self._stored = min(self._stored + horizon.valid, self._settings.prediction_steps)
        report, events = self._book.publish(
            horizon.stamp,
            horizon.step,
            {
                "clearance": clearance,
                "relative_velocity": relative_velocity,
                "acceleration": acceleration,
                **self._not_judged(horizon.stamp),
            },
        )
        return Outcome(report, events, self._reconstruct(horizon, predicted, bank, report))

    def silence(self, stamp: int) -> tuple[Report, list[Event]]:
        """Nothing arrives at all: the report (of no step) that says so at `stamp` (ns)."""
        nothing = {
            name: self._verdict(stamp, name, State.NO_DATA, nan, "nothing arrives at all")
            for name in self._confidence
        }
        return self._book.publish(stamp, 0, {**nothing, **self._not_judged(stamp)})

    def _judge_radar(
        self, horizon: Horizon, predicted: Predicted
    ) -> tuple[SignalVerdict, SignalVerdict]:
        measured = (horizon.clearance, horizon.relative_velocity)
        disagree = np.add.reduce(self._limits.outside(np.array(measured), predicted.states))
        rows = (
            ("clearance", "m", horizon.clearance_stale, horizon.clearance_age),
            (
                "relative_velocity",
                "m/s",
                horizon.relative_velocity_stale,
                horizon.relative_velocity_age,
            ),
        )
        verdicts = []
        n = self._settings.prediction_steps
        for (name, unit, stale, age), value, count in zip(
            rows, measured, disagree.tolist(), strict=True
        ):
            index = nan
            if stale:
                state, reason = State.NO_DATA, silent(age)
            elif not horizon.has_target and not horizon.valid:
                state, reason = State.NO_TARGET, "the radar sees no lead"
            elif not predicted.complete:
                state, reason = State.NOT_READY, self._filling()
            else:
                state, index = None, count / n
                reason = f"{count} of {n} predictions disagree with {value:.2f} {unit}"
            if horizon.sensor_text:
                reason += f"; the radar says: {horizon.sensor_text}"
            verdicts.append(self._verdict(horizon.stamp, name, state, index, reason))
        return verdicts[0], verdicts[1]

    def _judge_acceleration(self, horizon: Horizon, bank: BankState | None) -> SignalVerdict:
        index = nan
        if horizon.acceleration_stale:
            state, reason = State.NO_DATA, silent(horizon.acceleration_age)
        elif bank is None:
            state, reason = State.NOT_READY, "the observer bank did not answer"
        elif isnan(bank.acceleration_index):
            state, reason = State.NOT_READY, self._filling()
        else:
            state, index = None, bank.acceleration_index
            count, observers = int(bank.outside.sum()), len(bank.outside)
            lower, upper = bank.acceleration_lower[0], bank.acceleration_upper[0]
            reason = (
                f"{count} of {observers} observers exclude {horizon.acceleration:.2f} m/s^2 "
                f"(first one's limits {lower:.2f} to {upper:.2f})"
            )
        return self._verdict(horizon.stamp, "acceleration", state, index, reason)

    def _filling(self) -> str:
        because = f" after: {self._anew_because}" if self._anew_because else ""
        return f"{self._stored} of {self._settings.prediction_steps} predictions stored{because}"

    def _verdict(
        self, stamp: int, name: str, state: State | None, index: float, reason: str
    ) -> SignalVerdict:
        """The verdict on one signal; a state of None is decided by confidence (eq 26)."""
        confidence = self._confidence[name]
        confidence.step(index)
        if state is None:
            if confidence.faulty:
                state = State.FAULT
            else:
                state = State.SUSPECT if confidence.value > 0 else State.OK
        return SignalVerdict(
            state=state,
            index=index,
            threshold=confidence.index_threshold,
            confidence=confidence.value,
            confidence_threshold=confidence.fault_threshold,
            since=self._book.since(stamp, name, state),
            reason=reason,
        )

    def _not_judged(self, stamp: int) -> dict[str, SignalVerdict]:
        """The paper needs no evidence beyond its own."""
        state, reason = State.NOT_READY, "not judged by the paper profile"
        return {
            name: SignalVerdict(state, nan, nan, 0, 0, self._book.since(stamp, name, state), reason)
            for name in EVIDENCE
        }

    def _reconstruct(
        self, horizon: Horizon, predicted: Predicted, bank: BankState | None, report: Report
    ) -> Reconstruction:
        """What the signals should be (eqs 10, 21, 22).

        The oldest prediction is taken because it is the last to learn from a faulty measurement.
        """
        settings = self._settings
        tau = STEP_S * settings.prediction_steps
        sigma = settings.lead_acceleration_std
        clearance, relative_velocity = predicted.states[-1] if predicted.complete else (nan, nan)
        relative_acceleration = nan
        if bank is not None and bank.ready:
            relative_acceleration = float(bank.relative_acceleration[0])
        missing = []
        if not predicted.complete:
            missing.append(f"radar signals: {self._filling()}")
        acceleration = settings.lead_acceleration_mean - relative_acceleration
        if report.radar.state == State.FAULT:
            acceleration = nan
            missing.append("acceleration: the radar is faulty")
        elif isnan(relative_acceleration):
            missing.append("acceleration: the observers are not ready")
        return Reconstruction(
            stamp=horizon.stamp,
            step=horizon.step,
            clearance_valid=predicted.complete,
            clearance=float(clearance),
            clearance_std=hypot(settings.clearance_std, 0.5 * sigma * tau**2)
            if predicted.complete
            else nan,
            relative_velocity_valid=predicted.complete,
            relative_velocity=float(relative_velocity),
            relative_velocity_std=hypot(settings.relative_velocity_std, sigma * tau)
            if predicted.complete
            else nan,
            relative_acceleration_valid=not isnan(relative_acceleration),
            relative_acceleration=relative_acceleration,
            acceleration_valid=not isnan(acceleration),
            acceleration=acceleration,
            acceleration_std=nan if isnan(acceleration) else sigma,
            reason="; ".join(missing),
        )
