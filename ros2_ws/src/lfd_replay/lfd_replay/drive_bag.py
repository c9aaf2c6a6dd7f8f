"""Drives as bags: rosbag2 (MCAP or sqlite3) and ROS 1."""

import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lfd_mpc.errors import UserError
from lfd_mpc.printed import DISK_FULL
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, LEAD_ACCELERATION, RADAR, RadarSample, Sample
from lfd_replay.drive import Drive, playing_times
from lfd_replay.errors import WrongOption
from lfd_replay.paths import share_folder
from lfd_replay.recordings.can_log import HostSignals
from lfd_replay.recordings.message_definitions import DEFINITIONS
from lfd_replay.recordings.plain_imu import DEFINITION, IMU, LAYOUT, PLAIN_IMU
from lfd_replay.recordings.recorded_messages import (
    CAN_FRAME,
    ESR_STATUS_4,
    ESR_TRACK,
    HOST_FRAME,
    TYPES,
    MessageConverter,
    Mounting,
)

HORIZON_TYPE = "lfd_msgs/msg/PredictionHorizon"

TOPICS = {
    RADAR: ("/radar/target", "lfd_msgs/msg/RadarTarget"),
    ACCELERATION: ("/vehicle/imu", "sensor_msgs/msg/Imu"),
    HOST_SPEED: ("/vehicle/twist", "geometry_msgs/msg/TwistStamped"),
    LEAD_ACCELERATION: ("/v2v/lead_acceleration", "geometry_msgs/msg/AccelStamped"),
}
"""Topic and type of each input in a bag."""

OPTIONS = {
    RADAR: "--radar-topic",
    ACCELERATION: "--accel-topic",
    HOST_SPEED: "--speed-topic",
    LEAD_ACCELERATION: "--lead-acceleration-topic",
}
"""The option that names the topic of each input."""


@cache
def typestore() -> Typestore:
    """ROS 2 Jazzy's types, those of lfd_msgs, and those of recordings."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for file in sorted((share_folder("lfd_msgs") / "msg").glob("*.msg")):
        store.register(get_types_from_msg(file.read_text(), f"lfd_msgs/msg/{file.stem}"))
    for name, definition in DEFINITIONS.items():
        if name not in store.types:
            store.register(get_types_from_msg(definition, name))
    return store


class _TypesIfNeeded:
    """Stands for `typestore()`, which takes 0.15 s to make and which few bags need."""

    @property
    def fielddefs(self) -> Any:
        return typestore().fielddefs


@dataclass(frozen=True)
class Topics:
    """Topics to read each input from; None = found by type."""

    radar: str | None = None
    acceleration: str | None = None
    host_speed: str | None = None
    lead_acceleration: str | None = None


@contextmanager
def _with_known_name(path: Path) -> Iterator[Path]:
    """The path of a bag under which rosbags knows its kind: it heeds the suffix's case."""
    if path.suffix == path.suffix.lower() or path.is_dir():
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="lfd-") as folder:
        known = Path(folder) / f"bag{path.suffix.lower()}"
        known.symlink_to(path.resolve())
        yield known


@contextmanager
def open_bag(path: Path) -> Iterator[AnyReader]:
    """A bag to read. Raises UserError for one that cannot be read, then or while it is read."""
    try:
        with (
            _with_known_name(path) as known,
            AnyReader([known], default_typestore=_TypesIfNeeded()) as reader,
        ):
            yield reader
    except UserError:
        raise
    except Exception as error:  # whatever a damaged file makes a parser raise
        detail = " ".join(str(error).split()) or type(error).__name__
        raise UserError(
            f"{path}: cannot be read as a bag ({detail[:200]}); a whole MCAP, sqlite3 or ROS 1 bag "
            "is expected"
        ) from error


def read_bag_streams(
    path: Path,
    topics: Topics,
    mounting: Mounting,
    host: HostSignals | None,
    lacking: bool = False,
) -> tuple[dict[str, list[Sample]], list[str]]:
    """The streams of a bag, each in the order of its recording, and what is to be said of it.

    Raises UserError for a bag that cannot be read, and unless it may be `lacking` for one without
    a topic for an input, or with more than one.
    """
    converter = MessageConverter(mounting, host)
    streams: dict[str, list[Sample]] = {name: [] for name in TOPICS}
    with open_bag(path) as reader:
        wanted = vars(topics)
        on_can = () if host is None else host.inputs
        chosen = []
        for name in TOPICS:
            if name not in on_can:
                with _passed_over(lacking):
                    chosen += _choose(path, reader, name, wanted[name])
        # Last, so that frames that hold the radar as well are known for it.
        kinds = {c.id: HOST_FRAME for c in _host_frames(path, reader, on_can)}
        kinds |= {c.id: read_as(reader, c.msgtype) for c in chosen}
        types = {i: CAN_FRAME if kind == HOST_FRAME else kind for i, kind in kinds.items()}
        connections = [c for c in reader.connections if c.id in kinds]
        # No connections at all would stand for all that there are.
        messages = reader.messages(connections=connections) if connections else ()
        for connection, received, raw in messages:
            message = reader.deserialize(raw, types[connection.id])
            for sample in converter.push(kinds[connection.id], message, received):
                streams[sample.input].append(sample)
    for sample in converter.flush():
        streams[sample.input].append(sample)
    return streams, [f"{count} {what}" for what, count in converter.counts.items() if count]


