"""Verdicts against the truth: when which sensor was flagged, and whether rightly."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.verdict import SIGNALS, Report, State
from lfd_mpc.samples import HOST_SPEED
from lfd_mpc.settings import STEP_NS, STEP_S
from lfd_replay.faults import Fault, truth_windows

Interval = tuple[float, float]

TRUE_SIGNALS = (*SIGNALS, HOST_SPEED)
"""What faults can be injected into, and is judged."""

GRACE = 1.0
"""Seconds after the end of a window in which a flag still belongs to it."""


def hours_of(steps: int) -> float:
    """Hours that so many steps are."""
    return steps * STEP_S / 3600.0


@dataclass(frozen=True)
class Timeline:
    """States over the n steps of a drive: `stamps` (n,) in ns of drive time, `states` (n,) each."""

    stamps: NDArray[np.int64]
    states: dict[str, NDArray[np.int8]]


def timeline(reports: Iterable[Report], zero: int) -> Timeline:
    """Collect the states of reports; those of no step (nothing arrives) are left out."""
    stamps: list[int] = []
    states: dict[str, list[State]] = {name: [] for name in TRUE_SIGNALS}
    for report in reports:
        if report.step:
            stamps.append(report.stamp - zero)
            for name in TRUE_SIGNALS:
                states[name].append(getattr(report, name).state)
    return Timeline(
        np.array(stamps, dtype=np.int64),
        {name: np.array(column, dtype=np.int8) for name, column in states.items()},
    )


def row_timeline(rows: Iterable[NDArray[np.void]], zero: int) -> Timeline:
    """The same from arrays of rows of an offline graph."""
    stamps = [np.empty(0, dtype=np.int64)]
    states: dict[str, list[NDArray[np.int8]]] = {
        name: [np.empty(0, np.int8)] for name in TRUE_SIGNALS
    }
    for part in rows:
        stamps.append(part["outcome"]["stamp"] - zero)
        for name in TRUE_SIGNALS:
            states[name].append(part["outcome"][name]["state"].copy())
    return Timeline(
        np.concatenate(stamps), {name: np.concatenate(own) for name, own in states.items()}
    )


def intervals(stamps: NDArray[np.int64], marked: NDArray[np.bool_]) -> list[Interval]:
    """Stretches of marked steps as (first step, first step no longer marked), in s.

    `stamps` (n,) in ns, `marked` (n,).
    """
    if not len(stamps):
        return []
    step = np.diff(stamps)
    joined = marked[1:] & marked[:-1] & (step > 0) & (step <= STEP_NS)
    first = marked & ~np.append(False, joined)
    last = marked & ~np.append(joined, False)
    starts, ends = stamps[first].tolist(), (stamps[last] + STEP_NS).tolist()
    return [(start * 1e-9, end * 1e-9) for start, end in zip(starts, ends, strict=True)]


def inside(stamps: NDArray[np.int64], window: Interval) -> NDArray[np.bool_]:
    """Which of the `stamps` (n,) in ns lie in a window in s, its end excluded."""
    seconds = stamps * 1e-9
    return (window[0] <= seconds) & (seconds < window[1])


@dataclass(frozen=True)
class Found:
    """What a detector made of one window of truth: `delay` in s, `fraction` of its steps.

    `delay` is None where nothing was found, `fraction` where the window holds no step.
    """

    start: float
    delay: float | None
    fraction: float | None
    already_flagged: bool


def find_windows(
    stamps: NDArray[np.int64], fault: NDArray[np.bool_], truth: list[Interval]
) -> tuple[list[Found], list[Interval]]:
    """Hold a sensor's flags (n,) at `stamps` (n,) in ns against the truth in s.

    Returns what was made of each window, and the false flags: those that overlap none.
    """
    flagged = intervals(stamps, fault)
    found = []
    for start, end in truth:
        own = fault[inside(stamps, (start, end))]
        first = next((begin for begin, _ in flagged if start <= begin < end), None)
        found.append(
            Found(
                start,
                None if first is None else first - start,
                float(own.mean()) if len(own) else None,
                any(begin < start < finish for begin, finish in flagged),
            )
        )
    false = [
        (begin, finish)
        for begin, finish in flagged
        if not any(begin < end + GRACE and start < finish for start, end in truth)
    ]
    return found, false


def score_sensor(line: Timeline, name: str, truth: list[Interval]) -> dict:
    """The contract's figures for one sensor."""
    states = line.states[name]
    fault = states == State.FAULT
    found, false = find_windows(line.stamps, fault, truth)
    in_truth = np.zeros(len(states), dtype=bool)
    for window in truth:
        in_truth |= inside(line.stamps, window)
    delays = [_round(window.delay) for window in found if window.delay is not None]
    return {
        "truth": [[_round(start), _round(end)] for start, end in truth],
        "flagged": [
            [_round(begin), _round(finish)] for begin, finish in intervals(line.stamps, fault)
        ],
        "detected": len(delays) == len(found) if found else None,
        "delay_s": median(delays) if delays else None,
        "flagged_fraction": _round(fault[in_truth].mean()) if in_truth.any() else None,
        "false_events": len(false),
        "false_s": _round(sum(finish - begin for begin, finish in false)),
        "ready_fraction": _round((states != State.NOT_READY).mean()) if len(states) else 0.0,
        "windows": [
            {
                "start": _round(window.start),
                "found": window.delay is not None,
                "delay_s": None if window.delay is None else _round(window.delay),
                "fraction": None if window.fraction is None else _round(window.fraction),
                "already_flagged": window.already_flagged,
            }
            for window in found
        ],
    }


