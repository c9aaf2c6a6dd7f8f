"""The whole graph as separate processes, with the built executables."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader
from test_live_equals_offline import drive

from lfd_bringup.recorder import RecorderNode
from lfd_mpc.errors import UserError
from lfd_mpc.node_process import LEAVING, ros_started
from lfd_replay.drive import Drive
from lfd_replay.drive_bag import write_drive
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.read_drive import read_drive
from ros_support import (
    LOCKSTEP,
    ROOT,
    Graph,
    assert_live_equals_offline,
    next_domain,
    offline,
    recorded,
    run,
)

NODES = (
    ("lfd_mpc", "mpc_node"),
    ("lfd_observer", "observer_node"),
    ("lfd_diagnosis", "diagnosis_node"),
)


@pytest.fixture(scope="module")
def drive_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("drive") / "short.mcap"
    write_drive(Drive("short", drive(3.0)), path)
    return path


@pytest.mark.parametrize("fault", ["", "offset:clearance=4,relative_velocity=-10@1-2"])
def test_separate_processes_publish_what_offline_says(drive_file: Path, fault: str) -> None:
    samples = FaultInjector(parse_faults([fault]), 0, seed=0).apply(read_drive(drive_file).samples)
    with Graph() as graph:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(graph.domain)}
        recorder = graph.add(RecorderNode(lambda event: None, context=graph.context))
        parameters = ["--ros-args", "-p", "use_sim_time:=true", "--params-file", str(LOCKSTEP)]
        started = [
            subprocess.Popen(
                [ROOT / "run", package, node, *parameters],
                env=environment,
                stderr=subprocess.PIPE,
                text=True,
            )
            for package, node in NODES
        ]
        wait_for = [node for _, node in NODES] + ["recorder"]
        command = ["lfd_replay", "bag_player", str(drive_file), "--rate", "0"]
        player = subprocess.Popen(
            [
                ROOT / "run",
                *command,
                *(["--fault", fault] if fault else []),
                "--wait-for",
                *wait_for,
            ],
            env=environment,
            stderr=subprocess.PIPE,
            text=True,
        )
        try:
            graph.spin_until(lambda: player.poll() is not None, "the drive is played", 60.0)
            assert player.returncode == 0, player.stderr.read()
            own = offline(samples)
            graph.spin_until(
                lambda: all(recorder.count(topic) >= len(own[topic]) for topic in own),
                "everything is recorded",
            )
            assert_live_equals_offline(recorded(recorder), own)
        finally:
            for process in [player, *started]:
                process.send_signal(signal.SIGINT)
            for process in started:
                _, errors = process.communicate(timeout=10)
                assert "Traceback" not in errors
        assert [process.returncode for process in started] == [0, 0, 0]


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("command", [("replay", "--drive"), ("simulate", "--lead")])
def test_what_cannot_be_printed_costs_no_recording(
    command: tuple[str, str], full: bool, drive_file: Path, tmp_path: Path
) -> None:
    """Neither `| head -1` nor a full disk under the text; that is said when all else is done."""
    reader, closed = os.pipe()
    os.close(reader)
    name, option = command
    what = str(drive_file) if name == "replay" else "20,-1@0-1"
    with open("/dev/full" if full else closed, "w") as output:
        arguments = (name, option, what, "--rate", "0", "--out", str(tmp_path))
        done = run("lfd_bringup", *arguments, stdout=output)
    assert done.returncode == (2 if full else 0), done.stderr
    assert done.stderr.count("the output cannot be written") == full
    assert "Traceback" not in done.stderr
    assert (tmp_path / "report.html").exists() and (tmp_path / "summary.json").exists()
    with AnyReader([tmp_path / "bag"]) as bag:
        assert {c.topic for c in bag.connections if c.msgcount} >= {"/diagnosis/faults"}


def test_replay_leaves_bag_report_and_timeline(drive_file: Path, tmp_path: Path) -> None:
    fault = "offset:acceleration=4@1-2"
    out = tmp_path / "out"
    done = run(
        *("lfd_bringup", "replay", "--drive", str(drive_file), "--fault", fault),
        *("--rate", "0", "--out", str(out)),
    )
    assert done.returncode == 0, done.stderr
    faulty = [line for line in done.stdout.splitlines() if "-> FAULT" in line]
    assert len(faulty) == 1 and "acceleration" in faulty[0] and "host speed: off by" in faulty[0]
    summary = json.loads((out / "summary.json").read_text())
    assert summary["acceleration"]["detected"] and summary["acceleration"]["false_events"] == 0
    assert (out / "report.html").stat().st_size > 100_000
    with AnyReader([out / "bag"]) as reader:
        counts = {connection.topic: connection.msgcount for connection in reader.connections}
        for connection, logged, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = message.header.stamp
            assert logged == stamp.sec * 1_000_000_000 + stamp.nanosec
    steps = len(offline(drive(3.0))["mpc/horizon"])
    assert counts["/mpc/horizon"] == counts["/diagnosis/faults"] == steps
    assert counts["/radar/target"] == 60 and counts["/v2v/lead_acceleration"] == 30


RADAR_QOS = "qos_overrides./radar/target.subscription"


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["lfd_replay", "bag_player", "nowhere.mcap"], "nowhere.mcap"),
        (["lfd_replay", "bag_player", "{drive}", "--rate", "-1"], "--rate"),
        (["lfd_replay", "bag_player", "{drive}", "--start", "99"], "--start"),
        (["lfd_replay", "bag_player", "{drive}", "--fault", "melt:radar@1-2"], "melt"),
        (["lfd_bringup", "replay", "--drive", "nowhere.csv"], "nowhere.csv"),
        (["lfd_bringup", "replay", "--profile", "magic"], "magic"),
        (["lfd_bringup", "replay", "--drive", "{drive}", "--out", "{drive}/x"], "cannot be made"),
        (["lfd_bringup", "replay", "--drive", "{drive}", "--out", "/proc"], "or written"),
        (["lfd_bringup", "replay", "--drive", "{drive}", "--fault", "offset:radar=1@1-2"], "radar"),
        (["lfd_mpc", "mpc_node", "--ros-args", "-p", "solver:=magic"], "magic"),
        (["lfd_mpc", "mpc_node", "solver"], "--ros-args -p NAME:=VALUE"),
        (["lfd_mpc", "mpc_node", "--ros-args", "--params-file", "nowhere.yaml"], "nowhere.yaml"),
        (["lfd_mpc", "mpc_node", "--ros-args", "-p", "solver"], "-p NAME:=VALUE"),
        (["lfd_mpc", "mpc_node", "--ros-args", "-p", "use_sim_time:=soon"], "use_sim_time"),
        (["lfd_mpc", "mpc_node", "--ros-args", "-p", f"{RADAR_QOS}.reliability:=x"], "best_effort"),
        (["lfd_mpc", "mpc_node", "--ros-args", "-p", f"{RADAR_QOS}.depth:=-1"], "0 to 1000000"),
        (["lfd_mpc", "mpc_node", "--ros-args", "-p", f"{RADAR_QOS}.depth:={10**11}"], "0 to 1000"),
        (
            ["lfd_mpc", "mpc_node", "--ros-args", "-p", f"{RADAR_QOS[:-1]}.depth:=9"],
            "known: qos_ov",
        ),
        (
            ["lfd_mpc", "mpc_node", "--ros-args", "-p", f"{RADAR_QOS}.dept:=9"],
            f"{RADAR_QOS}.depth,",
        ),
        (["lfd_observer", "observer_node", "--ros-args", "-p", f"{RADAR_QOS}.depth:=9"], "none"),
        (["lfd_observer", "observer_node", "--ros-args", "-p", "lags:=[]"], "lags"),
        (["lfd_vehicle", "vehicle_node", "--ros-args", "-p", "rate:=1.0e-12"], "0.001 to 100"),
        (["lfd_diagnosis", "diagnosis_node", "--ros-args", "-p", "markers:=3"], "markers"),
        (["lfd_bringup", "replay", "--ros-args", "--params-file", "nowhere.yaml"], "nowhere.yaml"),
        (["lfd_replay", "bag_player", "{drive}", "--ros-args", "-p", "x"], "-p NAME:=VALUE"),
        (["lfd_mpc", "mpc_nod"], "mpc_node"),
        (["lfd_mcp", "mpc_node"], "lfd_mpc"),
    ],
)
def test_a_mistake_ends_with_one_line_and_status_2(
    drive_file: Path, tmp_path: Path, arguments: list[str], named: str
) -> None:
    filled = [argument.format(drive=drive_file) for argument in arguments]
    done = run(*filled, cwd=tmp_path)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1 and named in done.stderr
    assert "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("domain", ["soon", "233"])
def test_a_domain_that_cannot_be_is_named(monkeypatch, domain: str) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", domain)
    with pytest.raises(UserError, match=f"ROS_DOMAIN_ID.*{domain}.*0 to 232"), ros_started([]):
        pass


STOPPED = """
import atexit, ctypes, os, signal, sys, time
from rclpy.node import Node
from std_msgs.msg import String
from lfd_mpc.node_process import run_node

