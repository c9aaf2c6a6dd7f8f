"""Nodes that only copy: the floor of three hops with these messages.

`python floor_node.py mpc|observer|diagnosis`: takes the topics that the node of that name takes,
and publishes messages of the same types and lengths, filled once.
"""

import sys
from array import array
from functools import partial

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from lfd_mpc.node_process import run_node
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_msgs.msg import FaultReport, ObserverBank, PredictionHorizon

HOPS = {
    "mpc": (Imu, "vehicle/imu", PredictionHorizon, "mpc/horizon"),
    "observer": (PredictionHorizon, "mpc/horizon", ObserverBank, "observer/bank"),
    "diagnosis": (ObserverBank, "observer/bank", FaultReport, "diagnosis/faults"),
}


class FloorNode(Node):
    """Publishes one message for each that it takes, with its stamp."""

    def __init__(self, name: str) -> None:
        super().__init__(f"{name}_floor")
        taken, topic, made, out = HOPS[name]
        qos = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._message = made()
        for field in ("predicted_clearance", "predicted_relative_velocity", "input_sequence"):
            if hasattr(self._message, field):
                setattr(self._message, field, array("d", [0.0] * 20))
        self._out = self.create_publisher(made, out, PIPELINE_QOS)
        self.create_subscription(taken, topic, self._on, qos if taken is Imu else PIPELINE_QOS)

    def _on(self, message) -> None:
        self._message.header.stamp = message.header.stamp
        self._out.publish(self._message)


if __name__ == "__main__":
    name = sys.argv.pop(1)
    sys.exit(run_node(lambda: partial(FloorNode, name)))
