"""Messages of other people's cars become samples: the same in bags and on live topics.

Each converter takes anything with the message's fields, be it read from a bag or received. Stamps
are those of the headers; a header without a stamp counts as stamped when it was received.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import cos, radians, sin
from typing import Any

import numpy as np

from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RADAR,
    RadarSample,
    Sample,
    ScalarSample,
)
from lfd_replay.drive import LATEST
from lfd_replay.recordings.can_log import CanDrive, Frame, HostSignals
from lfd_replay.recordings.esr import ScanAssembler, esr_track, select_lead
from lfd_replay.recordings.lead_selection import HostMotion, LeadSelector, Track
from lfd_replay.recordings.plain_imu import (
    ANGULAR_VELOCITY,
    IMU,
    ITS_COVARIANCE,
    LINEAR_ACCELERATION,
    PLAIN_IMU,
)

ESR_TRACK, ESR_STATUS_4 = "delphi_esr_msgs/msg/EsrTrack", "delphi_esr_msgs/msg/EsrStatus4"
RADAR_TRACKS = "radar_msgs/msg/RadarTracks"
CAN_FRAME = "can_msgs/msg/Frame"
HOST_FRAME = "can_msgs/msg/Frame of the host"
"""A frame of a bus whose radar, if it has one, is not the one that counts."""

TYPES = {
    RADAR: ("lfd_msgs/msg/RadarTarget", ESR_TRACK, RADAR_TRACKS, CAN_FRAME),
    ACCELERATION: (IMU, "geometry_msgs/msg/AccelWithCovarianceStamped"),
    HOST_SPEED: ("geometry_msgs/msg/TwistStamped", "nav_msgs/msg/Odometry"),
    LEAD_ACCELERATION: ("geometry_msgs/msg/AccelStamped",),
}
"""Message types that carry each input; where a recording has several, the first one counts."""

STATIC, DYNAMIC = 1, 2
"""Classifications of a `radar_msgs/RadarTrack`."""


@dataclass(frozen=True)
class Mounting:
    """How an accelerometer sits in the car.

    `rotation`: roll, pitch and yaw of the sensor in the car in degrees; `offset` in m/s^2 is taken
    off the forward acceleration.
    """

    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset: float = 0.0

    def forward(self, x: float, y: float, z: float) -> float:
        """Forward acceleration of the car in m/s^2 from the sensor's own x, y and z."""
        if self.rotation == (0.0, 0.0, 0.0):
            return x - self.offset
        roll, pitch, yaw = map(radians, self.rotation)
        # First row of R = Rz(yaw) Ry(pitch) Rx(roll), which turns the sensor's axes into the car's.
        row = (
            cos(yaw) * cos(pitch),
            cos(yaw) * sin(pitch) * sin(roll) - sin(yaw) * cos(roll),
            cos(yaw) * sin(pitch) * cos(roll) + sin(yaw) * sin(roll),
        )
        return row[0] * x + row[1] * y + row[2] * z - self.offset

    def yaw_rate(self, x: float, y: float, z: float) -> float:
        """Yaw rate of the car in rad/s, positive to the left, from the sensor's own turn rates."""
        if self.rotation == (0.0, 0.0, 0.0):
            # An axis that does not count may be NaN.
            return z
        roll, pitch, _ = map(radians, self.rotation)
        # Third row of the same R.
        return -sin(pitch) * x + cos(pitch) * sin(roll) * y + cos(pitch) * cos(roll) * z


