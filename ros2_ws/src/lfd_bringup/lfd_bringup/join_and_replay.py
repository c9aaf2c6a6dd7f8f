"""Entry point of replay: it looks around in the domain while it still loads what it computes with.

Whether another graph runs there is known only some time after joining, and loading takes as long.
"""

import time

import rclpy

from lfd_mpc.node_support import start_ros
from lfd_replay.errors import run_command


def _join_and_replay(arguments: list[str]) -> int:
    start_ros(arguments)
    try:
        # A context joins with its first node.
        first = rclpy.create_node("replay", enable_rosout=False, start_parameter_services=False)
        joined = time.monotonic()
        from lfd_bringup.replay import main_replay

        try:
            return main_replay(arguments, joined)
        finally:
            first.destroy_node()
    finally:
        rclpy.try_shutdown()


def main() -> int:
    """Entry point of `lfd_bringup replay`."""
    return run_command(_join_and_replay)
