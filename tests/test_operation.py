"""What operators of the graph use: diagnostics, parameters, services, namespaces, layouts."""

import json
import math
import os
import subprocess
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import rclpy
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import TwistStamped
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger
from test_live_equals_offline import drive
from test_mpc import planned
from test_player import call, pump_until
from visualization_msgs.msg import MarkerArray

from lfd_bringup.layouts import LAYOUTS, PLOTS, curves
from lfd_bringup.recorder import TOPICS, RecorderNode
from lfd_diagnosis.diagnosis import make_diagnosis
from lfd_diagnosis.diagnosis_node import DiagnosisNode
from lfd_diagnosis.markers import COLOURS, colour_of, markers
from lfd_diagnosis.sensor_health import HARDWARE, LEVELS, SensorHealth
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import VERDICTS, State
from lfd_mpc.health import Level, StepHealth
from lfd_mpc.messages import to_time
from lfd_mpc.mpc_node import MpcNode
from lfd_mpc.node_support import PIPELINE_QOS, READY_QOS
from lfd_mpc.sensor_inputs import INPUT_TOPICS
from lfd_mpc.settings import STEP_NS, MpcSettings
from lfd_msgs.msg import FaultReport, RadarTarget, SignalFault
from lfd_msgs.srv import InjectFault
from lfd_observer.observer_node import ObserverNode
from lfd_observer.settings import BankSettings
from lfd_replay.fault_injector import FaultInjectorNode
from lfd_replay.faults import GRAMMAR, FaultInjector, parse_faults
from lfd_replay.offline import OfflineGraph
from lfd_replay.parameter_table import parameter_table
from lfd_replay.player import PlayerNode, PlayOptions
from lfd_replay.profiles import graph_settings
from lfd_replay.sample_publishers import SamplePublishers
from lfd_vehicle.settings import TABLES
from ros_support import REPLAY_ARGUMENTS, Graph

pytestmark = pytest.mark.alone

ROOT = Path(__file__).parent.parent
BRINGUP = ROOT / "ros2_ws/src/lfd_bringup"


@pytest.fixture
def graph():
    with Graph() as made:
        yield made


class Watcher:
    """A node that collects messages."""

    def __init__(self, graph: Graph, kind, topic: str, qos=10) -> None:
        self.node = graph.add(rclpy.create_node("watcher", context=graph.context))
        self.messages: list = []
        self.node.create_subscription(kind, topic, self.messages.append, qos)


def ask(graph: Graph, kind, service: str, request):
    """Call a service and wait for its answer."""
    node = graph.add(rclpy.create_node("asking", context=graph.context))
    client = node.create_client(kind, service)
    graph.spin_until(client.service_is_ready, f"{service} is there")
    future = client.call_async(request)
    graph.spin_until(future.done, f"{service} answers")
    return future.result()


def set_parameter(graph: Graph, node: str, name: str, value):
    """Set one parameter from outside; the result."""
    parameter = Parameter(name, value=value).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    (result,) = ask(graph, SetParameters, f"{node}/set_parameters", request).results
    return result


# --- /diagnostics


def until_said(graph: Graph, capfd, words: str) -> str:
    """Spin until a node has logged such words; returns all that was logged since asked last."""
    output = ""

    def said() -> bool:
        nonlocal output
        output += capfd.readouterr().err
        return words in output

    graph.spin_until(said, words)
    return output


def statuses(watcher: Watcher) -> dict[str, list]:
    """All statuses that were heard, by name."""
    heard: dict[str, list] = {}
    for array in watcher.messages:
        for status in array.status:
            heard.setdefault(status.name, []).append(status)
    return heard


def play_with_diagnostics(graph: Graph, fault: str) -> dict[str, list]:
    watcher = Watcher(graph, DiagnosticArray, "/diagnostics", 1000)
    graph.add_graph(REPLAY_ARGUMENTS)
    graph.spin_until(lambda: watcher.messages, "first statuses")
    samples = drive(3.0)
    if fault:
        samples = FaultInjector(parse_faults([fault]), 0, 0).apply(samples)
    graph.play(samples, 1.0, ["mpc_node", "observer_node", "diagnosis_node"])
    count = len(watcher.messages)
    graph.spin_until(lambda: len(watcher.messages) >= count + 3, "a last status of each node")
    return statuses(watcher)


