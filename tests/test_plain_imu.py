"""An Imu of a bag is read as plain numbers, and says the same so."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lfd_replay.drive_bag import read_as
from lfd_replay.recordings.plain_imu import IMU, PLAIN_IMU
from lfd_replay.recordings.recorded_messages import MessageConverter, Mounting


def reader_of(store: Any, is2: bool = True) -> Any:
    return SimpleNamespace(is2=is2, typestore=store)


def imu_of(store: Any, numbers: np.ndarray, measures_turns: bool) -> Any:
    """An Imu each of whose numbers is another one."""
    types = store.types

    def vector(first: int) -> Any:
        return types["geometry_msgs/msg/Vector3"](*numbers[first : first + 3].tolist())

    covariance = numbers[16:25].copy()
    if not measures_turns:
        covariance[0] = -1.0
    return types[IMU](
        header=types["std_msgs/msg/Header"](
            stamp=types["builtin_interfaces/msg/Time"](sec=7, nanosec=8), frame_id="odd name"
        ),
        orientation=types["geometry_msgs/msg/Quaternion"](*numbers[:4].tolist()),
        orientation_covariance=numbers[4:13],
        angular_velocity=vector(13),
        angular_velocity_covariance=covariance,
        linear_acceleration=vector(25),
        linear_acceleration_covariance=numbers[28:37],
    )


@pytest.mark.parametrize("measures_turns", [True, False])
@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (3.0, -20.0, 170.0)])
@pytest.mark.parametrize("little_endian", [True, False])
def test_it_says_what_an_imu_says(
    measures_turns: bool, rotation: tuple[float, float, float], little_endian: bool
) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    assert read_as(reader_of(store), IMU) == PLAIN_IMU
    message = imu_of(store, np.random.default_rng(1).normal(size=37), measures_turns)
    raw = store.serialize_cdr(message, IMU, little_endian=little_endian)
    said = []
    for message_type in (IMU, PLAIN_IMU):
        converter = MessageConverter(Mounting(rotation, 0.25))
        (sample,) = converter.push(message_type, store.deserialize_cdr(raw, message_type), 5)
        said.append((sample, converter._motion.yaw_rate))
    assert said[0] == said[1]
    assert said[0][0].stamp == 7_000_000_008
    assert (said[0][1] is not None) == measures_turns


def test_one_of_another_layout_is_read_as_its_bag_defines_it() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    other = get_typestore(Stores.EMPTY)
    definition = store.generate_msgdef(IMU)[0]
    other.register(get_types_from_msg("uint8 quality\n" + definition, IMU))
    assert read_as(reader_of(other), IMU) == IMU
    first = get_typestore(Stores.ROS1_NOETIC)
    assert read_as(reader_of(first, is2=False), IMU) == IMU


def test_other_types_are_read_as_they_are() -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    assert read_as(reader_of(store), "nav_msgs/msg/Odometry") == "nav_msgs/msg/Odometry"
    assert PLAIN_IMU not in store.types
