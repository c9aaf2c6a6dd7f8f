"""What every node of the graph does alike: parameters from settings, readiness, a quiet end."""

import sys
from collections.abc import Callable
from typing import TypeVar

import rclpy
from pydantic import ValidationError
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.context import Context
from rclpy.executors import Executor, ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from lfd_mpc.errors import UserError
from lfd_mpc.settings import Settings, settings_error

READY_TOPIC = "ready"
READY_QOS = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Every node says its own full name here, once, when it hears its publishers (latched)."""

PIPELINE_QOS = QoSProfile(depth=1000)
"""Between nodes: reliable, deep enough for a burst of steps."""

SettingsType = TypeVar("SettingsType", bound=Settings)


def declare_settings(node: Node, kind: type[SettingsType]) -> SettingsType:
    """Declare a parameter per field of `kind` and return the settings that they hold.

    Raises UserError naming the parameter for a value that is refused or a name that is unknown.
    """
    values = {}
    for name, field in kind.model_fields.items():
        extra = field.json_schema_extra
        assert isinstance(extra, dict)
        descriptor = ParameterDescriptor(
            description=f"{field.description} [{extra['unit']}]", read_only=True
        )
        low, high = _bounds(field.metadata)
        if isinstance(field.default, float) and None not in (low, high):
            descriptor.floating_point_range = [
                FloatingPointRange(from_value=float(low), to_value=float(high))
            ]
        elif isinstance(field.default, int) and None not in (low, high):
            descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
        default = list(field.default) if isinstance(field.default, tuple) else field.default
        try:
            value = node.declare_parameter(name, default, descriptor).value
        except (
            rclpy.exceptions.InvalidParameterTypeException,
            rclpy.exceptions.InvalidParameterValueException,
        ) as error:
            raise UserError(f"parameter '{name}': {error}") from error
        values[name] = tuple(value) if isinstance(field.default, tuple) else value
    try:
        settings = kind(**values)
    except ValidationError as error:
        raise UserError(settings_error(error)) from error
    _refuse_unknown(node)
    return settings


def _bounds(metadata: list) -> tuple[float | None, float | None]:
    low = high = None
    for item in metadata:
        low = getattr(item, "ge", getattr(item, "gt", low))
        high = getattr(item, "le", getattr(item, "lt", high))
    return low, high


def _refuse_unknown(node: Node) -> None:
    """A parameter that no one declared is a typing mistake: ROS itself would ignore it."""
    known = set(node.list_parameters([], 0).names)
    own = {"use_sim_time", "start_type_description_service"}
    for name in node._parameter_overrides:
        if name not in known and name not in own and not name.startswith("qos_overrides"):
            raise UserError(
                f"unknown parameter '{name}' for {node.get_name()}; "
                f"known: {', '.join(sorted(known - own))}"
            )


class ReadyAnnouncer:
    """Says once, latched, that the node hears all of its publishers."""

    def __init__(self, node: Node, topics: list[str]) -> None:
        """`topics`: relative names of the topics that must have a publisher."""
        self._node = node
        self._topics = topics
        self._publisher = node.create_publisher(String, READY_TOPIC, READY_QOS)
        self._timer = node.create_timer(
            0.02, self._check, clock=rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)
        )
        self._ticks = 0

    def _check(self) -> None:
        missing = [
            topic
            for topic in self._topics
            if not self._node.count_publishers(self._node.resolve_topic_name(topic))
        ]
        if not missing:
            self._publisher.publish(String(data=self._node.get_fully_qualified_name()))
            self._node.destroy_timer(self._timer)
            self._node.get_logger().info("ready")
            return
        self._ticks += 1
        if self._ticks % 500 == 100:
            self._node.get_logger().info(f"waiting for a publisher on {', '.join(missing)}")


def make_executor(context: Context | None = None) -> Executor:
    """The executor of all nodes: by events, a quarter of the cost of the one that polls.

    Only `spin_once` with a finite timeout delivers messages and heeds signals.
    """
    return EventsExecutor(context=context)


def run_node(make: Callable[[], Node], args: list[str] | None = None) -> int:
    """Spin one node until it is told to stop; returns the exit status."""
    if {"-h", "--help"} & set(sys.argv[1:] if args is None else args):
        print(sys.modules[make.__module__].__doc__)
        print("Options are ROS arguments: --ros-args -p NAME:=VALUE --params-file FILE -r FROM:=TO")
        return 0
    rclpy.init(args=args)
    node = None
    try:
        node = make()
        executor = make_executor()
        executor.add_node(node)
        while rclpy.ok():
            executor.spin_once(timeout_sec=0.1)
    except UserError as error:
        print(error, file=sys.stderr)
        return 2
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
