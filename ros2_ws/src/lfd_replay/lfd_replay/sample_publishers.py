"""Samples as live messages on the graph's input topics."""

from collections.abc import Iterable

from geometry_msgs.msg import AccelStamped, TwistStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Imu

from lfd_mpc.messages import set_time
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RadarSample, Sample
from lfd_mpc.sensor_inputs import INPUT_TOPICS
from lfd_msgs.msg import RadarTarget


class SamplePublishers:
    """Publishers of some of the inputs, made by a node."""

    def __init__(
        self,
        node: Node,
        qos: QoSProfile,
        inputs: Iterable[str] = tuple(INPUT_TOPICS),
    ) -> None:
        self._publishers = {
            name: node.create_publisher(*INPUT_TOPICS[name][:2], qos) for name in inputs
        }
        # One of each, filled again and again: what is published is copied at once.
        self._radar, self._imu = RadarTarget(), Imu()
        self._twist, self._lead = TwistStamped(), AccelStamped()
        # Only the acceleration is known.
        self._imu.orientation_covariance[0] = self._imu.angular_velocity_covariance[0] = -1.0

    @property
    def topics(self) -> list[str]:
        """Full names of the topics."""
        return [publisher.topic_name for publisher in self._publishers.values()]

    @property
    def heard(self) -> bool:
        """Whether every topic has a subscriber."""
        return all(p.get_subscription_count() for p in self._publishers.values())

    def publish(self, sample: Sample) -> None:
        """Publish one sample on the topic of its input."""
        message = self._message(sample)
        set_time(message.header.stamp, sample.stamp)
        self._publishers[sample.input].publish(message)

    def _message(self, sample: Sample) -> RadarTarget | Imu | TwistStamped | AccelStamped:
        if isinstance(sample, RadarSample):
            radar = self._radar
            radar.track_id, radar.has_target = sample.track_id, sample.has_target
            radar.clearance = sample.clearance
            radar.relative_velocity = sample.relative_velocity
            radar.sensor_flags, radar.sensor_text = sample.sensor_flags, sample.sensor_text
            return radar
        if sample.input == ACCELERATION:
            self._imu.linear_acceleration.x = sample.value
            return self._imu
        if sample.input == HOST_SPEED:
            self._twist.twist.linear.x = sample.value
            return self._twist
        self._lead.accel.linear.x = sample.value
        return self._lead
