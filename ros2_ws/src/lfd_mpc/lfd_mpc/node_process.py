"""How the process of a node starts, runs and ends.

It joins ROS before it loads what it computes with: finding the others takes as long as loading.
"""

import os
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TypeVar

import rclpy
from rclpy.context import Context
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos_overriding_options import InvalidQosOverridesError
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from lfd_mpc.collector import without_collector
from lfd_mpc.deadline import end_within
from lfd_mpc.errors import UserError
from lfd_mpc.printed import Printed, no_room
from lfd_mpc.starting import ENDING_SIGNALS

NodeType = TypeVar("NodeType", bound=Node)

LEAVING = 2.0
"""Seconds within which the process of a node that was told to end has ended; it takes 0.15 s.

Where DDS was built with an old C++ library, as for the wheels, it waits for ever if it leaves just
while it hears that another node left (https://github.com/eProsima/Fast-DDS/issues/6513): one end in
a thousand where all nodes of a graph are ended at the same time.
"""

ROS_ARGUMENTS = "--ros-args -p NAME:=VALUE --params-file FILE -r FROM:=TO"

REFUSED_PARAMETER = (
    rclpy.exceptions.InvalidParameterTypeException,
    rclpy.exceptions.InvalidParameterValueException,
)
"""What rclpy raises where a parameter is declared that was given another value."""

QOS_PREFIX = "qos_overrides."
"""What the names of parameters of quality of service begin with."""

LARGEST_DOMAIN = 232
"""Beyond it there are no ports."""


def make_executor(context: Context | None = None) -> Executor:
    """The executor of all nodes: by events, a quarter of the cost of the one that polls.

    Only `spin_once` with a finite timeout delivers messages; `deliver` does it, and heeds signals.
    """
    return EventsExecutor(context=context)


class _Signals:
    """SIGINT and SIGTERM, taken alike: a KeyboardInterrupt, one alone and never within a callback.

    The handlers of rclpy end the context in a thread of their own, while the main thread publishes
    or leaves: the node then says that it failed, with a traceback, or aborts. So it does where a
    second signal comes while what is made in C++ is taken down; whoever starts a graph from a
    terminal sends two.
    """

    def __init__(self) -> None:
        self.told = False
        self.at_once = True
        self._leaves_within: float | None = None
        self._status = 0

    def __call__(self, number: int, frame: FrameType | None) -> None:
        first, self.told = not self.told, True
        if first and self._leaves_within is not None:
            end_within(self._leaves_within, self._status)
        if self.at_once:
            self.at_once = False
            raise KeyboardInterrupt

    @contextmanager
    def taken(self, leaves_within: float | None, status: int) -> Iterator[None]:
        """Signals come here until the end; once told, nothing comes to the end of the process.

        If that end does not come within so many s of the first one, the process ends with `status`:
        also where ROS has been left, as Python takes down there what of a node was only half made.
        """
        self.told, self.at_once = False, True
        self._leaves_within, self._status = leaves_within, status
        before = {number: signal.signal(number, self) for number in ENDING_SIGNALS}
        try:
            yield
        finally:
            for number, handler in before.items():
                # Python's own end gives signals that it handles back to the system.
                signal.signal(number, signal.SIG_IGN if self.told else handler)


_signals = _Signals()


def deliver(executor: Executor, seconds: float) -> None:
    """Call back for what arrives within so many s.

    Raises KeyboardInterrupt afterwards if the process was told to end, by SIGINT or SIGTERM.
    """
    _signals.at_once = False
    if not _signals.told:
        executor.spin_once(timeout_sec=seconds)
    if _signals.told:
        raise KeyboardInterrupt
    _signals.at_once = True


@contextmanager
def interruptible() -> Iterator[None]:
    """Raises KeyboardInterrupt for a signal although there was one before."""
    _signals.at_once = True
    try:
        yield
    finally:
        _signals.at_once = False


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


def own_arguments(program: str, arguments: list[str]) -> list[str]:
    """A command line without its ROS arguments. Raises UserError for those that cannot be."""
    try:
        return remove_ros_args([program, *arguments])[1:]
    except RuntimeError as error:
        raise UserError(f"{program}: {_said(error)}; expected: {ROS_ARGUMENTS}") from error


def _said(error: Exception) -> str:
    """What ROS says, without where in its sources it does so."""
    return re.sub(r",? at /\S+:\d+", "", str(error))


def refused_value(error: Exception) -> str:
    """What ROS says of a parameter's value, without the parameter's name once more at the end."""
    return re.sub(r": \w+$", "", str(error))


def _refuse_domain() -> None:
    """The middleware would say it in a page of its own. Raises UserError."""
    text = os.environ.get("ROS_DOMAIN_ID", "")
    if text and not (text.isdecimal() and int(text) <= LARGEST_DOMAIN):
        raise UserError(
            f"ROS_DOMAIN_ID is '{text}'; a whole number of 0 to {LARGEST_DOMAIN} is expected"
        )