def test_diagnostics_have_one_status_per_sensor_and_node(graph: Graph) -> None:
    heard = play_with_diagnostics(graph, "")
    nodes = [f"{name}: steps" for name in ("mpc_node", "observer_node", "diagnosis_node")]
    sensors = [f"diagnosis_node: {name}" for name in VERDICTS]
    assert set(heard) == {*nodes, *sensors}
    for name in VERDICTS:
        assert heard[f"diagnosis_node: {name}"][0].hardware_id == HARDWARE[name]
    levels = {s.level for s in heard["diagnosis_node: clearance"]}
    assert bytes([Level.OK]) in levels and bytes([Level.ERROR]) not in levels
    for name in nodes:
        assert "waiting for the first step" in heard[name][0].message
        busy = [s for s in heard[name] if "steps in the last second" in s.message]
        assert busy, [s.message for s in heard[name]]
        values = {pair.key: pair.value for pair in busy[-1].values}
        assert 50 <= int(values["rate [1/s]"]) <= 150 and values["missed steps"] == "0"
        assert float(values["time of a step, mean [ms]"]) > 0.0
    mpc = {pair.key: pair.value for pair in heard["mpc_node: steps"][-1].values}
    assert mpc["steps that were solved anew"] == "0" and mpc["solver"] == "solved"


def test_a_fault_shorter_than_a_second_is_seen_with_its_figures(graph: Graph) -> None:
    heard = play_with_diagnostics(graph, "offset:acceleration=4@1.2-1.5")
    faulty = [s for s in heard["diagnosis_node: acceleration"] if s.level == bytes([Level.ERROR])]
    assert faulty
    values = {pair.key: pair.value for pair in faulty[0].values}
    assert values["state"] == "FAULT" and values["kind"] == "OFFSET"
    assert float(values["index"]) >= float(values["limit of the index"])
    assert int(values["confidence"]) >= int(values["limit of the confidence"])
    assert 1.2 <= float(values["since [s]"]) < 1.5
    assert "host speed" in faulty[0].message
    assert heard["diagnosis_node: clearance"][-1].level != bytes([Level.ERROR])


def outcome_of(state: State):
    """A report whose clearance is in a state, and the event that said so."""
    steps = list(OfflineGraph(graph_settings("robust")).run(drive(1.0)))
    outcome = steps[-1].outcome
    outcome.report.clearance.state = state
    return outcome.report


@pytest.mark.parametrize("state", list(State))
def test_levels_follow_the_documented_table(state: State) -> None:
    health = SensorHealth()
    health.take(outcome_of(state), [])
    status = next(s for s in health.statuses(of_period=True) if s.name == "clearance")
    assert status.level == LEVELS[state]
    documented = (ROOT / "docs/operation.md").read_text()
    level = {state.name for state, level in LEVELS.items() if level == status.level}
    row = next(
        line for line in documented.splitlines() if line.startswith(f"| {status.level.name}")
    )
    assert all(name in row for name in level)


@pytest.mark.parametrize("profile", ["robust", "paper"])
def test_what_a_profile_does_not_use_is_nothing_to_warn_of(profile: str) -> None:
    settings = graph_settings(profile)
    silent = [sample for sample in drive(3.0) if sample.input != "host_speed"]
    health = SensorHealth()
    health.take(list(OfflineGraph(settings).run(silent))[-1].outcome.report, [])
    levels = {status.name: status.level for status in health.statuses(of_period=True)}
    assert levels["host_speed"] == levels["lead_acceleration"] == Level.OK


@pytest.mark.parametrize(
    ("events", "level", "words"),
    [
        ([], Level.WARN, "waiting"),
        ([(0.0, 0, 0.001), (0.01, 10_000_000, 0.001)], Level.OK, "2 steps"),
        ([(0.0, 0, 0.001), (0.01, 20_000_000, 0.001)], Level.WARN, "1 steps missed"),
        ([(0.0, 0, 0.001), (0.01, 5_000_000_000, 0.001)], Level.OK, "2 steps"),
        ([(0.0, 0, 0.0101)], Level.WARN, "10.1 ms"),
        ([(-0.51, 0, 0.001)], Level.STALE, "no step for 0.6 s"),
    ],
)
def test_a_node_says_how_its_steps_go(events, level: Level, words: str) -> None:
    health = StepHealth()
    for wall, stamp, duration in events:
        health.step(wall, stamp, duration)
    made = health.health("steps", 0.05, {})
    assert made.level == level and words in made.message


