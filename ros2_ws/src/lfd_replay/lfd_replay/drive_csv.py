"""Drives as CSV files: one row per radar scan."""

import csv
import re
from collections.abc import Iterator
from itertools import pairwise
from math import isfinite, nan
from pathlib import Path

from lfd_mpc.errors import UserError
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RADAR,
    UNKNOWN_TRACK,
    RadarSample,
    Sample,
    ScalarSample,
)
from lfd_replay.drive import LATEST
from lfd_replay.errors import WrongOption

COLUMNS = ("t_s", "range_m", "range_rate_mps", "host_speed_mps", "host_accel_mps2")
"""Columns of a drive; units are in the names. `track_id` and `lead_accel_mps2` are optional."""

RANGE, RANGE_RATE, SPEED, ACCEL = COLUMNS[1:]
TRACK, LEAD_ACCEL = "track_id", "lead_accel_mps2"
SCALARS = {SPEED: HOST_SPEED, ACCEL: ACCELERATION, LEAD_ACCEL: LEAD_ACCELERATION}

LIKE_IDS = re.compile(r"track|(target|object|obj)_?id", re.IGNORECASE)
"""What a column of track ids may be called."""

MOST_REPEATED = 0.5
"""Share of rows that may have the time of the row before: a recording may have each row twice."""

NEARLY_ALL, MANY = 0.95, 0.3
"""Shares of the rows with a range that have no host value, and of those without one that have, from
which on a table is taken for one with a row per signal. A radar may have no lead for long."""

LONGEST_TEXT = 40
"""Characters of the file's own text that a message repeats: a quoted cell may be a whole file."""


def _clipped(text: str) -> str:
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 3] + "..."


def _as_others_read(text: str) -> str:
    """Text of a number without what Python takes for one and nobody else does."""
    return text.replace("_", "x")


def _unreadable(path: Path, reason: str | None = None) -> UserError:
    return UserError(
        f"{path}: cannot be read ({reason or 'no text in UTF-8'}); a CSV drive in UTF-8 is expected"
    )


