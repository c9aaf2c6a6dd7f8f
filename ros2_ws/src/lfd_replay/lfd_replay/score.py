"""Verdicts against the truth: when which sensor was flagged, and whether rightly."""

from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median

from lfd_diagnosis.verdict import SIGNALS, Report, State
from lfd_mpc.settings import STEP_NS
from lfd_replay.faults import Fault, truth_windows

Interval = tuple[float, float]

GRACE = 1.0
"""Seconds after the end of a window in which a flag still belongs to it."""


@dataclass(frozen=True)
class Timeline:
    """States of all signals over the steps of a drive; `stamps` in ns of drive time."""

    stamps: list[int]
    states: dict[str, list[State]]


def timeline(reports: Iterable[Report], zero: int) -> Timeline:
    """Collect the states of reports; those of no step (nothing arrives) are left out."""
    stamps: list[int] = []
    states: dict[str, list[State]] = {name: [] for name in SIGNALS}
    for report in reports:
        if report.step:
            stamps.append(report.stamp - zero)
            for name in SIGNALS:
                states[name].append(getattr(report, name).state)
    return Timeline(stamps, states)


def intervals(stamps: list[int], marked: Iterable[bool]) -> list[Interval]:
    """Stretches of marked steps as (first step, first step no longer marked), in s."""
    found: list[list[int]] = []
    last: int | None = None
    for stamp, mark in zip(stamps, marked, strict=True):
        continues = last is not None and 0 < stamp - last <= STEP_NS
        if mark and found and continues and found[-1][1] == stamp:
            found[-1][1] = stamp + STEP_NS
        elif mark:
            found.append([stamp, stamp + STEP_NS])
        last = stamp
    return [(start * 1e-9, end * 1e-9) for start, end in found]


def score_sensor(line: Timeline, name: str, truth: list[Interval]) -> dict:
    """The contract's figures for one sensor."""
    states = line.states[name]
    flagged = intervals(line.stamps, (state == State.FAULT for state in states))
    windows = []
    for start, end in truth:
        inside = [
            state == State.FAULT
            for stamp, state in zip(line.stamps, states, strict=True)
            if start <= stamp * 1e-9 < end
        ]
        first = next((begin for begin, _ in flagged if start <= begin < end), None)
        windows.append(
            {
                "start": _round(start),
                "found": first is not None,
                "delay_s": None if first is None else _round(first - start),
                "fraction": _round(sum(inside) / len(inside)) if inside else None,
                "already_flagged": any(begin < start < finish for begin, finish in flagged),
            }
        )
    false = [
        (begin, finish)
        for begin, finish in flagged
        if not any(begin < end + GRACE and start < finish for start, end in truth)
    ]
    in_truth = [
        state == State.FAULT
        for stamp, state in zip(line.stamps, states, strict=True)
        if any(start <= stamp * 1e-9 < end for start, end in truth)
    ]
    delays = [w["delay_s"] for w in windows if w["found"]]
    return {
        "truth": [[_round(start), _round(end)] for start, end in truth],
        "flagged": [[_round(begin), _round(finish)] for begin, finish in flagged],
        "detected": all(w["found"] for w in windows) if windows else None,
        "delay_s": median(delays) if delays else None,
        "flagged_fraction": _round(sum(in_truth) / len(in_truth)) if in_truth else None,
        "false_events": len(false),
        "false_s": _round(sum(finish - begin for begin, finish in false)),
        "ready_fraction": _round(sum(state != State.NOT_READY for state in states) / len(states))
        if states
        else 0.0,
        "windows": windows,
    }


def score(line: Timeline, faults: list[Fault]) -> dict[str, dict]:
    """The contract's figures for every sensor."""
    return {name: score_sensor(line, name, truth_windows(faults, name)) for name in SIGNALS}


SUMMARY_COLUMNS = ("sensor", "injected", "found", "delay", "flagged", "false events", "ready")


def summary_rows(sensors: dict[str, dict]) -> list[tuple[str, ...]]:
    """The figures of `score` as people read them, one row of `SUMMARY_COLUMNS` per sensor."""
    rows = []
    for name, figures in sensors.items():
        windows = figures["windows"]
        delay, flagged = figures["delay_s"], figures["flagged_fraction"]
        rows.append(
            (
                name,
                ", ".join(f"{start:g}-{end:g} s" for start, end in figures["truth"]) or "-",
                f"{sum(w['found'] for w in windows)} of {len(windows)}" if windows else "-",
                "-" if delay is None else f"{delay * 1000:.0f} ms",
                "-" if flagged is None else f"{flagged:.1%}",
                f"{figures['false_events']} ({figures['false_s']:.2f} s)",
                f"{figures['ready_fraction']:.1%}",
            )
        )
    return rows


def _round(value: float) -> float:
    return round(value, 6)
