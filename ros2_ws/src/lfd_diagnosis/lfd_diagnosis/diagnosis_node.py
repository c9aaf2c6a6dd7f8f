"""diagnosis_node: horizons and banks in; faults, events and reconstructed signals out."""

import time

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock as ClockMessage
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from lfd_diagnosis.diagnosis import make_diagnosis
from lfd_diagnosis.markers import MARKER_STEPS, markers
from lfd_diagnosis.pairing import Pair, Pairing
from lfd_diagnosis.sensor_health import SensorHealth
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.silence import SilenceWatch
from lfd_diagnosis.verdict import Event, Report
from lfd_mpc.health import Health, StepHealth
from lfd_mpc.horizon import Horizon, check_horizon, first_horizon
from lfd_mpc.messages import from_message, from_time, to_message, to_time
from lfd_mpc.node_support import (
    PIPELINE_QOS,
    HealthPublisher,
    ReadyAnnouncer,
    declare_settings,
)
from lfd_mpc.qos_events import telling
from lfd_msgs.msg import (
    FaultEvent,
    FaultReport,
    ObserverBank,
    PredictionHorizon,
    ReconstructedState,
)
from lfd_observer.bank import BankState, check_bank

EVENT_QOS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Events are latched: a subscriber that comes late hears what happened."""

REPORT_QOS = QoSProfile(
    depth=1000,
    deadline=Duration(seconds=0.3),
    liveliness=LivelinessPolicy.AUTOMATIC,
    liveliness_lease_duration=Duration(seconds=1.0),
)
"""Reports are offered with a deadline, so that a subscriber that asks for one is told when this
node has died. Without a report for 100 ms a subscriber must take every signal for NO_DATA."""

MARKERS_PARAMETER = ParameterDescriptor(
    description="publish markers for RViz on diagnosis/markers, 20 times a second", read_only=True
)
FRAME_PARAMETER = ParameterDescriptor(
    description="frame of the markers: origin at the radar, x forward", read_only=True
)
WATCH_PERIOD = 0.03
"""Seconds between looks at whether anything arrives."""


class DiagnosisNode(Node):
    """One report per horizon, and one that says so when nothing arrives."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("diagnosis_node", context=context, **node_options)
        self._frame = self.declare_parameter("marker_frame", "radar", FRAME_PARAMETER).value
        drawn = self.declare_parameter("markers", False, MARKERS_PARAMETER).value
        settings = declare_settings(self, DiagnosisSettings, self._change)
        self._pairing = Pairing()
        self._faults = self.create_publisher(
            FaultReport,
            "diagnosis/faults",
            REPORT_QOS,
            event_callbacks=telling(self, "diagnosis/faults", REPORT_QOS),
        )
        self._events = self.create_publisher(FaultEvent, "diagnosis/events", EVENT_QOS)
        self._reconstructed = self.create_publisher(
            ReconstructedState, "diagnosis/reconstructed", PIPELINE_QOS
        )
        self._markers = (
            self.create_publisher(MarkerArray, "diagnosis/markers", 10) if drawn else None
        )
        self.create_subscription(PredictionHorizon, "mpc/horizon", self._on_horizon, PIPELINE_QOS)
        self.create_subscription(ObserverBank, "observer/bank", self._on_bank, PIPELINE_QOS)
        # What comes while the algorithm is loaded waits and is judged at once afterwards.
        make_diagnosis(DiagnosisSettings(profile=settings.profile)).step(first_horizon(), None)
        self._core = make_diagnosis(settings)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self._watch = SilenceWatch(time.monotonic())
        self._stamp: int | None = None
        self.create_timer(
            WATCH_PERIOD, self._on_watch, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        # Always: use_sim_time may be set while this runs.
        self.create_subscription(ClockMessage, "/clock", self._on_clock, qos_profile_sensor_data)
        self._report, self._rebuilt = FaultReport(), ReconstructedState()
        self._health, self._sensors = StepHealth(), SensorHealth()
        self._diagnostics = HealthPublisher(self, self._statuses)
        ReadyAnnouncer(self, ["mpc/horizon", "observer/bank"])

    def _change(self, settings: DiagnosisSettings) -> None:
        self._core = self._core.change(settings)

    def _statuses(self, period_ends: bool) -> list[Health]:
        made = self._sensors.statuses(period_ends)
        if period_ends:
            made.append(self._health.health("steps", time.monotonic(), {}))
        return made

    def _on_horizon(self, message: PredictionHorizon) -> None:
        try:
            horizon = from_message(Horizon, message)
            check_horizon(horizon)
        except ValueError as error:
            self._refuse("mpc/horizon", error)
            return
        self._answer(self._pairing.add_horizon(horizon, time.monotonic()))

    def _on_bank(self, message: ObserverBank) -> None:
        try:
            bank = from_message(BankState, message)
            check_bank(bank)
        except ValueError as error:
            self._refuse("observer/bank", error)
            return
        self._answer(self._pairing.add_bank(bank, time.monotonic()))

    def _refuse(self, topic: str, error: ValueError) -> None:
        self._health.refuse(f"{topic}: {error}")
        self.get_logger().error(f"{topic}: {error}", throttle_duration_sec=1.0)

    def _answer(self, pairs: list[Pair]) -> None:
        for horizon, bank in pairs:
            begin = time.monotonic()
            try:
                outcome = self._core.step(horizon, bank)
            except ValueError as error:
                self._refuse("mpc/horizon", error)
                continue
            now = time.monotonic()
            self._watch.heard(now)
            self._stamp = horizon.stamp
            self._health.step(now, horizon.stamp, now - begin)
            self._publish(outcome.report, outcome.events)
            self._reconstructed.publish(to_message(outcome.reconstruction, self._rebuilt))
            if self._markers is not None and horizon.step % MARKER_STEPS == 0:
                stamp = to_time(horizon.stamp)
                self._markers.publish(markers(horizon, outcome, self._frame, stamp))

    def _publish(self, report: Report, events: list[Event]) -> None:
        self._faults.publish(to_message(report, self._report))
        for event in events:
            self._events.publish(to_message(event, FaultEvent()))
        self._sensors.take(report, events)
        if events:
            self._diagnostics.changed()

    def _on_clock(self, message: ClockMessage) -> None:
        self._watch.clock(time.monotonic(), from_time(message.clock) * 1e-9)

    def _on_watch(self) -> None:
        now = time.monotonic()
        self._answer(self._pairing.complete(now))
        simulated = self.get_parameter("use_sim_time").value
        if not self._watch.silent(now, simulated):
            return
        if self._stamp is None or simulated:
            stamp = self.get_clock().now().nanoseconds
        else:
            # Sensors may be stamped by another clock than this node's, as in a recording.
            stamp = self._stamp + round(self._watch.since_heard(now) * 1e9)
        self._publish(*self._core.silence(stamp))

    def _on_reset(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._core.reset()
        response.success = True
        response.message = "faults, confidence and all that was learnt or stored are forgotten"
        return response
