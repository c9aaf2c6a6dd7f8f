"""The diagnosis without ROS, of either profile: a horizon and its bank in, one report out.

The figures come from compiled functions (`robust_diagnosis`, `paper_diagnosis`), the words from
`reasons`; here they become reports and events.
"""

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from lfd_diagnosis.paper_diagnosis import (
    PAPER_OUTCOME,
    PAPER_STATE,
    paper_arrays,
    paper_silence_entry,
    paper_step_entry,
    start_paper_entry,
)
from lfd_diagnosis.reasons import (
    paper_missing,
    paper_reasons,
    radar_reason,
    robust_missing,
    robust_reasons,
)
from lfd_diagnosis.robust_diagnosis import (
    ROBUST_OUTCOME,
    ROBUST_STATE,
    robust_silence_entry,
    robust_step_entry,
    start_robust_entry,
)
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import (
    VERDICTS,
    Event,
    Kind,
    Outcome,
    Reconstruction,
    Report,
    SignalVerdict,
    State,
)
from lfd_mpc.compiled import make_state, unpacker
from lfd_mpc.horizon import Horizon
from lfd_mpc.settings import settings_record
from lfd_observer.bank import BANK, BankAnswer, BankState
from lfd_observer.prediction_store import check_shape

AT_START = (
    "profile",
    "learn_noise",
    "clearance_std",
    "relative_velocity_std",
    "lead_report_std",
)
"""Settings that say how to begin: where one of them changes, everything is judged anew."""

STATES = {int(state): state for state in State}
KINDS = {int(kind): kind for kind in Kind}


class Diagnosis(ABC):
    """Answers horizons; `state` and `outcome` are what is known and was said last, as
    arrays of one record."""

    state_kind: np.dtype
    outcome_kind: np.dtype
    missing: staticmethod
    reasons: staticmethod

    def __init__(self, settings: DiagnosisSettings) -> None:
        self.settings = settings
        self.numbers = settings_record(settings)
        self.state = make_state(self.state_kind)
        self.outcome = make_state(self.outcome_kind)
        self._unpack = unpacker(self.outcome_kind)
        self._anew_because = ""
        self._start()

    @abstractmethod
    def _start(self) -> None:
        """Begin with nothing."""

    @abstractmethod
    def _step(self, horizon: Horizon, bank: BankState | None) -> None:
        """Answer into `outcome`."""

    @abstractmethod
    def _silence(self, stamp: int) -> None:
        """Say into `outcome` that nothing arrives."""

    @abstractmethod
    def anew_because(self, restart_reason: str, solver_status: str) -> str:
        """Why nothing from before a step counts, given what its horizon says."""

    def reset(self) -> None:
        """Forget every fault and all that was learnt or stored: everything is judged anew."""
        self._start()
        self._anew_because = "reset"

    def change(self, settings: DiagnosisSettings) -> "Diagnosis":
        """The diagnosis that goes on with other settings from the next step on."""
        changed = [n for n in AT_START if getattr(settings, n) != getattr(self.settings, n)]
        if changed:
            anew = make_diagnosis(settings)
            anew.state["book"] = self.state["book"]
            anew._anew_because = f"parameters changed: {', '.join(changed)}"
            return anew
        self.settings = settings
        self.numbers = settings_record(settings)
        self._changed()
        return self

    @abstractmethod
    def _changed(self) -> None:
        """Take over from the settings what was made of them at the start."""

    def step(self, horizon: Horizon, bank: BankState | None) -> Outcome:
        """Answer one horizon with the bank's answer to the same one, None if it was lost.

        Raises ValueError when the horizon's length is not the diagnosis's.
        """
        self._step(horizon, bank)
        said = self._unpack(self.outcome[0])
        if said.starts_anew:
            self._anew_because = self.anew_because(horizon.restart_reason, horizon.solver_status)
        return self._outcome(said, self._anew_because, horizon.sensor_text)

    def silence(self, stamp: int) -> tuple[Report, list[Event]]:
        """Nothing arrives at all: the report (of no step) that says so at `stamp` (ns)."""
        self._silence(stamp)
        return self.report_of(self.outcome[0], "", "")

    def report_of(
        self, outcome: np.void, anew_because: str, sensor_text: str
    ) -> tuple[Report, list[Event]]:
        """A record of an outcome as report and events; the texts are those of its step."""
        return self._report(self._unpack(outcome), anew_because, sensor_text)

    def outcome_of(self, outcome: np.void, anew_because: str, sensor_text: str) -> Outcome:
        """A record of an outcome with everything that is said."""
        return self._outcome(self._unpack(outcome), anew_because, sensor_text)

    def _outcome(self, said: Any, anew_because: str, sensor_text: str) -> Outcome:
        report, events = self._report(said, anew_because, sensor_text)
        missing = self.missing(self.settings, said, anew_because)
        # The record has the fields of the class, in the same order.
        reconstruction = Reconstruction(said.stamp, said.step, *said.reconstructed, missing)
        return Outcome(report, events, reconstruction)

    def _report(self, said: Any, anew_because: str, sensor_text: str) -> tuple[Report, list[Event]]:
        reasons = self.reasons(self.settings, said, anew_because, sensor_text)
        reasons["radar"] = radar_reason(said.radar_is_velocity, reasons)
        verdicts = {name: _verdict(getattr(said, name), reasons[name]) for name in VERDICTS}
        report = Report(stamp=said.stamp, step=said.step, **verdicts)
        if not said.changed:
            return report, []
        events = [
            Event(
                said.stamp,
                name,
                STATES[int(said.old_state[number])],
                int(said.old_since[number]),
                verdicts[name],
            )
            for number, name in enumerate(VERDICTS)
            if said.changed & (1 << number)
        ]
        return report, events


