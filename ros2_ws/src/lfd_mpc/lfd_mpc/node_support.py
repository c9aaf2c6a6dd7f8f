"""What every node of the graph does alike: parameters from settings, readiness, health."""

import time
from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from pydantic import ValidationError
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from lfd_mpc.errors import UserError
from lfd_mpc.health import PERIOD, Health
from lfd_mpc.node_process import QOS_PREFIX, REFUSED_PARAMETER, refused_value
from lfd_mpc.settings import Settings, as_meant, is_fixed, settings_error, unknown_parameter

READY_TOPIC = "ready"
READY_QOS = QoSProfile(depth=20, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Every node says its own full name here, once, when it hears its publishers (latched)."""

READY_DEADLINE = 30.0
"""Seconds of wall time that nodes have to become ready for who waits for them."""

READY_PERIOD = 0.02
"""Seconds between two looks for publishers."""

WAITING_TOLD_AT, WAITING_TOLD_EVERY = 100, 500
"""Looks after which it is told first, and again, what is waited for: 2 s, then every 10 s."""

PIPELINE_QOS = QoSProfile(depth=1000)
"""Between nodes: reliable, deep enough for a burst of steps."""

SettingsType = TypeVar("SettingsType", bound=Settings)


def declare_settings(
    node: Node,
    kind: type[SettingsType],
    apply: Callable[[SettingsType], None] | None = None,
) -> SettingsType:
    """Declare a parameter per field of `kind` and return the settings that they hold.

    `apply` takes other settings while the node runs, between two steps, and raises UserError or
    ValueError for those that cannot work; without it every parameter is read-only. Raises
    UserError naming node and parameter for a value that is refused or a name that is unknown.
    """
    values = {}
    for name, field in kind.model_fields.items():
        descriptor = describe(field, read_only=apply is None or is_fixed(field))
        default = list(field.default) if isinstance(field.default, tuple) else field.default
        value = declare(node, name, default, descriptor)
        values[name] = tuple(value) if isinstance(field.default, tuple) else value
    try:
        settings = _checked(kind, values)
    except UserError as error:
        raise UserError(f"{node.get_name()}: {error}") from error
    _refuse_unknown(node)
    if apply is not None:
        _follow_changes(node, settings, apply)
    return settings


def declare(node: Node, name: str, default: Any, descriptor: ParameterDescriptor) -> Any:
    """Declare a parameter and return its value, of the type of `default`.

    Raises UserError naming node and parameter for a value that is refused.
    """
    whose = f"{node.get_name()}: parameter {name}"
    given = node._parameter_overrides.get(name)
    if given is not None:
        value = as_meant(given.value, default)
        node._parameter_overrides[name] = Parameter(name, value=value)
    try:
        value = node.declare_parameter(name, default, descriptor).value
    except REFUSED_PARAMETER as error:
        raise UserError(f"{whose}: {_refusal(given.value, descriptor, error)}") from error
    if value is None:
        raise UserError(f"{whose}: no value; expected one such as {default}")
    return value


def _refusal(value: Any, descriptor: ParameterDescriptor, error: Exception) -> str:
    """Why ROS refuses a parameter's value, and what is expected."""
    if isinstance(error, InvalidParameterValueException):
        for limits in (*descriptor.floating_point_range, *descriptor.integer_range):
            low, high = limits.from_value, limits.to_value
            return f"{value} is out of range; {low} to {high} is expected"
    return refused_value(error)


def _checked(kind: type[SettingsType], values: dict[str, Any]) -> SettingsType:
    try:
        return kind(**values)
    except ValidationError as error:
        raise UserError(settings_error(error)) from error


def _follow_changes(
    node: Node, settings: SettingsType, apply: Callable[[SettingsType], None]
) -> None:
    """Refuse parameters that cannot work, with the reason, and apply the others."""
    known = settings

    def change(parameters: list[Parameter]) -> SetParametersResult:
        nonlocal known
        values = known.model_dump()
        own = {p.name: p.value for p in parameters if p.name in values}
        if not own:
            return SetParametersResult(successful=True)
        for name, value in own.items():
            values[name] = tuple(value) if isinstance(values[name], tuple) else value
        try:
            changed = _checked(type(known), values)
            apply(changed)
        except (UserError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        known = changed
        node.get_logger().info(f"changed: {', '.join(f'{n} = {v}' for n, v in own.items())}")
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(change)


def describe(field: Any, read_only: bool) -> ParameterDescriptor:
    """The descriptor of a field of settings: text, unit and range."""
    extra = field.json_schema_extra
    descriptor = ParameterDescriptor(
        description=f"{field.description} [{extra['unit']}]", read_only=read_only
    )
    low, high = _bounds(field.metadata)
    if isinstance(field.default, float) and None not in (low, high):
        descriptor.floating_point_range = [
            FloatingPointRange(from_value=float(low), to_value=float(high))
        ]
    elif isinstance(field.default, int) and None not in (low, high):
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return descriptor


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
        # Those of quality of service are declared with the subscriptions, after all others.
        if name not in known and name not in own and not name.startswith(QOS_PREFIX):
            raise UserError(unknown_parameter(name, node.get_name(), known - own))


class HealthPublisher:
    """Publishes statuses on /diagnostics once a second, and whenever it is told to."""

    def __init__(self, node: Node, statuses: Callable[[bool], list[Health]]) -> None:
        """`statuses` gives them; it is told whether a period ends with these."""
        self._node, self._statuses = node, statuses
        self._prefix = node.get_fully_qualified_name().lstrip("/")
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, lambda: self._publish(True), clock=steady)

    def changed(self) -> None:
        """Publish now, within a period."""
        self._publish(False)

    def _publish(self, period_ends: bool) -> None:
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        array.status = [
            DiagnosticStatus(
                level=bytes([health.level]),
                name=f"{self._prefix}: {health.name}",
                hardware_id=health.hardware or self._prefix,
                message=health.message,
                values=[KeyValue(key=key, value=value) for key, value in health.values.items()],
            )
            for health in self._statuses(period_ends)
        ]
        self._publisher.publish(array)


class ReadyAnnouncer:
    """Says once, latched, that the node hears all of its publishers."""

    def __init__(self, node: Node, topics: list[str]) -> None:
        """`topics`: relative names of the topics that must have a publisher."""
        self._node = node
        self._topics = topics
        self._publisher = node.create_publisher(String, READY_TOPIC, READY_QOS)
        self._timer = node.create_timer(
            READY_PERIOD, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self._looks = 0

    def _check(self) -> None:
        missing = [missed for topic in self._topics if (missed := self._missed(topic))]
        if not missing:
            self._publisher.publish(String(data=self._node.get_fully_qualified_name()))
            self._node.destroy_timer(self._timer)
            self._node.get_logger().info("ready")
            return
        self._looks += 1
        if self._looks % WAITING_TOLD_EVERY == WAITING_TOLD_AT:
            self._node.get_logger().info(f"waiting for a publisher on {', '.join(missing)}")

    def _missed(self, topic: str) -> str:
        """The topic, where nobody publishes on it what the node subscribes to; else empty."""
        name = self._node.resolve_topic_name(topic)
        kinds = {info.topic_type for info in self._node.get_publishers_info_by_topic(name)}
        heard = {
            f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
            for subscription in self._node.subscriptions
            if subscription.topic_name == name and (kind := subscription.msg_type)
        }
        if not heard:
            return "" if kinds else topic
        if kinds & heard:
            return ""
        others = f" (there is one of {', '.join(sorted(kinds))}, not {', '.join(heard)})"
        return topic + (others if kinds else "")


class AwaitedNodes:
    """Nodes that must have said that they are ready before another one begins."""

    def __init__(self, node: Node, names: Iterable[str]) -> None:
        """`names`: of the nodes that `node` waits for."""
        # As they were given: with the namespace or without.
        self._missing = set(names)
        self._begun = time.monotonic()
        node.create_subscription(String, READY_TOPIC, self._on_ready, READY_QOS)

    @property
    def missing(self) -> list[str]:
        """Those that have not said it."""
        return sorted(self._missing)

    def check(self, further: str = "") -> None:
        """Raises UserError when the deadline has passed; `further`: what is missing beside them."""
        if time.monotonic() - self._begun > READY_DEADLINE:
            raise UserError(
                f"waited {READY_DEADLINE:.0f} s for {', '.join(self.missing) or further} to be "
                "ready: are they running, in the same ROS_DOMAIN_ID?"
            )

    def _on_ready(self, message: String) -> None:
        self._missing -= {message.data, message.data.rsplit("/", 1)[-1]}
