"""One drive with faults through both profiles: what each made of every window."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from lfd_diagnosis.verdict import COVERS, State
from lfd_mpc.arrays import Array
from lfd_mpc.samples import (
    HOST_SPEED,
    LEAD_ACCELERATION,
    UNKNOWN_TRACK,
    Sample,
    ScalarSample,
    playing_order,
)
from lfd_mpc.settings import STEP_S
from lfd_observer.settings import BankSettings
from lfd_replay.drive import Drive
from lfd_replay.evaluation.cases import BLAMED_FOR_S, RECORDED, behind_recorded, load_drive
from lfd_replay.evaluation.mishaps import MISHAPS
from lfd_replay.evaluation.random_sensors import RANDOM_SENSORS, random_sensors_drive
from lfd_replay.evaluation.recorded_noise import FARTHER_OFF, recorded_sensors_drive
from lfd_replay.evaluation.recorded_tracks import (
    BACKWARD,
    LANES,
    TRACK,
    TRACK_ID,
    backward,
    lane_drive,
    track_drive,
    track_id_drive,
)
from lfd_replay.evaluation.recorded_views import VIEWS, seen_by
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import MEASURED, Fault, FaultInjector, parse_faults
from lfd_replay.generated.generate import drive_truth, generate_drive
from lfd_replay.generated.lead_profiles import IN_TRAFFIC
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import PROFILES, GraphSettings, graph_settings
from lfd_replay.read_drive import ReadOptions
from lfd_replay.score import hours_of

NEAREST = "nearest in path"
"""The recorded drive's nearest target in path: its track ids change with every swap."""

FOLLOWS = 1.0
"""Seconds after a fault in which a flag is still its own."""

LOST_FOR = 0.5
"""Seconds without a lead after which it is not one that goes on."""

CLEAR_FOR = 1.0
"""Seconds for which a signal must stay unflagged before its fault counts as over."""

CRAWL = 2.0
"""m/s below which a car stands or crawls: wheels and accelerometers repeat themselves then."""

LEAD_PERIOD, LEAD_DELAY, LEAD_NOISE = 0.1, 0.1, 0.2
"""The V2V messages of generated drives: period and delay in s, noise in m/s^2."""


LIE_FROM, LIE = 20.0, 4.0
"""Seconds from which on a lead that lies does so, and by how many m/s^2."""

STARTING = 1.0
"""Seconds at the beginning in which nothing need be ready."""


@dataclass(frozen=True)
class Run:
    """One drive with faults: which drive, which sensors, which inputs, which profiles.

    `faults`: texts. `changes`: settings of the bank and the diagnosis, by name, that differ from
    those of its `profiles`. `lead`: what the lead says: nothing, the truth, or a lie after a while.
    `mishap`: what happens to the sensors, of `MISHAPS`.
    """

    drive: str
    seed: int
    faults: tuple[str, ...] = ()
    sensor: str = "esr"
    peak: float | None = None
    host_speed: bool = True
    lead: str = "nothing"
    changes: tuple[tuple[str, object], ...] = ()
    mishap: str = ""
    profiles: tuple[str, ...] = tuple(PROFILES)

    @property
    def key(self) -> str:
        """A name of its own."""
        return "/".join(map(str, vars(self).values()))


def load(run: Run, recorded: Path | None) -> Drive:
    """The drive of a run."""
    if run.sensor in VIEWS and recorded is not None:
        if run.drive in IN_TRAFFIC:
            view = VIEWS[run.sensor]
            return recorded_sensors_drive(recorded, run.drive, run.seed, run.peak, view)
        return seen_by(run.sensor, load(replace(run, sensor="esr"), recorded), recorded)
    if run.drive.startswith(BACKWARD):
        return backward(load(replace(run, drive=run.drive.removeprefix(BACKWARD)), recorded))
    if run.drive == NEAREST and recorded is not None:
        ids = ReadOptions(mapping={"track_id": "track_addr"})
        return behind_recorded(recorded, "nearest_in_path", ids)
    if run.drive.startswith(TRACK) and recorded is not None:
        return track_drive(recorded, int(run.drive.removeprefix(TRACK)))
    if run.drive.startswith(TRACK_ID) and recorded is not None:
        return track_id_drive(recorded, int(run.drive.removeprefix(TRACK_ID)))
    if run.drive in LANES and recorded is not None:
        return lane_drive(recorded, run.drive)
    if run.drive == RECORDED:
        return load_drive(RECORDED, recorded)
    if run.sensor in FARTHER_OFF and recorded is not None:
        rougher = FARTHER_OFF[run.sensor]
        return recorded_sensors_drive(recorded, run.drive, run.seed, run.peak, rougher=rougher)
    if run.sensor == RANDOM_SENSORS:
        return random_sensors_drive(run.drive, run.seed, run.peak)
    return generate_drive(run.drive, run.seed, run.sensor, run.peak)