# --- parameters


def test_every_parameter_is_described_and_the_table_is_current(graph: Graph) -> None:
    assert (ROOT / "docs/parameters.md").read_text() == parameter_table(TABLES)
    graph.add_graph()
    for node, kind in (
        ("mpc_node", MpcSettings),
        ("observer_node", BankSettings),
        ("diagnosis_node", DiagnosisSettings),
    ):
        names = list(kind.model_fields)
        request = DescribeParameters.Request(names=names)
        answer = ask(graph, DescribeParameters, f"{node}/describe_parameters", request)
        for name, descriptor in zip(names, answer.descriptors, strict=True):
            assert descriptor.description.endswith("]"), name
            if descriptor.type == ParameterType.PARAMETER_DOUBLE:
                assert descriptor.floating_point_range, name
            if descriptor.type == ParameterType.PARAMETER_INTEGER:
                assert descriptor.integer_range, name


@pytest.mark.parametrize(
    ("kind", "name", "value", "named"),
    [
        (DiagnosisNode, "clearance_floor", -1.0, "clearance_floor"),
        (DiagnosisNode, "profile", "magic", "profile"),
        (DiagnosisNode, "confidence_max", 5, "confidence_max"),
        (DiagnosisNode, "prediction_steps", 10, "read-only"),
        (ObserverNode, "injection_gain", 1.0, "injection_gain"),
        (MpcNode, "solver", "magic", "magic"),
        (MpcNode, "input_weight", 0.0, "positive definite"),
    ],
)
def test_a_wrong_value_is_refused_while_running(graph, kind, name, value, named: str) -> None:
    node = graph.add(kind(context=graph.context))
    before = node.get_parameter(name).value
    result = set_parameter(graph, node.get_name(), name, value)
    assert not result.successful and named in result.reason
    assert not result.reason.startswith("Value error")
    assert node.get_parameter(name).value == before


def test_a_threshold_changed_while_running_holds_from_the_next_step_on(graph: Graph) -> None:
    recorder = graph.add(RecorderNode(lambda event: None, context=graph.context))
    graph.add_graph(REPLAY_ARGUMENTS)
    options, nodes = PlayOptions(rate=1.0), ["mpc_node", "observer_node", "diagnosis_node"]
    player = graph.add(PlayerNode(drive(6.0), options, nodes, graph.context))
    pump_until(graph, player, lambda: player.played > 2.0, "two seconds")

    def limits() -> set[float]:
        report = recorder.messages("diagnosis/faults")[-1]
        return {report.acceleration.confidence_threshold}

    assert limits() == {4}
    pump_during(graph, player, "diagnosis_node", "acceleration_steps", 7)
    pump_until(graph, player, lambda: limits() == {7}, "the new limit is published")
    pump_during(graph, player, "diagnosis_node", "profile", "paper")
    pump_until(graph, player, lambda: limits() == {10}, "the paper's limit is published")
    report = recorder.messages("diagnosis/faults")[-1]
    assert report.host_speed.state == SignalFault.NOT_READY
    pump_until(
        graph,
        player,
        lambda: recorder.messages("diagnosis/faults")[-1].acceleration.state == SignalFault.OK,
        "the paper profile judges",
    )


def test_weights_and_gains_change_while_running(graph: Graph) -> None:
    recorder = graph.add(RecorderNode(lambda event: None, context=graph.context))
    graph.add_graph(REPLAY_ARGUMENTS)
    options, nodes = PlayOptions(rate=1.0), ["mpc_node", "observer_node", "diagnosis_node"]
    player = graph.add(PlayerNode(drive(5.0), options, nodes, graph.context))
    pump_until(graph, player, lambda: player.played > 1.0, "a second")
    pump_during(graph, player, "mpc_node", "relative_velocity_weight", 50.0)
    pump_during(graph, player, "observer_node", "weight_decay", 0.5)
    held = player.played
    pump_until(graph, player, lambda: player.played > held + 0.5, "some more")
    after, bank = recorder.messages("mpc/horizon")[-1], recorder.messages("observer/bank")[-1]
    inputs = after.clearance, after.relative_velocity, after.acceleration, after.host_speed
    weighed = planned(*inputs, relative_velocity_weight=50.0).command
    assert after.valid and after.command == pytest.approx(weighed, abs=1e-9)
    assert abs(weighed - planned(*inputs).command) > 0.01
    assert bank.weights[1] == pytest.approx(0.5 * bank.weights[0])