def stop():
    os.kill(os.getpid(), signal.{name})

class WhileMade(Node):
    def __init__(self):
        super().__init__("made")
        stop()
        time.sleep(60.0)

class WhileALibraryLoads(Node):
    def __init__(self):
        super().__init__("loading")
        try:
            stop()
        except KeyboardInterrupt as told:
            raise ImportError("what libraries in C make of it") from told

class WhereItIsNotHeard(Node):
    def __init__(self):
        super().__init__("unheard")
        class Dropped:
            def __del__(self):
                stop()
        Dropped()

class InACallback(Node):
    def __init__(self):
        super().__init__("busy")
        self.publisher = self.create_publisher(String, "said", 1)
        self.timer = self.create_timer(0.01, self.work)
    def work(self):
        stop()
        time.sleep(0.2)
        self.publisher.publish(String())
        print("the step is whole")

class Running(Node):
    def __init__(self):
        super().__init__("running")
        self.timer = self.create_timer(0.01, lambda: print("it runs", flush=True))

class NeverLeaves(Running):
    def destroy_node(self):
        # In C, with Python's lock.
        ctypes.PyDLL(None).sleep(60)

class HeldUpAsPythonEnds(Running):
    def destroy_node(self):
        atexit.register(ctypes.PyDLL(None).sleep, 60)
        super().destroy_node()

