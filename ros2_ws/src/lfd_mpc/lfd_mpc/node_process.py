"""How the process of a node starts, runs and ends.

It joins ROS before it loads what it computes with: finding the others takes as long as loading.
"""

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter

from lfd_mpc.collector import without_collector
from lfd_mpc.errors import UserError


def make_executor(context: Context | None = None) -> Executor:
    """The executor of all nodes: by events, a quarter of the cost of the one that polls.

    Only `spin_once` with a finite timeout delivers messages and heeds signals.
    """
    return EventsExecutor(context=context)


def _refuse_pretended_security() -> None:
    """Asked for security that is not enforced a node would start, unsecured. Raises UserError."""
    if os.environ.get("ROS_SECURITY_ENABLE", "").lower() != "true":
        return
    if not os.environ.get("ROS_SECURITY_KEYSTORE"):
        raise UserError(
            "ROS_SECURITY_ENABLE is true, but ROS_SECURITY_KEYSTORE names no keystore: the node "
            "would start unsecured"
        )
    if os.environ.get("ROS_SECURITY_STRATEGY") != "Enforce":
        raise UserError(
            "ROS_SECURITY_ENABLE is true, but ROS_SECURITY_STRATEGY is not Enforce: the node "
            "might start unsecured"
        )


def start_ros(args: list[str] | None) -> None:
    """Initialise ROS, seen by this machine alone unless the environment says otherwise.

    Raises UserError for security that was asked for but would not be enforced.
    """
    _refuse_pretended_security()
    if "ROS_STATIC_PEERS" not in os.environ:
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    rclpy.init(args=args)


@contextmanager
def joined(args: list[str] | None) -> Iterator[float]:
    """Joined ROS, since the `time.monotonic()` that is given; left at the end. As `start_ros`.

    Raises ExternalShutdownException where a signal ended it while something was being made.
    """
    start_ros(args)
    try:
        # A context joins with its first node; hidden, as its name begins with an underscore.
        first = rclpy.create_node(
            "_joining",
            enable_rosout=False,
            start_parameter_services=False,
            use_global_arguments=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        try:
            yield time.monotonic()
        finally:
            first.destroy_node()
    except RuntimeError as error:
        if rclpy.ok():
            raise
        # What ROS says to whoever goes on after a signal has ended the context.
        raise ExternalShutdownException from error
    finally:
        rclpy.try_shutdown()


def run_node(load: Callable[[], Callable[[], Node]], args: list[str] | None = None) -> int:
    """Spin one node until it is told to stop; returns the exit status.

    `load` gives its class, and may import it only then.
    """
    if {"-h", "--help"} & set(sys.argv[1:] if args is None else args):
        print(sys.modules[load().__module__].__doc__)
        print("Options are ROS arguments: --ros-args -p NAME:=VALUE --params-file FILE -r FROM:=TO")
        return 0
    try:
        with joined(args):
            with without_collector(stays=True):
                node = load()()
            try:
                executor = make_executor()
                executor.add_node(node)
                while rclpy.ok():
                    executor.spin_once(timeout_sec=0.1)
            finally:
                node.destroy_node()
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    return 0