def pump_during(graph: Graph, player: PlayerNode, node: str, name: str, value) -> None:
    """Set a parameter while the player goes on."""
    client_node = graph.add(rclpy.create_node("changing", context=graph.context))
    client = client_node.create_client(SetParameters, f"{node}/set_parameters")
    pump_until(graph, player, client.service_is_ready, "the service is there")
    parameter = Parameter(name, value=value).to_parameter_msg()
    future = client.call_async(SetParameters.Request(parameters=[parameter]))
    pump_until(graph, player, future.done, "the service answers")
    assert future.result().results[0].successful, future.result().results[0].reason


def test_changed_settings_judge_as_if_they_had_been_there() -> None:
    """Limits that are changed in the middle are those of a graph that was started with them."""

    samples = drive(4.0)
    steps = list(OfflineGraph(graph_settings("robust")).run(samples))
    changed = make_diagnosis(DiagnosisSettings())
    other = make_diagnosis(DiagnosisSettings(clearance_floor=3.0, acceleration_steps=9))
    for number, step in enumerate(steps):
        if number == 200:
            settings = DiagnosisSettings(clearance_floor=3.0, acceleration_steps=9)
            assert changed.change(settings) is changed
        late = changed.step(step.horizon, step.bank)
        always = other.step(step.horizon, step.bank)
        if number > 200:
            assert late.report.clearance.index == always.report.clearance.index
            assert late.report.acceleration.confidence_threshold == 9


# --- fault injector and player


def test_faults_are_injected_and_cleared_live(graph: Graph, capfd) -> None:
    graph.add(FaultInjectorNode(context=graph.context))
    sensor = graph.add(rclpy.create_node("sensor", context=graph.context))
    radar = sensor.create_publisher(RadarTarget, "sensors/radar/target", 10)
    heard = Watcher(graph, RadarTarget, "radar/target")
    graph.spin_until(
        lambda: radar.get_subscription_count() and heard.node.count_publishers("radar/target"),
        "everyone listens",
    )
    graph.spin_for(0.2)
    sent = 0

    def see(clearance: float) -> float:
        nonlocal sent
        message = RadarTarget(has_target=True, clearance=clearance, track_id=7, sensor_text="x")
        message.header.stamp.nanosec = sent * 50_000_000
        message.header.frame_id = "bumper"
        count, sent = len(heard.messages), sent + 1
        radar.publish(message)
        graph.spin_until(lambda: len(heard.messages) > count, "it passes")
        assert heard.messages[-1].header.frame_id == "bumper"
        assert heard.messages[-1].track_id == 7
        return heard.messages[-1].clearance

    def inject(text: str) -> InjectFault.Response:
        request = InjectFault.Request(fault=text)
        return ask(graph, InjectFault, "fault_injector/inject", request)

    assert not inject("offset:clearance=4@0-1").success
    assert see(30.0) == 30.0
    answer = inject("offset:clearance=4@0-0.12")
    assert answer.success and "from 0.000 s on" in answer.message
    # 50 and 100 ms are within 0.12 s of the newest sample, 150 ms is not.
    assert [see(30.0), see(30.0), see(30.0)] == [34.0, 34.0, 30.0]
    assert inject("hold:clearance@0-10").success
    assert [see(31.0), see(32.0)] == [30.0, 30.0]
    assert ask(graph, Trigger, "fault_injector/clear", Trigger.Request()).success
    assert see(33.0) == 33.0
    wrong = inject("melt:radar@1-2")
    assert not wrong.success and "melt" in wrong.message and "kinds:" in wrong.message
    (line,) = [line for line in capfd.readouterr().err.splitlines() if "unknown kind" in line]
    assert line.startswith("[WARN]") and line.endswith(f"a fault is written {GRAMMAR}")
    assert inject(" ").message == f"fault ' ': expected {GRAMMAR}"


