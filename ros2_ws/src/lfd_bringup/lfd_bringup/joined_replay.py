"""replay, which joins ROS before what it computes with is imported."""

from lfd_mpc.node_process import joined, loading, own_arguments
from lfd_replay.errors import run_command


def _replay(arguments: list[str]) -> int:
    own_arguments("replay", arguments)
    with joined(arguments) as since:
        with loading():
            from lfd_bringup.replay import main_replay

        return main_replay(arguments, since)


def main() -> int:
    """Entry point of `lfd_bringup replay`."""
    return run_command(_replay)
