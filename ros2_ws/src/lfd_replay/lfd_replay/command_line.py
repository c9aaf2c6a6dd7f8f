"""What the commands on drives have in common: options, warnings and the table of verdicts."""

import argparse
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
)
from rich.table import Table

from lfd_mpc.errors import UserError
from lfd_replay.drive import Drive, streams_of
from lfd_replay.faults import GRAMMAR, Fault, spared_signals
from lfd_replay.inspection import cannot_run, missing_of
from lfd_replay.paths import named_path
from lfd_replay.profiles import DEFAULT_PROFILE, PROFILES, known_profile
from lfd_replay.read_drive import add_read_options
from lfd_replay.score import SUMMARY_COLUMNS, summary_rows


def add_drive_options(parser: argparse.ArgumentParser) -> None:
    """Options that every command on drives and faults has."""
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="TEXT",
        help=f"{GRAMMAR} in s of drive time; may be repeated",
    )
    add_read_options(parser)
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise fault (default: 0)")


def add_profile_option(parser: argparse.ArgumentParser, what: str = "profile") -> None:
    """`--profile`, refused by a UserError where there is no such one; `what` it is for."""
    parser.add_argument(
        "--profile",
        type=known_profile,
        default=DEFAULT_PROFILE,
        help=f"{what}, one of: {', '.join(PROFILES)} (default: %(default)s)",
    )


def _job_count(text: str) -> int:
    try:
        jobs = int(text)
    except ValueError:
        jobs = 0
    if jobs < 1:
        raise UserError(f"--jobs {text}: 1 or more is expected")
    return jobs


def add_jobs_option(parser: argparse._ActionsContainer) -> None:
    """`--jobs`; anything but a number of 1 or more is refused by a UserError."""
    parser.add_argument(
        "--jobs",
        type=_job_count,
        default=os.cpu_count() or 1,
        help="processes (default: %(default)s)",
    )


RECORDED_AT = Path("../shared/data")
"""Where the recorded drive is unless told; it need not be there."""


def parse_campaign(
    parser: argparse.ArgumentParser, arguments: list[str], out: str
) -> argparse.Namespace:
    """Options of a command that runs many drives, its own and those all have; `out`: where its
    results go unless told. Raises UserError."""
    parser.add_argument(
        "--recorded",
        type=named_path,
        default=RECORDED_AT,
        metavar="FOLDER",
        help="where the recorded drive is (default: %(default)s)",
    )
    add_jobs_option(parser)
    parser.add_argument("--out", type=named_path, default=Path(out), help="(default: %(default)s)")
    options = parser.parse_args(arguments)
    if options.recorded != RECORDED_AT and not options.recorded.is_dir():
        raise UserError(
            f"--recorded {options.recorded}: no such folder; one with the recorded drive is "
            f"expected, and only {RECORDED_AT} may be absent"
        )
    return options


QUIET_S = 30.0
"""Seconds between the lines that tell of progress where no bar can be drawn."""


class CountingProgress(Progress):
    """A bar that counts what is done, on stderr; lines now and then where that is no terminal."""

    def __init__(self) -> None:
        """A bar without tasks."""
        console = Console(stderr=True)
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
        )
        super().__init__(*columns, console=console, disable=not console.is_terminal)
        self._said_at = time.monotonic()

    def advance(self, task_id: TaskID, advance: float = 1.0) -> None:
        """So much more is done."""
        super().advance(task_id, advance)
        now = time.monotonic()
        if self.disable and now - self._said_at >= QUIET_S:
            self._said_at, task = now, self.tasks[task_id]
            print(f"{task.description}: {task.completed:g} of {task.total:g}", file=sys.stderr)


def late_faults(faults: list[Fault], duration: float) -> list[str]:
    """Faults that start after so many s, which is all that there is, in words."""
    return [
        f"fault '{fault.text}' starts after the end of the drive ({duration:.1f} s)"
        for fault in faults
        if fault.start * 1e-9 > duration
    ]


def idle_faults(drive: Drive, faults: list[Fault]) -> list[str]:
    """Faults that change nothing of a drive, in words: none of them can be found."""
    if not faults:
        return []
    said, duration = [], drive.duration
    for fault, spared in zip(
        faults, spared_signals(faults, drive.samples, drive.zero), strict=True
    ):
        late = late_faults([fault], duration)
        said += late
        for why, signals in spared.items() if not late else ():
            said.append(f"fault '{fault.text}' does nothing to {' and '.join(signals)}: {why}")
    return said


def oddities_of(drive: Drive, faults: list[Fault]) -> list[str]:
    """What was accepted although it looks odd, in words: a drive, and faults on it."""
    unfit = cannot_run(missing_of(streams_of(drive.samples)))
    return [*drive.warnings, *([unfit] if unfit else []), *idle_faults(drive, faults)]


def warn(drive: Drive, faults: list[Fault]) -> None:
    """Say on stderr what was accepted although it looks odd."""
    say_warnings(drive.name, oddities_of(drive, faults))


def say_warnings(name: str, warnings: Iterable[str]) -> None:
    """Say on stderr what there is to be said of one drive."""
    for warning in warnings:
        print(f"warning: {name}: {warning}", file=sys.stderr)


def result_table(sensors: dict[str, dict], title: str) -> Table:
    """The verdict per sensor as people read it."""
    table = Table(*SUMMARY_COLUMNS, title=title, title_justify="left")
    for row in summary_rows(sensors):
        table.add_row(*row)
    return table


def print_table(table: Table) -> None:
    """Print a table; where nobody knows how wide the output is, wide enough for all of it.

    Its title is a line of its own, which a narrow table does not break. Long words are broken
    rather than cut off: two faults may differ at their ends only. Names of files are in it, whose
    brackets are no markup.
    """
    console = Console(markup=False)
    for column in table.columns:
        column.overflow = "fold"
    if table.title:
        console.print(table.title, highlight=False, soft_wrap=True)
        table.title = None
    Console(width=None if console.is_terminal else 120, markup=False).print(table)