def test_a_paused_player_goes_on_step_by_step(graph: Graph) -> None:
    player = graph.add(PlayerNode(drive(3.0), PlayOptions(), [], graph.context))
    pump_until(graph, player, lambda: player.played > 0.2, "some of it is played")
    assert not call(graph, player, "step").success
    assert call(graph, player, "pause").success
    held = player.played
    for _ in range(5):
        before = player.played
        assert call(graph, player, "step").success
        assert before < player.played <= before + 0.0101
    assert held + 0.04 <= player.played <= held + 0.05


# --- start


def test_nodes_come_up_in_any_order_and_name_what_they_wait_for(graph: Graph, capfd) -> None:
    ready = Watcher(graph, String, "ready", READY_QOS)
    graph.add(DiagnosisNode(context=graph.context))
    words = "waiting for a publisher on mpc/horizon, observer/bank"
    output = until_said(graph, capfd, words)
    assert output.count("waiting for a publisher") == 1
    graph.add(ObserverNode(context=graph.context))
    graph.add(MpcNode(context=graph.context))
    graph.spin_until(lambda: len(ready.messages) == 2, "diagnosis and bank are ready")
    until_said(graph, capfd, "waiting for a publisher on radar/target, vehicle/imu")
    graph.add(PlayerNode(drive(1.0), PlayOptions(), ["mpc_node"], graph.context))
    graph.spin_until(lambda: len(ready.messages) == 3, "all are ready")
    assert {m.data for m in ready.messages} == {"/mpc_node", "/observer_node", "/diagnosis_node"}


def test_a_publisher_of_another_type_is_named_and_is_none(graph: Graph, capfd) -> None:
    graph.add(MpcNode(context=graph.context))
    elsewhere = rclpy.Context()
    rclpy.init(context=elsewhere, domain_id=graph.domain)
    other = rclpy.create_node("other", context=elsewhere)
    other.create_publisher(Float64, "radar/target", 10)
    other.create_publisher(Imu, "vehicle/imu", 10)
    output = until_said(graph, capfd, "waiting for a publisher on")
    assert "radar/target (there is one of std_msgs/msg/Float64, not lfd_msgs/msg/Radar" in output
    assert "vehicle/imu" not in output.split("waiting")[1]
    ready = Watcher(graph, String, "ready", READY_QOS)
    graph.spin_for(0.2)
    assert not ready.messages
    driver = graph.add(rclpy.create_node("driver", context=graph.context))
    driver.create_publisher(RadarTarget, "radar/target", 10)
    graph.spin_until(lambda: ready.messages, "ready with the right one")
    other.destroy_node()
    rclpy.shutdown(context=elsewhere)


def test_two_sources_of_one_input_and_stamps_that_fit_no_other_are_told(graph: Graph) -> None:
    graph.add(MpcNode(context=graph.context))
    watcher = Watcher(graph, DiagnosticArray, "/diagnostics", 100)
    driver = graph.add(rclpy.create_node("driver", context=graph.context))
    imus = [driver.create_publisher(Imu, "vehicle/imu", 10) for _ in range(2)]
    twist = driver.create_publisher(TwistStamped, "vehicle/twist", 10)
    graph.spin_until(
        lambda: twist.get_subscription_count() and imus[0].get_subscription_count(), "it hears"
    )
    said = set()
    number = 0

    def drive_until(words: str, ahead: int, felt: float = 0.0) -> None:
        nonlocal number
        deadline = time.monotonic() + 15.0
        while not any(words in message for message in said):
            assert time.monotonic() < deadline, (words, said)
            number += 1
            imu, speed = Imu(), TwistStamped()
            imu.header.stamp = to_time(number * STEP_NS)
            imu.linear_acceleration.x = felt
            speed.header.stamp = to_time((number + ahead) * STEP_NS)
            imus[0].publish(imu)
            twist.publish(speed)
            graph.spin_for(0.01)
            said.update(s.message for m in watcher.messages for s in m.status)

    drive_until("samples refused in the last second: stamps that fit no other input", 500)
    drive_until("samples in the last second are no numbers", 0, math.nan)
    drive_until("more than one publisher on /vehicle/imu", 0)


# --- quality of service, namespaces


