"""calibrate: thresholds and noise figures from anyone's fault-free drives, as a parameter file."""

import argparse
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import floor
from typing import TypeVar

import numpy as np
from pydantic import ValidationError
from rich.console import Console
from rich.progress import track
from rich.table import Table

from lfd_mpc.errors import UserError
from lfd_mpc.settings import Settings, settings_error
from lfd_replay.command_line import add_profile_option, print_table, warn
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.evaluation.detectors import counted_faults
from lfd_replay.evaluation.normal_driving import (
    LEAST_SCANS,
    IndexStatistics,
    index_statistics,
    lead_acceleration,
    scan_deviations,
)
from lfd_replay.evaluation.trace import JUDGED, Trace, record_trace
from lfd_replay.offline import OfflineGraph
from lfd_replay.paths import named_path, refuse_to_overwrite
from lfd_replay.profiles import (
    PROFILES,
    GraphSettings,
    graph_settings,
    parameter_file_text,
)
from lfd_replay.read_drive import (
    DRIVE_HELP,
    add_read_options,
    files_read,
    read_drive,
    read_options,
)
from lfd_replay.score import intervals
from lfd_replay.text_file import write_text

Changed = TypeVar("Changed", bound=Settings)

LEAST_INDICES = 50
"""So many indices above zero a threshold is derived from; with fewer the profile's stays."""


def with_noise(settings: GraphSettings, drives: list[Drive]) -> GraphSettings:
    """Settings with the lead's distribution and the radar's deviations as in the drives.

    Raises UserError where no lead is followed for long enough to tell, or as none can be.
    """
    lead = np.concatenate([lead_acceleration(drive) for drive in drives])
    if not len(lead):
        raise UserError(
            "calibrate: in none of the drives a lead is followed for two seconds and "
            f"{LEAST_SCANS} scans"
        )
    clearance, velocity = scan_deviations(drives)
    motion = {
        "lead_acceleration_mean": round(float(lead.mean()), 4),
        "lead_acceleration_std": round(float(lead.std()), 4),
    }
    noise = {
        "clearance_std": round(clearance, 4),
        "relative_velocity_std": round(velocity, 4),
    }
    try:
        return replace(
            settings,
            bank=_changed(settings.bank, motion),
            diagnosis=_changed(settings.diagnosis, {**motion, **noise}),
        )
    except ValidationError as error:
        names = ", ".join(drive.name for drive in drives)
        raise UserError(
            f"calibrate: {names}: no figures of real driving: {settings_error(error)}"
        ) from error


def with_thresholds(
    settings: GraphSettings, found: list[Trace], allowed: float
) -> tuple[GraphSettings, list[str]]:
    """Settings with thresholds for fault-free traces, and what there is to say about them.

    Mean + standard deviation of the indices above zero (eq 26), and more where that would raise
    over `allowed` false events per hour.
    """
    normal = index_statistics(found)
    thresholds, remarks = {}, []
    for signal in JUDGED:
        values = normal.values[signal]
        if len(values) < LEAST_INDICES:
            remarks.append(f"{signal}: too few indices above zero; the profile's threshold stays")
            continue
        recipe = min(normal.mean[signal] + normal.std[signal], 1.0)
        for threshold in (recipe, *np.unique(values[values > recipe]).tolist()):
            events = _false_events(settings, found, signal, threshold)
            if events <= allowed * normal.hours:
                break
        else:
            remarks.append(f"{signal}: no threshold keeps to {allowed:g} false events per hour")
        # Downwards, so that an index that equals the threshold still counts.
        thresholds[f"{signal}_threshold"] = floor(threshold * 1e5) / 1e5
    diagnosis = _changed(settings.diagnosis, thresholds)
    return replace(settings, diagnosis=diagnosis), remarks


def _false_events(
    settings: GraphSettings, found: list[Trace], signal: str, threshold: float
) -> int:
    diagnosis = settings.diagnosis
    return sum(
        len(
            intervals(
                trace.stamps,
                counted_faults(
                    trace.index(signal),
                    threshold,
                    diagnosis.confidence_threshold,
                    diagnosis.confidence_max,
                ),
            )
        )
        for trace in found
    )


