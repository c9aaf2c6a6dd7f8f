"""A drive replayed into the node graph, one process per node.

ros2 launch lfd_bringup replay.launch.py drive:=PATH fault:='offset:acceleration=4@20-35' rate:=1.0
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    EmitEvent,
    OpaqueFunction,
    RegisterEventHandler,
    SetEnvironmentVariable,
)
from launch.event_handlers import OnProcessExit
from launch.events import Shutdown
from launch_ros.actions import Node

ARGUMENTS = {
    "drive": (None, "path of a drive: CSV file or bag"),
    "fault": ("", "fault texts, several separated by ;"),
    "rate": ("1.0", "x real time; 0 = lockstep"),
    "profile": ("robust", "parameter profile: robust or paper"),
}


def start(context):
    """The nodes, and an end when the player has ended."""
    value = {name: context.launch_configurations[name] for name in ARGUMENTS}
    share = Path(get_package_share_directory("lfd_bringup"))
    parameters = [
        str(share / "params" / f"{value['profile']}.yaml"),
        str(share / "params" / "lockstep.yaml"),
        {"use_sim_time": True},
    ]
    nodes = [
        Node(package=package, executable=node, name=node, parameters=parameters, output="screen")
        for package, node in (
            ("lfd_mpc", "mpc_node"),
            ("lfd_observer", "observer_node"),
            ("lfd_diagnosis", "diagnosis_node"),
        )
    ]
    arguments = [value["drive"], "--rate", value["rate"]]
    if value["fault"]:
        arguments += ["--fault", value["fault"]]
    arguments += ["--wait-for", "mpc_node", "observer_node", "diagnosis_node"]
    player = Node(
        package="lfd_replay",
        executable="bag_player",
        arguments=arguments,
        output="screen",
    )
    end = RegisterEventHandler(
        OnProcessExit(target_action=player, on_exit=[EmitEvent(event=Shutdown())])
    )
    return [*nodes, player, end]


def generate_launch_description():
    """Entry point of `ros2 launch`."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    local = SetEnvironmentVariable("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    return LaunchDescription([local, *declared, OpaqueFunction(function=start)])
