"""Any drive by its path: CSV file, bag, CAN log or a folder of a public data set."""

import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import isfinite
from pathlib import Path

import numpy as np

from lfd_mpc.collector import without_collector
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, Sample, ScalarSample
from lfd_replay.drive import Drive, make_drive, partly_there
from lfd_replay.drive_bag import OPTIONS, Topics, read_bag_streams
from lfd_replay.drive_csv import read_csv_as_it_is, read_csv_streams
from lfd_replay.errors import WrongOption
from lfd_replay.paths import named_path
from lfd_replay.placeholders import placeholders
from lfd_replay.recordings.can_log import SUFFIXES as CAN_SUFFIXES
from lfd_replay.recordings.can_log import HostSignals, read_can_streams
from lfd_replay.recordings.comma2k19 import is_segment, read_segment_streams
from lfd_replay.recordings.recorded_messages import Mounting
from lfd_replay.units import odd_units

BAG_SUFFIXES = (".mcap", ".db3", ".bag")
DRIVE_SUFFIXES = (*BAG_SUFFIXES, *CAN_SUFFIXES, ".csv")
"""Of files that are drives, in any case."""

NAMED = 10
"""Drives of a folder that a message names; more are counted."""

DRIVE_HELP = "CSV file, bag, CAN log or folder of a segment"
"""What every command on drives takes."""

KINDS = BAG, SEGMENT, CAN_LOG, CSV = "a bag", "a comma2k19 segment", "a CAN log", "a CSV drive"
"""Kinds of recordings, in words."""

MEANT_FOR = {
    "--map": (CSV,),
    # The others hold one axis of the car.
    "--imu-rotation": (BAG, SEGMENT),
    "--host-dbc": (BAG, CAN_LOG),
    **dict.fromkeys(OPTIONS.values(), (BAG,)),
}
"""The kinds that an option can apply to."""

STANDSTILL = "standstill"
STANDING = 0.05
"""Host speed in m/s below which the car stands."""

STANDING_SAMPLES = 100
"""Accelerations at standstill from which an offset is told."""


@dataclass(frozen=True)
class ReadOptions:
    """How a recording is to be understood; `standstill`: the offset is what it shows standing."""

    mapping: dict[str, str] = field(default_factory=dict)
    topics: Topics = Topics()
    mounting: Mounting = Mounting()
    standstill: bool = False
    host: HostSignals | None = None


def add_read_options(parser: argparse.ArgumentParser) -> None:
    """Options of every command that reads drives."""
    group = parser.add_argument_group("recordings that are no drives yet")
    group.add_argument(
        "--map",
        action="append",
        default=[],
        metavar="NAME=COLUMN",
        help="own column name of a CSV drive, such as range_m=dist; may be repeated",
    )
    for name, option in OPTIONS.items():
        group.add_argument(option, metavar="TOPIC", help=f"topic of the {name} (default: by type)")
    group.add_argument(
        "--imu-rotation",
        metavar="ROLL,PITCH,YAW",
        default="0,0,0",
        help="how the accelerometer is turned in the car, in degrees; 0,0,180 = backwards",
    )
    group.add_argument(
        "--imu-offset",
        metavar="VALUE",
        default="0",
        help=f"constant offset of the accelerometer in m/s^2, or {STANDSTILL}: what it shows "
        "while the car stands",
    )
    group.add_argument(
        "--host-dbc", type=named_path, metavar="FILE", help="DBC of the car's own CAN"
    )
    group.add_argument("--speed-signal", metavar="NAME", help="its signal of the host speed")
    group.add_argument("--accel-signal", metavar="NAME", help="its signal of the acceleration")