class Table:
    """One CSV file with named columns, checked while it is read."""

    def __init__(self, path: Path, mapping: dict[str, str]) -> None:
        """`mapping`: the file's own column for some of ours.

        Raises UserError for a file that cannot be read or has no rows.
        """
        self.path = path
        self.mapping = mapping
        try:
            text = path.read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise _unreadable(path, getattr(error, "strerror", None)) from error
        if "\0" in text:
            raise _unreadable(path)
        rows: list[list[str]] = []
        try:
            # Strictly: a quote that is left open would swallow the rows after it unseen.
            rows.extend(csv.reader(text.splitlines(), strict=True))
        except csv.Error as error:
            raise UserError(
                f"{path}: line {len(rows) + 1}: cannot be read as CSV ({error}); cells whose "
                "quotes are closed are expected"
            ) from error
        # A line with nothing on it is no row.
        there = [(line, row) for line, row in enumerate(rows, start=1) if row]
        if len(there) < 2:
            raise UserError(f"{path}: is empty; a header and at least one row are expected")
        self.header = [name.strip() for name in there[0][1]]
        between = next((mark for mark in (";", "\t") if mark in self.header[0]), None)
        if between and len(self.header) == 1:
            mark = "tabs" if between == "\t" else f"'{between}'"
            raise UserError(f"{path}: has {mark} between its columns; commas are expected")
        self._lines, self._rows = zip(*there[1:], strict=True)
        self._refuse_long_rows()
        ended = text.endswith(("\n", "\r"))
        if not ended and len(self._rows[-1]) < len(self.header):
            raise UserError(f"{path}: is cut off in its last row; a whole file is expected")
        self.remarks = list(self._oddities(ended))

    def _refuse_long_rows(self) -> None:
        """Of a row with more cells than the header nobody knows which one is too many."""
        width = len(self.header)
        for line, row in zip(self._lines, self._rows, strict=True):
            if any(cell.strip() for cell in row[width:]):
                raise UserError(
                    f"{self.path}: line {line}: has {len(row)} cells, the header {width}; no more "
                    "than that are expected, and commas within a cell between quotes"
                )

    def _oddities(self, ended: bool) -> Iterator[str]:
        """What is accepted and said, as a whole file may look like that."""
        short = sum(len(row) < len(self.header) for row in self._rows)
        if short:
            yield (
                f"{short} rows have fewer than the header's {len(self.header)} cells; "
                "those that are missing count as blank"
            )
        if not ended:
            yield "the file does not end with a line break: its last number may be cut off"

    @property
    def there(self) -> str:
        """The columns that the file has, in words."""
        return ", ".join(map(_clipped, self.header))

    def has(self, column: str) -> bool:
        """Whether the file has that column, under its own name or a mapped one."""
        return self.mapping.get(column, column) in self.header

    def filled(self, column: str) -> list[bool]:
        """Which rows have anything in a column; none where the file does not have it."""
        own = self.mapping.get(column, column)
        position = self.header.index(own) if own in self.header else len(self.header)
        return [position < len(row) and bool(row[position].strip()) for row in self._rows]

    def column(self, column: str) -> Iterator[float | None]:
        """Numbers of one column, None for a blank. Raises UserError for anything else."""
        for line, text in self._cells(column):
            yield self._number(column, line, text) if text else None

    def _cells(self, column: str) -> Iterator[tuple[int, str]]:
        """Line and text of each cell of one column. Raises UserError where it is not there."""
        own = self.mapping.get(column, column)
        if own not in self.header:
            raise UserError(f"{self.path}: column '{own}' is missing; there are: {self.there}")
        if self.header.count(own) > 1:
            raise UserError(
                f"{self.path}: column '{own}' is there {self.header.count(own)} times; one is "
                "expected: rename the others"
            )
        position = self.header.index(own)
        for line, row in zip(self._lines, self._rows, strict=True):
            yield line, row[position].strip() if position < len(row) else ""

    def _number(self, column: str, line: int, text: str) -> float:
        try:
            return float(_as_others_read(text))
        except ValueError:
            raise UserError(
                f"{self.path}: line {line}, column '{self.mapping.get(column, column)}': "
                f"'{_clipped(text)}' is not a number"
            ) from None

    def stamps(self) -> list[int]:
        """Stamps in ns. Raises UserError where time is missing, not finite or decreases."""
        stamps: list[int] = []
        for line, seconds in zip(self._lines, self.column("t_s"), strict=True):
            if seconds is None or not isfinite(seconds):
                raise UserError(
                    f"{self.path}: line {line}: the time is missing or not finite; every line "
                    "needs one, in seconds"
                )
            stamp = self._nanoseconds(line, seconds)
            if stamp < 0:
                raise UserError(
                    f"{self.path}: line {line}: the time {seconds} s is negative; "
                    "t_s is in seconds, from 0 on"
                )
            if stamps and stamp < stamps[-1]:
                raise UserError(
                    f"{self.path}: line {line}: time decreases from {stamps[-1] / 1e9} s to "
                    f"{seconds} s; it must not"
                )
            stamps.append(stamp)
        return stamps

    def times(self) -> list[int | None]:
        """Stamps in ns as they stand, in whatever order; None = missing or not finite."""
        return [
            None if seconds is None or not isfinite(seconds) else self._nanoseconds(line, seconds)
            for line, seconds in zip(self._lines, self.column("t_s"), strict=True)
        ]

    def _nanoseconds(self, line: int, seconds: float) -> int:
        if not abs(seconds) < LATEST:
            raise UserError(
                f"{self.path}: line {line}: the time {seconds:g} s is out of range; t_s is in "
                f"seconds, below {LATEST}"
            )
        return round(seconds * 1e9)

    def tracks(self) -> list[int]:
        """Track ids; UNKNOWN_TRACK where there is none. Raises UserError for no whole number."""
        if not self.has(TRACK):
            return [UNKNOWN_TRACK] * len(self._rows)
        return [self._track(line, text) for line, text in self._cells(TRACK)]

    def _track(self, line: int, text: str) -> int:
        """The id in one cell, to its last digit: a float has 53 of its 64 bits."""
        if not text:
            return UNKNOWN_TRACK
        try:
            track: int | None = int(_as_others_read(text))
        except ValueError:
            number = self._number(TRACK, line, text)
            if not isfinite(number):
                return UNKNOWN_TRACK
            track = int(number) if number.is_integer() else None
        if track is None or not -(2**63) <= track < 2**63:
            raise UserError(
                f"{self.path}: line {line}, column '{self.mapping.get(TRACK, TRACK)}': "
                f"{_clipped(text)} is no track id; a whole number of 64 bits is expected"
            )
        return track


def scalar_stream(table: Table, column: str, name: str) -> list[Sample]:
    """The samples of one column; blank = no sample."""
    return [
        ScalarSample(name, stamp, value)
        for stamp, value in zip(table.stamps(), table.column(column), strict=True)
        if value is not None
    ]


def radar_stream(table: Table) -> list[Sample]:
    """The radar's scans; a blank range = the radar sees no target.

    Raises UserError where most rows are of the scan of the row before: those are all tracks.
    """
    stamps = table.stamps()
    repeated = sum(stamp == before for before, stamp in pairwise(stamps))
    if repeated > MOST_REPEATED * len(stamps):
        raise UserError(
            f"{table.path}: {repeated} of {len(stamps)} rows have the time of the row before, as "
            "all tracks of a radar have; one row per scan, that of the lead, is expected"
        )
    return [
        _scan(stamp, clearance, velocity, track)
        for stamp, clearance, velocity, track in zip(
            stamps,
            table.column(RANGE),
            table.column(RANGE_RATE),
            table.tracks(),
            strict=True,
        )
    ]


