"""Table 3: which faults on which drive, and what the paper profile says to each."""

from dataclasses import dataclass
from pathlib import Path
from statistics import median

import numpy as np

from lfd_diagnosis.verdict import SIGNALS
from lfd_mpc.arrays import Array
from lfd_mpc.samples import ACCELERATION, RADAR, Sample
from lfd_replay.drive import Drive
from lfd_replay.evaluation.fault_windows import PAPER
from lfd_replay.faults import Fault, FaultInjector, parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.import_drive import join_drive
from lfd_replay.offline import GraphStep, OfflineGraph
from lfd_replay.profiles import GraphSettings
from lfd_replay.read_drive import ReadOptions
from lfd_replay.score import row_timeline, score

RECORDED = "comma2k19_rav4_seg40"
"""The recorded drive, by the beginning of its files' names."""

RECORDED_RADAR_FIRST = 7.2534
"""First radar sample of the recorded drive in s of its drive time."""

COMBINATIONS = {
    "none": (),
    "x1, x2": ("clearance", "relative_velocity"),
    "a": ("acceleration",),
    "x1, x2, a": ("clearance", "relative_velocity", "acceleration"),
}
"""Faulty signals of each row of Table 3."""

SCAN_S = 0.05
"""Scan period of the radar, over which the starts of faults are spread."""

BLAMED_FOR_S = 3.0
"""Time after a fault in which a flag on a healthy signal is blamed on it."""


@dataclass(frozen=True)
class Case:
    """One row: a drive, its faulty signals, and the window of the fault in s of drive time."""

    drive: str
    combination: str
    start: float
    end: float

    @property
    def title(self) -> str:
        """A name for people."""
        return f"{self.drive}: {self.combination}"

    @property
    def key(self) -> str:
        """A name for files."""
        return f"{self.drive}-{'-'.join(self.combination.split(', '))}".replace("_", "-")

    def fault_texts(self, phase: float) -> list[str]:
        """The fault as the command line takes it, `phase` s later than the paper's."""
        signals = COMBINATIONS[self.combination]
        values = ",".join(f"{name}={value:g}" for name, value in PAPER if name in signals)
        start, end = self.start + phase, self.end + phase
        return [f"offset:{values}@{start:.4f}-{end:.4f}"] if values else []


def table_3(recorded: Path | None) -> list[Case]:
    """The paper's nine rows, and its four combinations on the recorded drive where it is there."""
    cases = [
        Case(drive, combination, 40.0, 60.0)
        for drive in ("data-1", "data-2")
        for combination in COMBINATIONS
    ]
    cases.append(Case("data-3", "none", 40.0, 60.0))
    if recorded is not None:
        start = RECORDED_RADAR_FIRST + 20.0
        cases += [Case(RECORDED, combination, start, start + 15.0) for combination in COMBINATIONS]
    return cases


def load_drive(name: str, recorded: Path | None, seed: int = 0) -> Drive:
    """A drive of an evaluation by name: the recorded one, or generated. Raises UserError."""
    if name != RECORDED or recorded is None:
        return generate_drive(name, seed, "esr")
    return behind_recorded(recorded, "lead")


def lead_file(folder: Path, lead: str = "lead") -> Path:
    """The file of one lead of the recorded drive in its folder; `lead`: the end of its name."""
    return folder / f"{RECORDED}_{lead}.csv"


def behind_recorded(recorded: Path, lead: str, options: ReadOptions | None = None) -> Drive:
    """The recorded car's own sensors behind that lead of its radar. Raises UserError.

    `lead`: the end of the name of its file; `options`: how that is read.
    """
    base = recorded / RECORDED
    return join_drive(
        lead_file(recorded, lead),
        f"{base}.can_accel_0x24.csv:acc_forward_mps2",
        f"{base}.speed.csv",
        options,
    )


def _with_faults(
    case: Case, phase: float, recorded: Path | None
) -> tuple[Drive, list[Fault], list[Sample]]:
    """The drive of a case, its faults, and the samples that they leave."""
    drive = load_drive(case.drive, recorded)
    faults = parse_faults(case.fault_texts(phase))
    return drive, faults, FaultInjector(faults, drive.zero, 0).apply(drive.samples)


def run_case(
    case: Case, phase: float, settings: GraphSettings, recorded: Path | None
) -> tuple[Drive, list[Fault], list[GraphStep]]:
    """The drive of one case, its faults, and every step."""
    drive, faults, samples = _with_faults(case, phase, recorded)
    return drive, faults, list(OfflineGraph(settings).run(samples))


def added(drive: Drive, case: Case, phase: float) -> dict[str, tuple[Array, Array]]:
    """What a case's fault adds to each signal: times in s, and the difference, by signal."""
    injector = FaultInjector(parse_faults(case.fault_texts(phase)), drive.zero, 0)
    points: dict[str, list[tuple[float, float]]] = {name: [] for name, _ in PAPER}
    for sample in drive.samples:
        changed = injector(sample)
        for name, field in _FIELDS.items():
            if sample.input == field[0] and changed is not None:
                difference = getattr(changed, field[1]) - getattr(sample, field[1])
                points[name].append(((sample.stamp - drive.zero) * 1e-9, difference))
    return {name: tuple(np.array(rows).reshape(-1, 2).T) for name, rows in points.items()}


_FIELDS = {
    "clearance": (RADAR, "clearance"),
    "relative_velocity": (RADAR, "relative_velocity"),
    "acceleration": (ACCELERATION, "value"),
}


def score_case(case: Case, phase: float, settings: GraphSettings, recorded: Path | None) -> dict:
    """The contract's figures of one case."""
    drive, faults, samples = _with_faults(case, phase, recorded)
    return score(row_timeline(OfflineGraph(settings).rows(samples), drive.zero), faults)


def phases(count: int) -> list[float]:
    """Starts spread over the radar's scan, the paper's own first, in s after it."""
    return [SCAN_S * k / count for k in range(count)]


def summarise_phases(case: Case, scored: list[dict]) -> dict:
    """Over all starts of a case: per sensor how often found, delays, share flagged, false events.

    `wrong_blame` holds healthy signals that were flagged during the fault or soon after, in s.
    """
    injected = COMBINATIONS[case.combination]
    sensors = {}
    for name in SIGNALS:
        figures = [sensors_of[name] for sensors_of in scored]
        delays = [f["delay_s"] for f in figures if f["delay_s"] is not None]
        fractions = [f["flagged_fraction"] for f in figures if f["flagged_fraction"] is not None]
        healthy = name not in injected and not (name == "radar" and "clearance" in injected)
        blamed = [
            max(0.0, min(end, case.end + BLAMED_FOR_S) - max(begin, case.start))
            for f in figures
            for begin, end in f["flagged"]
        ]
        sensors[name] = {
            "injected": not healthy,
            "starts": len(figures),
            "found": sum(bool(f["detected"]) for f in figures),
            "delay_s": median(delays) if delays else None,
            "delay_min_s": min(delays, default=None),
            "delay_max_s": max(delays, default=None),
            "flagged_fraction": median(fractions) if fractions else None,
            "false_events": sum(f["false_events"] for f in figures) / len(figures),
            "wrong_blame_s": sum(blamed) / len(figures) if healthy and injected else 0.0,
        }
    return sensors


def combination_title(combination: str) -> str:
    """A combination of Table 3 in words."""
    return " and ".join(name.replace("_", " ") for name in COMBINATIONS[combination]) or "no fault"