def read_as(reader: AnyReader, message_type: str) -> str:
    """The type as which messages of a bag are best read."""
    if message_type != IMU or not reader.is2 or reader.typestore.hash_rihs01(IMU) != LAYOUT:
        return message_type
    if PLAIN_IMU not in reader.typestore.types:
        reader.typestore.register(get_types_from_msg(DEFINITION, PLAIN_IMU))
    return PLAIN_IMU


@contextmanager
def _passed_over(lacking: bool) -> Iterator[None]:
    """An input that a bag lacks raises UserError unless it may be `lacking`."""
    try:
        yield
    except WrongOption:
        raise
    except UserError:
        if not lacking:
            raise


def _there(reader: AnyReader) -> str:
    return ", ".join(sorted(f"{c.topic} ({c.msgtype})" for c in reader.connections)) or "no topics"


def _host_frames(path: Path, reader: AnyReader, on_can: tuple[str, ...]) -> list[Any]:
    """The connections that may carry host signals. Raises UserError where there is none."""
    frames = [c for c in reader.connections if on_can and c.msgtype == CAN_FRAME]
    if on_can and not frames:
        raise WrongOption(
            f"{path}: --host-dbc: no topic of type {CAN_FRAME}; there are: {_there(reader)}"
        )
    return frames


def _choose(path: Path, reader: AnyReader, name: str, topic: str | None) -> list[Any]:
    """The connections that carry one input: those of a topic, or found by type.

    Raises UserError where there is none, or more than one that could be meant.
    """
    there = _there(reader)
    option = OPTIONS[name]
    if topic is not None:
        chosen = [c for c in reader.connections if c.topic == topic]
        if not chosen:
            raise WrongOption(f"{path}: {option} {topic}: no such topic; there are: {there}")
        if chosen[0].msgtype not in TYPES[name]:
            raise WrongOption(
                f"{path}: {option} {topic}: is {chosen[0].msgtype}; one of "
                f"{', '.join(TYPES[name])} is expected"
            )
        return _with_status(reader, chosen)
    for msgtype in TYPES[name]:
        found = [c for c in reader.connections if c.msgtype == msgtype]
        if name == LEAD_ACCELERATION:
            # Many things are accelerations; only the topic says whose it is.
            found = [c for c in found if c.topic.endswith(TOPICS[name][0])]
        if len({c.topic for c in found}) > 1:
            found = [c for c in found if c.topic.endswith(TOPICS[name][0])] or found
        if len({c.topic for c in found}) > 1:
            candidates = ", ".join(sorted({c.topic for c in found}))
            raise UserError(
                f"{path}: more than one topic of type {msgtype}: {candidates}; "
                f"choose one with {option}"
            )
        if found:
            return _with_status(reader, found)
    if name in (HOST_SPEED, LEAD_ACCELERATION):
        return []
    raise UserError(
        f"{path}: no topic of type {' or '.join(TYPES[name])} for {TOPICS[name][0]}; "
        f"there are: {there}"
    )


def _with_status(reader: AnyReader, chosen: list[Any]) -> list[Any]:
    """With the tracks of an ESR goes the message that names the one in its path."""
    if chosen[0].msgtype != ESR_TRACK:
        return chosen
    return chosen + [c for c in reader.connections if c.msgtype == ESR_STATUS_4]


