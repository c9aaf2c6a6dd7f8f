"""The graph, one process per node, and a drive replayed into it.

ros2 launch lfd_bringup replay.launch.py drive:=PATH fault:='offset:acceleration=4@20-35' rate:=1.0

Without a drive there is the graph alone: for a car (use_sim_time:=false), or for `ros2 bag play`.
"""

import os
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    ExecuteProcess,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch_ros.actions import Node

ARGUMENTS = {
    "drive": ("", "path of a drive: CSV file or bag; empty = none is played"),
    "fault": ("", "fault texts, several separated by ;"),
    "rate": ("1.0", "x real time; 0 = lockstep"),
    "profile": ("robust", "parameter profile (robust or paper), or a parameter file"),
    "namespace": ("", "namespace of all nodes and topics, one for each vehicle"),
    "use_sim_time": ("true", "follow /clock: true for replays, false in a car"),
    "record": ("", "folder of a bag to record the outputs into; empty = none"),
    "driving": ("false", "the controller drives: mpc/command follows the verdicts"),
    "markers": ("false", "publish markers for RViz on diagnosis/markers"),
}
GRAPH = (
    ("lfd_mpc", "mpc_node"),
    ("lfd_observer", "observer_node"),
    ("lfd_diagnosis", "diagnosis_node"),
    ("lfd_diagnosis", "decision_node"),
)
INPUTS = ("radar/target", "vehicle/imu", "vehicle/twist", "v2v/lead_acceleration")
OUTPUTS = (
    "mpc/horizon",
    "mpc/command",
    "observer/bank",
    "diagnosis/faults",
    "diagnosis/events",
    "diagnosis/reconstructed",
    "diagnosis/decision",
    "diagnosis/decision_changes",
    "mpc/driving",
)


def start(context):
    """The nodes, and an end when the player has ended."""
    value = {name: context.launch_configurations[name] for name in ARGUMENTS}
    actions = graph(value)
    if value["record"]:
        actions.append(recording(value))
    if value["drive"]:
        actions += playing(value)
    return actions


def graph(value):
    """The graph's nodes with their parameters, for the arguments' values."""
    params = Path(get_package_share_directory("lfd_bringup")) / "params"
    chosen = params / f"{value['profile']}.yaml"
    common = [
        str(chosen if chosen.is_file() else value["profile"]),
        {"use_sim_time": value["use_sim_time"].lower() == "true"},
    ]
    own = {
        "mpc_node": [
            {"driving": value["driving"].lower() == "true"},
            *([{"receipts": True}] if value["drive"] else []),
        ],
        "diagnosis_node": [{"markers": value["markers"].lower() == "true"}],
    }
    return [
        Node(
            package=package,
            executable=node,
            name=node,
            namespace=value["namespace"],
            parameters=[*common, *own.get(node, [])],
            output="screen",
        )
        for package, node in GRAPH
    ]


def recording(value):
    """What records inputs and outputs into a bag."""
    prefix = f"/{value['namespace'].strip('/')}/".replace("//", "/")
    topics = [*(prefix + topic for topic in (*INPUTS, *OUTPUTS)), "/diagnostics"]
    record = ["ros2", "bag", "record", "-s", "mcap", "-o", value["record"], "--topics", *topics]
    return ExecuteProcess(cmd=record, output="screen")


def playing(value):
    """The player, and what ends everything once it has ended."""
    arguments = [value["drive"], "--rate", value["rate"]]
    if value["fault"]:
        arguments += ["--fault", value["fault"]]
    arguments += ["--wait-for", *(node for _, node in GRAPH)]
    player = Node(
        package="lfd_replay",
        executable="bag_player",
        namespace=value["namespace"],
        arguments=arguments,
        output="screen",
    )
    end = RegisterEventHandler(
        OnProcessExit(target_action=player, on_exit=[EmitEvent(event=Shutdown())])
    )
    return [player, end]


def generate_launch_description():
    """Entry point of `ros2 launch`."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    # As ./run does: this machine alone, and nodes that find each other fast, unless said otherwise.
    profile = Path(get_package_share_directory("lfd_bringup")) / "config/fastdds.xml"
    usual = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "FASTRTPS_DEFAULT_PROFILES_FILE": str(profile),
    }
    chosen = [
        SetEnvironmentVariable(name, value)
        for name, value in usual.items()
        if name not in os.environ
    ]
    return LaunchDescription([*chosen, *declared, OpaqueFunction(function=start)])
