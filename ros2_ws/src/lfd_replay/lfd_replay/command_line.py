"""What the commands on drives have in common: options, warnings and the table of verdicts."""

import argparse
import sys

from rich.console import Console
from rich.table import Table

from lfd_replay.drive import Drive
from lfd_replay.faults import Fault
from lfd_replay.read_drive import add_read_options
from lfd_replay.score import SUMMARY_COLUMNS, summary_rows


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
