"""Panels of a drive through the graph: measured, limits, indices, verdicts."""

from collections.abc import Sequence
from math import nan

import numpy as np

from lfd_diagnosis.fault_index import PredictionLimits
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import COVERS, SIGNALS, State
from lfd_mpc.arrays import Array
from lfd_mpc.settings import STEP_S
from lfd_observer.prediction_store import PredictionStore
from lfd_replay.drawing.figures import (
    COLOURS,
    DARK,
    FAULTY,
    GREY,
    INJECTED,
    SERIES,
    SHADES,
    SILENT,
    SUSPECTED,
    UNJUDGED,
    Band,
    HeatMap,
    Limit,
    Line,
    Panel,
    Spans,
)
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import Fault, truth_windows
from lfd_replay.recorded_step import RecordedStep
from lfd_replay.score import intervals

TIME = "drive time (s)"
UNITS = {"clearance": "m", "relative_velocity": "m/s", "acceleration": "m/s²"}

SAID = {
    "FAULT": ((State.FAULT,), FAULTY),
    "SUSPECT": ((State.SUSPECT,), SUSPECTED),
    "NO_DATA": ((State.NO_DATA,), SILENT),
    "not judged": ((State.NOT_READY, State.NO_TARGET), UNJUDGED),
}
"""What a lane of verdicts shows, and its colour; OK is no mark."""


class Recording:
    """Steps of one drive, `zero` its time zero in ns; there is a panel where there is a step."""

    def __init__(self, steps: Sequence[RecordedStep], zero: int, faults: list[Fault]) -> None:
        self.steps, self.faults = steps, faults
        self.stamps = np.array([step.horizon.stamp - zero for step in steps])
        self.time: Array = self.stamps * 1e-9

    def horizon(self, field: str) -> Array:
        """One field (n,) of the horizons."""
        return np.array([getattr(step.horizon, field) for step in self.steps], dtype=float)

    def bank(self, field: str) -> Array:
        """One field (n, observers) of the bank's answers, NaN where one was lost."""
        there = next((s.bank for s in self.steps if s.bank is not None), None)
        width = 1 if there is None else len(there.lags)
        rows = [
            np.full(width, np.nan) if step.bank is None else getattr(step.bank, field)
            for step in self.steps
        ]
        return np.array(rows, dtype=float)

    @property
    def lags(self) -> list[int]:
        """Lags of the bank's observers in steps."""
        return next(([int(x) for x in s.bank.lags] for s in self.steps if s.bank is not None), [])

    def reconstructed(self, field: str) -> Array:
        """One field (n,) of the reconstructions, NaN where it is not valid or was lost."""
        steps = (step.reconstruction for step in self.steps)
        return np.array([nan if s is None else getattr(s, field) for s in steps], dtype=float)

    def verdict(self, signal: str, field: str) -> Array:
        """One field (n,) of the verdicts on a signal."""
        return np.array([getattr(getattr(step.report, signal), field) for step in self.steps])

    def predicted(self, name: str) -> Array:
        """For each step (n,) what the oldest solution that reaches it predicted, else NaN."""
        predicted = np.full(len(self.steps), np.nan)
        since_restart = 0
        for k, step in enumerate(self.steps):
            since_restart = 0 if step.horizon.restart else since_restart + 1
            lead = len(getattr(step.horizon, f"predicted_{name}"))
            if lead and since_restart >= lead:
                states = getattr(self.steps[k - lead].horizon, f"predicted_{name}")
                predicted[k] = states[-1] if len(states) == lead else np.nan
        return predicted

    def truth(self, signal: str) -> list[tuple[float, float]]:
        """Injected windows of a signal in s."""
        return truth_windows(self.faults, signal)


def label(signal: str) -> str:
    """A signal's name for people."""
    return signal.replace("_", " ")


def measured_panel(recording: Recording, signal: str, unit: str) -> Panel:
    """A radar signal as measured and as predicted one horizon before."""
    return Panel(
        label(signal),
        TIME,
        unit,
        [
            Line("predicted one horizon before", recording.time, recording.predicted(signal), GREY),
            Line(
                f"{label(signal)}, measured",
                recording.time,
                recording.horizon(signal),
                COLOURS[signal],
            ),
        ],
        shaded=recording.truth(signal),
    )


def sensor_panel(recording: Recording, signal: str) -> Panel:
    """A signal as measured, where it is called faulty, and as it is reconstructed."""
    time, unit = recording.time, UNITS[signal]
    stale = recording.horizon(f"{signal}_stale") > 0
    measured = np.where(stale, np.nan, recording.horizon(f"measured_{signal}"))
    faulty = recording.verdict(signal, "state") == State.FAULT
    value = recording.reconstructed(signal)
    off = COVERS * recording.reconstructed(f"{signal}_std")
    return Panel(
        label(signal),
        TIME,
        unit,
        [
            Band("its 95 % band", time, value - off, value + off, GREY),
            Line("reconstructed", time, value, DARK),
            Line(f"{label(signal)}, measured", time, measured, COLOURS[signal]),
            Line("called faulty", time, np.where(faulty, measured, np.nan), FAULTY),
        ],
        shaded=recording.truth(signal),
    )


