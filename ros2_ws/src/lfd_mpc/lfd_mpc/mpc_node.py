"""mpc_node: radar, acceleration and host speed in; prediction horizon and command out."""

import heapq
import time
from dataclasses import replace
from functools import partial
from typing import Any

from geometry_msgs.msg import AccelStamped
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header

from lfd_mpc.decision import Decision as Decided
from lfd_mpc.driving import DrivingMpc
from lfd_mpc.errors import UserError
from lfd_mpc.health import Health, Level, StepHealth
from lfd_mpc.horizon import Horizon, Mpc, first_horizon
from lfd_mpc.messages import from_message, from_time, to_message, to_time
from lfd_mpc.node_support import (
    PIPELINE_QOS,
    HealthPublisher,
    ReadyAnnouncer,
    declare,
    declare_settings,
)
from lfd_mpc.qos_events import hearing, telling
from lfd_mpc.samples import Sample, playing_order
from lfd_mpc.sensor_inputs import INPUT_TOPICS, SENSOR_OVERRIDES, sensor_qos
from lfd_mpc.settings import MpcSettings
from lfd_msgs.msg import Decision, DrivingState, PredictionHorizon

RECEIPTS_TOPIC = "mpc/received"
RECEIPTS_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECEIPTS_PARAMETER = ParameterDescriptor(
    description="for lockstep players: publish the stamp of every sample received on mpc/received, "
    "and hear sensors reliably",
    read_only=True,
)


class MpcNode(Node):
    """Samples to the core, horizons from it."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("mpc_node", context=context, **node_options)
        receipts = declare(self, "receipts", False, RECEIPTS_PARAMETER)
        settings = declare_settings(self, MpcSettings, self._change)
        self._horizon = self.create_publisher(
            PredictionHorizon,
            "mpc/horizon",
            PIPELINE_QOS,
            event_callbacks=telling(self, "mpc/horizon", PIPELINE_QOS),
        )
        self._command = self.create_publisher(AccelStamped, "mpc/command", PIPELINE_QOS)
        self._receipts = (
            self.create_publisher(Header, RECEIPTS_TOPIC, RECEIPTS_QOS) if receipts else None
        )
        self._inputs = {}
        for input_name, (kind, topic, _) in INPUT_TOPICS.items():
            # Lockstep must not lose a sample, in whatever namespace.
            qos = sensor_qos(lossless=receipts)
            self._inputs[input_name] = self.create_subscription(
                kind,
                topic,
                partial(self._on_sample, input_name),
                qos,
                qos_overriding_options=SENSOR_OVERRIDES,
                event_callbacks=hearing(self, topic, qos),
            )
        self._driving = None
        if settings.driving:
            self._driving = self.create_publisher(DrivingState, "mpc/driving", PIPELINE_QOS)
            self.create_subscription(
                Decision, "diagnosis/decision", self._on_decision, PIPELINE_QOS
            )
        self.create_subscription(Clock, "/clock", self._on_clock, qos_profile_sensor_data)
        # What comes while the algorithm is loaded waits and is taken at once afterwards.
        first_horizon()
        try:
            self._core = DrivingMpc(settings) if settings.driving else Mpc(settings)
        except ValueError as error:
            raise UserError(f"mpc_node: {error}") from error
        self._message = PredictionHorizon()
        self._health, self._counts = StepHealth(), {}
        HealthPublisher(self, self._statuses)
        ReadyAnnouncer(self, ["radar/target", "vehicle/imu"])

    def _change(self, settings: MpcSettings) -> None:
        self._core.change(settings)

    def _statuses(self, _period_ends: bool) -> list[Health]:
        health = self._health.health("steps", time.monotonic(), self._counts)
        doubled = [
            subscription.topic_name
            for subscription in self._inputs.values()
            if self.count_publishers(subscription.topic_name) > 1
        ]
        if doubled and health.level == Level.OK:
            message = f"more than one publisher on {', '.join(doubled)}"
            health = replace(health, level=Level.WARN, message=message)
        return [health]

    def _on_sample(self, input_name: str, message: Any) -> None:
        self._push_waiting({input_name: [INPUT_TOPICS[input_name][2](message)]})

    def _push_waiting(self, queues: dict[str, list[Sample]]) -> None:
        """Push what was taken from the queues and what still waits in them, by stamp.

        DDS keeps no order between topics, so no step is released before the queues are empty.
        """
        for input_name, subscription in self._inputs.items():
            convert = INPUT_TOPICS[input_name][2]
            queue = queues.setdefault(input_name, [])
            while (message := self._take(subscription)) is not None:
                queue.append(convert(message))
        for sample in heapq.merge(*queues.values(), key=playing_order):
            self._confirm(sample.stamp, sample.input)
            self._publish(self._core.push(sample))

    def _confirm(self, stamp: int, what: str) -> None:
        if self._receipts is not None:
            self._receipts.publish(Header(stamp=to_time(stamp), frame_id=what))

    def _on_decision(self, message: Decision) -> None:
        assert isinstance(self._core, DrivingMpc)
        try:
            self._core.driver.decide(from_message(Decided, message))
        except ValueError as error:
            self._health.refuse(f"diagnosis/decision: {error}")
        if message.step:
            self._confirm(from_time(message.header.stamp), "decision")

    @staticmethod
    def _take(subscription: Subscription):
        with subscription.handle:
            taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        return None if taken is None else taken[0]

    def _on_clock(self, message: Clock) -> None:
        self._push_waiting({})
        self._publish(self._core.clock(from_time(message.clock)))

    def _publish(self, horizons: list[Horizon]) -> None:
        for horizon in horizons:
            message = to_message(horizon, self._message)
            self._horizon.publish(message)
            command = AccelStamped(header=message.header)
            command.accel.linear.x = horizon.command
            self._command.publish(command)
            if self._driving is not None and isinstance(self._core, DrivingMpc):
                driven = self._core.driven.pop(0)
                self._driving.publish(to_message(driven, DrivingState()))
            self._health.step(
                time.monotonic(),
                horizon.stamp,
                horizon.solve_time,
                horizon.fallbacks,
                horizon.refused_samples,
                horizon.bad_samples,
            )
            if horizon.restart:
                self.get_logger().info(
                    f"restart at {horizon.stamp * 1e-9:.3f} s: {horizon.restart_reason}"
                )
        if horizons:
            last = horizons[-1]
            self._counts = {
                "solver": last.solver_status,
                "steps that were solved anew": str(last.fallbacks),
                "late samples": str(last.late_samples),
                "refused samples": str(last.refused_samples),
                "samples that are no numbers": str(last.bad_samples),
            }
