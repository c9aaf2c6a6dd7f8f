"""mpc_node: radar, acceleration and host speed in; prediction horizon and command out."""

import sys

from geometry_msgs.msg import AccelStamped, TwistStamped
from lfd_msgs.msg import PredictionHorizon, RadarTarget
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu

from lfd_mpc.errors import UserError
from lfd_mpc.horizon import Horizon, Mpc
from lfd_mpc.messages import from_time, radar_sample, to_message
from lfd_mpc.node_support import (
    PIPELINE_QOS,
    ReadyAnnouncer,
    declare_settings,
    run_node,
)
from lfd_mpc.sampling import ACCELERATION, HOST_SPEED, Sample, ScalarSample
from lfd_mpc.settings import MpcSettings

SENSOR_QOS = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Best effort hears every kind of sensor driver; deep, since a late step needs its samples."""


class MpcNode(Node):
    """Samples to the core, horizons from it."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("mpc_node", context=context, **node_options)
        settings = declare_settings(self, MpcSettings)
        try:
            self._core = Mpc(settings)
        except ValueError as error:
            raise UserError(f"mpc_node: {error}") from error
        self._horizon = self.create_publisher(PredictionHorizon, "mpc/horizon", PIPELINE_QOS)
        self._command = self.create_publisher(AccelStamped, "mpc/command", PIPELINE_QOS)
        self._others: list[tuple[Subscription, object]] = []
        self._listen(RadarTarget, "radar/target", self._on_radar)
        self._listen(TwistStamped, "vehicle/twist", self._on_twist)
        self._listen(Imu, "vehicle/imu", self._on_imu)
        self.create_subscription(Clock, "/clock", self._on_clock, qos_profile_sensor_data)
        ReadyAnnouncer(self, ["radar/target", "vehicle/imu"])

    def _listen(self, kind, topic, callback) -> None:
        subscription = self.create_subscription(
            kind,
            topic,
            callback,
            SENSOR_QOS,
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        if kind is not Imu:
            self._others.append((subscription, callback))

    def _on_radar(self, message: RadarTarget) -> None:
        self._push(radar_sample(message))

    def _on_twist(self, message: TwistStamped) -> None:
        stamp = from_time(message.header.stamp)
        self._push(ScalarSample(HOST_SPEED, stamp, message.twist.linear.x))

    def _on_imu(self, message: Imu) -> None:
        # DDS keeps no order between topics: what waits in the other queues goes first.
        for subscription, callback in self._others:
            while (taken := self._take(subscription)) is not None:
                callback(taken)
        stamp = from_time(message.header.stamp)
        self._push(ScalarSample(ACCELERATION, stamp, message.linear_acceleration.x))

    @staticmethod
    def _take(subscription: Subscription):
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        return None if taken is None else taken[0]

    def _on_clock(self, message: Clock) -> None:
        self._publish(self._core.clock(from_time(message.clock)))

    def _push(self, sample: Sample) -> None:
        self._publish(self._core.push(sample))

    def _publish(self, horizons: list[Horizon]) -> None:
        for horizon in horizons:
            message = to_message(horizon, PredictionHorizon())
            self._horizon.publish(message)
            command = AccelStamped(header=message.header)
            command.accel.linear.x = horizon.command
            self._command.publish(command)
            if horizon.restart:
                self.get_logger().info(
                    f"restart at {horizon.stamp * 1e-9:.3f} s: {horizon.restart_reason}"
                )


def main() -> int:
    """Entry point of `lfd_mpc mpc_node`."""
    return run_node(MpcNode)


if __name__ == "__main__":
    sys.exit(main())