def _verdict(said: Any, reason: str) -> SignalVerdict:
    state, kind, confidence, confidence_threshold, index, threshold, since, size, size_std = said
    return SignalVerdict(
        STATES[state],
        index,
        threshold,
        confidence,
        confidence_threshold,
        since,
        reason,
        KINDS[kind],
        size,
        size_std,
    )


class RobustDiagnosis(Diagnosis):
    """Lead track, host's speed, observers and V2V as evidence."""

    state_kind, outcome_kind = ROBUST_STATE, ROBUST_OUTCOME
    reasons, missing = staticmethod(robust_reasons), staticmethod(robust_missing)

    def _start(self) -> None:
        start_robust_entry(self.state, self.numbers)

    def _changed(self) -> None:
        radar = self.state["radar"]
        radar["clearance"]["floor"] = self.settings.clearance_floor
        radar["velocity"]["floor"] = self.settings.relative_velocity_floor

    def _step(self, horizon: Horizon, bank: BankState | None) -> None:
        relative = np.nan if bank is None else float(bank.relative_acceleration[0])
        robust_step_entry(self.state, self.numbers, horizon.record, relative, self.outcome)

    def _silence(self, stamp: int) -> None:
        robust_silence_entry(self.state, self.numbers, stamp, self.outcome)

    def anew_because(self, restart_reason: str, solver_status: str) -> str:
        """Why nothing from before a step counts."""
        return restart_reason or "horizons were lost on the way"


class PaperDiagnosis(Diagnosis):
    """Fault indices, confidence, decision and reconstruction (eqs 25, 26, Table 1)."""

    state_kind, outcome_kind = PAPER_STATE, PAPER_OUTCOME
    reasons, missing = staticmethod(paper_reasons), staticmethod(paper_missing)

    def __init__(self, settings: DiagnosisSettings) -> None:
        self.arrays = paper_arrays(settings)
        self._bank = make_state(BANK)
        self._no_answer = BankAnswer(np.empty((4, 0)), np.empty(0, dtype=bool))
        super().__init__(settings)

    def _start(self) -> None:
        start_paper_entry(self.state)

    def _changed(self) -> None:
        solutions = self.arrays.solutions
        self.arrays = paper_arrays(self.settings)._replace(solutions=solutions)

    def _step(self, horizon: Horizon, bank: BankState | None) -> None:
        if horizon.valid:
            check_shape(horizon.states, len(self.arrays.solutions))
        answer = self._no_answer
        if bank is not None:
            self._bank["ready"] = bank.ready
            self._bank["acceleration_index"] = bank.acceleration_index
            values = np.empty((4, len(bank.outside)))
            values[0] = bank.relative_acceleration
            values[2], values[3] = bank.acceleration_lower, bank.acceleration_upper
            answer = BankAnswer(values, bank.outside)
        paper_step_entry(
            self.state,
            self.arrays,
            self.numbers,
            horizon.record,
            horizon.states,
            bank is not None,
            self._bank,
            answer,
            self.outcome,
        )

    def _silence(self, stamp: int) -> None:
        paper_silence_entry(self.state, self.numbers, stamp, self.outcome)

    def anew_because(self, restart_reason: str, solver_status: str) -> str:
        """Why nothing from before a step counts."""
        return restart_reason or solver_status


def make_diagnosis(settings: DiagnosisSettings) -> Diagnosis:
    """The diagnosis of the profile that the settings name."""
    return PaperDiagnosis(settings) if settings.profile == "paper" else RobustDiagnosis(settings)