def acceleration_panel(recording: Recording, observers: int | None = None) -> Panel:
    """The acceleration and the limits of all observers, or of the first so many (Figs 9, 25)."""
    lags = recording.lags[:observers]
    marks: list = []
    for side in ("upper", "lower"):
        limits = recording.bank(f"acceleration_{side}")
        for observer, lag in enumerate(lags):
            marks.append(
                Line(
                    f"limits, lag {lag}",
                    recording.time,
                    limits[:, observer],
                    SHADES[min(observer, len(SHADES) - 1)],
                    width=0.8,
                    legend=side == "upper",
                )
            )
    measured = np.where(
        recording.horizon("acceleration_stale") > 0, np.nan, recording.horizon("acceleration")
    )
    marks.append(Line("acceleration, measured", recording.time, measured, COLOURS["acceleration"]))
    return Panel(
        "host acceleration and its limits",
        TIME,
        "m/s²",
        marks,
        shaded=recording.truth("acceleration"),
        height=1.2,
    )


def index_panel(recording: Recording) -> Panel:
    """Fault indices and their thresholds."""
    marks: list = []
    for signal in JUDGED:
        index = recording.verdict(signal, "index")
        marks.append(Line(f"{label(signal)}, index", recording.time, index, COLOURS[signal]))
        marks.append(Limit(float(recording.verdict(signal, "threshold")[0]), COLOURS[signal]))
    return Panel("fault index", TIME, "index", marks, y_range=(-0.05, 1.05))


def confidence_panel(recording: Recording) -> Panel:
    """Confidence and its threshold: of steps, or of what a sensor says."""
    marks: list = [
        Line(
            f"{label(signal)}, confidence",
            recording.time,
            recording.verdict(signal, "confidence").astype(float),
            COLOURS[signal],
            legend=False,
        )
        for signal in JUDGED
    ]
    limits = {name: float(recording.verdict(name, "confidence_threshold")[0]) for name in JUDGED}
    if len(set(limits.values())) == 1:
        marks.append(Limit(limits[JUDGED[0]], DARK))
    else:
        marks += [Limit(limit, COLOURS[name]) for name, limit in limits.items()]
    return Panel("confidence", TIME, "count", marks, height=0.8)


def verdict_panel(recording: Recording) -> Panel:
    """Lanes: what was injected above, what was said below."""
    marks: list = []
    lanes = list(reversed(SIGNALS))
    for lane, name in enumerate(lanes):
        states = recording.verdict(name, "state")
        marks.append(
            Spans("injected", recording.truth(name), lane, 0.15, INJECTED, legend=lane == 0)
        )
        for text, (those, colour) in SAID.items():
            spans = intervals(recording.stamps, np.isin(states, those))
            marks.append(Spans(text, spans, lane, -0.15, colour, legend=lane == 0))
    return Panel("verdict", TIME, "", marks, lanes=[label(name) for name in lanes], height=0.9)


def output_error_panel(recording: Recording) -> Panel:
    """Output errors of the observers: how far each one is off its sliding surface (eq 18)."""
    errors = recording.bank("output_error")
    marks: list = [
        Line(f"output error, lag {lag}", recording.time, errors[:, k], SERIES[k % len(SERIES)], 0.8)
        for k, lag in enumerate(recording.lags)
    ]
    return Panel("estimation errors of the observers", TIME, "m + m/s", marks)


CONTOUR_STEPS = 5
"""Steps that share a column of a contour; it is coloured if any of them is outside."""


def contour_panels(recording: Recording, settings: DiagnosisSettings) -> list[Panel]:
    """Where a measurement leaves the limits, over lead time and time (Fig 10, panels c)."""
    n = settings.prediction_steps
    limits, store = PredictionLimits(settings), PredictionStore(n)
    outside = np.zeros((len(recording.steps), n, 2), dtype=bool)
    for k, step in enumerate(recording.steps):
        horizon = step.horizon
        measured = np.array([horizon.clearance, horizon.relative_velocity])
        store.follow(horizon.record)
        outside[k] = limits.outside(measured, store.for_now())
        if horizon.valid:
            store.push(horizon.states)
    count = len(outside) // CONTOUR_STEPS
    columns = outside[: count * CONTOUR_STEPS].reshape(count, CONTOUR_STEPS, n, 2).any(axis=1)
    time = recording.time[: count * CONTOUR_STEPS : CONTOUR_STEPS]
    return [
        Panel(
            f"{label(signal)}: predictions that disagree",
            TIME,
            "lead time (s)",
            [
                HeatMap(
                    label(signal),
                    time,
                    STEP_S * np.arange(1, n + 1),
                    columns[:, :, k].T.astype(np.uint8),
                    COLOURS[signal],
                )
            ],
        )
        for k, signal in enumerate(JUDGED[:2])
    ]