def _with_mishaps(run: Run, samples: Sequence[Sample]) -> Sequence[Sample]:
    """The samples of a drive with what happens to its sensors, the same for the same seed."""
    if not run.mishap:
        return samples
    generator = np.random.default_rng([run.seed, crc32(f"{run.mishap}/{run.drive}".encode())])
    return MISHAPS[run.mishap](samples, generator)


def _lead_says(run: Run) -> list[Sample]:
    """What the lead says of its acceleration."""
    if run.lead == "nothing":
        return []
    truth = drive_truth(run.drive, run.peak)
    times = np.arange(LEAD_PERIOD, truth.time[-1], LEAD_PERIOD)
    generator = np.random.default_rng([run.seed, crc32(run.drive.encode())])
    noise = generator.normal(0.0, LEAD_NOISE, len(times))
    said = np.interp(times - LEAD_DELAY, truth.time, truth.lead_acceleration) + noise
    if run.lead == "a lie":
        said += np.where(times > LIE_FROM, LIE, 0.0)
    # The truth's time zero is that of the stamps.
    return [
        ScalarSample(LEAD_ACCELERATION, round(t * 1e9), float(v))
        for t, v in zip(times.tolist(), said, strict=True)
    ]


def settings_of(run: Run) -> dict[str, GraphSettings]:
    """Settings of the profiles that a run goes through, with its changes, by profile."""
    bank = {k: v for k, v in run.changes if k in BankSettings.model_fields}
    diagnosis = {k: v for k, v in run.changes if k not in bank}
    return {
        name: replace(
            settings,
            bank=settings.bank.model_copy(update=bank),
            diagnosis=settings.diagnosis.model_copy(update=diagnosis),
        )
        for name, settings in ((name, graph_settings(name)) for name in run.profiles)
    }


@dataclass(frozen=True)
class Seen:
    """A run under one profile, over n steps.

    `times` (n,) in s of drive time, `targets` (n,) ids of the radar's. By signal: `flags`, `ready`
    and `silent` (n,); `kinds`, `sizes` and `size_stds` (n,). `rebuilt` and `rebuilt_std` (n, 3) in
    the order of `JUDGED`.
    """

    times: Array
    targets: NDArray[np.int64]
    flags: dict[str, NDArray[np.bool_]]
    ready: dict[str, NDArray[np.bool_]]
    silent: dict[str, NDArray[np.bool_]]
    kinds: dict[str, Array]
    sizes: dict[str, Array]
    size_stds: dict[str, Array]
    rebuilt: Array
    rebuilt_std: Array


def look(run: Run, recorded: Path | None) -> tuple[dict[str, Seen], Array, Array, list[Fault]]:
    """Each profile's view, the signals as faulty and as healthy (n, 4), and the faults."""
    drive = load(run, recorded)
    zero = drive.zero
    samples = _with_mishaps(run, drive.samples)
    samples = [s for s in samples if run.host_speed or s.input != HOST_SPEED]
    samples = sorted([*samples, *_lead_says(run)], key=playing_order)
    faults = parse_faults(run.faults)
    faulty = FaultInjector(faults, zero, run.seed).apply(samples) if faults else samples
    seen = {}
    for name, settings in settings_of(run).items():
        rows = np.concatenate(list(OfflineGraph(settings).rows(faulty)))
        times = (rows["horizon"]["stamp"] - zero) * 1e-9
        seen[name] = _collect(times, rows["horizon"]["track_id"], rows["outcome"])
    # Every profile has the same controller: any of its horizons will do.
    horizon = rows["horizon"]
    used = ("clearance", "relative_velocity", "acceleration", "measured_host_speed")
    measured = np.stack([horizon[field] for field in used], axis=1)
    healthy = _healthy(samples, settings, horizon["stamp"]) if faults else measured
    return seen, measured, healthy, faults


