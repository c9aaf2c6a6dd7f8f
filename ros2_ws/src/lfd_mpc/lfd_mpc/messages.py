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


def set_time(time: Time, stamp: int) -> None:
    """Set a message time to so many nanoseconds."""
    time.sec, time.nanosec = divmod(stamp, 1_000_000_000)


def _as_sequence(value: NDArray, typecode: str | None) -> array | list:
    return value.tolist() if typecode is None else array(typecode, value.tobytes())


def _as_array(value: array | list | NDArray) -> NDArray:
    if isinstance(value, array):
        return np.frombuffer(value, dtype=value.typecode)
    return np.asarray(value)


_Writing = tuple[tuple[str, ...], tuple[Callable[[Any, Any], None], ...]]


@cache
def _writing(kind: type, message_type: type) -> _Writing:
    """Names of the fields that are taken as they are, and what sets the others."""
    example, plain, others = message_type(), [], []
    for name in (field.name for field in fields(kind)):
        old = getattr(example, name, None)
        if name == "stamp":
            others.append(lambda record, made: set_time(made.header.stamp, record.stamp))
        elif isinstance(old, Time):
            others.append(
                lambda record, made, n=name: set_time(getattr(made, n), getattr(record, n))
            )
        elif hasattr(old, "get_fields_and_field_types"):
            others.append(
                lambda record, made, n=name: to_message(getattr(record, n), getattr(made, n))
            )
        elif isinstance(old, (array, list)):
            code = old.typecode if isinstance(old, array) else None
            others.append(
                lambda record, made, n=name, c=code: setattr(
                    made, n, _as_sequence(getattr(record, n), c)
                )
            )
        else:
            plain.append(name)
    return tuple(plain), tuple(others)


def to_message(record: Any, message: Message) -> Message:
    """Fill `message` from `record` and return it; what a step needs is found out once per type."""
    names, others = _writing(type(record), type(message))
    for name in names:
        setattr(message, name, getattr(record, name))
    for fill in others:
        fill(record, message)
    return message


_Reading = tuple[Callable[[Any], tuple], tuple[tuple[int, Callable[[Any], Any]], ...]]


@cache
def _reading(kind: type, message_type: type) -> _Reading:
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
