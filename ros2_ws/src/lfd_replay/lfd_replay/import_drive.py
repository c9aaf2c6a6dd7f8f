"""import_drive: recorded CSV files become one drive."""

import argparse
from pathlib import Path

from lfd_mpc.errors import UserError
from lfd_mpc.sampling import ACCELERATION, HOST_SPEED, INPUTS
from lfd_replay.drive import Drive, make_drive
from lfd_replay.drive_bag import write_drive
from lfd_replay.drive_csv import ACCEL, SPEED, Table, read_csv_streams, scalar_stream
from lfd_replay.errors import run_command
from lfd_replay.evaluate import warn
from lfd_replay.read_drive import parse_mapping


def _existing(path: Path) -> Path:
    if not path.is_file():
        raise UserError(f"{path}: no such file")
    return path


def extra_column(text: str, usual: str) -> tuple[Table, str]:
    """`FILE[:COLUMN]` as a table and the name of its column.

    Without a column name the usual one is taken, or the only one beside the time.
    """
    path, column = Path(text), ""
    if not path.is_file() and ":" in text:
        head, _, column = text.rpartition(":")
        path = Path(head)
    header = Table(_existing(path), {}).header
    if not column:
        others = [name for name in header if name != "t_s"]
        column = usual if usual in header else others[0] if len(others) == 1 else ""
    if not column:
        raise UserError(
            f"{path}: which column? name it as {path}:COLUMN; there are: {', '.join(header)}"
        )
    return Table(path, {usual: column}), usual


def join_drive(
    radar: Path, accel: str | None, speed: str | None, mapping: dict[str, str] | None = None
) -> Drive:
    """A drive from a radar CSV file, with acceleration and host speed from files of their own.

    `accel` and `speed` are `FILE[:COLUMN]` and replace those columns of `radar`. Raises UserError.
    """
    given = {ACCEL: (accel, ACCELERATION), SPEED: (speed, HOST_SPEED)}
    replaced = frozenset(column for column, (text, _) in given.items() if text)
    streams = read_csv_streams(_existing(radar), mapping or {}, replaced)
    for column, (text, name) in given.items():
        if text:
            table, usual = extra_column(text, column)
            streams[name] = scalar_stream(table, usual, name)
    return make_drive(str(radar), streams)


def main_import(arguments: list[str]) -> int:
    """The command line of `import_drive`."""
    parser = argparse.ArgumentParser(prog="import_drive", description=__doc__)
    parser.add_argument("radar", type=Path, help="CSV file of a drive, or of the radar alone")
    parser.add_argument("--accel", metavar="FILE[:COLUMN]", help="host acceleration in m/s^2")
    parser.add_argument("--speed", metavar="FILE[:COLUMN]", help="host speed in m/s")
    parser.add_argument("--map", action="append", default=[], metavar="NAME=COLUMN")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.mcap")
    options = parser.parse_args(arguments)

    drive = join_drive(options.radar, options.accel, options.speed, parse_mapping(options.map))
    warn(drive, [])
    write_drive(drive, options.out)
    counts = ", ".join(f"{drive.count(name)} {name}" for name in INPUTS if drive.count(name))
    print(f"{options.out}: {drive.duration:.1f} s, {counts} samples")
    return 0


def main() -> int:
    """Entry point of `lfd_replay import_drive`."""
    return run_command(main_import)