def _healthy(samples: list[Sample], settings: GraphSettings, stamps: NDArray[np.int64]) -> Array:
    """The signals (n, 4) at `stamps` (n,) in ns as they would have been without a fault."""
    rows = np.concatenate(list(OfflineGraph(settings).rows(samples)))
    horizon = rows["horizon"]
    carried = horizon["measured_relative_velocity"] * horizon["clearance_age"]
    values = np.stack(
        [
            horizon["measured_clearance"] + carried,
            horizon["measured_relative_velocity"],
            horizon["measured_acceleration"],
            horizon["measured_host_speed"],
        ],
        axis=1,
    )
    at = np.searchsorted(horizon["stamp"], stamps).clip(max=len(horizon) - 1)
    return np.where((horizon["stamp"][at] == stamps)[:, None], values[at], np.nan)


def _collect(times: Array, targets: NDArray[np.int64], outcomes: NDArray[np.void]) -> Seen:
    states = {name: outcomes[name]["state"] for name in MEASURED}
    now = outcomes["reconstructed"]
    return Seen(
        times,
        targets,
        {name: state == State.FAULT for name, state in states.items()},
        {name: state != State.NOT_READY for name, state in states.items()},
        {name: state == State.NO_DATA for name, state in states.items()},
        *(
            {name: outcomes[name][field].astype(float) for name in MEASURED}
            for field in ("kind", "size", "size_std")
        ),
        np.stack([now[name] for name in JUDGED], axis=1),
        np.stack([now[f"{name}_std"] for name in JUDGED], axis=1),
    )


