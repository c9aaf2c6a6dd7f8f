"""The inputs of the graph as messages: types, topics, conversions and quality of service."""

from geometry_msgs.msg import AccelStamped, TwistStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import Imu

from lfd_mpc.messages import from_time, radar_sample
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RADAR,
    Sample,
    ScalarSample,
)
from lfd_msgs.msg import RadarTarget


def sensor_qos(lossless: bool = False) -> QoSProfile:
    """Best effort hears every kind of sensor driver, reliable (`lossless`) misses nothing; deep,
    since a late step needs its samples.

    A new object each time: an override by parameter changes the object itself.
    """
    reliability = ReliabilityPolicy.RELIABLE if lossless else ReliabilityPolicy.BEST_EFFORT
    return QoSProfile(depth=200, reliability=reliability)


DEEPEST = 1_000_000
"""Messages that a queue may be asked to hold."""


def _possible(qos: QoSProfile) -> SetParametersResult:
    return SetParametersResult(
        successful=0 <= qos.depth <= DEEPEST,
        reason=f"depth {qos.depth}; 0 to {DEEPEST} is expected",
    )


SENSOR_OVERRIDES = QoSOverridingOptions.with_default_policies(callback=_possible)
"""What parameters may change of `sensor_qos`."""


def _acceleration(message: Imu) -> Sample:
    stamp = from_time(message.header.stamp)
    return ScalarSample(ACCELERATION, stamp, message.linear_acceleration.x)


def _host_speed(message: TwistStamped) -> Sample:
    return ScalarSample(HOST_SPEED, from_time(message.header.stamp), message.twist.linear.x)


def _lead_acceleration(message: AccelStamped) -> Sample:
    return ScalarSample(LEAD_ACCELERATION, from_time(message.header.stamp), message.accel.linear.x)


INPUT_TOPICS = {
    RADAR: (RadarTarget, "radar/target", radar_sample),
    HOST_SPEED: (TwistStamped, "vehicle/twist", _host_speed),
    ACCELERATION: (Imu, "vehicle/imu", _acceleration),
    LEAD_ACCELERATION: (AccelStamped, "v2v/lead_acceleration", _lead_acceleration),
}
"""Type, relative topic and conversion of each input."""
