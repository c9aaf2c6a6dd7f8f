"""What a recording holds, and whether the graph can run on it."""

from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from lfd_mpc.arrays import Array
from lfd_mpc.arrival import AHEAD_NS
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    INPUTS,
    RADAR,
    RadarSample,
    Sample,
    ScalarSample,
)
from lfd_replay.drive import nothing_of, stamps_of

GAP_PERIODS = 5
"""A gap is longer than so many of an input's own periods."""

LONGEST_PERIOD = {RADAR: 0.15, ACCELERATION: 0.05}
"""Seconds between samples with which an input can be judged at all."""

CLOCK_OFF = 1.1
"""How many times longer they may be: no sensor's clock is exact."""


def inspect_streams(streams: dict[str, list[Sample]]) -> dict:
    """Figures of every input; times in s, None where there is nothing to tell."""
    stamps = [sample.stamp for stream in streams.values() for sample in stream]
    missing = missing_of(streams)
    return {
        "duration_s": (max(stamps) - min(stamps)) * 1e-9 if stamps else 0.0,
        "inputs": {name: _inspect(streams.get(name, ())) for name in INPUTS},
        "runs": not missing,
        "missing": missing,
    }


def missing_of(streams: dict[str, list[Sample]]) -> list[str]:
    """What the graph lacks to run on these streams, in words; empty where it can."""
    return [*_missing(streams), *_apart(streams)]


def cannot_run(missing: Sequence[str]) -> str:
    """That the graph cannot run on a recording, and what is missing; empty where nothing is."""
    return f"the graph cannot run on it: {'; '.join(missing)}" if missing else ""


def _period(steps: Array) -> float | None:
    """Median of the times in ns from one sample to a later one; None where there are none."""
    forward = steps[steps > 0]
    return float(np.median(forward)) if len(forward) else None


def _inspect(stream: Sequence[Sample]) -> dict:
    stamps = stamps_of(stream)
    steps = np.diff(stamps)
    forward = steps[steps > 0]
    period = _period(steps)
    gaps = forward[forward > GAP_PERIODS * period] if period else forward[:0]
    figures = {
        "samples": len(stamps),
        "period_s": None if period is None else period * 1e-9,
        "rate_hz": None if period is None else 1e9 / period,
        "gaps": len(gaps),
        "longest_gap_s": float(forward.max()) * 1e-9 if len(forward) else None,
        "clock_steps": int((np.abs(steps) > AHEAD_NS).sum()),
        "repeated_stamps": int((steps == 0).sum()),
        "backward_stamps": int((steps < 0).sum()),
        "ranges": {},
    }
    scans = [s for s in stream if isinstance(s, RadarSample)]
    scalars = [s for s in stream if isinstance(s, ScalarSample)]
    if scans:
        figures["share_with_lead"] = sum(s.has_target for s in scans) / len(scans)
        figures["leads"] = len({s.track_id for s in scans if s.has_target})
        with_lead = [s for s in scans if s.has_target]
        figures["ranges"]["clearance"] = _range([s.clearance for s in with_lead])
        figures["ranges"]["relative_velocity"] = _range([s.relative_velocity for s in with_lead])
    elif scalars:
        figures["ranges"][scalars[0].input] = _range([s.value for s in scalars])
    return figures


def _range(values: Sequence[float]) -> dict:
    """Least and greatest of the finite values, and how many are not finite."""
    array: Array = np.array(values, dtype=float)
    finite = array[np.isfinite(array)]
    return {
        "least": float(finite.min()) if len(finite) else None,
        "greatest": float(finite.max()) if len(finite) else None,
        "not_finite": int(len(array) - len(finite)),
    }


def _missing(streams: dict[str, list[Sample]]) -> list[str]:
    """What inputs lack each by itself."""
    missing = []
    for name, slowest in LONGEST_PERIOD.items():
        period = _period(np.diff(stamps_of(streams.get(name, ()))))
        lack = nothing_of(name, streams)
        if lack:
            missing.append(lack)
        elif period is None:
            missing.append(f"{name}: one sample tells nothing")
        elif period * 1e-9 > CLOCK_OFF * slowest:
            missing.append(
                f"{name} comes every {period * 1e-9:.3f} s; "
                f"more often than every {slowest:g} s is needed"
            )
    scans = [s for s in streams.get(RADAR, ()) if isinstance(s, RadarSample)]
    if scans and not any(scan.has_target for scan in scans):
        missing.append("the radar never sees a lead")
    return missing


def _apart(streams: dict[str, list[Sample]]) -> list[str]:
    """What the graph lacks where one input ends before another one begins, in words."""
    spans = {
        name: (min(sample.stamp for sample in stream), max(sample.stamp for sample in stream))
        for name in LONGEST_PERIOD
        if (stream := streams.get(name))
    }
    if len(spans) < len(LONGEST_PERIOD):
        return []
    (first, (_, end)), (last, (begin, _)) = sorted(spans.items(), key=itemgetter(1))
    if begin <= end:
        return []
    apart = (begin - end) * 1e-9
    return [f"{first} ends {apart:.3f} s before {last} begins: they are never there at once"]


def remarks(figures: dict) -> list[str]:
    """What is worth knowing although the graph runs."""
    found = []
    if not figures["inputs"][HOST_SPEED]["samples"]:
        found.append("no host speed: only the relative velocity is regulated")
    for name, values in figures["inputs"].items():
        for key, text in (
            ("clock_steps", "gaps or steps of its clock of over 1 s"),
            ("backward_stamps", "backward stamps"),
            ("repeated_stamps", "repeated stamps"),
        ):
            if values[key]:
                found.append(f"{name}: {values[key]} {text}")
    return found
