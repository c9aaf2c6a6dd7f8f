"""The live graph at 100 Hz in separate processes, against three hops that only copy."""

import os
import subprocess
import sys
import time
from pathlib import Path

import rclpy
from measure import Figure, against, late
from rclpy.context import Context
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu

from lfd_mpc.messages import to_time
from lfd_mpc.node_process import make_executor
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_msgs.msg import FaultReport, RadarTarget

HERE = Path(__file__).parent
TICKS = os.sysconf("SC_CLK_TCK")
NODES = {
    "mpc": ("lfd_mpc", "mpc_node"),
    "observer": ("lfd_observer", "observer_node"),
    "diagnosis": ("lfd_diagnosis", "diagnosis_node"),
}


def _cpu(process: subprocess.Popen) -> float:
    """Seconds of processor time that a process has taken."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def _start(kind: str, domain: int, root: Path) -> list[subprocess.Popen]:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    if kind == "floor":
        commands = [[sys.executable, str(HERE / "floor_node.py"), name] for name in NODES]
    else:
        install = root / "ros2_ws/install"
        commands = [[str(install / p / "lib" / p / name)] for p, name in NODES.values()]
    return [subprocess.Popen(command, **quiet) for command in commands]


class _Car:
    """Publishes radar at 20 Hz and acceleration at 100 Hz, and hears the reports."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("car", context=self.context)
        qos = QoSProfile(depth=200, reliability=ReliabilityPolicy.BEST_EFFORT)
        self._imu = self.node.create_publisher(Imu, "vehicle/imu", qos)
        self._radar = self.node.create_publisher(RadarTarget, "radar/target", qos)
        self.node.create_subscription(FaultReport, "diagnosis/faults", self._on, PIPELINE_QOS)
        self.executor = make_executor(self.context)
        self.executor.add_node(self.node)
        self.sent: dict[int, float] = {}
        self.delays: list[float] = []
        self.answered: set[int] = set()

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)

    def _on(self, report: FaultReport) -> None:
        now = time.perf_counter()
        key = report.header.stamp.sec * 1_000_000_000 + report.header.stamp.nanosec
        if key in self.sent and key not in self.answered:
            self.answered.add(key)
            self.delays.append(now - self.sent[key])

    def drive(self, seconds: float) -> None:
        """One step every 10 ms of wall time, stamped with whole multiples of it."""
        base = time.time_ns() // 10_000_000 * 10_000_000
        begin = time.perf_counter()
        for k in range(round(seconds * 100)):
            while (left := begin + 0.01 * k - time.perf_counter()) > 0:
                self.executor.spin_once(timeout_sec=left)
            stamp = base + 10_000_000 * k
            if k % 5 == 0:
                scan = RadarTarget(has_target=True, clearance=30.0, track_id=1)
                scan.header.stamp = to_time(stamp)
                self._radar.publish(scan)
            message = Imu()
            message.header.stamp = to_time(stamp)
            self.sent[stamp] = time.perf_counter()
            self._imu.publish(message)
        end = time.perf_counter() + 0.5
        while time.perf_counter() < end:
            self.executor.spin_once(timeout_sec=0.05)


def _run(kind: str, domain: int, seconds: float, root: Path) -> tuple[list[float], int, float]:
    """Delays in s, steps without a report, processor time of all three nodes in s."""
    car = _Car(domain)
    processes = _start(kind, domain, root)
    try:
        deadline = time.monotonic() + 60.0
        while not car.delays:
            assert time.monotonic() < deadline, f"{kind}: no report within a minute"
            car.drive(0.5)
        car.drive(1.0)
        car.sent.clear()
        car.delays.clear()
        car.answered.clear()
        before = sum(map(_cpu, processes))
        car.drive(seconds)
        spent = sum(map(_cpu, processes)) - before
        return car.delays, len(car.sent) - len(car.answered), spent
    finally:
        for process in processes:
            process.terminate()
        for process in processes:
            process.wait(timeout=10.0)
        car.close()


def measure(seconds: float, rounds: int, root: Path) -> list[Figure]:
    """Floor and graph in turn; `seconds` of driving in all of each."""
    delays: dict[str, list[float]] = {"floor": [], "graph": []}
    lost, spent = dict.fromkeys(delays, 0), dict.fromkeys(delays, 0.0)
    for number in range(rounds):
        for offset, kind in enumerate(delays):
            domain = 101 + (os.getpid() * 7 + 2 * number + offset) % 100
            own, missing, cpu = _run(kind, domain, seconds / rounds, root)
            delays[kind] += own
            lost[kind] += missing
            spent[kind] += cpu
    floor = "three nodes that copy"
    value, peer = late(delays["graph"]) * 1e3, late(delays["floor"]) * 1e3
    below_two = "at most 2", lambda _, ratio: ratio <= 2.0
    share = spent["graph"] / seconds * 100.0, spent["floor"] / seconds * 100.0
    return [
        against("acceleration to report, 99th percentile", value, "ms", floor, peer, *below_two),
        against(
            "processor time of all nodes",
            share[0],
            "%",
            floor,
            share[1],
            "at most 2.5",
            lambda _, ratio: ratio <= 2.5,
        ),
        against(
            f"steps lost in {seconds:g} s",
            lost["graph"],
            "steps",
            floor,
            lost["floor"],
            "none",
            lambda value, _: value == 0,
        ),
    ]