def _changed(settings: Changed, values: Mapping[str, object]) -> Changed:
    """A copy of validated settings with other values, validated again."""
    return type(settings)(**{**settings.model_dump(), **values})


def traces(settings: GraphSettings, drives: list[Drive], what: str) -> Iterator[Trace]:
    """Each drive through a graph of its own."""
    console = Console(stderr=True)
    for drive in track(drives, what, console=console, disable=not console.is_terminal):
        yield record_trace(OfflineGraph(settings).rows(drive.samples), drive.zero)


def calibration_table(settings: GraphSettings, normal: IndexStatistics) -> Table:
    """What was derived, as people read it."""
    chosen = settings.diagnosis
    table = Table(
        "signal", "standard deviation", "index zero", "threshold", "false events per hour",
        title=f"lead acceleration {chosen.lead_acceleration_mean:.3f} +- "
        f"{chosen.lead_acceleration_std:.3f} m/s^2, from {normal.hours * 60:.1f} minutes",
        title_justify="left",
    )  # fmt: skip
    for signal, unit in zip(JUDGED, ("m", "m/s", None), strict=True):
        table.add_row(
            signal,
            "-" if unit is None else f"{getattr(chosen, f'{signal}_std'):.3f} {unit}",
            f"{normal.zero_share[signal]:.1%}",
            f"{getattr(chosen, f'{signal}_threshold'):.3f}",
            f"{normal.false_events_per_hour[signal]:.1f}",
        )
    return table


def of_paper(settings: GraphSettings) -> GraphSettings:
    """The same settings under the paper profile."""
    changes = PROFILES["paper"]
    return replace(
        settings,
        bank=_changed(settings.bank, changes["observer_node"]),
        diagnosis=_changed(settings.diagnosis, changes["diagnosis_node"]),
    )


def _parse(arguments: list[str]) -> argparse.Namespace:
    """Raises UserError for a number of false events that cannot be."""
    parser = argparse.ArgumentParser(prog="calibrate", description=__doc__)
    parser.add_argument("drives", type=named_path, nargs="+", metavar="DRIVE", help=DRIVE_HELP)
    add_read_options(parser)
    add_profile_option(parser, "profile to start from")
    parser.add_argument(
        "--false-events",
        type=float,
        default=1.0,
        metavar="PER_HOUR",
        help="false events per hour and signal that may remain (default: %(default)s)",
    )
    parser.add_argument("-o", "--out", type=named_path, required=True, metavar="PARAMS.yaml")
    options = parser.parse_args(arguments)
    if not options.false_events >= 0.0:
        raise UserError(f"--false-events {options.false_events}: 0 or more per hour is expected")
    return options


def main_calibrate(arguments: list[str]) -> int:
    """The command line of `calibrate`."""
    options = _parse(arguments)
    refuse_to_overwrite(options.out, files_read(options, *options.drives))
    settings = graph_settings(options.profile)
    reading = read_options(options)
    drives = [read_drive(path, reading) for path in options.drives]
    settings = with_noise(settings, drives)
    for drive in drives:
        warn(drive, [])
    # The thresholds are those of the paper's indices, whichever profile will be used.
    settings, remarks = with_thresholds(
        settings,
        list(traces(of_paper(settings), drives, "reading the indices")),
        options.false_events,
    )
    normal = index_statistics(list(traces(of_paper(settings), drives, "counting false events")))
    if not normal.hours:
        raise UserError("no drive makes a step: radar and acceleration that go on are expected")
    heading = [
        f"Parameters of the {options.profile} profile, calibrated on {len(drives)} fault-free "
        f"drives ({normal.hours * 60:.1f} minutes).",
        "False events per hour that these drives would raise (paper profile): "
        + ", ".join(f"{s} {normal.false_events_per_hour[s]:.1f}" for s in JUDGED)
        + ".",
        *remarks,
    ]
    write_text(options.out, parameter_file_text(heading, settings))
    print_table(calibration_table(settings, normal))
    for line in remarks:
        print(line)
    print(f"written: {options.out}")
    return 0


def main() -> int:
    """Entry point of `lfd_replay calibrate`."""
    return run_command(main_calibrate)