def read_options(options: argparse.Namespace) -> ReadOptions:
    """Options of reading from a parsed command line. Raises UserError."""
    standstill = options.imu_offset == STANDSTILL
    rotation = _numbers("--imu-rotation", options.imu_rotation, 3)
    offset = 0.0 if standstill else _numbers("--imu-offset", options.imu_offset, 1)[0]
    signals = (options.speed_signal, options.accel_signal)
    if options.host_dbc is None and any(signals):
        raise UserError("--speed-signal and --accel-signal need --host-dbc FILE")
    if options.host_dbc is not None and not any(signals):
        raise UserError("--host-dbc needs --speed-signal NAME, --accel-signal NAME or both")
    for what, topic, signal in (
        ("speed", options.speed_topic, options.speed_signal),
        ("accel", options.accel_topic, options.accel_signal),
    ):
        if topic and signal:
            raise UserError(f"--{what}-topic {topic} and --{what}-signal {signal}: give one")
    return ReadOptions(
        mapping=parse_mapping(options.map),
        topics=Topics(
            options.radar_topic,
            options.accel_topic,
            options.speed_topic,
            options.lead_acceleration_topic,
        ),
        mounting=Mounting((rotation[0], rotation[1], rotation[2]), offset),
        standstill=standstill,
        host=None if options.host_dbc is None else HostSignals(options.host_dbc, *signals),
    )


def files_read(options: argparse.Namespace, *drives: Path | None) -> list[Path]:
    """What a command reads: drives, further files where given, and those of reading options."""
    return [path for path in (*drives, options.host_dbc) if path is not None]


def _numbers(option: str, text: str, count: int) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(map(isfinite, values)):
        wanted = "a number is" if count == 1 else f"{count} numbers with commas between are"
        raise UserError(f"{option} {text}: {wanted} expected")
    return values


def is_bag(path: Path) -> bool:
    """Whether a path looks like a bag: a file of such a kind, or a folder."""
    return path.suffix.lower() in BAG_SUFFIXES or (path / "metadata.yaml").is_file()


def is_drive(path: Path) -> bool:
    """Whether a path looks like one drive: a file of a known kind, a bag folder or a segment."""
    if path.is_dir():
        return (path / "metadata.yaml").is_file() or is_segment(path)
    return path.suffix.lower() in DRIVE_SUFFIXES


def _kind(path: Path) -> str:
    """What a path holds: one of `KINDS`. Raises UserError for anything else."""
    if not path.exists():
        raise UserError(f"{path}: no such file{_neighbours(path)}")
    if not (path.is_file() or path.is_dir()):
        # Opening a pipe that nobody writes to waits for ever.
        raise UserError(f"{path}: is a pipe or a device; a file or a folder is expected")
    if is_bag(path):
        return BAG
    if path.is_dir() and is_segment(path):
        return SEGMENT
    if path.is_dir():
        raise UserError(
            f"{path}: is a folder without metadata.yaml or processed_log; a bag folder or a "
            "comma2k19 segment is expected"
        )
    if path.suffix.lower() in CAN_SUFFIXES:
        return CAN_LOG
    if path.suffix.lower() == ".csv":
        return CSV
    raise UserError(
        f"{path}: is no drive; a .csv file, a bag folder, a CAN log "
        f"({', '.join(CAN_SUFFIXES)}) or one of {', '.join(BAG_SUFFIXES)} is expected"
    )


def _refuse_what_cannot_apply(path: Path, kind: str, options: ReadOptions) -> None:
    given = {
        "--map": options.mapping,
        "--imu-rotation": any(options.mounting.rotation),
        "--host-dbc": options.host,
        **{option: vars(options.topics)[name] for name, option in OPTIONS.items()},
    }
    for option, value in given.items():
        if value and kind not in MEANT_FOR[option]:
            meant = " or ".join(MEANT_FOR[option])
            raise WrongOption(f"{path}: {option} is for {meant}, and this is {kind}")


