"""The enclave policy is what the graph does; security that would not be enforced is refused."""

import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rclpy

from lfd_diagnosis.decision_node import DecisionNode
from lfd_diagnosis.diagnosis_node import DiagnosisNode
from lfd_mpc.mpc_node import MpcNode
from lfd_observer.observer_node import ObserverNode
from lfd_replay.fault_injector import FaultInjectorNode
from ros_support import REPLAY_ARGUMENTS, Graph, next_domain

ROOT = Path(__file__).parent.parent
POLICY = ROOT / "ros2_ws/src/lfd_bringup/security/policy.xml"
NODES = {
    "mpc_node": MpcNode,
    "observer_node": ObserverNode,
    "diagnosis_node": DiagnosisNode,
    "decision_node": DecisionNode,
    "fault_injector": FaultInjectorNode,
}


def full_name(node: str, name: str) -> str:
    """Of a name in the policy, for a node without a namespace."""
    return name.replace("~", f"/{node}") if name[0] in "~/" else f"/{name}"


def allowed(node: str) -> dict[str, set[str]]:
    """What the policy allows a node."""
    (profile,) = (p for p in ElementTree.parse(POLICY).iter("profile") if p.get("node") == node)
    found: dict[str, set[str]] = {"publish": set(), "subscribe": set(), "reply": set()}
    for group in (*profile.iter("topics"), *profile.iter("services")):
        for way in found:
            if group.get(way) == "ALLOW":
                found[way] |= {full_name(node, name.text or "") for name in group}
    return found


def running(watcher, node: str) -> dict[str, set[str]]:
    """What a running node does."""
    ways = {
        "publish": watcher.get_publisher_names_and_types_by_node,
        "subscribe": watcher.get_subscriber_names_and_types_by_node,
        "reply": watcher.get_service_names_and_types_by_node,
    }
    return {way: {name for name, _ in ask(node, "/")} for way, ask in ways.items()}


def test_the_policy_lists_exactly_what_the_running_graph_has() -> None:
    with Graph() as graph:
        for kind in NODES.values():
            arguments = [*REPLAY_ARGUMENTS, "-p", "diagnosis_node:markers:=true"]
            arguments += ["-p", "mpc_node:driving:=true"]
            graph.add(kind(context=graph.context, cli_args=arguments))
        watcher = graph.add(rclpy.create_node("watcher", context=graph.context))
        for name in NODES:
            graph.spin_until(
                lambda: running(watcher, name) == allowed(name),  # noqa: B023
                f"{name} does what its policy says",
            )


@pytest.mark.parametrize(
    ("environment", "named"),
    [
        ({}, "ROS_SECURITY_KEYSTORE"),
        ({"ROS_SECURITY_KEYSTORE": "/keys"}, "ROS_SECURITY_STRATEGY"),
        ({"ROS_SECURITY_KEYSTORE": "/keys", "ROS_SECURITY_STRATEGY": "Permissive"}, "Enforce"),
    ],
)
def test_security_that_would_not_be_enforced_is_refused(environment: dict, named: str) -> None:
    environment = {**os.environ, "ROS_SECURITY_ENABLE": "true", **environment}
    environment["ROS_DOMAIN_ID"] = str(next_domain())
    done = subprocess.run(
        [ROOT / "run", "lfd_mpc", "mpc_node"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 2 and named in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("given", "used"),
    [
        ({}, "LOCALHOST"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "SUBNET"),
        ({"ROS_STATIC_PEERS": "192.0.2.1"}, "None"),
    ],
)
def test_discovery_stays_on_the_machine_unless_told_otherwise(given: dict, used: str) -> None:
    own = {k: v for k, v in os.environ.items() if k != "ROS_AUTOMATIC_DISCOVERY_RANGE"}
    script = (
        "import os\nfrom lfd_mpc.node_process import ros_started\nwith ros_started([]):\n"
        "    print(os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE'))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**own, **given, "ROS_DOMAIN_ID": str(next_domain())},
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.stdout.strip() == used, done.stderr


def test_enforcement_where_there_is_a_secured_installation() -> None:
    """Needs sros2 and a middleware built with security: the wheels have neither."""
    pytest.importorskip("sros2", reason="no secured installation here: enforcement was NOT RUN")
    keys = os.environ.get("ROS_SECURITY_KEYSTORE")
    if not keys:
        pytest.skip("ROS_SECURITY_KEYSTORE names no keystore: enforcement was NOT RUN")
    environment = {
        **os.environ,
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_STRATEGY": "Enforce",
        "ROS_DOMAIN_ID": str(next_domain()),
    }
    command = [ROOT / "run", "lfd_mpc", "mpc_node", "--ros-args", "--enclave"]
    stranger = subprocess.run(
        [*command, "/lfd/nobody"], env=environment, capture_output=True, text=True, timeout=30
    )
    assert stranger.returncode != 0