def sample_message(sample: Sample) -> tuple[str, str, Any]:
    """Topic, type and `rosbags` message of one sample."""
    types = typestore().types
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](
            sec=sample.stamp // 1_000_000_000, nanosec=sample.stamp % 1_000_000_000
        ),
        frame_id="",
    )
    topic, msgtype = TOPICS[sample.input]
    if isinstance(sample, RadarSample):
        message = types[msgtype](
            header=header,
            track_id=sample.track_id,
            has_target=sample.has_target,
            clearance=sample.clearance,
            relative_velocity=sample.relative_velocity,
            sensor_flags=sample.sensor_flags,
            sensor_text=sample.sensor_text,
        )
        return topic, msgtype, message
    vector, zero = types["geometry_msgs/msg/Vector3"], 0.0
    forward = vector(x=sample.value, y=zero, z=zero)
    nothing = vector(x=zero, y=zero, z=zero)
    if sample.input == HOST_SPEED:
        twist = types["geometry_msgs/msg/Twist"](linear=forward, angular=nothing)
        return topic, msgtype, types[msgtype](header=header, twist=twist)
    if sample.input == LEAD_ACCELERATION:
        accel = types["geometry_msgs/msg/Accel"](linear=forward, angular=nothing)
        return topic, msgtype, types[msgtype](header=header, accel=accel)
    unknown = np.array([-1.0] + [0.0] * 8)
    message = types[msgtype](
        header=header,
        orientation=types["geometry_msgs/msg/Quaternion"](x=zero, y=zero, z=zero, w=1.0),
        orientation_covariance=unknown,
        angular_velocity=nothing,
        angular_velocity_covariance=unknown,
        linear_acceleration=forward,
        linear_acceleration_covariance=np.zeros(9),
    )
    return topic, msgtype, message


def _log_times(samples: Sequence[Sample]) -> list[int]:
    """When each sample is logged, in ns: at its stamp, and later than what its topic says before.

    Readers go by that time: where stamps go back it goes on, or loops would lie in each other.
    """
    last: dict[str, int] = {}
    times = []
    for sample, elapsed in zip(samples, playing_times(samples), strict=True):
        time = max(samples[0].stamp + elapsed, last.get(sample.input, -1) + 1)
        last[sample.input] = time
        times.append(time)
    return times


def write_drive(drive: Drive, out: Path) -> None:
    """Write a drive as one MCAP file that reads back as it is. Nothing half-written is left.

    Log time is the stamp, as long as time goes on.

    Raises UserError for a name that is not `.mcap` and where nothing can be written.
    """
    if out.suffix != ".mcap":
        raise UserError(f"{out}: a drive is written as MCAP; the name must end in .mcap")
    if drive.samples and drive.samples[0].stamp < 0:
        raise UserError(
            f"{drive.name}: begins at {drive.samples[0].stamp * 1e-9:.3f} s; a bag holds no time "
            "below 0"
        )
    times = _log_times(drive.samples)
    rows = ((at, *sample_message(s)) for at, s in zip(times, drive.samples, strict=True))
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=".writing-") as folder:
            bag = Path(folder) / "bag"
            write_bag(rows, bag)
            (written,) = bag.glob("*.mcap")
            written.replace(out)
    except OSError as error:
        raise UserError(f"{out}: cannot be written ({error.strerror or error})") from error


def write_bag(rows: Iterable[tuple[int, str, str, Any]], folder: Path) -> None:
    """Write rows of (log time in ns, topic, type, message or serialised bytes) as a bag folder."""
    store = typestore()
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for stamp, topic, msgtype, message in rows:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, msgtype, typestore=store)
            if isinstance(message, bytes):
                # CDR padding of other writers is uninitialised memory; this one zeroes it.
                message = store.deserialize_cdr(message, msgtype)
            raw = store.serialize_cdr(message, msgtype)
            writer.write(connections[topic], stamp, raw)


def write_what_fits(rows: list[tuple[int, str, str, Any]], folder: Path) -> int:
    """Write the first rows as a whole bag, as many as the disk takes; returns how many.

    Raises OSError where none can be written.
    """
    count = len(rows)
    while True:
        try:
            write_bag(rows[:count], folder)
        except OSError as error:
            shutil.rmtree(folder, ignore_errors=True)
            if error.errno not in DISK_FULL or not count:
                raise
            count //= 2
        else:
            return count


def refuse_others_bag(folder: Path) -> None:
    """Raises UserError where a folder is there that is no bag which a run has left.

    Such a bag holds what no other does: the name that `write_bag` gives, and each step's horizon.
    """
    if not os.path.lexists(folder):
        return
    try:
        names = {entry.name for entry in folder.iterdir()}
        ours = not names
        if names == {"metadata.yaml", f"{folder.name}.mcap"}:
            text = (folder / "metadata.yaml").read_text(errors="replace")
            ours = HORIZON_TYPE in text or "\n  message_count: 0\n" in text
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror})") from error
    if not ours:
        raise UserError(
            f"{folder}: cannot be written: it is no bag that a run has left, and stays as it is; "
            "another --out is expected"
        )


def replace_folder(new: Path, old: Path) -> None:
    """Put a finished bag in the place of an older one, which goes beside the new one's place.

    Raises UserError where the older one is somebody else's.
    """
    refuse_others_bag(old)
    if old.exists():
        old.replace(new.with_name("older"))
    new.replace(old)
