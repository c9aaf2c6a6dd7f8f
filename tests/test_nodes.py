"""The published fields, as a subscriber sees them."""

import math
import re

import pytest
import rclpy
from geometry_msgs.msg import AccelStamped
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from lfd_diagnosis.diagnosis_node import EVENT_QOS, DiagnosisNode
from lfd_mpc.errors import UserError
from lfd_mpc.messages import from_time, to_time
from lfd_mpc.mpc_node import MpcNode
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_msgs.msg import (
    FaultEvent,
    FaultReport,
    ObserverBank,
    PredictionHorizon,
    RadarTarget,
    SignalFault,
)
from lfd_observer.observer_node import ObserverNode
from ros_support import REPLAY_ARGUMENTS, Graph

N = 20
STEP = 10_000_000


class Subscriber:
    """Collects the messages of one topic."""

    def __init__(self, node: Node, kind, topic: str, qos=PIPELINE_QOS) -> None:
        self.messages: list = []
        node.create_subscription(kind, topic, self.messages.append, qos)


class SensorRig:
    """Publishes what a car's sensors would, and watches the controller."""

    def __init__(self, graph: Graph) -> None:
        self.graph, qos = graph, qos_profile_sensor_data
        self.node = graph.add(rclpy.create_node("rig", context=graph.context))
        self.radar = self.node.create_publisher(RadarTarget, "radar/target", qos)
        self.imu = self.node.create_publisher(Imu, "vehicle/imu", qos)
        self.horizons = Subscriber(self.node, PredictionHorizon, "mpc/horizon")
        self.commands = Subscriber(self.node, AccelStamped, "mpc/command")

    def wait_for_subscribers(self) -> None:
        self.graph.spin_until(
            lambda: (
                self.radar.get_subscription_count()
                and self.imu.get_subscription_count()
                and self.node.count_publishers("mpc/horizon")
            ),
            "the controller listens",
        )
        self.graph.spin_for(0.2)

    def see(self, stamp: int, clearance: float, velocity: float, **fields) -> None:
        message = RadarTarget(
            has_target=True, clearance=clearance, relative_velocity=velocity, track_id=5
        )
        for name, value in fields.items():
            setattr(message, name, value)
        message.header.stamp = to_time(stamp)
        self.radar.publish(message)

    def feel(self, stamp: int, acceleration: float) -> None:
        message = Imu()
        message.header.stamp = to_time(stamp)
        message.linear_acceleration.x = acceleration
        self.imu.publish(message)

    def step(self, stamp: int, acceleration: float = 0.0) -> PredictionHorizon:
        """Release one step and wait for its horizon."""
        count = len(self.horizons.messages)
        self.feel(stamp, acceleration)
        self.graph.spin_until(lambda: len(self.horizons.messages) > count, "the step is answered")
        return self.horizons.messages[-1]


@pytest.fixture
def graph():
    with Graph() as made:
        yield made


def test_horizon_carries_inputs_solution_and_counts(graph: Graph) -> None:
    graph.add(MpcNode(context=graph.context))
    rig = SensorRig(graph)
    rig.wait_for_subscribers()
    rig.see(0, 30.0, -2.0)
    horizon = rig.step(20_000_000, 0.5)
    graph.spin_until(lambda: len(rig.horizons.messages) == 3, "three steps: 0, 10 and 20 ms")
    assert [from_time(m.header.stamp) for m in rig.horizons.messages] == [0, STEP, 2 * STEP]
    horizon = rig.horizons.messages[-1]
    assert horizon.valid and horizon.solver_status == "solved" and horizon.residual <= 1e-9
    assert horizon.measured_clearance == 30.0
    assert horizon.clearance == pytest.approx(30.0 - 2.0 * 0.02)
    assert horizon.clearance_age == pytest.approx(0.02)
    assert horizon.acceleration == 0.5 and horizon.host_speed_stale
    assert len(horizon.predicted_clearance) == len(horizon.input_sequence) == N
    assert horizon.step == 3 and horizon.late_samples == 0 and horizon.fallbacks == 0
    graph.spin_until(lambda: len(rig.commands.messages) == 3, "three commands")
    assert rig.commands.messages[-1].accel.linear.x == horizon.command
    assert rig.horizons.messages[0].restart_reason == "start"