def _scan(stamp: int, clearance: float | None, velocity: float | None, track: int) -> Sample:
    """One row as a scan."""
    return RadarSample(
        stamp=stamp,
        has_target=clearance is not None,
        clearance=nan if clearance is None else clearance,
        relative_velocity=nan if clearance is None or velocity is None else velocity,
        track_id=track,
    )


def read_csv_streams(
    path: Path, mapping: dict[str, str], replaced: frozenset[str]
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The streams of a drive in one file, and what is to be said of it.

    Columns in `replaced` are not read.

    Raises UserError for a missing column, text that is no number or decreasing time.
    """
    table = Table(path, mapping)
    for name, column in mapping.items():
        if name not in (*COLUMNS, TRACK, LEAD_ACCEL):
            raise WrongOption(
                f"--map {name}: no such column of a drive; "
                f"there are: {', '.join((*COLUMNS, TRACK, LEAD_ACCEL))}"
            )
        if not table.has(name):
            raise WrongOption(
                f"{path}: --map {name}={column}: column '{column}' is missing; "
                f"there are: {table.there}"
            )
    missing = [
        mapping.get(column, column)
        for column in COLUMNS
        if column not in replaced and not table.has(column)
    ]
    if missing:
        raise UserError(f"{path}: column '{missing[0]}' is missing; there are: {table.there}")
    streams = {RADAR: radar_stream(table)}
    for column, name in SCALARS.items():
        if column not in replaced and (column in COLUMNS or table.has(column)):
            streams[name] = scalar_stream(table, column, name)
    return streams, [*table.remarks, *_row_per_signal(table), *_unread_ids(table)]


def _row_per_signal(table: Table) -> Iterator[str]:
    """A table whose rows carry either a range or what the host says of itself.

    Its own blank ranges are empty roads, as in any other: in each of the host's rows.
    """
    ranges = table.filled(RANGE)
    host = [any(row) for row in zip(table.filled(SPEED), table.filled(ACCEL), strict=True)]
    if not any(host):
        return
    blank = [of_host for there, of_host in zip(ranges, host, strict=True) if not there]
    alone = [not of_host for there, of_host in zip(ranges, host, strict=True) if there]
    if not alone or sum(alone) < NEARLY_ALL * len(alone) or sum(blank) < MANY * len(blank):
        return
    options = [f"--map {name}={column}" for name, column in table.mapping.items()]
    options += [
        f"--{option} {table.path}:{table.mapping.get(column, column)}"
        for option, column in (("accel", ACCEL), ("speed", SPEED))
        if any(table.filled(column))
    ]
    yield (
        f"a row per signal: {sum(alone)} of {len(alone)} rows with a range have no host value, "
        f"{sum(blank)} of {len(blank)} without one have, and in each of these the radar counts as "
        "one that sees no lead; copy the rows without host values into RADAR.csv, then "
        f"import_drive RADAR.csv {' '.join(options)} -o OUT.mcap"
    )


def _unread_ids(table: Table) -> Iterator[str]:
    """Columns that may be track ids under another name."""
    names = [name for name in table.header if LIKE_IDS.search(name)]
    if names and not table.has(TRACK):
        yield (
            f"no {TRACK} is read, though '{_clipped(names[0])}' may be one "
            f"(--map {TRACK}={_clipped(names[0])}): without ids another car that is just as fast "
            "is a fault"
        )


def read_csv_as_it_is(
    path: Path, mapping: dict[str, str]
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The streams of a CSV file that may be no drive, and what is to be said of it.

    Time may decrease, columns may be missing.
    Raises UserError for a file that cannot be read, has no time, or has text that is no number.
    """
    table = Table(path, mapping)
    times = table.times()
    columns = {
        name: list(table.column(name)) if table.has(name) else [None] * len(times)
        for name in (*COLUMNS[1:], LEAD_ACCEL)
    }
    tracks = table.tracks()
    streams: dict[str, list[Sample]] = {RADAR: [], **{name: [] for name in SCALARS.values()}}
    for row, stamp in enumerate(times):
        if stamp is None:
            continue
        clearance, velocity = columns[RANGE][row], columns[RANGE_RATE][row]
        if table.has(RANGE):
            streams[RADAR].append(_scan(stamp, clearance, velocity, tracks[row]))
        for column, name in SCALARS.items():
            value = columns[column][row]
            if value is not None:
                streams[name].append(ScalarSample(name, stamp, value))
    return streams, [*table.remarks, *_row_per_signal(table), *_unread_ids(table)]
