"""Records to messages and back, by field name; imports no rclpy.

A record is a dataclass whose fields are named as the message's. Its `stamp` is the message's
`header.stamp`; times are integer nanoseconds in records.
"""

from array import array
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar

import numpy as np
from builtin_interfaces.msg import Time

from lfd_mpc.sampling import RadarSample
from lfd_msgs.msg import RadarTarget

Record = TypeVar("Record")
Message = TypeVar("Message")


def to_time(stamp: int) -> Time:
    """Nanoseconds as a message time."""
    return Time(sec=stamp // 1_000_000_000, nanosec=stamp % 1_000_000_000)


def from_time(time: Time) -> int:
    """A message time as nanoseconds."""
    return time.sec * 1_000_000_000 + time.nanosec


def to_message(record: Any, message: Message) -> Message:
    """Fill `message` from `record` and return it."""
    for field in fields(record):
        value = getattr(record, field.name)
        if field.name == "stamp":
            message.header.stamp = to_time(value)
            continue
        old = getattr(message, field.name)
        if is_dataclass(value):
            to_message(value, old)
        elif isinstance(old, Time):
            setattr(message, field.name, to_time(value))
        elif isinstance(value, np.ndarray) and isinstance(old, array):
            setattr(message, field.name, array(old.typecode, value.tobytes()))
        elif isinstance(value, np.ndarray):
            setattr(message, field.name, value.tolist())
        else:
            setattr(message, field.name, value)
    return message


def from_message(kind: type[Record], message: Any) -> Record:
    """The record of type `kind` that `message` carries."""
    values = {}
    for field in fields(kind):  # type: ignore[arg-type]
        if field.name == "stamp":
            values[field.name] = from_time(message.header.stamp)
            continue
        value = getattr(message, field.name)
        if is_dataclass(field.type):
            value = from_message(field.type, value)
        elif isinstance(value, array):
            value = np.frombuffer(value, dtype=value.typecode)
        elif isinstance(value, list):
            value = np.array(value)
        elif isinstance(value, Time):
            value = from_time(value)
        elif isinstance(field.type, type) and issubclass(field.type, int):
            value = field.type(value)
        values[field.name] = value
    return kind(**values)


def radar_sample(message: RadarTarget) -> RadarSample:
    """A radar message as the sampler takes it."""
    return RadarSample(
        stamp=from_time(message.header.stamp),
        has_target=message.has_target,
        clearance=message.clearance,
        relative_velocity=message.relative_velocity,
        track_id=message.track_id,
        sensor_flags=message.sensor_flags,
        sensor_text=message.sensor_text,
    )