def score(line: Timeline, faults: list[Fault]) -> dict[str, dict]:
    """The contract's figures for every sensor."""
    return {name: score_sensor(line, name, truth_windows(faults, name)) for name in SIGNALS}


def shown(line: Timeline, faults: list[Fault]) -> dict[str, dict]:
    """The same for people, with what is right but no FAULT and what is judged but no sensor.

    `no_data_s`: when a window's sensor was called silent, in s after its start; and the host's
    speed, where a fault of it was injected.
    """
    figures = score(line, faults)
    of_speed = truth_windows(faults, HOST_SPEED)
    if of_speed:
        figures[HOST_SPEED] = score_sensor(line, HOST_SPEED, of_speed)
    for name, own in figures.items():
        silent = line.states[name] == State.NO_DATA
        windows, _ = find_windows(line.stamps, silent, truth_windows(faults, name))
        own["no_data_s"] = [window.delay for window in windows if window.delay is not None]
    return figures


SUMMARY_COLUMNS = ("sensor", "injected", "found", "delay", "flagged", "false events", "ready")


def summary_rows(sensors: dict[str, dict]) -> list[tuple[str, ...]]:
    """The figures of `shown` or `score`, one row of `SUMMARY_COLUMNS` per sensor."""
    rows = []
    for name, figures in sensors.items():
        windows = figures["windows"]
        delay, flagged = figures["delay_s"], figures["flagged_fraction"]
        rows.append(
            (
                name,
                ", ".join(f"{start:g}-{end:g} s" for start, end in figures["truth"]) or "-",
                _found(windows, figures.get("no_data_s", ())),
                "-" if delay is None else f"{delay * 1000:.0f} ms",
                "-" if flagged is None else f"{flagged:.1%}",
                f"{figures['false_events']} ({figures['false_s']:.2f} s)",
                f"{figures['ready_fraction']:.1%}",
            )
        )
    return rows


def _found(windows: list[dict], no_data: Sequence[float]) -> str:
    if not windows:
        return "-"
    text = f"{sum(window['found'] for window in windows)} of {len(windows)}"
    return text + (f", NO_DATA in {len(no_data)} after {median(no_data):.2f} s" if no_data else "")


def _round(value: float) -> float:
    return round(float(value), 6)
