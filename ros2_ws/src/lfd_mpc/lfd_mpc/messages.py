"""Records to messages and back, by field name; imports no rclpy.

A record is a dataclass whose fields are named as the message's. Its `stamp` is the message's
`header.stamp`; times are integer nanoseconds in records.
"""

from array import array
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from enum import IntEnum
from functools import cache, partial
from operator import attrgetter
from typing import Any, TypeVar

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray

from lfd_mpc.samples import RadarSample
from lfd_msgs.msg import RadarTarget

Record = TypeVar("Record")
Message = TypeVar("Message")


def from_time(time: Time) -> int:
    """A message time as nanoseconds."""
    return time.sec * 1_000_000_000 + time.nanosec


def set_time(time: Time, stamp: int) -> None:
    """Set a message time to so many nanoseconds."""
    time.sec, time.nanosec = divmod(stamp, 1_000_000_000)


def to_time(stamp: int) -> Time:
    """Nanoseconds as a message time."""
    time = Time()
    set_time(time, stamp)
    return time


def _put_stamp(message: Any, _name: str, value: int) -> None:
    set_time(message.header.stamp, value)


def _put_time(message: Any, name: str, value: int) -> None:
    set_time(getattr(message, name), value)


def _put_record(message: Any, name: str, value: Any) -> None:
    to_message(value, getattr(message, name))


def _put_array(message: Any, name: str, value: NDArray) -> None:
    setattr(message, name, array(getattr(message, name).typecode, value.tobytes()))


def _put_list(message: Any, name: str, value: NDArray) -> None:
    setattr(message, name, value.tolist())


@cache
def _writing(kind: type, message_type: type) -> tuple[tuple[str, Callable], ...]:
    """Names of a record's fields, and what puts each into the message."""
    example, made = message_type(), []
    for field in fields(kind):
        old = getattr(example, field.name, None)
        if field.name == "stamp":
            put = _put_stamp
        elif isinstance(old, Time):
            put = _put_time
        elif hasattr(old, "get_fields_and_field_types"):
            put = _put_record
        elif isinstance(old, array):
            put = _put_array
        elif isinstance(old, list):
            put = _put_list
        else:
            put = setattr
        made.append((field.name, put))
    return tuple(made)


def to_message(record: Any, message: Message) -> Message:
    """Fill `message` from `record` and return it."""
    for name, put in _writing(type(record), type(message)):
        put(message, name, getattr(record, name))
    return message


def _as_array(value: array | list | NDArray) -> NDArray:
    if isinstance(value, array):
        return np.frombuffer(value, dtype=value.typecode)
    return np.asarray(value)


@cache
def _reading(kind: type, message_type: type) -> tuple[Callable, tuple[tuple[int, Callable], ...]]:
    """What gets a message's values in the order of the record's fields, and what converts which."""
    types, names, conversions = message_type.get_fields_and_field_types(), [], []
    for number, field in enumerate(fields(kind)):
        name, convert = field.name, None
        if name == "stamp":
            name, convert = "header.stamp", from_time
        elif is_dataclass(field.type):
            convert = partial(from_message, field.type)
        elif types[name] == "builtin_interfaces/Time":
            convert = from_time
        elif types[name].endswith((">", "]")):
            convert = _as_array
        elif isinstance(field.type, type) and issubclass(field.type, IntEnum):
            convert = field.type
        names.append(name)
        if convert is not None:
            conversions.append((number, convert))
    return attrgetter(*names), tuple(conversions)


def from_message(kind: type[Record], message: Any) -> Record:
    """The record of type `kind` that `message` carries."""
    get, conversions = _reading(kind, type(message))
    values = list(get(message))
    for number, convert in conversions:
        values[number] = convert(values[number])
    return kind(*values)


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