def begins(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Steps (n,) at which a signal is flagged anew."""
    return flags & ~np.append(False, flags[:-1])


def first(times: Array, marked: NDArray[np.bool_]) -> float | None:
    """Time of the first marked step; None where there is none."""
    where = np.flatnonzero(marked)
    return float(times[where[0]]) if len(where) else None


def run_windows(run: Run, recorded: Path | None) -> dict[str, dict]:
    """By profile: what was made of each window, false events, and how long it was ready."""
    seen, measured, healthy, faults = look(run, recorded)
    error = measured - healthy
    return {
        profile: {
            "windows": [made_of(view, error, healthy, fault) for fault in faults],
            "false": false_events(view, faults),
            "ready": {
                name: float(ready[view.times > STARTING].mean())
                for name, ready in view.ready.items()
            },
            "hours": _hours(view, faults),
        }
        for profile, view in seen.items()
    }


def false_events(view: Seen, faults: list[Fault]) -> dict[str, list[float]]:
    """Beginnings of flags outside of all faults and what follows them, by signal, in s.

    What follows a fault: the second after it, and all until the signal is neither flagged nor
    silent. A flag that silence interrupts, and that goes on as the sensor is back, does not begin
    there.
    """
    times = view.times
    begun = {}
    for name in MEASURED:
        flags = view.flags[name]
        near = np.zeros(len(times), dtype=bool)
        for fault in faults:
            start, end = fault.start * 1e-9, fault.end * 1e-9
            over = first(times, ~(flags | view.silent[name]) & (times >= end))
            until = np.inf if over is None else max(end + FOLLOWS, over)
            near |= (times >= start) & (times < until)
        begun[name] = times[begins(flags) & ~near].round(3).tolist()
    return begun


def _hours(view: Seen, faults: list[Fault]) -> float:
    """Hours in which a flag would be a false event."""
    counts = np.ones(len(view.times), dtype=bool)
    for fault in faults:
        counts &= (view.times < fault.start * 1e-9) | (view.times >= fault.end * 1e-9 + FOLLOWS)
    return hours_of(int(counts.sum()))


def clear_from(times: Array, flags: NDArray[np.bool_], end: float) -> float | None:
    """When a signal stays unflagged after the end of its fault (s), None if it never does."""
    next_flag = np.minimum.accumulate(np.where(flags, times, np.inf)[::-1])[::-1]
    return first(times, (times >= end) & (next_flag - times >= CLEAR_FOR))


def made_of(view: Seen, error: Array, healthy: Array, fault: Fault) -> dict:
    """One fault: delays, blame, kind, size, and how well the signals were rebuilt.

    `error` and `healthy` (n, 4): what the signals were off by, and what they should have been. A
    fault is found where a flag begins inside its window: one that stood before says nothing of it.

    `drives`: whether the car drove faster than at a crawl, by tenths of a second, as `rms` is.
    """
    start, end = fault.start * 1e-9, fault.end * 1e-9
    times = view.times
    inside = (times >= start) & (times < end)
    follows = (times >= end) & (times < end + FOLLOWS)
    drives = ~(healthy[:, MEASURED.index(HOST_SPEED)] < CRAWL)
    signals = {}
    for name, value in fault.values:
        flags = view.flags[name]
        at = first(times, begins(flags) & inside)
        clear = clear_from(times, flags, end)
        gone = view.silent[name]
        back = first(times, ~gone & view.ready[name] & ~flags & (times >= end))
        signals[name] = {
            "delay": None if at is None else at - start,
            "injected": value,
            "late": not (flags & inside).any() and bool((begins(flags) & follows).any()),
            "fraction": float(flags[inside].mean()) if inside.any() else None,
            "clear": None if clear is None else clear - end,
            "silent_after": _after(first(times, gone & inside), start),
            "back_after": _after(back, end),
            **_named(view, name, inside, times, end),
            **_error(error[:, MEASURED.index(name)], times, start, inside, at),
            "drives": [bool(part[-1]) for part in _tenths(drives, inside)],
        }
    watched = (times >= start) & (times < end + BLAMED_FOR_S)
    around = (times >= start - BLAMED_FOR_S) & (times < end + BLAMED_FOR_S)
    return {
        "signals": signals,
        "one_target": _is_one(times[around], view.targets[around], np.isnan(healthy[around, 0])),
        "blamed": [
            name
            for name in MEASURED
            if name not in fault.signals and (view.flags[name] & watched).any()
        ],
        "rebuilt": _rebuilt(view, healthy, fault, inside, times, start),
    }


def _is_one(times: Array, targets: NDArray[np.int64], unseen: NDArray[np.bool_]) -> bool:
    """Whether one target goes on: the same id, as far as there is one, and not `unseen` (n,) for
    long. Of the healthy radar, whatever the diagnosis makes of it."""
    known = targets[targets != UNKNOWN_TRACK]
    seen = np.concatenate((times[:1], times[~unseen], times[-1:]))
    same = len(known) == 0 or np.ptp(known) == 0
    return bool(same and np.diff(seen).max() <= LOST_FOR + 1.5 * STEP_S)


def _after(at: float | None, zero: float) -> float | None:
    return None if at is None else at - zero


def _named(view: Seen, name: str, inside: NDArray[np.bool_], times: Array, end: float) -> dict:
    """What the fault was called, and how large, at the end of its window."""
    last = np.flatnonzero(inside & view.flags[name] & (times < end - 0.02))
    if not len(last):
        return {"kind": None, "size": None, "size_std": None}
    k = last[-1]
    size, std = float(view.sizes[name][k]), float(view.size_stds[name][k])
    return {
        "kind": int(view.kinds[name][k]),
        "size": size if isfinite(size) else None,
        "size_std": std if isfinite(std) else None,
    }


def _error(
    error: Array, times: Array, start: float, inside: NDArray[np.bool_], at: float | None
) -> dict:
    """What the fault did to the signal: at its onset, when it was found, and over time.

    `rms`: of each 0.1 s of the window, as far as the signal was there.
    """
    onset = np.abs(error[inside & (times < start + 0.1)])
    found = None if at is None else np.abs(error[np.searchsorted(times, at)])
    slices = _tenths(np.nan_to_num(error), inside)
    return {
        "onset": _number(np.nanmax(onset)) if np.isfinite(onset).any() else None,
        "at_found": None if found is None else _number(found),
        "rms": [round(float(np.sqrt(np.mean(part**2))), 4) for part in slices],
    }


def _tenths(values: NDArray, inside: NDArray[np.bool_]) -> list[NDArray]:
    """A window's values by tenths of a second."""
    return np.array_split(values[inside], max(round(inside.sum() / 10), 1))


def _number(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _rebuilt(
    view: Seen,
    healthy: Array,
    fault: Fault,
    inside: NDArray[np.bool_],
    times: Array,
    start: float,
) -> dict:
    """Reconstructed signals against what the sensor would have said, while they are faulty."""
    result = {}
    for k, name in enumerate(JUDGED):
        if name not in fault.signals:
            continue
        # Where the healthy sensor itself says nothing there is nothing to be held against.
        flagged = inside & view.flags[name] & np.isfinite(healthy[:, k])
        off = view.rebuilt[:, k] - healthy[:, k]
        valid = flagged & np.isfinite(off)
        early = flagged & (times < start + 1.0)
        covered = np.abs(off[valid]) <= COVERS * view.rebuilt_std[valid, k]
        result[name] = {
            "worst": _number(np.abs(off[early]).max()) if early.any() else None,
            "rms": float(np.sqrt(np.mean(off[valid] ** 2))) if valid.any() else None,
            "flagged": int(flagged.sum()),
            "covered": int(covered.sum()),
            "steps": int(valid.sum()),
        }
    return result
