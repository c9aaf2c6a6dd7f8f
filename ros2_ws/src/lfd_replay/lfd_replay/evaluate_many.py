"""Many drives side by side: what each one showed, and all of them together."""

import hashlib
import json
import os
import sys
import tempfile
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

from rich.table import Table

from lfd_diagnosis.verdict import SIGNALS
from lfd_mpc.errors import UserError
from lfd_replay.command_line import CountingProgress, say_warnings
from lfd_replay.errors import refusal
from lfd_replay.journal import Journal, Task, run_tasks, workers
from lfd_replay.read_drive import is_drive
from lfd_replay.score import hours_of
from lfd_replay.text_file import is_stream, write_text


def drives_of(paths: list[Path]) -> list[Path] | None:
    """The drives that paths stand for where they are several or folders of drives; else None.

    Raises UserError for a folder that holds none.
    """
    if len(paths) == 1 and (not paths[0].is_dir() or is_drive(paths[0])):
        return None
    found: list[Path] = []
    for path in paths:
        if not path.is_dir() or is_drive(path):
            found.append(path)
            continue
        inside = sorted(entry for entry in path.iterdir() if is_drive(entry))
        if not inside:
            raise UserError(
                f"{path}: holds no drive: neither metadata.yaml (a bag) nor processed_log (a "
                "segment), nor CSV files, bags or CAN logs (a folder of drives)"
            )
        found += inside
    return found


def attempt(evaluate: Callable, path: Path, question: object) -> dict:
    """The figures of one drive, or why there are none: one bad drive does not stop the rest."""
    try:
        drive, result = evaluate(path, question)
    except Exception as error:
        said = refusal(error)
        if said is None:
            # Our mistake rather than the drive's: shown as one, and no reason to lose the others.
            traceback.print_exc()
            detail = " ".join(f"{type(error).__name__}: {error}".split())[:200]
            said = f"{path}: failed unexpectedly ({detail})"
        return {"drive": str(path), "error": said}
    return {**result, "warnings": list(drive.warnings)}


def _state(file: Path) -> str:
    try:
        status = file.stat()
    except OSError:
        return f"{file} not there"
    return f"{file} {status.st_mtime_ns} {status.st_size}"


def drive_key(path: Path, question: object, further: Sequence[Path]) -> str:
    """Names a drive as it is now, what is asked of it, and the further files that this needs."""
    # A folder's own time does not change with the content of its files.
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    states = [str(path.resolve()), *map(_state, files), str(question), *map(_checksum, further)]
    return hashlib.sha256("\0".join(states).encode()).hexdigest()


def _checksum(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else "not there"


def journal_file(out: Path | None, paths: list[Path]) -> Path:
    """Where results are kept until all are there: beside the output, or with the user's others,
    as there is nothing beside a pipe."""
    if out is not None and not is_stream(out):
        return out.with_name(f".{out.name}.journal")
    name = hashlib.sha256("\0".join(str(p.resolve()) for p in paths).encode()).hexdigest()[:16]
    return Path(tempfile.gettempdir()) / f"lfd-{os.getuid()}" / f"{name}.journal"


def evaluate_all(
    paths: list[Path],
    question: object,
    further: Sequence[Path],
    evaluate: Callable,
    out: Path | None,
    jobs: int,
    scheduler: str | None,
) -> list[dict]:
    """What each drive showed, in the order of the paths; writes it to `out`.

    `further`: files beside the drives that what they show depends on.
    An interrupted run goes on where it stopped. Raises UserError for an unknown scheduler.
    """
    tasks = [
        Task(drive_key(path, question, further), attempt, (evaluate, path, question))
        for path in paths
    ]
    kept = journal_file(out, paths)
    journal = Journal(kept)
    with CountingProgress() as progress, workers(jobs, scheduler) as pool:
        bar = progress.add_task("evaluating", total=len(tasks))
        try:
            results = run_tasks(tasks, journal, pool, lambda: progress.advance(bar))
        except KeyboardInterrupt:
            done = sum(task.key in journal.results for task in tasks)
            print(
                f"interrupted: {done} of {len(tasks)} drives are done and kept; the same command "
                "goes on with the others",
                file=sys.stderr,
            )
            raise
    ordered = [results[task.key] for task in tasks]
    if out is not None:
        write_text(out, json.dumps(together(ordered), indent=1, allow_nan=False) + "\n")
    kept.unlink(missing_ok=True)
    return ordered


def together(results: list[dict]) -> dict:
    """All drives as one: hours, and per sensor windows found and false events."""
    good = [result for result in results if "error" not in result]
    sensors = {}
    for name in SIGNALS:
        figures = [result["sensors"][name] for result in good]
        windows = [window for own in figures for window in own["windows"]]
        sensors[name] = {
            "windows": len(windows),
            "found": sum(window["found"] for window in windows),
            "false_events": sum(own["false_events"] for own in figures),
        }
    return {
        "drives": results,
        "failed": len(results) - len(good),
        # Of what was judged: a drive may be long and give no step.
        "hours": round(hours_of(sum(result["steps"] for result in good)), 6),
        "sensors": sensors,
    }


def _ready(result: dict) -> float:
    """Share of a drive's steps in which every sensor is judged."""
    return min(own["ready_fraction"] for own in result["sensors"].values())


def many_table(results: list[dict], profile: str) -> Table:
    """One line per drive, as people read it."""
    summed = together(results)
    good = [result for result in results if "error" not in result]
    steps = sum(result["steps"] for result in good)
    ready = sum(_ready(result) * result["steps"] for result in good)
    table = Table(
        "drive", "hours", "ready", "x real time", *(name.replace("_", " ") for name in SIGNALS),
        title=f"{len(results)} drives, {summed['hours']:.2f} h, profile {profile}; "
        "per sensor: windows found, false events",
        title_justify="left",
    )  # fmt: skip
    for result in good:
        table.add_row(
            Path(result["drive"]).name,
            f"{hours_of(result['steps']):.3f}",
            f"{_ready(result):.1%}",
            f"{result['realtime_factor']:.0f}",
            *(_cell(result["sensors"][name]) for name in SIGNALS),
        )
    table.add_section()
    table.add_row(
        "all",
        f"{summed['hours']:.3f}",
        f"{ready / steps:.1%}" if steps else "-",
        "",
        *(
            f"{own['found']} of {own['windows']}, {own['false_events']}"
            for own in summed["sensors"].values()
        ),
    )
    return table


def _cell(figures: dict) -> str:
    windows = figures["windows"]
    found = sum(window["found"] for window in windows)
    return f"{found} of {len(windows)}, {figures['false_events']}"


def say_failures(results: list[dict]) -> int:
    """Name the drives that could not be evaluated, and what is odd about the others.

    Returns the exit status.
    """
    for result in results:
        say_warnings(result["drive"], result.get("warnings", ()))
    failed = [result for result in results if "error" in result]
    for result in failed:
        print(f"error: {result['error']}", file=sys.stderr)
    return 2 if failed else 0