def test_a_reliable_controller_leaves_the_next_one_best_effort(graph: Graph) -> None:
    first = MpcNode(context=graph.context, cli_args=REPLAY_ARGUMENTS)
    first.destroy_node()
    graph.add(MpcNode(context=graph.context))
    rig = SensorRig(graph)
    rig.wait_for_subscribers()
    (info,) = rig.node.get_subscriptions_info_by_topic("radar/target")
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


def test_nothing_that_a_sensor_says_ends_the_controller(graph: Graph) -> None:
    graph.add(MpcNode(context=graph.context))
    rig = SensorRig(graph)
    rig.wait_for_subscribers()
    stamp = 1_000_000_000
    for value in (math.nan, math.inf, -math.inf, -5.0, 1e300, -1e308, 0.0):
        rig.see(stamp, value, value, track_id=-(2**63))
        rig.feel(stamp - 5_000_000_000, value)
        rig.feel(stamp + 50_000_000_000_000, value)
        rig.see(0, value, 1.0)
        stamp += STEP
        horizon = rig.step(stamp, value)
        assert math.isfinite(horizon.command) and abs(horizon.command) <= 5.0
    for _ in range(10):
        rig.see(stamp, 30.0, 0.0)
        stamp += STEP
        horizon = rig.step(stamp, 0.1)
    assert horizon.valid and horizon.clearance == pytest.approx(30.0)
    assert horizon.bad_samples > 0 and horizon.refused_samples > 0


NAMES = {MpcNode: "mpc_node", ObserverNode: "observer_node", DiagnosisNode: "diagnosis_node"}


@pytest.mark.parametrize(
    ("kind", "argument", "named"),
    [
        (MpcNode, "solver:=nonsense", "nonsense"),
        (MpcNode, "input_weight:=0.0", "positive definite"),
        (
            MpcNode,
            "preview_time:=99.0",
            "mpc_node: parameter preview_time: 99.0 is out of range; 0.0 to 10.0 is expected",
        ),
        (
            MpcNode,
            "prediction_steps:=999",
            "mpc_node: parameter prediction_steps: 999 is out of range; 2 to 100 is expected",
        ),
        (MpcNode, "preview_tiem:=1.0", "preview_tiem"),
        (MpcNode, "preview_time:=soon", "preview_time"),
        (MpcNode, "receipts:=soon", "receipts"),
        (MpcNode, "preview_time:='2.0'", "preview_time"),
        (ObserverNode, "injection_gain:=1.0", "injection_gain"),
        (ObserverNode, "lags:=[3, 0]", "observer_node: lags must increase"),
        (DiagnosisNode, "confidence_max:=5", "confidence_max"),
    ],
)
def test_a_wrong_parameter_is_refused_by_name(graph, kind, argument: str, named: str) -> None:
    with pytest.raises(UserError) as error:
        graph.add(kind(context=graph.context, cli_args=["--ros-args", "-p", argument]))
    said = str(error.value)
    assert named in said and re.search(rf"^{NAMES[kind]}: |^unknown .* for {NAMES[kind]};", said)
    assert "\n" not in said and not said.endswith(f": {argument.partition(':')[0]}")


def test_a_whole_number_will_do_where_any_number_will(graph: Graph) -> None:
    arguments = ["--ros-args", "-p", "preview_time:=2"]
    node = graph.add(MpcNode(context=graph.context, cli_args=arguments))
    assert node.get_parameter("preview_time").value == 2.0