@pytest.mark.parametrize("offered", [ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE])
@pytest.mark.parametrize(
    "durability", [DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL]
)
@pytest.mark.parametrize("wanted", ["best_effort", "reliable"])
def test_every_sensor_profile_is_heard_or_named(graph, capfd, offered, durability, wanted) -> None:
    arguments = ["--ros-args"]
    for _, topic, _ in INPUT_TOPICS.values():
        arguments += ["-p", f"qos_overrides./{topic}.subscription.reliability:={wanted}"]
    graph.add(MpcNode(context=graph.context, cli_args=arguments))
    driver = graph.add(rclpy.create_node("radar_driver", context=graph.context))
    qos = QoSProfile(depth=10, reliability=offered, durability=durability)
    radar = driver.create_publisher(RadarTarget, "radar/target", qos)
    heard = wanted == "best_effort" or offered == ReliabilityPolicy.RELIABLE
    if heard:
        graph.spin_until(radar.get_subscription_count, "the controller hears it")
        return
    output = until_said(graph, capfd, "/radar_driver can be heard")
    line = next(line for line in output.splitlines() if "/radar_driver" in line)
    assert "it offers best effort" in line and "wanted is reliable" in line
    assert "qos_overrides./radar/target.subscription" in line


def test_a_subscriber_that_asks_for_too_much_is_named(graph: Graph, capfd) -> None:
    graph.add(DiagnosisNode(context=graph.context))
    dashboard = graph.add(rclpy.create_node("dashboard", context=graph.context))
    qos = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    dashboard.create_subscription(FaultReport, "diagnosis/faults", lambda _: None, qos)
    output = until_said(graph, capfd, "/dashboard cannot hear this node")
    assert "it wants reliable, transient local" in output


def test_two_vehicles_share_one_graph(graph: Graph) -> None:
    """Each in its namespace: one has a fault, the other has not."""
    recorders = {}
    for car in ("car1", "car2"):
        prefix = ["--ros-args", "-r", f"__ns:=/{car}", "-p", "use_sim_time:=true"]
        for _, topic, _ in INPUT_TOPICS.values():
            prefix += ["-p", f"qos_overrides./{car}/{topic}.subscription.reliability:=reliable"]
        for kind in (MpcNode, ObserverNode, DiagnosisNode):
            graph.add(kind(context=graph.context, cli_args=prefix))
        recorders[car] = Watcher(graph, FaultReport, f"/{car}/diagnosis/faults", 5000)
    watcher = Watcher(graph, DiagnosticArray, "/diagnostics", 100)
    samples = {"car1": drive(2.5), "car2": drive(2.5)}

    samples["car1"] = FaultInjector(parse_faults(["offset:acceleration=4@1-2.5"]), 0, 0).apply(
        samples["car1"]
    )
    outputs = {
        car: SamplePublishers(
            graph.add(rclpy.create_node("sensors", namespace=car, context=graph.context)),
            PIPELINE_QOS,
        )
        for car in samples
    }
    graph.spin_until(
        lambda: all(
            recorders[car].node.count_subscribers(topic)
            for car in samples
            for topic in outputs[car].topics
        ),
        "both listen",
    )
    graph.spin_for(0.3)
    for one, other in zip(samples["car1"], samples["car2"], strict=True):
        outputs["car1"].publish(one)
        outputs["car2"].publish(other)
        graph.executor.spin_once(timeout_sec=0.0)
    graph.spin_until(
        lambda: all(any(m.step >= 240 for m in seen.messages) for seen in recorders.values()),
        "both have judged",
    )
    states = {car: {m.acceleration.state for m in seen.messages} for car, seen in recorders.items()}
    assert SignalFault.FAULT in states["car1"] and SignalFault.FAULT not in states["car2"]
    graph.spin_until(
        lambda: (
            {"car1/diagnosis_node: clearance", "car2/diagnosis_node: clearance"}
            <= set(statuses(watcher))
        ),
        "statuses of both",
    )


# --- pictures


def test_layouts_are_current_and_name_fields_that_exist() -> None:
    for name, make in LAYOUTS.items():
        assert (BRINGUP / "layouts" / name).read_text() == make(), name
    ElementTree.fromstring(LAYOUTS["plotjuggler.xml"]().split("?>", 1)[1])
    json.loads(LAYOUTS["foxglove.json"]())
    for plot in PLOTS:
        for topic, field in curves(plot):
            message = TOPICS[topic.lstrip("/")]()
            for part in field.split("."):
                message = getattr(message, part)
            assert isinstance(message, (int, float)), (topic, field)


