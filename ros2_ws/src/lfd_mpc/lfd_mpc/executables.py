"""Executables of this package; what they compute with is imported when they have joined ROS."""

from lfd_mpc.node_process import run_node


def mpc_node() -> int:
    """Entry point of `lfd_mpc mpc_node`."""

    def load() -> type:
        from lfd_mpc.mpc_node import MpcNode

        return MpcNode

    return run_node(load)
