"""The adapters: what a car publishes, or has on its CAN bus, reaches the graph."""

import os
import subprocess
import sys
import time
from pathlib import Path

import can
import pytest
from can.interfaces.virtual import VirtualBus
from esr_frames import STATUS_4, encode, scan_frames
from geometry_msgs.msg import AccelWithCovarianceStamped, TwistStamped
from message_workspace import build
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import Imu
from test_esr import HOST_DBC, host_frames

from lfd_mpc.errors import UserError
from lfd_mpc.messages import to_time
from lfd_msgs.msg import RadarTarget
from lfd_replay.host_adapter import HostAdapterNode
from lfd_replay.radar_adapter import RadarAdapterNode
from ros_support import Graph

ADAPTER = Path(__file__).parent / "adapter_process.py"


def listen(node, kind: type, topic: str) -> list:
    """Everything that a subscriber of a topic sees."""
    seen: list = []
    node.create_subscription(kind, topic, seen.append, qos_profile_sensor_data)
    return seen


def probe(graph: Graph):
    return graph.add(Node("probe", context=graph.context))


def test_odometry_and_acceleration_become_the_graph_s_inputs() -> None:
    with Graph() as graph:
        adapter = graph.add(HostAdapterNode(graph.context))
        car = probe(graph)
        speed = listen(car, TwistStamped, "vehicle/twist")
        felt = listen(car, Imu, "vehicle/imu")
        odometry = car.create_publisher(Odometry, "host/odometry", 10)
        accel = car.create_publisher(AccelWithCovarianceStamped, "host/accel", 10)
        graph.spin_until(
            lambda: odometry.get_subscription_count() and accel.get_subscription_count()
            and adapter.count_subscribers("/vehicle/imu") and car.count_publishers("/vehicle/imu"),
            "discovery",
        )  # fmt: skip
        message = Odometry()
        message.header.stamp = to_time(5_000_000_000)
        message.twist.twist.linear.x = 12.5
        felt_message = AccelWithCovarianceStamped()
        felt_message.header.stamp = to_time(5_010_000_000)
        felt_message.accel.accel.linear.x = -1.5

        def both() -> bool:
            odometry.publish(message)
            accel.publish(felt_message)
            return bool(speed and felt)

        graph.spin_until(both, "speed and acceleration")
        assert speed[0].twist.linear.x == 12.5 and speed[0].header.stamp.sec == 5
        assert felt[0].linear_acceleration.x == -1.5
        assert felt[0].header.stamp.nanosec == 10_000_000


def test_a_second_imu_is_turned_and_its_offset_taken_off() -> None:
    arguments = ["--ros-args", "-p", "imu_yaw:=180.0", "-p", "imu_offset:=0.25"]
    with Graph() as graph:
        graph.add(HostAdapterNode(graph.context, cli_args=arguments))
        car = probe(graph)
        felt = listen(car, Imu, "vehicle/imu")
        imu = car.create_publisher(Imu, "host/imu", 10)
        message = Imu()
        message.header.stamp = to_time(1_000_000_000)
        message.linear_acceleration.x = -1.0

        def arrives() -> bool:
            imu.publish(message)
            return bool(felt)

        graph.spin_until(arrives, "the acceleration")
        assert felt[0].linear_acceleration.x == pytest.approx(0.75)


def bus_arguments(**parameters: str) -> list[str]:
    values = {"source": "can_bus", "can_interface": "virtual", **parameters}
    return ["--ros-args", *(x for k, v in values.items() for x in ("-p", f"{k}:={v}"))]


def test_a_can_bus_reaches_radar_target_with_what_the_radar_says(tmp_path: Path) -> None:
    dbc = tmp_path / "car.dbc"
    dbc.write_text(HOST_DBC)
    arguments = bus_arguments(
        can_channel="lfd-test",
        host_dbc=str(dbc),
        speed_signal="SPEED.SPEED",
        accel_signal="ACCEL_X",
    )
    with Graph() as graph, can.Bus(channel="lfd-test", interface="virtual") as bus:
        graph.add(RadarAdapterNode(graph.context, cli_args=arguments))
        car = probe(graph)
        targets = listen(car, RadarTarget, "radar/target")
        felt = listen(car, Imu, "vehicle/imu")
        graph.spin_until(lambda: car.count_publishers("/radar/target"), "discovery")
        scan = 0

        def send_scan() -> bool:
            nonlocal scan
            lead = {"STATUS": 3, "RANGE": 30.0, "RANGE_RATE": -1.5}
            frames = [(0.0, 0x4E3, encode(STATUS_4, PARTIAL_BLOCKAGE=1, PATH_ID_ACC_MOVE=12))]
            frames += host_frames(0.0, 15.0, 0.5) + scan_frames(0.0, scan, {12: lead})
            for _, identifier, data in frames:
                bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            scan += 1
            graph.spin_for(0.05)
            return len(targets) >= 5 and bool(felt)

        graph.spin_until(send_scan, "targets from the bus")
        target = targets[-1]
        assert target.has_target and target.clearance == pytest.approx(30.0)
        assert target.relative_velocity == pytest.approx(-1.5)
        assert (target.sensor_flags, target.sensor_text) == (32, "partial blockage")
        assert felt[-1].linear_acceleration.x == pytest.approx(0.5)
        age = time.time() - (target.header.stamp.sec + target.header.stamp.nanosec * 1e-9)
        assert 0.0 <= age < 10.0, "frames of a bus are stamped when they come"