def read_streams(
    path: Path, options: ReadOptions | None = None
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The streams of a recording, and what is to be said of it. Raises UserError."""
    options = options or ReadOptions()
    streams, remarks = read_as_recorded(path, options)
    return without_offset(path, streams, options), remarks


def read_as_recorded(
    path: Path, options: ReadOptions, replaced: frozenset[str] = frozenset()
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The same with the accelerometer's offset; columns of a CSV in `replaced` are not read."""
    kind = _kind(path)
    _refuse_what_cannot_apply(path, kind, options)
    # What has been replaced has an offset, too: it is taken off afterwards, for all kinds alike.
    mounting = replace(options.mounting, offset=0.0)
    if kind == BAG:
        return read_bag_streams(path, options.topics, mounting, options.host)
    if kind == SEGMENT:
        return read_segment_streams(path, mounting)
    if kind == CAN_LOG:
        return read_can_streams(path, options.host)
    return read_csv_streams(path, options.mapping, replaced)


def read_as_it_is(
    path: Path, options: ReadOptions
) -> tuple[dict[str, list[Sample]], list[str]] | None:
    """The same of a bag or CSV file that is no drive: each input by itself, as far as it is there.

    None for another kind of recording. Raises UserError.
    """
    kind = _kind(path)
    if kind == BAG:
        mounting = replace(options.mounting, offset=0.0)
        streams, remarks = read_bag_streams(path, options.topics, mounting, options.host, True)
    elif kind == CSV:
        streams, remarks = read_csv_as_it_is(path, options.mapping)
    else:
        return None
    return without_offset(path, streams, options), remarks


def without_offset(
    path: Path, streams: dict[str, list[Sample]], options: ReadOptions
) -> dict[str, list[Sample]]:
    """Streams less the accelerometer's offset. Raises UserError where no standstill tells it."""
    felt = [s for s in streams[ACCELERATION] if isinstance(s, ScalarSample)]
    offset = options.mounting.offset
    if options.standstill:
        offset = _felt_at_standstill(path, felt, streams.get(HOST_SPEED, []))
    if not offset:
        return streams
    level = [ScalarSample(ACCELERATION, s.stamp, s.value - offset) for s in felt]
    return {**streams, ACCELERATION: [*level]}


def _felt_at_standstill(path: Path, felt: list[ScalarSample], driven: list[Sample]) -> float:
    """Median of the accelerations in m/s^2 while the host stands."""
    speed = [s for s in driven if isinstance(s, ScalarSample)]
    felt = [s for s in felt if isfinite(s.value)]
    times = np.array([s.stamp for s in speed], dtype=float)
    standing = (
        np.interp([s.stamp for s in felt], times, [abs(s.value) for s in speed]) < STANDING
        if len(times)
        else np.zeros(len(felt), dtype=bool)
    )
    if standing.sum() < STANDING_SAMPLES:
        raise WrongOption(
            f"{path}: --imu-offset {STANDSTILL}: the car stands for {standing.sum()} accelerations "
            f"only, {STANDING_SAMPLES} are needed; give the offset in m/s^2"
        )
    return float(np.median([s.value for s, still in zip(felt, standing, strict=True) if still]))


def read_drive(path: Path, options: ReadOptions | None = None) -> Drive:
    """Read a drive. Raises UserError with one clear line for anything that is not one."""
    with without_collector():
        return as_read(path, *read_streams(path, options))


def as_read(path: Path, streams: dict[str, list[Sample]], remarks: Iterable[str]) -> Drive:
    """A drive of what was read from a path, and all that there is to warn of. Raises UserError."""
    drive = make_drive(str(path), streams)
    return replace(drive, warnings=(*remarks, *drive.warnings, *oddities(streams)))


def oddities(streams: dict[str, list[Sample]]) -> Iterator[str]:
    """What readers of a recording, and those who inspect it, are told of what its inputs say."""
    yield from partly_there(streams)
    yield from odd_units(streams)
    yield from placeholders(streams)


def _neighbours(path: Path) -> str:
    """What drives are there instead."""
    if not path.parent.is_dir():
        return f"; there is no folder {path.parent} either"
    there = sorted(p.name for p in path.parent.iterdir() if p.suffix.lower() in DRIVE_SUFFIXES)
    more = f" and {len(there) - NAMED} more" if len(there) > NAMED else ""
    return f"; in {path.parent} there are: {', '.join(there[:NAMED])}{more}" if there else ""


def parse_mapping(texts: Sequence[str]) -> dict[str, str]:
    """`--map NAME=COLUMN` options as a dictionary. Raises UserError for another form."""
    mapping = {}
    for text in texts:
        name, equals, column = text.partition("=")
        if not (name and equals and column):
            raise UserError(f"--map {text}: NAME=COLUMN is expected")
        mapping[name] = column
    return mapping
