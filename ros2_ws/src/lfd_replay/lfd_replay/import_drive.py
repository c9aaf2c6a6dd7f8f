"""import_drive: what a car has recorded becomes one drive."""

import argparse
from pathlib import Path

from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, INPUTS
from lfd_replay.command_line import warn
from lfd_replay.drive import Drive
from lfd_replay.drive_bag import write_drive
from lfd_replay.drive_csv import ACCEL, SPEED, Table, scalar_stream
from lfd_replay.errors import run_command
from lfd_replay.paths import named_path, refuse_to_overwrite
from lfd_replay.read_drive import (
    ReadOptions,
    add_read_options,
    as_read,
    files_read,
    read_as_recorded,
    read_options,
    without_offset,
)


def _file_and_column(text: str) -> tuple[Path, str]:
    if Path(text).is_file() or ":" not in text:
        return Path(text), ""
    head, _, column = text.rpartition(":")
    return Path(head), column


def extra_column(text: str, usual: str, time: str = "t_s") -> tuple[Table, str]:
    """`FILE[:COLUMN]` as a table and the name of its column; `time`: what `t_s` may be called.

    Without a column name the usual one is taken, or the only one beside the time.
    """
    path, column = _file_and_column(text)
    table = Table(path, {})
    time = time if time in table.header else "t_s"
    if not column:
        others = [name for name in table.header if name != time]
        column = usual if usual in table.header else others[0] if len(others) == 1 else ""
    if not column:
        raise UserError(f"{path}: which column? name it as {path}:COLUMN; there are: {table.there}")
    return Table(path, {usual: column, "t_s": time}), usual


def join_drive(
    recording: Path, accel: str | None, speed: str | None, options: ReadOptions | None = None
) -> Drive:
    """A drive from a recording, with acceleration and host speed from files of their own.

    `accel` and `speed` are `FILE[:COLUMN]` and replace those of `recording`. Raises UserError.
    """
    options = options or ReadOptions()
    given = {ACCEL: (accel, ACCELERATION), SPEED: (speed, HOST_SPEED)}
    replaced = frozenset(column for column, (text, _) in given.items() if text)
    streams, remarks = read_as_recorded(recording, options, replaced)
    for column, (text, name) in given.items():
        if text:
            table, usual = extra_column(text, column, options.mapping.get("t_s", "t_s"))
            streams[name] = scalar_stream(table, usual, name)
            remarks += [f"{table.path}: {remark}" for remark in table.remarks]
    return as_read(recording, without_offset(recording, streams, options), remarks)


def main_import(arguments: list[str]) -> int:
    """The command line of `import_drive`."""
    parser = argparse.ArgumentParser(prog="import_drive", description=__doc__)
    parser.add_argument(
        "recording",
        type=named_path,
        help="CSV file of a drive or of the radar alone, bag, CAN log (.log, .asc, .blf), or "
        "folder of a comma2k19 segment",
    )
    parser.add_argument("--accel", metavar="FILE[:COLUMN]", help="host acceleration in m/s^2")
    parser.add_argument("--speed", metavar="FILE[:COLUMN]", help="host speed in m/s")
    add_read_options(parser)
    parser.add_argument("-o", "--out", type=named_path, required=True, metavar="OUT.mcap")
    options = parser.parse_args(arguments)

    further = (_file_and_column(text)[0] for text in (options.accel, options.speed) if text)
    refuse_to_overwrite(options.out, files_read(options, options.recording, *further))
    drive = join_drive(options.recording, options.accel, options.speed, read_options(options))
    write_drive(drive, options.out)
    warn(drive, [])
    counts = ", ".join(f"{drive.count(name)} {name}" for name in INPUTS if drive.count(name))
    print(f"{options.out}: {drive.duration:.1f} s, {counts} samples")
    return 0


def main() -> int:
    """Entry point of `lfd_replay import_drive`."""
    return run_command(main_import)
