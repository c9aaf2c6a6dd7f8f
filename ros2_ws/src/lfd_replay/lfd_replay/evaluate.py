"""evaluate: a drive through the whole algorithm offline, and the verdicts against the truth."""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.progress import track

from lfd_mpc.collector import without_collector
from lfd_mpc.errors import UserError
from lfd_mpc.samples import Sample
from lfd_replay.command_line import (
    add_drive_options,
    add_jobs_option,
    add_profile_option,
    oddities_of,
    print_table,
    result_table,
    say_warnings,
)
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.evaluate_many import drives_of, evaluate_all, many_table, say_failures
from lfd_replay.faults import Fault, FaultInjector, parse_faults
from lfd_replay.offline import OfflineGraph
from lfd_replay.paths import named_path, refuse_to_overwrite
from lfd_replay.profiles import GraphSettings, graph_settings
from lfd_replay.read_drive import DRIVE_HELP, ReadOptions, files_read, read_drive, read_options
from lfd_replay.recorded_step import RecordedStep
from lfd_replay.score import Timeline, row_timeline, score, shown
from lfd_replay.text_file import write_text


@dataclass(frozen=True)
class Question:
    """What is asked of each drive: settings, faults, seed, and how to read it."""

    settings: GraphSettings
    faults: list[Fault]
    seed: int
    reading: ReadOptions


def evaluate_drive(path: Path, question: Question) -> tuple[Drive, dict]:
    """The drive and the contract's figures. Raises UserError for what is no drive."""
    drive, result, _ = _judge(path, question)
    return drive, result


def _judge(path: Path, question: Question) -> tuple[Drive, dict, Timeline]:
    """The same, and the states that the figures are of."""
    with without_collector():
        began = time.perf_counter()
        drive = read_drive(path, question.reading)
        reading = time.perf_counter() - began
        # Not before it is known that there is a drive: after a change this takes a minute.
        _fetch_compiled(question.settings)
        began = time.perf_counter()
        graph = OfflineGraph(question.settings)
        line = row_timeline(graph.rows(_with_faults(drive, question)), drive.zero)
        elapsed = reading + time.perf_counter() - began
    result = _figures(path, drive, question, line, elapsed)
    said = (*oddities_of(drive, question.faults), *_not_judged(result))
    return replace(drive, warnings=said), result, line


def _not_judged(result: dict) -> list[str]:
    """Says of a drive that it shows nothing: its figures look like those of a healthy one."""
    never = [name for name, own in result["sensors"].items() if not own["ready_fraction"]]
    if not never:
        return []
    return [
        f"never ready: {', '.join(never)}" if result["steps"] else "no steps: nothing was judged"
    ]


def _fetch_compiled(settings: GraphSettings) -> None:
    """What is compiled is fetched from disk, or compiled, when it is called first: untimed."""
    for _ in OfflineGraph(settings).rows(()):
        pass


def _with_faults(drive: Drive, question: Question) -> Sequence[Sample]:
    if not question.faults:
        return drive.samples
    return FaultInjector(question.faults, drive.zero, question.seed).apply(drive.samples)


def _figures(path: Path, drive: Drive, question: Question, line: Timeline, elapsed: float) -> dict:
    return {
        "drive": str(path),
        "profile": question.settings.profile,
        "faults": [fault.text for fault in question.faults],
        "duration_s": round(drive.duration, 6),
        "steps": len(line.stamps),
        "elapsed_s": round(elapsed, 6),
        "realtime_factor": round(drive.duration / elapsed, 3),
        "sensors": score(line, question.faults),
    }


def _report_drive(drive: Drive, question: Question, sensors: dict, folder: Path) -> None:
    """Once more step by step: the page shows what was said at each of them."""
    graph = OfflineGraph(question.settings)
    samples = _with_faults(drive, question)
    console = Console(stderr=True)
    counted = track(samples, "drawing", console=console, disable=not console.is_terminal)
    steps = [step for sample in counted for step in graph.push(sample)]
    # plotly is loaded when there is something to draw: other commands use this module, too.
    from lfd_replay.drawing.panels import Recording
    from lfd_replay.report import write_report

    recorded = [RecordedStep.offline(step) for step in steps]
    recording = Recording(recorded, drive.zero, question.faults)
    write_report(folder, drive.name, recording, sensors, question.settings.profile)


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument(
        "drives",
        type=named_path,
        nargs="+",
        metavar="DRIVE",
        help=f"{DRIVE_HELP}; several, or a folder of drives, are evaluated side by side",
    )
    add_drive_options(parser)
    add_profile_option(parser)
    parser.add_argument("--params", type=named_path, metavar="FILE.yaml", help="ROS parameter file")
    parser.add_argument("--json", type=named_path, metavar="FILE", help="write the figures there")
    parser.add_argument(
        "--report",
        type=named_path,
        metavar="FOLDER",
        help="write a page to look at there (one drive)",
    )
    many = parser.add_argument_group("several drives")
    add_jobs_option(many)
    many.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler to use instead")
    return parser.parse_args(arguments)


def main_evaluate(arguments: list[str]) -> int:
    """The command line of `evaluate`."""
    options = _parse(arguments)
    question = Question(
        graph_settings(options.profile, options.params),
        parse_faults(options.fault),
        options.seed,
        read_options(options),
    )
    drives = drives_of(options.drives)
    read = files_read(options, *(drives or options.drives), options.params)
    if options.json:
        refuse_to_overwrite(options.json, read)
    if options.report:
        refuse_to_overwrite(options.report / "report.html", read)
    if drives is None:
        (path,) = options.drives
        return _evaluate_one(path, question, options)
    return _evaluate_several(drives, question, options)


def _evaluate_several(drives: list[Path], question: Question, options: argparse.Namespace) -> int:
    if options.report:
        raise UserError("--report makes the page of one drive; give one")
    results = evaluate_all(
        drives,
        question,
        files_read(options),
        evaluate_drive,
        options.json,
        options.jobs,
        options.scheduler,
    )
    print_table(many_table(results, question.settings.profile))
    return say_failures(results)


def _evaluate_one(path: Path, question: Question, options: argparse.Namespace) -> int:
    drive, result, line = _judge(path, question)
    sensors = shown(line, question.faults)
    if options.report:
        _report_drive(drive, question, sensors, options.report)
    if options.json:
        write_text(options.json, json.dumps(result, indent=1, allow_nan=False) + "\n")
    say_warnings(drive.name, drive.warnings)
    title = (
        f"{drive.name}: {result['duration_s']:.1f} s, {result['steps']} steps in "
        f"{result['elapsed_s']:.2f} s ({result['realtime_factor']:.0f} x real time), "
        f"profile {question.settings.profile}"
    )
    print_table(result_table(sensors, title))
    return 0


def main() -> int:
    """Entry point of `lfd_replay evaluate`."""
    return run_command(main_evaluate)
