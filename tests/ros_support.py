"""Nodes spun in-process: own context, own domain, deadlines instead of sleeps."""

import itertools
import os
import subprocess
import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path

import numpy as np
import rclpy

from lfd_bringup.recorder import RecorderNode
from lfd_diagnosis.diagnosis_node import DiagnosisNode
from lfd_diagnosis.verdict import Event, Reconstruction, Report
from lfd_mpc.horizon import Horizon
from lfd_mpc.messages import from_message, from_time
from lfd_mpc.mpc_node import MpcNode
from lfd_mpc.node_process import make_executor
from lfd_observer.bank import BankState
from lfd_observer.observer_node import ObserverNode
from lfd_replay.offline import OfflineGraph
from lfd_replay.player import PlayerNode, PlayOptions
from lfd_replay.profiles import graph_settings

ROOT = Path(__file__).parent.parent
LOCKSTEP = ROOT / "ros2_ws/src/lfd_bringup/params/lockstep.yaml"
REPLAY_ARGUMENTS = ["--ros-args", "-p", "use_sim_time:=true", "--params-file", str(LOCKSTEP)]


def profile_arguments(profile: str) -> list[str]:
    """Arguments of nodes in lockstep under a profile."""
    return [*REPLAY_ARGUMENTS, "--params-file", str(LOCKSTEP.with_name(f"{profile}.yaml"))]


_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_RUN = zlib.crc32(os.environ.get("PYTEST_XDIST_TESTRUNUID", str(os.getpid())).encode())

DOMAINS = range(1, 101)
"""Domain ids whose ports the system gives to nobody else; 0 is everybody's."""


def domains_of(worker: int, workers: int, run: int) -> Iterator[int]:
    """Domain ids of one of so many workers, in turn: no other worker's, however long they go on.

    `run`: where a run begins, so that it hardly meets another one on this machine.
    """
    own = len(DOMAINS) // workers
    for turn in itertools.count():
        yield DOMAINS[(run + worker * own + turn % own) % len(DOMAINS)]


_domains = domains_of(_WORKER, _WORKERS, _RUN)


def next_domain() -> int:
    """A domain id that no other test uses now, and hardly another run on this machine."""
    return next(_domains)


def run(*arguments: str | Path, **options) -> subprocess.CompletedProcess[str]:
    """`./run` with such arguments, in a domain of its own, until it ends."""
    return subprocess.run(
        [ROOT / "run", *arguments],
        env={**os.environ, "ROS_DOMAIN_ID": str(next_domain())},
        text=True,
        timeout=300,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options},
    )


class Graph:
    """Nodes in a context and a domain of their own."""

    def __init__(self) -> None:
        self.domain = next_domain()
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.executor = make_executor(self.context)
        self.nodes: list = []

    def __enter__(self) -> "Graph":
        return self

    def __exit__(self, *_) -> None:
        for node in self.nodes:
            node.destroy_node()
        self.executor.shutdown()
        rclpy.shutdown(context=self.context)

    def add(self, node):
        self.nodes.append(node)
        self.executor.add_node(node)
        return node

    def remove(self, node) -> None:
        self.nodes.remove(node)
        self.executor.remove_node(node)
        node.destroy_node()

    def add_graph(self, arguments: list[str] | None = None) -> None:
        """The three nodes."""
        for kind in (MpcNode, ObserverNode, DiagnosisNode):
            self.add(kind(context=self.context, cli_args=arguments))

    def spin_until(self, reached: Callable[[], object], what: str, seconds: float = 15.0) -> None:
        deadline = time.monotonic() + seconds
        while not reached():
            assert time.monotonic() < deadline, f"after {seconds} s still not: {what}"
            self.executor.spin_once(timeout_sec=0.02)

    def spin_for(self, seconds: float) -> None:
        """Only for what must NOT happen."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.02)

    def play(self, samples: list, rate: float, wait_for: list[str]) -> None:
        """Play samples until everything is out."""
        player = self.add(PlayerNode(samples, PlayOptions(rate=rate), wait_for, self.context))
        deadline = time.monotonic() + 120
        while not player.done:
            assert time.monotonic() < deadline, "the drive is not played"
            self.executor.spin_once(timeout_sec=min(player.pump(), 0.05))


RECORDS = {
    "mpc/horizon": Horizon,
    "observer/bank": BankState,
    "diagnosis/faults": Report,
    "diagnosis/events": Event,
    "diagnosis/reconstructed": Reconstruction,
}


@dataclass(frozen=True)
class Command:
    """What is asked of the car, m/s^2."""

    stamp: int
    acceleration: float


def recorded(recorder: RecorderNode) -> dict[str, list]:
    """What a subscriber saw on each output topic; reports of no step are left out."""
    seen = {
        topic: [from_message(kind, message) for message in recorder.messages(topic)]
        for topic, kind in RECORDS.items()
    }
    seen["diagnosis/faults"] = [report for report in seen["diagnosis/faults"] if report.step]
    seen["mpc/command"] = [
        Command(from_time(message.header.stamp), message.accel.linear.x)
        for message in recorder.messages("mpc/command")
    ]
    return seen


def offline(samples: list, profile: str = "robust") -> dict[str, list]:
    """The same from the offline evaluation."""
    steps = list(OfflineGraph(graph_settings(profile)).run(samples))
    return {
        "mpc/horizon": [step.horizon for step in steps],
        "mpc/command": [Command(step.horizon.stamp, step.horizon.command) for step in steps],
        "observer/bank": [step.bank for step in steps],
        "diagnosis/faults": [step.outcome.report for step in steps],
        "diagnosis/events": [event for step in steps for event in step.outcome.events],
        "diagnosis/reconstructed": [step.outcome.reconstruction for step in steps],
    }


EXACT = {"index", "acceleration_index", "confidence", "state", "reason", "old_state"}


def difference(live, own, where: str = "") -> str:
    """Where two records differ beyond what the contract allows; empty = nowhere."""
    if is_dataclass(own):
        for field in fields(own):
            if field.name == "solve_time":
                continue
            found = difference(
                getattr(live, field.name), getattr(own, field.name), f"{where}.{field.name}"
            )
            if found:
                return found
        return ""
    if isinstance(own, (float, np.ndarray)):
        tolerance = 0.0 if where.rsplit(".", 1)[-1] in EXACT else 1e-9
        same = np.shape(live) == np.shape(own) and np.allclose(
            live, own, rtol=0.0, atol=tolerance, equal_nan=True
        )
    else:
        same = live == own
    return "" if same else f"{where}: live {live!r}, offline {own!r}"


def assert_live_equals_offline(live: dict[str, list], own: dict[str, list]) -> None:
    for topic, records in own.items():
        assert len(live[topic]) == len(records), topic
        for number, (seen, expected) in enumerate(zip(live[topic], records, strict=True)):
            assert not difference(seen, expected), f"{topic} {number}: {difference(seen, expected)}"
