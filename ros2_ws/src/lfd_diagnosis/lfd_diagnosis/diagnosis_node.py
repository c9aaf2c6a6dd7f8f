"""diagnosis_node: horizons and banks in; faults, events and reconstructed signals out."""

import sys
import time

from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import Trigger

from lfd_diagnosis.diagnosis import make_diagnosis
from lfd_diagnosis.pairing import Pair, Pairing
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.silence import SilenceWatch
from lfd_diagnosis.verdict import Event, Report
from lfd_mpc.horizon import Horizon, first_horizon
from lfd_mpc.messages import from_message, from_time, to_message
from lfd_mpc.node_support import PIPELINE_QOS, ReadyAnnouncer, declare_settings, run_node
from lfd_msgs.msg import (
    FaultEvent,
    FaultReport,
    ObserverBank,
    PredictionHorizon,
    ReconstructedState,
)
from lfd_observer.bank import BankState

EVENT_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Events are latched: a subscriber that comes late hears what happened."""

WATCH_PERIOD = 0.1
"""Seconds between looks at whether anything arrives."""


class DiagnosisNode(Node):
    """One report per horizon, and one that says so when nothing arrives."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("diagnosis_node", context=context, **node_options)
        settings = declare_settings(self, DiagnosisSettings)
        make_diagnosis(DiagnosisSettings(profile=settings.profile)).step(first_horizon(), None)
        self._core = make_diagnosis(settings)
        self._pairing = Pairing()
        self._faults = self.create_publisher(FaultReport, "diagnosis/faults", PIPELINE_QOS)
        self._events = self.create_publisher(FaultEvent, "diagnosis/events", EVENT_QOS)
        self._reconstructed = self.create_publisher(
            ReconstructedState, "diagnosis/reconstructed", PIPELINE_QOS
        )
        self.create_subscription(PredictionHorizon, "mpc/horizon", self._on_horizon, PIPELINE_QOS)
        self.create_subscription(ObserverBank, "observer/bank", self._on_bank, PIPELINE_QOS)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self._watch = SilenceWatch(time.monotonic())
        self.create_timer(
            WATCH_PERIOD, self._on_watch, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        if self.get_parameter("use_sim_time").value:
            self.create_subscription(
                ClockMessage, "/clock", self._on_clock, qos_profile_sensor_data
            )
        ReadyAnnouncer(self, ["mpc/horizon", "observer/bank"])

    def _on_horizon(self, message: PredictionHorizon) -> None:
        horizon = from_message(Horizon, message)
        self._answer(self._pairing.add_horizon(horizon, time.monotonic()))

    def _on_bank(self, message: ObserverBank) -> None:
        bank = from_message(BankState, message)
        self._answer(self._pairing.add_bank(bank, time.monotonic()))

    def _answer(self, pairs: list[Pair]) -> None:
        for horizon, bank in pairs:
            self._watch.heard(time.monotonic())
            try:
                outcome = self._core.step(horizon, bank)
            except ValueError as error:
                self.get_logger().error(f"mpc/horizon: {error}", throttle_duration_sec=1.0)
                continue
            self._publish(outcome.report, outcome.events)
            self._reconstructed.publish(to_message(outcome.reconstruction, ReconstructedState()))

    def _publish(self, report: Report, events: list[Event]) -> None:
        self._faults.publish(to_message(report, FaultReport()))
        for event in events:
            self._events.publish(to_message(event, FaultEvent()))

    def _on_clock(self, message: ClockMessage) -> None:
        self._watch.clock(time.monotonic(), from_time(message.clock) * 1e-9)

    def _on_watch(self) -> None:
        now = time.monotonic()
        self._answer(self._pairing.complete(now))
        if self._watch.silent(now, self.get_parameter("use_sim_time").value):
            self._publish(*self._core.silence(self.get_clock().now().nanoseconds))

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._core.reset()
        response.success = True
        response.message = "faults, confidence and all that was learnt or stored are forgotten"
        return response


def main() -> int:
    """Entry point of `lfd_diagnosis diagnosis_node`."""
    return run_node(DiagnosisNode)


if __name__ == "__main__":
    sys.exit(main())
