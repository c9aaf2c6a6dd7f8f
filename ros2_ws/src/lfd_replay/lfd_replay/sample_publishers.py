"""Samples as live messages on the graph's input topics."""

from geometry_msgs.msg import AccelStamped, TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu

from lfd_mpc.messages import to_time
from lfd_mpc.sampling import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RADAR,
    RadarSample,
    Sample,
    ScalarSample,
)
from lfd_msgs.msg import RadarTarget


class SamplePublishers:
    """Publishers of some of the inputs, made by a node."""

    def __init__(
        self,
        node: Node,
        qos: QoSProfile,
        inputs: tuple[str, ...] = (RADAR, ACCELERATION, HOST_SPEED, LEAD_ACCELERATION),
    ) -> None:
        kinds = {
            RADAR: (RadarTarget, "radar/target"),
            ACCELERATION: (Imu, "vehicle/imu"),
            HOST_SPEED: (TwistStamped, "vehicle/twist"),
            LEAD_ACCELERATION: (AccelStamped, "v2v/lead_acceleration"),
        }
        self._publishers = {name: node.create_publisher(*kinds[name], qos) for name in inputs}

    @property
    def topics(self) -> list[str]:
        """Full names of the topics."""
        return [publisher.topic_name for publisher in self._publishers.values()]

    def publish(self, sample: Sample) -> None:
        """Publish one sample on the topic of its input."""
        message = _radar(sample) if isinstance(sample, RadarSample) else _scalar(sample)
        message.header.stamp = to_time(sample.stamp)
        self._publishers[sample.input].publish(message)


def _radar(sample: RadarSample) -> RadarTarget:
    return RadarTarget(
        track_id=sample.track_id,
        has_target=sample.has_target,
        clearance=sample.clearance,
        relative_velocity=sample.relative_velocity,
        sensor_flags=sample.sensor_flags,
        sensor_text=sample.sensor_text,
    )


def _scalar(sample: ScalarSample) -> Imu | TwistStamped | AccelStamped:
    if sample.input == HOST_SPEED:
        twist = TwistStamped()
        twist.twist.linear.x = sample.value
        return twist
    if sample.input == LEAD_ACCELERATION:
        lead = AccelStamped()
        lead.accel.linear.x = sample.value
        return lead
    imu = Imu()
    imu.linear_acceleration.x = sample.value
    # Only the acceleration is known.
    imu.orientation_covariance[0] = imu.angular_velocity_covariance[0] = -1.0
    return imu
