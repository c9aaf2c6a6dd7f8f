"""A car's sensors, live: steady following with sensor noise, at the pace of the wall clock."""

import time

import numpy as np
from geometry_msgs.msg import TwistStamped
from rclpy.node import Node
from sensor_msgs.msg import Imu

from lfd_mpc.messages import to_time
from lfd_msgs.msg import RadarTarget
from ros_support import Graph

STEP_NS = 10_000_000


class Car:
    """Publishes on its own node; `graph` is spun meanwhile."""

    def __init__(self, graph: Graph, node: Node) -> None:
        self.graph, self.node = graph, node
        self._radar = node.create_publisher(RadarTarget, "radar/target", 10)
        self._imu = node.create_publisher(Imu, "vehicle/imu", 10)
        self._twist = node.create_publisher(TwistStamped, "vehicle/twist", 10)
        self._noise = np.random.default_rng(1)
        self._number = 0
        self._base = time.time_ns() // STEP_NS * STEP_NS
        self._begin = time.perf_counter()

    def wait_until_heard(self) -> None:
        """Until the graph's nodes have found each other, and this car; its clock begins then."""
        outputs = ("mpc/horizon", "observer/bank", "diagnosis/faults")
        self.graph.spin_until(
            lambda: (
                self._radar.get_subscription_count()
                and self._imu.get_subscription_count()
                and all(map(self.node.count_publishers, outputs))
                and all(map(self.node.count_subscribers, outputs))
            ),
            "the graph hears the car",
        )
        self.graph.spin_for(0.3)
        self._base = time.time_ns() // STEP_NS * STEP_NS
        self._begin = time.perf_counter()

    @property
    def stamp(self) -> int:
        """Of the newest acceleration sample, in ns."""
        return self._base + (self._number - 1) * STEP_NS

    def drive(self, seconds: float) -> None:
        """Go on for so many seconds of wall time."""
        for _ in range(round(seconds * 100)):
            self.step()

    def step(self) -> None:
        """The samples of the next 10 ms, when they are due."""
        due = self._begin + 0.01 * self._number
        while (left := due - time.perf_counter()) > 0.0:
            self.graph.executor.spin_once(timeout_sec=min(left, 0.01))
        stamp = to_time(self._base + self._number * STEP_NS)
        noise = self._noise.standard_normal(4)
        if self._number % 5 == 0:
            scan = RadarTarget(has_target=True, track_id=3)
            scan.clearance = 30.0 + 0.05 * float(noise[0])
            scan.relative_velocity = 0.02 * float(noise[1])
            scan.header.stamp = stamp
            self._radar.publish(scan)
            speed = TwistStamped()
            speed.twist.linear.x = 20.0 + 0.01 * float(noise[2])
            speed.header.stamp = stamp
            self._twist.publish(speed)
        sample = Imu()
        sample.linear_acceleration.x = 0.1 * float(noise[3])
        sample.header.stamp = stamp
        self._imu.publish(sample)
        self._number += 1
