"""radar_adapter: a car's radar tracks, as messages or on CAN, become radar/target.

Subscribes to radar/esr_tracks and radar/esr_status4, radar/tracks, or can/frames (remap them), or
reads a CAN bus; the parameter `source` says which. Host speed and yaw rate for the choice of the
lead are taken from vehicle/twist and vehicle/imu where these are published.
"""

import importlib
import queue
import threading
import time
from pathlib import Path
from typing import Any

import can
import rclpy
from geometry_msgs.msg import TwistStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu

from lfd_mpc.errors import UserError
from lfd_mpc.node_support import PIPELINE_QOS, declare_settings
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR
from lfd_replay.adapter_settings import RadarAdapterSettings
from lfd_replay.recordings.can_log import HostSignals
from lfd_replay.recordings.recorded_messages import (
    CAN_FRAME,
    ESR_STATUS_4,
    ESR_TRACK,
    RADAR_TRACKS,
    MessageConverter,
)
from lfd_replay.sample_publishers import SamplePublishers

SOURCES = {
    "esr_tracks": {"radar/esr_tracks": ESR_TRACK, "radar/esr_status4": ESR_STATUS_4},
    "radar_tracks": {"radar/tracks": RADAR_TRACKS},
    "can_frames": {"can/frames": CAN_FRAME},
    "can_bus": {},
}
"""Topics and message types of each source."""

ON_CAN = ("can_frames", "can_bus")
"""Sources that may carry host signals."""

BUS_POLL = 0.005
"""Seconds between looks at what the bus has received."""

BUS_RETRY = 0.5
"""Seconds after which a bus that could not be read is tried again."""


def message_class(message_type: str) -> Any:
    """The class of a message type. Raises UserError where its package is not installed."""
    package, _, name = message_type.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except (ImportError, AttributeError) as error:
        raise UserError(
            f"radar_adapter: message package '{package}' is not installed (needed for "
            f"{message_type}); install it, or choose another source"
        ) from error


def _host_signals(settings: RadarAdapterSettings) -> HostSignals | None:
    """What is to be taken from CAN. Raises UserError where that would never come."""
    speed, acceleration = settings.speed_signal or None, settings.accel_signal or None
    if not (settings.host_dbc or speed or acceleration):
        return None
    if not settings.host_dbc or not (speed or acceleration):
        raise UserError("radar_adapter: host_dbc goes with speed_signal, accel_signal or both")
    if settings.source not in ON_CAN:
        raise UserError(
            f"radar_adapter: host_dbc {settings.host_dbc}: source {settings.source} has no CAN "
            f"frames; with host_dbc source must be one of: {', '.join(ON_CAN)}"
        )
    return HostSignals(Path(settings.host_dbc), speed, acceleration)


class RadarAdapterNode(Node):
    """Tracks in, the lead out."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters, packages, files or a bus that cannot work."""
        super().__init__("radar_adapter", context=context, **node_options)
        settings = declare_settings(self, RadarAdapterSettings)
        host = _host_signals(settings)
        self._converter = MessageConverter(host=host)
        given = (RADAR, *(() if host is None else host.inputs))
        self._outputs = SamplePublishers(self, PIPELINE_QOS, given)
        for topic, message_type in SOURCES[settings.source].items():
            self.create_subscription(
                message_class(message_type),
                topic,
                lambda message, message_type=message_type: self._on_message(message_type, message),
                # A scan is up to 64 messages at once.
                rclpy.qos.QoSProfile(depth=1000, reliability=qos_profile_sensor_data.reliability),
            )
        # What this node itself publishes needs no subscription.
        if HOST_SPEED not in given:
            self._listen(TwistStamped, "vehicle/twist", "geometry_msgs/msg/TwistStamped")
        if ACCELERATION not in given:
            self._listen(Imu, "vehicle/imu", "sensor_msgs/msg/Imu")
        self._told = 0
        self._bus: can.BusABC | None = None
        if settings.source == "can_bus":
            self._open_bus(settings)

    def _listen(self, kind: Any, topic: str, message_type: str) -> None:
        """Host signals tell the converter how the car moves; they are not passed on."""
        self.create_subscription(
            kind,
            topic,
            lambda message: list(self._converter.push(message_type, message, 0)),
            qos_profile_sensor_data,
        )

    def _on_message(self, message_type: str, message: Any) -> None:
        received = self.get_clock().now().nanoseconds
        for sample in self._converter.push(message_type, message, received):
            self._outputs.publish(sample)
        self._tell_damage()

    def _open_bus(self, settings: RadarAdapterSettings) -> None:
        try:
            self._bus = can.Bus(channel=settings.can_channel, interface=settings.can_interface)
        except (can.CanError, OSError, ValueError, ImportError) as error:
            detail = " ".join(str(error).split())[:200]
            raise UserError(
                f"radar_adapter: CAN channel '{settings.can_channel}' of interface "
                f"'{settings.can_interface}' cannot be opened ({detail})"
            ) from error
        self._channel = settings.can_channel
        self._received: queue.SimpleQueue[tuple[int, can.Message]] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read_bus, daemon=True)
        self._reader.start()
        self.create_timer(BUS_POLL, self._on_bus)

    def _read_bus(self) -> None:
        bus = self._bus
        while bus is not None and self._bus is bus:
            try:
                message = bus.recv(timeout=0.2)
            except (can.CanError, OSError) as error:
                # An interface that goes down may come up again.
                self.get_logger().error(
                    f"CAN channel '{self._channel}' cannot be read ({error}); trying again",
                    throttle_duration_sec=10.0,
                )
                time.sleep(BUS_RETRY)
                continue
            if message is not None:
                # The node's clock, so that the stamps fit those of the other inputs.
                self._received.put((self.get_clock().now().nanoseconds, message))

    def _on_bus(self) -> None:
        while not self._received.empty():
            stamp, message = self._received.get()
            if message.is_error_frame or message.is_remote_frame:
                continue
            frame = stamp, message.arbitration_id, bytes(message.data)
            for sample in self._converter.push_frame(frame):
                self._outputs.publish(sample)
        self._tell_damage()

    def _tell_damage(self) -> None:
        damaged = sum(self._converter.counts.values())
        if damaged != self._told:
            self._told = damaged
            text = ", ".join(f"{n} {what}" for what, n in self._converter.counts.items() if n)
            self.get_logger().warning(f"so far: {text}", throttle_duration_sec=10.0)

    def destroy_node(self) -> None:
        """Leave the bus, too."""
        bus, self._bus = self._bus, None
        if bus is not None:
            self._reader.join(timeout=1.0)
            bus.shutdown()
        super().destroy_node()
