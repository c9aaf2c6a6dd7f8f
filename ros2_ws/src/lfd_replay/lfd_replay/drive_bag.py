"""Drives as bags: rosbag2 (MCAP or sqlite3) and ROS 1."""

import shutil
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from lfd_mpc.errors import UserError
from lfd_mpc.sampling import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample, ScalarSample
from lfd_replay.drive import Drive
from lfd_replay.paths import share_folder

TOPICS = {
    RADAR: ("/radar/target", "lfd_msgs/msg/RadarTarget"),
    ACCELERATION: ("/vehicle/imu", "sensor_msgs/msg/Imu"),
    HOST_SPEED: ("/vehicle/twist", "geometry_msgs/msg/TwistStamped"),
}
"""Topic and type of each input in a bag."""


@cache
def typestore() -> Typestore:
    """ROS 2 Jazzy's types and those of lfd_msgs."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for file in sorted((share_folder("lfd_msgs") / "msg").glob("*.msg")):
        store.register(get_types_from_msg(file.read_text(), f"lfd_msgs/msg/{file.stem}"))
    return store


def _nanoseconds(header: Any) -> int:
    return header.stamp.sec * 1_000_000_000 + header.stamp.nanosec


def _radar(message: Any) -> Sample:
    return RadarSample(
        stamp=_nanoseconds(message.header),
        has_target=bool(message.has_target),
        clearance=float(message.clearance),
        relative_velocity=float(message.relative_velocity),
        track_id=int(message.track_id),
    )


def _acceleration(message: Any) -> Sample:
    stamp = _nanoseconds(message.header)
    return ScalarSample(ACCELERATION, stamp, float(message.linear_acceleration.x))


def _host_speed(message: Any) -> Sample:
    return ScalarSample(HOST_SPEED, _nanoseconds(message.header), float(message.twist.linear.x))


_CONVERT: dict[str, Callable[[Any], Sample]] = {
    RADAR: _radar,
    ACCELERATION: _acceleration,
    HOST_SPEED: _host_speed,
}


def read_bag_streams(path: Path) -> dict[str, list[Sample]]:
    """The streams of a bag, each in the order of its recording.

    Raises UserError for a bag that cannot be read or lacks a topic.
    """
    try:
        with AnyReader([path], default_typestore=typestore()) as reader:
            chosen = {name: _choose(path, reader, name) for name in TOPICS}
            by_id = {c.id: name for name, c in chosen.items() if c is not None}
            streams: dict[str, list[Sample]] = {name: [] for name in TOPICS}
            connections = [c for c in chosen.values() if c is not None]
            for connection, _, raw in reader.messages(connections=connections):
                name = by_id[connection.id]
                message = reader.deserialize(raw, connection.msgtype)
                streams[name].append(_CONVERT[name](message))
            return streams
    except UserError:
        raise
    except Exception as error:  # whatever a damaged file makes a parser raise
        detail = " ".join(str(error).split()) or type(error).__name__
        raise UserError(
            f"{path}: cannot be read as a bag ({detail[:200]}); a whole MCAP, sqlite3 or ROS 1 bag "
            "is expected"
        ) from error


def _choose(path: Path, reader: AnyReader, name: str) -> Any:
    """The connection that carries one input: by type, and by name where there are several."""
    topic, msgtype = TOPICS[name]
    found = [c for c in reader.connections if c.msgtype == msgtype]
    if len(found) > 1:
        found = [c for c in found if c.topic.endswith(topic)] or found
    if found:
        return found[0]
    if name == HOST_SPEED:
        return None
    there = ", ".join(sorted(f"{c.topic} ({c.msgtype})" for c in reader.connections))
    raise UserError(
        f"{path}: no topic of type {msgtype} for {topic}; there are: {there or 'no topics'}"
    )


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
            sensor_flags=0,
            sensor_text="",
        )
        return topic, msgtype, message
    vector, zero = types["geometry_msgs/msg/Vector3"], 0.0
    forward = vector(x=sample.value, y=zero, z=zero)
    nothing = vector(x=zero, y=zero, z=zero)
    if sample.input == HOST_SPEED:
        twist = types["geometry_msgs/msg/Twist"](linear=forward, angular=nothing)
        return topic, msgtype, types[msgtype](header=header, twist=twist)
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


def write_drive(drive: Drive, out: Path) -> None:
    """Write a drive as one MCAP file; log time is the stamp. Nothing half-written is left.

    Raises UserError for a name that is not `.mcap` and where nothing can be written.
    """
    if out.suffix != ".mcap":
        raise UserError(f"{out}: a drive is written as MCAP; the name must end in .mcap")
    rows = ((sample.stamp, *sample_message(sample)) for sample in drive.samples)
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


def replace_folder(new: Path, old: Path) -> None:
    """Put a finished folder in the place of an older one."""
    if old.exists():
        shutil.rmtree(old)
    new.replace(old)
