"""host_adapter: what a research car publishes of itself becomes vehicle/imu and vehicle/twist.

Subscribes to host/odometry (nav_msgs/Odometry), host/accel (geometry_msgs/
AccelWithCovarianceStamped) and host/imu (sensor_msgs/Imu): remap them to the car's own topics.
Rotation and offset of the accelerometer are parameters.
"""

from functools import partial
from typing import Any

from geometry_msgs.msg import AccelWithCovarianceStamped
from nav_msgs.msg import Odometry
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu

from lfd_mpc.node_support import PIPELINE_QOS, declare_settings
from lfd_mpc.samples import ACCELERATION, HOST_SPEED
from lfd_replay.adapter_settings import MountingSettings
from lfd_replay.recordings.recorded_messages import MessageConverter
from lfd_replay.sample_publishers import SamplePublishers

TOPICS = {
    "host/odometry": (Odometry, "nav_msgs/msg/Odometry"),
    "host/accel": (AccelWithCovarianceStamped, "geometry_msgs/msg/AccelWithCovarianceStamped"),
    "host/imu": (Imu, "sensor_msgs/msg/Imu"),
}
"""What is listened to, with its type."""


class HostAdapterNode(Node):
    """The car's own messages in, the graph's inputs out."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("host_adapter", context=context, **node_options)
        self._converter = MessageConverter(declare_settings(self, MountingSettings).mounting)
        self._outputs = SamplePublishers(self, PIPELINE_QOS, (ACCELERATION, HOST_SPEED))
        for topic, (kind, message_type) in TOPICS.items():
            self.create_subscription(
                kind, topic, partial(self._on_message, message_type), qos_profile_sensor_data
            )

    def _on_message(self, message_type: str, message: Any) -> None:
        received = self.get_clock().now().nanoseconds
        for sample in self._converter.push(message_type, message, received):
            self._outputs.publish(sample)