class DiagnosisRig:
    """Feeds the paper's diagnosis horizons and banks, and watches what it says."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        paper = ["--ros-args", "-p", "profile:=paper"]
        graph.add(DiagnosisNode(context=graph.context, cli_args=paper))
        self.node = graph.add(rclpy.create_node("rig", context=graph.context))
        self.horizon = self.node.create_publisher(PredictionHorizon, "mpc/horizon", PIPELINE_QOS)
        self.bank = self.node.create_publisher(ObserverBank, "observer/bank", PIPELINE_QOS)
        self.reports = Subscriber(self.node, FaultReport, "diagnosis/faults")
        self.events = Subscriber(self.node, FaultEvent, "diagnosis/events", EVENT_QOS)
        graph.spin_until(
            lambda: (
                self.horizon.get_subscription_count()
                and self.bank.get_subscription_count()
                and self.node.count_publishers("diagnosis/faults")
                and self.node.count_publishers("diagnosis/events")
            ),
            "the diagnosis listens",
        )
        graph.spin_for(0.2)
        self.number = 0

    def step(self, index: float = 0.0, clearance: float = 30.0, **changes) -> FaultReport:
        """One step of a steady lead with the given acceleration index."""
        self.number += 1
        stamp = to_time(self.number * STEP)
        horizon = PredictionHorizon(
            step=self.number,
            valid=True,
            has_target=True,
            clearance=clearance,
            relative_velocity=0.0,
            predicted_clearance=[30.0] * N,
            predicted_relative_velocity=[0.0] * N,
            input_sequence=[0.0] * N,
        )
        for name, value in changes.items():
            setattr(horizon, name, value)
        horizon.header.stamp = stamp
        bank = ObserverBank(
            step=self.number,
            ready=True,
            lags=[0],
            weights=[1.0],
            relative_acceleration=[0.0],
            output_error=[0.0],
            acceleration_lower=[-2.0],
            acceleration_upper=[2.0],
            outside=[index > 0],
            acceleration_index=index,
        )
        bank.header.stamp = stamp
        # The order of arrival must not matter.
        first, second = (self.bank, self.horizon) if self.number % 2 else (self.horizon, self.bank)
        for publisher in (first, second):
            publisher.publish(bank if publisher is self.bank else horizon)
        self.graph.spin_until(
            lambda: self.reports.messages and self.reports.messages[-1].step == self.number,
            f"report {self.number}",
        )
        return self.reports.messages[-1]

    def fill(self) -> None:
        """Steps until the stores are full."""
        for _ in range(N):
            report = self.step()
            assert report.clearance.state == SignalFault.NOT_READY
            assert math.isnan(report.clearance.index)
        assert self.step().clearance.state == SignalFault.OK


@pytest.mark.parametrize(("offset", "counts"), [(-1e-9, False), (0.0, True), (1e-9, True)])
def test_confidence_grows_at_and_above_the_threshold_only(graph, offset: float, counts) -> None:
    rig = DiagnosisRig(graph)
    rig.fill()
    threshold = rig.step().acceleration.threshold
    report = rig.step(index=threshold + offset)
    assert report.acceleration.confidence == (1 if counts else 0)
    assert report.acceleration.state == (SignalFault.SUSPECT if counts else SignalFault.OK)


def test_a_fault_is_declared_at_ten_and_explains_itself(graph: Graph) -> None:
    rig = DiagnosisRig(graph)
    rig.fill()
    for confidence in range(1, 10):
        fault = rig.step(index=1.0).acceleration
        assert (fault.state, fault.confidence) == (SignalFault.SUSPECT, confidence)
    fault = rig.step(index=1.0).acceleration
    assert (fault.state, fault.confidence) == (SignalFault.FAULT, 10)
    assert from_time(fault.since) == rig.number * STEP
    assert fault.confidence_threshold == 10 and "observers exclude" in fault.reason
    for _ in range(30):
        fault = rig.step(index=1.0).acceleration
    assert fault.confidence == 20
    for _ in range(10):
        assert rig.step().acceleration.state == SignalFault.FAULT
    assert rig.step().acceleration.state == SignalFault.SUSPECT
    states = [SignalFault.NOT_READY, SignalFault.OK, SignalFault.SUSPECT, SignalFault.FAULT]
    states.append(SignalFault.SUSPECT)

    def seen() -> list[int]:
        """States in turn; where this machine stalled, the wall timer said NO_DATA in between."""
        own = [event.fault.state for event in rig.events.messages if event.signal == "acceleration"]
        told = [SignalFault.NOT_READY, *(s for s in own if s != SignalFault.NO_DATA)]
        return [state for state, before in zip(told[1:], told, strict=False) if state != before]

    graph.spin_until(lambda: seen()[-4:] == states[1:], f"the states {states}")


def test_a_clearance_off_its_predictions_makes_the_radar_faulty(graph: Graph) -> None:
    rig = DiagnosisRig(graph)
    rig.fill()
    for _ in range(10):
        report = rig.step(clearance=34.0)
    assert report.clearance.index == 1.0
    assert report.clearance.state == report.radar.state == SignalFault.FAULT
    assert report.relative_velocity.state == SignalFault.OK
    assert "20 of 20 predictions disagree with 34.00 m" in report.radar.reason


def test_silent_sensors_and_an_empty_road_are_told_apart(graph: Graph) -> None:
    rig = DiagnosisRig(graph)
    rig.fill()
    nothing = {"valid": False, "predicted_clearance": [], "predicted_relative_velocity": []}
    report = rig.step(has_target=False, solver_status="no target", **nothing)
    assert report.radar.state == SignalFault.NO_TARGET
    report = rig.step(
        clearance_stale=True, relative_velocity_stale=True, clearance_age=0.2, **nothing
    )
    assert report.radar.state == SignalFault.NO_DATA and "0.20 s" in report.radar.reason
    report = rig.step(acceleration_stale=True, acceleration_age=math.nan)
    assert report.acceleration.state == SignalFault.NO_DATA
    assert report.clearance.state == SignalFault.NOT_READY


def test_when_nothing_arrives_the_wall_timer_says_no_data(graph: Graph) -> None:
    rig = DiagnosisRig(graph)
    rig.fill()
    stepped = rig.reports.messages[-1]
    graph.spin_until(lambda: rig.reports.messages[-1].step == 0, "a report of no step", 3.0)
    report = rig.reports.messages[-1]
    for fault in (report.clearance, report.relative_velocity, report.radar, report.acceleration):
        assert fault.state == SignalFault.NO_DATA
        assert fault.reason.endswith("nothing arrives at all")
    silent_for = (from_time(report.header.stamp) - from_time(stepped.header.stamp)) * 1e-9
    assert 0.1 <= silent_for <= 3.0, "in the stamps' own time"
    assert rig.step().clearance.state == SignalFault.OK


def test_simulated_time_that_is_set_while_it_runs_makes_a_pause_no_silence(graph: Graph) -> None:
    rig = DiagnosisRig(graph)
    (diagnosis,) = (node for node in graph.nodes if isinstance(node, DiagnosisNode))
    assert diagnosis.set_parameters([Parameter("use_sim_time", value=True)])[0].successful
    clock = rig.node.create_publisher(Clock, "/clock", 10)
    graph.spin_until(clock.get_subscription_count, "the clock is heard")
    rig.node.create_timer(0.05, lambda: clock.publish(Clock(clock=to_time(STEP))))
    graph.spin_for(0.3)
    rig.step()
    count = len(rig.reports.messages)
    graph.spin_for(2.5)
    assert len(rig.reports.messages) == count


def test_reset_forgets_confidence(graph: Graph) -> None:
    rig = DiagnosisRig(graph)
    rig.fill()
    for _ in range(10):
        report = rig.step(index=1.0)
    assert report.acceleration.state == SignalFault.FAULT
    client = rig.node.create_client(Trigger, "diagnosis_node/reset")
    graph.spin_until(client.service_is_ready, "the service is there")
    future = client.call_async(Trigger.Request())
    graph.spin_until(future.done, "the service answers")
    assert future.result().success
    report = rig.step(index=1.0)
    assert report.acceleration.confidence == 1
    assert report.clearance.state == SignalFault.NOT_READY


def test_a_horizon_of_another_length_does_not_end_a_node(graph: Graph) -> None:
    graph.add(ObserverNode(context=graph.context))
    rig = DiagnosisRig(graph)
    wrong = PredictionHorizon(step=1, valid=True, predicted_clearance=[1.0])
    wrong.predicted_relative_velocity = [1.0]
    rig.horizon.publish(wrong)
    graph.spin_for(0.3)
    rig.number = 1
    assert rig.step().acceleration.state in (SignalFault.OK, SignalFault.NOT_READY)
