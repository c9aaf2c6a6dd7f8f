"""Executables of this package; what they compute with is imported when they have joined ROS."""

from lfd_mpc.node_process import run_node


def observer_node() -> int:
    """Entry point of `lfd_observer observer_node`."""

    def load() -> type:
        from lfd_observer.observer_node import ObserverNode

        return ObserverNode

    return run_node(load)