def _start_ros(args: list[str] | None) -> None:
    """Raises UserError for arguments or an environment with which ROS does not start."""
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        rclpy.try_shutdown()
        raise UserError(f"ROS does not start: {_said(error)}") from error


@contextmanager
def _refused_parameters_told() -> Iterator[None]:
    """UserError for those that ROS itself declares: `use_sim_time`, and quality of service."""
    try:
        yield
    except REFUSED_PARAMETER as error:
        raise UserError(f"parameter: {refused_value(error)}") from error
    except InvalidQosOverridesError as error:
        raise UserError(f"parameter: {error}") from error
    except RuntimeError as error:
        if not str(error).startswith("Unexpected QoS override"):
            raise
        raise UserError(
            f"parameter qos_overrides: {error}; expected: reliability reliable or best_effort, "
            "history keep_last or keep_all"
        ) from error


@contextmanager
def ros_started(
    args: list[str] | None, leaves_within: float | None = None, status: int = 0
) -> Iterator[None]:
    """ROS, seen by this machine alone unless the environment says otherwise; left at the end.

    Told to end, the process ends within so many s, with `status` at the latest, if that is given.

    Raises UserError for arguments, parameters or an environment with which ROS or a node does not
    start, and for security that was asked for but would not be enforced; KeyboardInterrupt for
    SIGINT and SIGTERM.
    """
    _refuse_pretended_security()
    _refuse_domain()
    if "ROS_STATIC_PEERS" not in os.environ:
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with _signals.taken(leaves_within, status), _refused_parameters_told():
        _start_ros(args)
        try:
            yield
        finally:
            rclpy.try_shutdown()


@contextmanager
def joined(args: list[str] | None, leaves_within: float | None = None) -> Iterator[float]:
    """ROS joined, since the `time.monotonic()` that is given. Otherwise as `ros_started`."""
    with ros_started(args, leaves_within):
        # A context joins with its first node; hidden, as its name begins with an underscore.
        try:
            first = rclpy.create_node(
                "_joining",
                enable_rosout=False,
                start_parameter_services=False,
                use_global_arguments=False,
                parameter_overrides=[Parameter("start_type_description_service", value=False)],
            )
        except RuntimeError as error:
            raise UserError(f"ROS does not start: {_said(error)}") from error
        try:
            yield time.monotonic()
        finally:
            first.destroy_node()


def run_node(
    load: Callable[[], Callable[[], NodeType]],
    args: list[str] | None = None,
) -> int:
    """Spin one node until it is told to stop; returns the exit status.

    `load` gives its class, and may import it only then. A node that ends by itself has a `status`,
    which is None while it goes on.
    """
    args = sys.argv[1:] if args is None else args
    if {"-h", "--help"} & set(args):
        about = sys.modules[load().__module__].__doc__
        return _print_help(f"{about}\nOptions are ROS arguments: {ROS_ARGUMENTS}")
    try:
        _refuse_further(args)
        with joined(args, LEAVING):
            return _spin(load)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        pass
    return 0


def _print_help(text: str) -> int:
    """Returns the exit status: a reader who has gone is no failure, a full disk is one."""
    printed = Printed(sys.stdout)
    print(text, file=printed, flush=True)
    if printed.full is None:
        return 0
    print(no_room(printed.full), file=sys.stderr)
    return 2


def _refuse_further(args: list[str]) -> None:
    """What follows no --ros-args would be ignored. Raises UserError."""
    program = Path(sys.argv[0]).name
    further = own_arguments(program, args)
    if further:
        raise UserError(f"{program}: unknown: {' '.join(further)}; expected: {ROS_ARGUMENTS}")


@contextmanager
def loading() -> Iterator[None]:
    """Raises KeyboardInterrupt if told to end meanwhile, whatever was made of that."""
    try:
        yield
    except Exception as error:
        # Libraries in C make an ImportError of what is raised while they are loaded.
        if _signals.told:
            raise KeyboardInterrupt from error
        raise


def _refuse_unknown_qos(node: Node) -> None:
    """What names no topic, kind or policy of the node would be ignored. Raises UserError."""
    # What describes parameters takes long to load: not before the node has joined.
    from lfd_mpc.settings import unknown_parameter

    known = {name for name in node.list_parameters([], 0).names if name.startswith(QOS_PREFIX)}
    for name in node._parameter_overrides:
        if name.startswith(QOS_PREFIX) and name not in known:
            raise UserError(unknown_parameter(name, node.get_name(), known))


def _spin(load: Callable[[], Callable[[], NodeType]]) -> int:
    """Returns when told to stop or when there is a status, and leaves nothing of ROS behind."""
    try:
        with without_collector(stays=True), loading():
            node = load()()
        try:
            _refuse_unknown_qos(node)
            executor = make_executor()
            executor.add_node(node)
            while (ended := getattr(node, "status", None)) is None:
                deliver(executor, 0.1)
            return ended
        finally:
            node.destroy_node()
    except KeyboardInterrupt:
        # Here, and no later: it holds the executor.
        return 0
