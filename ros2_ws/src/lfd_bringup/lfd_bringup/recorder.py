"""The recorder node: everything that the graph says, as it says it."""

from collections.abc import Callable, Sequence
from pathlib import Path

from geometry_msgs.msg import AccelStamped, TwistStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu

from lfd_diagnosis.diagnosis_node import EVENT_QOS
from lfd_diagnosis.verdict import Event, Reconstruction, Report
from lfd_mpc.horizon import Horizon
from lfd_mpc.messages import from_message, from_time
from lfd_mpc.node_support import PIPELINE_QOS, ReadyAnnouncer
from lfd_msgs.msg import (
    Decision,
    DrivingState,
    FaultEvent,
    FaultReport,
    ObserverBank,
    PredictionHorizon,
    RadarTarget,
    ReconstructedState,
    VehicleTruth,
)
from lfd_observer.bank import BankState
from lfd_replay.drive_bag import write_what_fits
from lfd_replay.recorded_step import RecordedStep

GRAPH_TOPICS = {
    "radar/target": RadarTarget,
    "vehicle/imu": Imu,
    "vehicle/twist": TwistStamped,
    "mpc/horizon": PredictionHorizon,
    "mpc/command": AccelStamped,
    "observer/bank": ObserverBank,
    "diagnosis/faults": FaultReport,
    "diagnosis/events": FaultEvent,
    "diagnosis/reconstructed": ReconstructedState,
}

TOPICS = {**GRAPH_TOPICS, "v2v/lead_acceleration": AccelStamped}
"""What is recorded of a replay: all that the diagnosis rests on, and all that it says."""

LOOP_TOPICS = {
    **GRAPH_TOPICS,
    "diagnosis/decision": Decision,
    "mpc/driving": DrivingState,
    "vehicle/truth": VehicleTruth,
}
"""What is recorded of the closed loop, where no lead says what it does."""


class RecorderNode(Node):
    """Keeps serialised messages by topic, in the order in which they arrive."""

    def __init__(
        self,
        on_event: Callable[[Event], None],
        context: Context | None = None,
        topics: dict[str, type] = TOPICS,
    ) -> None:
        """`on_event` is called with each change of state."""
        super().__init__("recorder", context=context)
        self._on_event, self._topics = on_event, topics
        self._raw: dict[str, list[bytes]] = {topic: [] for topic in topics}
        self.received = 0
        for topic, kind in topics.items():
            self.create_subscription(
                kind,
                topic,
                lambda raw, topic=topic: self._keep(topic, raw),
                EVENT_QOS if kind is FaultEvent else PIPELINE_QOS,
                raw=True,
            )
        ReadyAnnouncer(self, list(topics))

    def _keep(self, topic: str, raw: bytes) -> None:
        self._raw[topic].append(raw)
        self.received += 1
        if self._topics[topic] is FaultEvent:
            self._on_event(from_message(Event, deserialize_message(raw, FaultEvent)))

    def count(self, topic: str) -> int:
        """How many messages of one topic have arrived."""
        return len(self._raw[topic])

    def messages(self, topic: str) -> list:
        """The messages of one topic."""
        return [deserialize_message(raw, self._topics[topic]) for raw in self._raw[topic]]

    def steps(self) -> Sequence[RecordedStep]:
        """What every node said about each step."""
        horizons = [from_message(Horizon, m) for m in self.messages("mpc/horizon")]
        banks = {m.step: from_message(BankState, m) for m in self.messages("observer/bank")}
        reports = {m.step: from_message(Report, m) for m in self.messages("diagnosis/faults")}
        rebuilt = {
            m.step: from_message(Reconstruction, m)
            for m in self.messages("diagnosis/reconstructed")
        }
        return [
            RecordedStep(h, banks.get(h.step), reports[h.step], rebuilt.get(h.step))
            for h in horizons
            if h.step in reports
        ]

    def write(self, folder: Path) -> tuple[int, int]:
        """Write everything as a bag whose log time is each message's header stamp, or 0 before it.

        Returns how many messages were written and how many there are: the disk may be full.
        Raises OSError where nothing can be written.
        """
        rows = []
        for topic, kind in self._topics.items():
            name = f"lfd_msgs/msg/{kind.__name__}"
            if not kind.__module__.startswith("lfd_msgs"):
                name = f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"
            for raw in self._raw[topic]:
                stamp = from_time(deserialize_message(raw, kind).header.stamp)
                # No bag holds a log time below zero, and a wrong stamp must not lose all of it.
                rows.append((max(stamp, 0), self.resolve_topic_name(topic), name, raw))
        rows.sort(key=lambda row: row[0])
        return write_what_fits(rows, folder), len(rows)
