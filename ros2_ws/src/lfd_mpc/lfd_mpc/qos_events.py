"""Publishers and subscribers that cannot hear each other are named, with what both want."""

from collections.abc import Callable

from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSCompatibility, QoSProfile, qos_check_compatible
from rclpy.topic_endpoint_info import TopicEndpointInfo

UNLIMITED = 1e8
"""Seconds (three years) from which on a duration stands for no limit."""


def hearing(node: Node, topic: str, wanted: QoSProfile) -> SubscriptionEventCallbacks:
    """Callbacks of a subscription that log which publishers it cannot hear, and why."""
    return SubscriptionEventCallbacks(
        incompatible_qos=lambda _: _report_publishers(node, topic, wanted),
        use_default_callbacks=False,
    )


def telling(node: Node, topic: str, offered: QoSProfile) -> PublisherEventCallbacks:
    """Callbacks of a publisher that log which subscribers cannot hear it, and why."""
    return PublisherEventCallbacks(
        incompatible_qos=lambda _: _report_subscribers(node, topic, offered),
        use_default_callbacks=False,
    )


def _report_publishers(node: Node, topic: str, wanted: QoSProfile) -> None:
    name = node.resolve_topic_name(topic)
    for info in _incompatible(
        node.get_publishers_info_by_topic(name), lambda other: (other, wanted)
    ):
        node.get_logger().error(
            f"{name}: nothing of {_full_name(info)} can be heard: it offers "
            f"{profile_words(info.qos_profile)}, wanted is {profile_words(wanted)}; change that "
            f"publisher, or the parameters qos_overrides.{name}.subscription.* of this node"
        )


def _report_subscribers(node: Node, topic: str, offered: QoSProfile) -> None:
    name = node.resolve_topic_name(topic)
    for info in _incompatible(
        node.get_subscriptions_info_by_topic(name), lambda other: (offered, other)
    ):
        node.get_logger().error(
            f"{name}: {_full_name(info)} cannot hear this node: it wants "
            f"{profile_words(info.qos_profile)}, offered is {profile_words(offered)}"
        )


def _incompatible(
    infos: list[TopicEndpointInfo],
    pair: Callable[[QoSProfile], tuple[QoSProfile, QoSProfile]],
) -> list[TopicEndpointInfo]:
    """Those whose profile, as `pair` puts it beside ours (publisher, subscriber), does not fit."""
    return [
        info
        for info in infos
        if qos_check_compatible(*pair(info.qos_profile))[0] == QoSCompatibility.ERROR
    ]


def _full_name(info: TopicEndpointInfo) -> str:
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def profile_words(profile: QoSProfile) -> str:
    """The policies that two sides must agree on, in words."""
    words = [
        profile.reliability.name.lower().replace("_", " "),
        profile.durability.name.lower().replace("_", " "),
    ]
    deadline = profile.deadline.nanoseconds * 1e-9
    if 0.0 < deadline < UNLIMITED:
        words.append(f"deadline {deadline:g} s")
    lease = profile.liveliness_lease_duration.nanoseconds * 1e-9
    if 0.0 < lease < UNLIMITED:
        words.append(f"liveliness {profile.liveliness.name.lower()} within {lease:g} s")
    return ", ".join(words)