class ByItself(Node):
    def __init__(self):
        super().__init__("wrong")
        raise RuntimeError("a mistake of its own")

class Over(Running):
    status = 3

sys.exit(run_node(lambda: {kind}, []))
"""


def started(kind: str, name: str = "SIGINT") -> subprocess.Popen[str]:
    """A process of such a node, which sends itself that signal, if any."""
    return subprocess.Popen(
        [sys.executable, "-c", STOPPED.format(name=name, kind=kind)],
        env={**os.environ, "ROS_DOMAIN_ID": str(next_domain())},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def ended(process: subprocess.Popen[str]) -> subprocess.CompletedProcess[str]:
    try:
        output, errors = process.communicate(timeout=30)
    finally:
        process.kill()
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def stopped(name: str, kind: str) -> subprocess.CompletedProcess[str]:
    return ended(started(kind, name))


@pytest.mark.alone
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_node_that_is_stopped_ends_in_peace(name: str) -> None:
    made = stopped(name, "WhileMade")
    assert (made.returncode, made.stderr) == (0, "")
    loading = stopped(name, "WhileALibraryLoads")
    assert (loading.returncode, loading.stderr) == (0, "")
    # Python drops what is raised while it frees an object, and says so.
    unheard = stopped(name, "WhereItIsNotHeard")
    assert unheard.returncode == 0 and "Exception ignored" in unheard.stderr
    busy = stopped(name, "InACallback")
    assert (busy.returncode, busy.stderr) == (0, "")
    assert busy.stdout == "the step is whole\n"


def running(kind: str) -> subprocess.Popen[str]:
    """A process of such a node, which runs."""
    process = started(kind)
    assert process.stdout is not None and process.stdout.readline() == "it runs\n"
    return process


@pytest.mark.alone
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_node_that_is_told_again_and_again_ends_in_peace(name: str) -> None:
    """From a terminal and from `ros2 launch` at the same time, or by an impatient user."""
    process = running("Running")
    while process.poll() is None:
        process.send_signal(getattr(signal, name))
        time.sleep(0.005)
    done = ended(process)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.alone
@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("kind", ["NeverLeaves", "HeldUpAsPythonEnds"])
def test_a_node_that_the_middleware_does_not_let_go_ends_in_time(kind: str, name: str) -> None:
    process = running(kind)
    process.send_signal(getattr(signal, name))
    told = time.monotonic()
    done = ended(process)
    assert LEAVING - 0.1 < time.monotonic() - told < 5.0
    assert (done.returncode, done.stderr) == (0, "")


def test_a_node_that_ends_by_itself_ends_its_process_with_its_status() -> None:
    done = stopped("SIGINT", "Over")
    assert (done.returncode, done.stderr) == (3, "")


def test_a_mistake_of_a_nodes_own_is_no_peaceful_end() -> None:
    done = stopped("SIGINT", "ByItself")
    assert done.returncode == 1 and "a mistake of its own" in done.stderr
