"""Detectors side by side on the same faults: normal drives to set them, windows to compare them."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.roughness import SECOND_DIFFERENCES
from lfd_diagnosis.verdict import State
from lfd_mpc.arrays import Array
from lfd_mpc.samples import Sample
from lfd_replay.evaluation.cases import load_drive
from lfd_replay.evaluation.cusum import Cusum, residuals
from lfd_replay.evaluation.detectors import (
    PUBLISHED,
    ROBUST,
    ROBUST_SET,
    Choice,
    CountedIndex,
    Detector,
    choose,
    count_false_events,
)
from lfd_replay.evaluation.fault_windows import LENGTH, WARM_UP, Cell
from lfd_replay.evaluation.kalman import KalmanGate, LeadModel
from lfd_replay.evaluation.normal_driving import following
from lfd_replay.evaluation.recorded_tracks import track_drive
from lfd_replay.evaluation.statistics import median, rate
from lfd_replay.evaluation.trace import JUDGED, Trace, load_trace
from lfd_replay.evaluation.variants import trace_variants, variants
from lfd_replay.faults import Fault, FaultInjector, truth_windows
from lfd_replay.profiles import GraphSettings, graph_settings
from lfd_replay.score import find_windows, hours_of, inside, intervals

AS_PUBLISHED = "paper, as published"

MEDIAN_OF_NORMAL = 0.6745
"""Median deviation from the mean of a normal distribution, in standard deviations."""

SMOOTH_RADAR: dict[str, float] = {
    "clearance_floor": 0.2,
    "relative_velocity_floor": 0.1,
    "largest_shift": 0.0,
    "jerk_density": 0.3,
}
"""What the robust profile is set to where radars never step from one part of a car to another and
leads drive calmly, as generated ones do: no false event on the normal drives of even seeds."""


@dataclass(frozen=True)
class NormalScales:
    """What detectors know of normal driving.

    `scan_noise` (2,): deviations of the radar's clearance (m) and relative velocity (m/s);
    `residual_centre` and `residual_deviation` (3,) of the prediction residuals in m, m/s, m/s^2.
    """

    scan_noise: tuple[float, ...]
    residual_centre: tuple[float, ...]
    residual_deviation: tuple[float, ...]


def record_normal(name: str, settings: GraphSettings, files: dict[str, Path]) -> float:
    """Put a normal drive through all variants, keep the traces in files; returns its hours."""
    drive = load_drive(name, None)
    traces = trace_variants(variants(settings), drive.samples, drive.zero)
    for variant, trace in traces.items():
        trace.save(files[variant])
    return hours_of(len(traces[PUBLISHED].stamps))


def normal_scales(traces: list[Trace], names: list[str], settings: GraphSettings) -> NormalScales:
    """Learn the scales from the traces of normal drives and from these drives' own scans."""
    mean = settings.bank.lead_acceleration_mean
    off = np.concatenate([residuals(trace, mean) for trace in traces])
    second: list[list[Array]] = [[], []]
    for name in names:
        for part in following(load_drive(name, None)):
            for column, values in zip(
                second, (part.clearance, part.relative_velocity), strict=True
            ):
                column.append(np.diff(values, 2))
    return NormalScales(
        # The median ignores outliers.
        tuple(
            float(
                np.median(np.abs(np.concatenate(column)))
                / MEDIAN_OF_NORMAL
                / np.sqrt(SECOND_DIFFERENCES)
            )
            for column in second
        ),
        tuple(np.nanmean(off, axis=0).tolist()),
        tuple(np.nanstd(off, axis=0).tolist()),
    )


def detectors(
    settings: GraphSettings, scales: NormalScales, with_variants: bool = True
) -> list[Detector]:
    """All that are compared."""
    motion = settings.bank
    return [
        *(
            CountedIndex(name, name, changed.diagnosis)
            for name, changed in variants(settings).items()
            if with_variants or name == PUBLISHED
        ),
        KalmanGate(
            (scales.scan_noise[0], scales.scan_noise[1]),
            LeadModel(motion.lead_acceleration_mean, motion.lead_acceleration_std),
        ),
        Cusum(
            motion.lead_acceleration_mean,
            np.array(scales.residual_centre),
            np.array(scales.residual_deviation),
        ),
    ]


def count_normal(
    number: int, file: Path, settings: GraphSettings, scales: NormalScales, allowed: int
) -> dict:
    """False events on one normal drive, by signal and setting, of the detector of that number."""
    return count_false_events(detectors(settings, scales)[number], load_trace(file), allowed)


def choose_settings(
    found: list[Detector], counts: list[list[dict[str, list[int]]]], allowed: int
) -> dict[str, dict[str, Choice]]:
    """Each detector's setting by signal; `counts` holds, per detector, one entry per drive."""
    return {
        detector.name: {
            signal: choose(
                detector,
                np.sum([drive[signal] for drive in drives], axis=0).tolist(),
                allowed,
            )
            for signal in JUDGED
        }
        for detector, drives in zip(found, counts, strict=True)
    }


WINDOWS_SEED = 1
"""Of the drives and windows: detectors are set on the normal drives of seed 0."""