def test_the_lead_of_a_can_bus_is_chosen_by_the_topics_of_the_host_and_damage_is_told() -> None:
    with Graph() as graph, can.Bus(channel="lfd-bend", interface="virtual") as bus:
        adapter = graph.add(
            RadarAdapterNode(graph.context, cli_args=bus_arguments(can_channel="lfd-bend"))
        )
        car = probe(graph)
        targets = listen(car, RadarTarget, "radar/target")
        told: list[Log] = []
        car.create_subscription(Log, "/rosout", told.append, 100)
        speed = car.create_publisher(TwistStamped, "vehicle/twist", 10)
        turning = car.create_publisher(Imu, "vehicle/imu", 10)
        graph.spin_until(
            lambda: speed.get_subscription_count() and turning.get_subscription_count()
            and car.count_publishers("/radar/target")
            and adapter.count_subscribers("/rosout"),
            "discovery",
        )  # fmt: skip
        driven, felt = TwistStamped(), Imu()
        driven.twist.linear.x, felt.angular_velocity.z = 15.0, 0.1
        scan = 0

        def send_scan() -> bool:
            nonlocal scan
            speed.publish(driven)
            turning.publish(felt)
            graph.spin_for(0.05)
            parked = {"STATUS": 3, "RANGE": 20.0, "RANGE_RATE": -15.0}
            aside = {"STATUS": 3, "RANGE": 60.0, "ANGLE": -11.3}
            frames = scan_frames(0.0, scan, {3: parked, 12: aside})
            for _, identifier, data in [*frames, (0.0, 0x500, b"cut")]:
                bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            scan += 1
            return bool(targets) and targets[-1].has_target and bool(told)

        graph.spin_until(send_scan, "a lead around the bend")
        assert targets[-1].clearance == pytest.approx(58.8, abs=0.1)
        assert any("ESR frames of a wrong length" in log.msg for log in told)


def test_an_interface_that_was_down_is_named_and_read_again(monkeypatch) -> None:
    down = [can.CanOperationError("Network is down"), OSError(19, "No such device")]
    receive = VirtualBus.recv

    def recv(self, timeout: float | None = None) -> can.Message | None:
        if down:
            raise down.pop(0)
        return receive(self, timeout)

    monkeypatch.setattr(VirtualBus, "recv", recv)
    with Graph() as graph, can.Bus(channel="lfd-down", interface="virtual") as bus:
        car = probe(graph)
        told: list[Log] = []
        everything = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        car.create_subscription(Log, "/rosout", told.append, everything)
        targets = listen(car, RadarTarget, "radar/target")
        graph.add(RadarAdapterNode(graph.context, cli_args=bus_arguments(can_channel="lfd-down")))

        def send_scan() -> bool:
            for _, identifier, data in scan_frames(0.0, 0, {}):
                bus.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=False))
            graph.spin_for(0.05)
            said = "CAN channel 'lfd-down' cannot be read (Network is down); trying again"
            return bool(targets) and any(log.msg == said for log in told)

        graph.spin_until(send_scan, "targets after the failure, and that it was told")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--ros-args", "-p", "source:=sonar"], "parameter source"),
        (bus_arguments(can_interface="nonsense"), "cannot be opened"),
        (bus_arguments(host_dbc="/none.dbc", speed_signal="X"), "cannot be read as a DBC file"),
        (bus_arguments(host_dbc="/none.dbc"), "host_dbc goes with speed_signal, accel_signal"),
        (
            bus_arguments(source="esr_tracks", host_dbc="car.dbc", speed_signal="X"),
            "source esr_tracks has no CAN frames; with host_dbc source must be one of: can_frames",
        ),
    ],
)
def test_mistakes_are_named(arguments: list[str], said: str) -> None:
    with Graph() as graph, pytest.raises(UserError, match=said):
        graph.add(RadarAdapterNode(graph.context, cli_args=arguments))


def test_a_message_package_that_is_not_installed_is_named() -> None:
    with Graph() as graph, pytest.raises(UserError) as refused:
        graph.add(RadarAdapterNode(graph.context))
    if os.environ.get("ROS_DISTRO") is None:
        assert "message package 'delphi_esr_msgs' is not installed" in str(refused.value)


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The message packages of such cars, built here."""
    return build(tmp_path_factory.mktemp("message_workspace"))


@pytest.mark.parametrize("source", ["esr_tracks", "radar_tracks", "can_frames"])
def test_messages_of_a_recorded_car_reach_the_fault_report(messages: Path, source: str) -> None:
    command = f'. "{messages}" && exec "{sys.executable}" "{ADAPTER}" {source}'
    done = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=90, cwd=ADAPTER.parent
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    assert "lead followed" in done.stdout
