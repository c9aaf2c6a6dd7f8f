"""evaluate: a drive through the whole algorithm offline, and the verdicts against the truth."""

import argparse
import json
import sys
import time
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from lfd_replay.drawing.panels import RecordedStep
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.faults import Fault, FaultInjector, parse_faults
from lfd_replay.offline import GraphStep, OfflineGraph
from lfd_replay.profiles import DEFAULT_PROFILE, PROFILES, graph_settings
from lfd_replay.read_drive import add_read_options, read_drive, read_options
from lfd_replay.report import write_report
from lfd_replay.score import SUMMARY_COLUMNS, score, summary_rows, timeline
from lfd_replay.text_file import write_text


def add_drive_options(parser: argparse.ArgumentParser) -> None:
    """Options that every command on drives and faults has."""
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="TEXT",
        help="KIND:SIGNAL[=VALUE][,SIGNAL=VALUE...]@START-END in s of drive time; may be repeated",
    )
    add_read_options(parser)
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise fault (default: 0)")


def warn(drive: Drive, faults: list[Fault]) -> None:
    """Say on stderr what was accepted although it looks odd."""
    for warning in drive.warnings:
        print(f"warning: {drive.name}: {warning}", file=sys.stderr)
    for fault in faults:
        if fault.start * 1e-9 > drive.duration:
            print(
                f"warning: fault '{fault.text}' starts after the end of the drive "
                f"({drive.duration:.1f} s)",
                file=sys.stderr,
            )


def result_table(sensors: dict[str, dict], title: str) -> Table:
    """The verdict per sensor as people read it."""
    table = Table(*SUMMARY_COLUMNS, title=title, title_justify="left")
    for row in summary_rows(sensors):
        table.add_row(*row)
    return table


def print_table(table: Table) -> None:
    """Print a table; where nobody knows how wide the output is, wide enough for all of it."""
    console = Console()
    Console(width=None if console.is_terminal else 120).print(table)


def main_evaluate(arguments: list[str]) -> int:
    """The command line of `evaluate`."""
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument("drive", type=Path, help="CSV file, bag, CAN log or folder of a segment")
    add_drive_options(parser)
    parser.add_argument(
        "--profile",
        default=DEFAULT_PROFILE,
        help=f"one of: {', '.join(PROFILES)} (default: %(default)s)",
    )
    parser.add_argument("--params", type=Path, metavar="FILE.yaml", help="ROS parameter file")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there")
    parser.add_argument(
        "--report", type=Path, metavar="FOLDER", help="write a page to look at there"
    )
    options = parser.parse_args(arguments)

    faults = parse_faults(options.fault)
    reading = read_options(options)
    graph = OfflineGraph(graph_settings(options.profile, options.params))
    started = time.perf_counter()
    drive = read_drive(options.drive, reading)
    warn(drive, faults)
    injector = FaultInjector(faults, drive.zero, options.seed)
    samples = injector.apply(drive.samples)
    steps: list[GraphStep] = []
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("evaluating", total=len(samples))
        for count, sample in enumerate(samples):
            steps.extend(graph.push(sample))
            if count % 500 == 0:
                progress.update(task, completed=count)
    elapsed = time.perf_counter() - started
    sensors = score(timeline((step.outcome.report for step in steps), drive.zero), faults)
    result = {
        "drive": str(options.drive),
        "profile": options.profile,
        "faults": [fault.text for fault in faults],
        "duration_s": round(drive.duration, 6),
        "steps": len(steps),
        "elapsed_s": round(elapsed, 6),
        "realtime_factor": round(drive.duration / elapsed, 3),
        "sensors": sensors,
    }
    if options.report:
        recorded = [RecordedStep(step.horizon, step.bank, step.outcome.report) for step in steps]
        write_report(options.report, drive.name, recorded, drive.zero, faults, sensors)
    if options.json:
        write_text(options.json, json.dumps(result, indent=1, allow_nan=False) + "\n")
    title = (
        f"{drive.name}: {result['duration_s']:.1f} s, {len(steps)} steps in {elapsed:.1f} s "
        f"({result['realtime_factor']:.0f} x real time), profile {options.profile}"
    )
    print_table(result_table(sensors, title))
    return 0


def main() -> int:
    """Entry point of `lfd_replay evaluate`."""
    return run_command(main_evaluate)
