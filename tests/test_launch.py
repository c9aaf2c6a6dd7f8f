"""The launch file, run with a stand-in for `launch`: real processes, heard on their topics."""

import os
import runpy
import signal
import subprocess
from pathlib import Path

import launch_stand_in
import pytest
import rclpy
from test_live_equals_offline import drive

from lfd_diagnosis.diagnosis_node import EVENT_QOS
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_msgs.msg import FaultEvent, FaultReport, SignalFault
from lfd_replay.drive import Drive
from lfd_replay.drive_bag import write_drive
from lfd_replay.faults import FaultInjector, parse_faults
from ros_support import Graph, offline

ROOT = Path(__file__).parent.parent
LAUNCH = ROOT / "ros2_ws/src/lfd_bringup/launch/replay.launch.py"
FAULT = "offset:acceleration=4@1-2"


def launched(monkeypatch, folder: Path, domain: int, arguments: dict[str, str]):
    """What the launch file starts with these arguments."""
    with monkeypatch.context() as standing_in:
        launch_stand_in.install(standing_in)
        for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"):
            standing_in.delenv(name, raising=False)
        description = runpy.run_path(str(LAUNCH))["generate_launch_description"]()
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    install = ROOT / "ros2_ws/install"
    return launch_stand_in.launch(description, arguments, install, folder, environment)


def ended(started: launch_stand_in.Launched) -> dict[str, int]:
    """Exit statuses, ended as `ros2 launch` does: interrupted, and told again after 5 s.

    A process that has just begun may lose the interrupt.
    """
    left = [process for process in started.processes.values() if process.poll() is None]
    for process in left:
        process.send_signal(signal.SIGINT)
    for process in left:
        try:
            process.wait(timeout=5)
        except subprocess.TimeoutExpired:
            process.terminate()
            try:
                process.wait(timeout=5)
            except subprocess.TimeoutExpired:
                process.kill()
    return {name: process.wait(timeout=10) for name, process in started.processes.items()}


@pytest.mark.parametrize(
    ("namespace", "profile"), [("", "robust"), ("car1", "paper"), ("/fleet/car2", "robust")]
)
def test_a_drive_is_played_into_the_graph_and_ends_it(
    monkeypatch, tmp_path: Path, namespace: str, profile: str
) -> None:
    samples = drive(3.0)
    write_drive(Drive("short", samples), tmp_path / "drive.mcap")
    arguments = {"drive": str(tmp_path / "drive.mcap"), "fault": FAULT, "rate": "0"}
    arguments |= {"namespace": namespace, "profile": profile}
    prefix = f"/{namespace.strip('/')}" if namespace else ""
    with Graph() as graph:
        listener = graph.add(rclpy.create_node("listener", context=graph.context))
        reports, events = [], []
        topic = f"{prefix}/diagnosis/faults"
        listener.create_subscription(FaultReport, topic, reports.append, PIPELINE_QOS)
        topic = f"{prefix}/diagnosis/events"
        listener.create_subscription(FaultEvent, topic, events.append, EVENT_QOS)
        started = launched(monkeypatch, tmp_path, graph.domain, arguments)
        try:
            assert started.ends_with == ["bag_player"]
            player = started.processes["bag_player"]
            graph.spin_until(lambda: player.poll() is not None, "the drive is played", 60.0)
            own = offline(FaultInjector(parse_faults([FAULT]), 0, 0).apply(samples), profile)
            steps = own["diagnosis/faults"]
            graph.spin_until(
                lambda: sum(r.step > 0 for r in reports) >= len(steps), "all is reported"
            )
        finally:
            statuses = ended(started)
    said = [(r.step, r.acceleration.state, r.acceleration.reason) for r in reports if r.step]
    assert said == [(r.step, r.acceleration.state, r.acceleration.reason) for r in steps]
    assert any(e.signal == "acceleration" and e.fault.state == SignalFault.FAULT for e in events)
    assert statuses == dict.fromkeys(started.processes, 0)
    assert "decision_node" in started.processes


@pytest.mark.alone
def test_without_a_drive_there_is_the_graph_alone_in_the_cars_time(
    monkeypatch, tmp_path: Path
) -> None:
    arguments = {"use_sim_time": "false", "driving": "true", "markers": "true"}
    with Graph() as graph:
        started = launched(monkeypatch, tmp_path, graph.domain, arguments)
        try:
            listener = graph.add(rclpy.create_node("listener", context=graph.context))
            made = {"/mpc/driving", "/diagnosis/markers", "/diagnosis/decision", "/ready"}
            graph.spin_until(
                lambda: made <= {name for name, _ in listener.get_topic_names_and_types()},
                "the nodes are there",
            )
            clocks = listener.count_publishers("/clock")
        finally:
            statuses = ended(started)
    assert clocks == 0 and started.ends_with == []
    assert started.environment["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "LOCALHOST"
    assert Path(started.environment["FASTRTPS_DEFAULT_PROFILES_FILE"]).is_file()
    names = ["mpc_node", "observer_node", "diagnosis_node", "decision_node"]
    assert statuses == dict.fromkeys(names, 0)


def test_outputs_are_recorded_by_the_bag_recorder_of_ros(monkeypatch, tmp_path: Path) -> None:
    """What is asked of `ros2 bag record`, by its command line; it runs where ROS is installed."""
    program = tmp_path / "ros2"
    program.write_text('#!/bin/sh\necho "$@" >&2\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    with Graph() as graph:
        arguments = {"record": str(tmp_path / "bag"), "namespace": "car1"}
        started = launched(monkeypatch, tmp_path, graph.domain, arguments)
        assert started.processes["recorder"].wait(timeout=10) == 0
        listener = graph.add(rclpy.create_node("listener", context=graph.context))
        # Interrupted before it has begun, a process would have to be told again.
        nodes = set(started.processes) - {"recorder"}
        graph.spin_until(lambda: nodes <= set(listener.get_node_names()), "the nodes are there")
        ended(started)
    asked = (tmp_path / "recorder.txt").read_text().split()
    assert asked[:7] == ["bag", "record", "-s", "mcap", "-o", str(tmp_path / "bag"), "--topics"]
    assert {"/car1/diagnosis/faults", "/car1/radar/target", "/diagnostics"} <= set(asked[7:])