class MessageConverter:
    """Messages of one recording, or of one car, to samples; counts what is damaged."""

    def __init__(self, mounting: Mounting | None = None, host: HostSignals | None = None) -> None:
        """Raises UserError for a DBC file or signal that is not there."""
        self._mounting = mounting or Mounting()
        self._motion = HostMotion()
        self._can = CanDrive(host, self._motion)
        self.counts: Counter[str] = self._can.counts
        self._selector = LeadSelector(self.counts)
        self._assembler = ScanAssembler(self.counts)
        self._converters: dict[str, Callable[[Any, int], Iterable[Sample]]] = {
            "lfd_msgs/msg/RadarTarget": self._radar_target,
            ESR_TRACK: self._esr_track,
            ESR_STATUS_4: self._esr_status_4,
            RADAR_TRACKS: self._radar_tracks,
            CAN_FRAME: partial(self._can_frame, self._can.push),
            HOST_FRAME: partial(self._can_frame, self._can.push_host),
            IMU: self._imu,
            PLAIN_IMU: self._plain_imu,
            "geometry_msgs/msg/AccelWithCovarianceStamped": self._accel,
            "geometry_msgs/msg/TwistStamped": self._twist,
            "nav_msgs/msg/Odometry": self._odometry,
            "geometry_msgs/msg/AccelStamped": self._lead_acceleration,
        }

    def push(self, message_type: str, message: Any, received: int) -> Iterable[Sample]:
        """Take a message of a type in `TYPES` or `HOST_FRAME`, received at `received` (ns)."""
        header = message.header.stamp
        stamp = header.sec * 1_000_000_000 + header.nanosec
        if stamp >= LATEST * 1_000_000_000:
            # Its nanoseconds are more than a second of them, in the last seconds that there are.
            self.counts["messages without a possible stamp"] += 1
            return ()
        if not stamp and received:
            self.counts["messages without a stamp count as stamped when they were received"] += 1
        return self._converters[message_type](message, stamp or received)

    def push_frame(self, frame: Frame) -> Iterable[Sample]:
        """Take a frame as it comes from a bus itself."""
        return self._can.push(frame)

    def flush(self) -> Iterator[Sample]:
        """What the end of a recording has cut off."""
        for scan in self._assembler.flush():
            yield select_lead(self._selector, scan, self._motion)
        yield from self._can.flush()

    def _radar_target(self, message: Any, stamp: int) -> Iterable[Sample]:
        sample = RadarSample(
            stamp=stamp,
            has_target=bool(message.has_target),
            clearance=float(message.clearance),
            relative_velocity=float(message.relative_velocity),
            track_id=int(message.track_id),
            sensor_flags=int(message.sensor_flags),
            sensor_text=str(message.sensor_text),
        )
        return (sample,)

    def _esr_track(self, message: Any, stamp: int) -> Iterator[Sample]:
        track = esr_track(
            int(message.id),
            int(message.status),
            float(message.range),
            float(message.angle),
            float(message.range_rate),
        )
        rolling = int(message.rolling_count)
        for scan in self._assembler.push(stamp, int(message.id), track, rolling):
            yield select_lead(self._selector, scan, self._motion)

    def _esr_status_4(self, message: Any, _stamp: int) -> Iterable[Sample]:
        self._assembler.in_path = int(message.path_id_acc)
        return ()

    def _radar_tracks(self, message: Any, stamp: int) -> Iterable[Sample]:
        tracks = [self._track(track) for track in message.tracks]
        host = self._motion
        return (self._selector.select(stamp, tracks, host.speed, host.yaw_rate),)

    def _track(self, track: Any) -> Track:
        known = {STATIC: False, DYNAMIC: True}
        return Track(
            number=int.from_bytes(bytes(track.uuid.uuid), "big"),
            clearance=float(track.position.x),
            lateral=float(track.position.y),
            relative_velocity=float(track.velocity.x),
            moving=known.get(int(track.classification)),
        )

    def _can_frame(
        self, push: Callable[[Frame], Iterable[Sample]], message: Any, stamp: int
    ) -> Iterable[Sample]:
        if message.is_error or message.is_rtr:
            self.counts["error and remote frames"] += 1
            return ()
        data = bytes(np.asarray(message.data, dtype=np.uint8))[: int(message.dlc)]
        return push((stamp, int(message.id), data))

    def _imu(self, message: Any, stamp: int) -> Iterable[Sample]:
        unknown = message.angular_velocity_covariance[0]
        rate, forward = message.angular_velocity, message.linear_acceleration
        return self._felt(_axes(rate), unknown, _axes(forward), stamp)

    def _plain_imu(self, message: Any, stamp: int) -> Iterable[Sample]:
        numbers = message.numbers.tolist()
        rate, forward = numbers[ANGULAR_VELOCITY], numbers[LINEAR_ACCELERATION]
        return self._felt(rate, numbers[ITS_COVARIANCE], forward, stamp)

    def _felt(
        self, rate: Sequence[float], unknown: float, forward: Sequence[float], stamp: int
    ) -> Iterable[Sample]:
        """`unknown`: -1 where the sensor does not measure how it turns."""
        if unknown != -1.0:
            self._motion.hear(yaw_rate=self._mounting.yaw_rate(*rate))
        return (self._forward(forward, stamp),)

    def _accel(self, message: Any, stamp: int) -> Iterable[Sample]:
        return (self._forward(_axes(message.accel.accel.linear), stamp),)

    def _forward(self, axes: Sequence[float], stamp: int) -> Sample:
        return ScalarSample(ACCELERATION, stamp, self._mounting.forward(*axes))

    def _twist(self, message: Any, stamp: int) -> Iterable[Sample]:
        return (self._host_speed(message.twist, stamp),)

    def _odometry(self, message: Any, stamp: int) -> Iterable[Sample]:
        return (self._host_speed(message.twist.twist, stamp),)

    def _lead_acceleration(self, message: Any, stamp: int) -> Iterable[Sample]:
        return (ScalarSample(LEAD_ACCELERATION, stamp, float(message.accel.linear.x)),)

    def _host_speed(self, twist: Any, stamp: int) -> Sample:
        speed = float(twist.linear.x)
        self._motion.hear(speed=speed)
        return ScalarSample(HOST_SPEED, stamp, speed)


def _axes(vector: Any) -> tuple[float, float, float]:
    return float(vector.x), float(vector.y), float(vector.z)