@dataclass(frozen=True)
class Comparison:
    """All that are compared, on the graph's settings and with what they know of normal driving.

    `chosen`: by detector, under which name it is set to what for each signal.
    """

    settings: GraphSettings
    scales: NormalScales
    chosen: dict[str, dict[str, dict[str, float]]]

    def flags(
        self, samples: Sequence[Sample], zero: int, cell: Cell | None, with_variants: bool
    ) -> dict[str, tuple[Trace, dict[str, NDArray[np.bool_]]]]:
        """By detector and setting: its trace, and when it flags each signal (n,).

        `samples` hold the faults of `cell`, if there is one; `zero` is their time zero in ns.
        """
        compared = detectors(self.settings, self.scales, with_variants)
        needed = {detector.variant for detector in compared}
        chosen_variants = {k: v for k, v in variants(self.settings).items() if k in needed}
        robust = chosen_variants[ROBUST] = graph_settings("robust")
        # The noise of the radar is told to the Kalman filter, too.
        noise = dict(
            zip(("clearance_std", "relative_velocity_std"), self.scales.scan_noise, strict=True)
        )
        chosen_variants[ROBUST_SET] = GraphSettings(
            robust.mpc, robust.bank, robust.diagnosis.model_copy(update={**SMOOTH_RADAR, **noise})
        )
        traces = trace_variants(chosen_variants, samples, zero)
        seen = {}
        for detector in compared:
            trace = traces[detector.variant]
            scores = detector.scores(trace)
            for label, by_signal in self.chosen[detector.name].items():
                flags = {s: detector.flags(s, scores[s], by_signal[s]) for s in JUDGED}
                seen[label] = trace, flags
        # A sensor that says nothing is reported as such; everything else is reported as a fault.
        said = [State.FAULT, *([State.NO_DATA] if cell and cell.kind == "dropout" else [])]
        labels = {PUBLISHED: AS_PUBLISHED, ROBUST: ROBUST, ROBUST_SET: ROBUST_SET}
        for variant, label in labels.items():
            trace = traces[variant]
            seen[label] = trace, {s: np.isin(trace.state(s), said) for s in JUDGED}
        return seen


def compare_on(cell: Cell | None, name: str, compared: Comparison, with_variants: bool) -> dict:
    """Faults of one cell on one normal drive: what every detector makes of each window.

    Without a cell nothing is injected, and windows are looked at all the same.
    """
    drive = load_drive(name, None, WINDOWS_SEED)
    faults = [] if cell is None else cell.faults(name, WINDOWS_SEED, drive.duration)
    if cell is None:
        starts = np.arange(WARM_UP, drive.duration - LENGTH, LENGTH).tolist()
    else:
        starts = [fault.start * 1e-9 for fault in faults]
    samples = FaultInjector(faults, drive.zero, WINDOWS_SEED).apply(drive.samples)
    seen = compared.flags(samples, drive.zero, cell, with_variants)
    return {
        label: _judge(trace, flags, cell, faults, starts) for label, (trace, flags) in seen.items()
    }


def false_on_track(number: int, recorded: Path, compared: Comparison) -> dict[str, dict[str, int]]:
    """False events of every detector by signal on one track of the recorded radar."""
    drive = track_drive(recorded, number)
    seen = compared.flags(drive.samples, drive.zero, None, False)
    return {
        label: {s: len(intervals(trace.stamps, flags[s])) for s in JUDGED}
        for label, (trace, flags) in seen.items()
    }


def _judge(
    trace: Trace,
    flags: dict[str, NDArray[np.bool_]],
    cell: Cell | None,
    faults: list[Fault],
    starts: list[float],
) -> dict:
    """Delays of each signal by window, what was reported in each window, and false events."""
    delays, false = {}, {}
    for signal, fault in flags.items():
        found, wrong = find_windows(trace.stamps, fault, truth_windows(faults, signal))
        false[signal] = len(wrong)
        if cell is not None and signal in cell.injected:
            delays[signal] = [window.delay for window in found]
    reported = [
        [s for s in JUDGED if flags[s][inside(trace.stamps, (start, start + LENGTH))].any()]
        for start in starts
    ]
    return {"delays": delays, "reported": reported, "false": false}


CATEGORIES = {
    (): "no fault",
    ("clearance",): "clearance",
    ("relative_velocity",): "relative velocity",
    ("clearance", "relative_velocity"): "radar",
    ("acceleration",): "acceleration",
}


def category(signals: list[str] | tuple[str, ...]) -> str:
    """The row or column of the confusion matrix of a set of faulty signals."""
    return CATEGORIES.get(tuple(s for s in JUDGED if s in signals), "radar and acceleration")


def confusion(results: list[tuple[tuple[str, ...], dict]]) -> dict[str, dict[str, dict[str, int]]]:
    """By detector: fault injected against fault reported, in windows.

    `results`: the signals injected, and what `compare_on` gave.
    """
    counted: dict[str, Counter] = {}
    for injected, result in results:
        for name, judged in result.items():
            counter = counted.setdefault(name, Counter())
            for reported in judged["reported"]:
                counter[category(injected), category(reported)] += 1
    names = [*CATEGORIES.values(), "radar and acceleration"]
    return {
        name: {row: {column: counter[row, column] for column in names} for row in names}
        for name, counter in counted.items()
    }


def detector_rows(cell: Cell, results: list[dict]) -> list[dict]:
    """The summary's rows of one cell: rate and delay of every detector, with intervals."""
    rows = []
    for name in results[0]:
        for signal in cell.injected:
            delays = [d for result in results for d in result[name]["delays"][signal]]
            found = [d for d in delays if d is not None]
            share, low, high = rate(len(found), len(delays))
            middle, least, most = median(found) if found else (None, None, None)
            rows.append(
                {
                    "name": name,
                    "signal": signal,
                    "kind": cell.kind,
                    "size": dict(cell.values)[signal],
                    "injected": list(cell.injected),
                    "windows": len(delays),
                    "detected": share,
                    "detected_low": low,
                    "detected_high": high,
                    "delay_s": middle,
                    "delay_low_s": least,
                    "delay_high_s": most,
                    "false_events": sum(sum(result[name]["false"].values()) for result in results),
                }
            )
    return rows