def test_markers_show_lead_limits_and_verdicts(graph: Graph) -> None:
    watcher = Watcher(graph, MarkerArray, "diagnosis/markers", 1000)
    for kind in (MpcNode, ObserverNode):
        graph.add(kind(context=graph.context, cli_args=REPLAY_ARGUMENTS))
    arguments = [*REPLAY_ARGUMENTS, "-p", "markers:=true", "-p", "marker_frame:=nose"]
    graph.add(DiagnosisNode(context=graph.context, cli_args=arguments))
    graph.play(drive(2.0), 0.0, ["mpc_node", "observer_node", "diagnosis_node"])
    graph.spin_until(lambda: len(watcher.messages) >= 39, "twenty pictures a second")
    made = {marker.ns: marker for marker in watcher.messages[-1].markers}
    assert set(made) == {
        *("lead as measured", "lead as reconstructed", "95 % of the reconstruction", "verdicts")
    }
    assert {marker.header.frame_id for marker in made.values()} == {"nose"}
    assert "clearance: OK" in made["verdicts"].text


@pytest.mark.parametrize(
    ("of_radar", "of_acceleration", "shown"),
    [
        (State.NO_DATA, State.OK, State.NO_DATA),
        (State.NO_DATA, State.SUSPECT, State.NO_DATA),
        (State.NO_DATA, State.FAULT, State.FAULT),
        (State.NOT_READY, State.OK, State.NOT_READY),
        (State.NO_TARGET, State.OK, State.OK),
        (State.NO_TARGET, State.NO_TARGET, State.NO_TARGET),
    ],
)
def test_markers_have_the_colour_of_the_worst_state(of_radar, of_acceleration, shown) -> None:
    step = list(OfflineGraph(graph_settings("robust")).run(drive(1.0)))[-1]
    for name in VERDICTS:
        state = of_acceleration if name == "acceleration" else of_radar
        getattr(step.outcome.report, name).state = state
    made = {m.ns: m for m in markers(step.horizon, step.outcome, "radar", Time()).markers}
    assert made["verdicts"].color == colour_of(COLOURS[shown], 1.0)
    assert made["lead as measured"].color == colour_of(COLOURS[of_radar], 0.9)


def test_every_state_has_a_colour_of_its_own() -> None:
    assert set(COLOURS) == set(State) and len(set(COLOURS.values())) == len(State)


# --- scripts of a user's own

ASKS = "ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"


@pytest.mark.parametrize("given", [("SUBNET", "own.xml"), ("", "")])
def test_a_command_in_the_workspace_runs_where_and_as_its_caller_says(
    given: tuple[str, str], tmp_path: Path
) -> None:
    program = f"import os; print(os.getcwd(), *(os.environ[name] for name in {ASKS}), sep='\\n')"
    done = subprocess.run(
        [ROOT / "tools/in_workspace", "python", "-c", program],
        cwd=tmp_path,
        env={**os.environ, **dict(zip(ASKS, given, strict=True))},
        capture_output=True,
        text=True,
        check=True,
    )
    where, discovery, profile = done.stdout.splitlines()
    assert where == str(tmp_path) and discovery == (given[0] or "LOCALHOST")
    assert profile == given[1] or (not given[1] and Path(profile).name == "fastdds.xml")


# --- make


@pytest.mark.parametrize(
    ("target", "option", "text"),
    [
        ("replay", "DRIVE", "/x/it's/o.mcap"),
        ("replay", "FAULT", 'offset:clearance=4@2-3;"no fault" `id`'),
        ("simulate", "LEAD", "a lead's.csv"),
        ("evaluate", "RECORDED", "/x/it's"),
    ],
)
def test_make_hands_on_what_is_written_as_it_is(
    target: str, option: str, text: str, tmp_path: Path
) -> None:
    (tmp_path / "run").write_text('#!/bin/sh\nprintf "<%s>\\n" "$@"\n')
    (tmp_path / "run").chmod(0o755)
    make = ["make", "-f", ROOT / "Makefile", "PYTHON=true", target, f"{option}={text}"]
    done = subprocess.run(make, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert f"<--{option.lower()}>\n<{text}>\n" in done.stdout
    if target == "simulate":
        assert "<--rate>\n<0>\n" in done.stdout
