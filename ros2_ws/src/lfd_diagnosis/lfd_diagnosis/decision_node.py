"""decision_node: fault reports and reconstructed signals in; fault level and action out."""

import time
from dataclasses import replace

from rclpy.context import Context
from rclpy.node import Node

from lfd_diagnosis.diagnosis_node import EVENT_QOS
from lfd_diagnosis.fault_level import DecisionMaker
from lfd_diagnosis.settings import DecisionSettings
from lfd_diagnosis.verdict import Reconstruction, Report
from lfd_mpc.decision import Decision as Decided
from lfd_mpc.decision import FaultLevel
from lfd_mpc.health import BADNESS, SILENT, Health, Level
from lfd_mpc.messages import from_message, to_message
from lfd_mpc.node_support import (
    PIPELINE_QOS,
    HealthPublisher,
    ReadyAnnouncer,
    declare_settings,
)
from lfd_msgs.msg import Decision, FaultReport, ReconstructedState

WAITING = 20
"""Steps of which one half may be missing; older ones were lost."""

LEVELS = {
    FaultLevel.NORMAL: Level.OK,
    FaultLevel.DEGRADED: Level.WARN,
    FaultLevel.TAKE_OVER: Level.ERROR,
    FaultLevel.EMERGENCY: Level.ERROR,
}
"""Levels on /diagnostics."""


class DecisionNode(Node):
    """One decision per step, when its report and what was reconstructed are both there."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("decision_node", context=context, **node_options)
        settings = declare_settings(self, DecisionSettings, self._change)
        self._core = DecisionMaker(settings)
        self._reports: dict[tuple[int, int], Report] = {}
        self._made: dict[tuple[int, int], Reconstruction] = {}
        self._last: Decided | None = None
        self._refused = self._refused_before = 0
        self._refused_because = ""
        self._decided = 0.0
        self._decisions = self.create_publisher(Decision, "diagnosis/decision", PIPELINE_QOS)
        self._changes = self.create_publisher(Decision, "diagnosis/decision_changes", EVENT_QOS)
        self.create_subscription(FaultReport, "diagnosis/faults", self._on_report, PIPELINE_QOS)
        self.create_subscription(
            ReconstructedState, "diagnosis/reconstructed", self._on_made, PIPELINE_QOS
        )
        self._diagnostics = HealthPublisher(self, self._statuses)
        ReadyAnnouncer(self, ["diagnosis/faults", "diagnosis/reconstructed"])

    def _change(self, settings: DecisionSettings) -> None:
        self._core.change(settings)

    def _statuses(self, period_ends: bool) -> list[Health]:
        health = self._level_health()
        refused = self._refused - self._refused_before
        if period_ends:
            self._refused_before = self._refused
        if refused:
            # What has been decided is no less urgent for what could not be read.
            level = max(health.level, Level.WARN, key=lambda level: BADNESS[level])
            said = f"{refused} messages refused in the last second: {self._refused_because}"
            health = replace(health, level=level, message=f"{health.message}; {said}")
        return [health]

    def _level_health(self) -> Health:
        last = self._last
        if last is None:
            return Health("fault level", "", Level.STALE, "no decision yet")
        age = time.monotonic() - self._decided
        values = {
            "action": last.action.name,
            "since": f"{last.since * 1e-9:.2f} s",
            "reports refused": f"{self._refused}",
            "age of the last decision [s]": f"{age:.3f}",
        }
        if age > SILENT:
            message = f"no decision for {age:.1f} s (limit {SILENT:g} s)"
            return Health("fault level", "", Level.STALE, message, values)
        message = f"{last.level.name}: {last.reason}" if last.reason else last.level.name
        return Health("fault level", "", LEVELS[last.level], message, values)

    def _on_report(self, message: FaultReport) -> None:
        try:
            report = from_message(Report, message)
        except ValueError as error:
            # A state or kind that there is not: of another version, or by hand.
            self._refused += 1
            self._refused_because = f"diagnosis/faults: {error}"
            # As many as there are steps may be refused.
            self.get_logger().warning(
                f"refused: {self._refused_because}", throttle_duration_sec=1.0
            )
            return
        if report.step:
            self._reports[report.step, report.stamp] = report
            self._answer(report)
        else:
            # Nothing arrives: this is no step, and what it says is not made up for.
            self._decide(report, _nothing(report.stamp))

    def _on_made(self, message: ReconstructedState) -> None:
        made = from_message(Reconstruction, message)
        self._made[made.step, made.stamp] = made
        self._answer(made)

    def _answer(self, half: Report | Reconstruction) -> None:
        # Steps are counted anew where the controller is started anew.
        key = half.step, half.stamp
        if key in self._reports and key in self._made:
            self._decide(self._reports.pop(key), self._made.pop(key))
        for waiting in (self._reports, self._made):
            while len(waiting) > WAITING:
                waiting.pop(next(iter(waiting)))

    def _decide(self, report: Report, made: Reconstruction) -> None:
        decision = self._core.step(report, made)
        message = to_message(decision, Decision())
        self._decisions.publish(message)
        self._decided = time.monotonic()
        before, self._last = self._last, decision
        if before is None or (before.level, before.action) != (decision.level, decision.action):
            self._changes.publish(message)
            self._diagnostics.changed()
            if decision.level != FaultLevel.NORMAL:
                self.get_logger().warning(
                    f"{decision.level.name}, {decision.action.name}: {decision.reason}"
                )


def _nothing(stamp: int) -> Reconstruction:
    none = float("nan")
    return Reconstruction(
        stamp, 0, False, none, none, False, none, none, False, none, False, none, none, "no data"
    )
