"""fault_injector: stands between the sensors and the graph, and makes sensors faulty.

Hears sensors/radar/target, sensors/vehicle/imu, sensors/vehicle/twist and
sensors/v2v/lead_acceleration (remap them, or the sensors) and says the same on radar/target and so
on, with faults in the grammar of --fault, whose times count from the newest sample when ~/inject
(lfd_msgs/srv/InjectFault) is called; ~/clear (std_srvs/Trigger) ends them all.
"""

from collections import deque
from dataclasses import replace
from functools import partial
from typing import Any

from rclpy.context import Context
from rclpy.node import Node
from std_srvs.srv import Trigger

from lfd_mpc.arrival import AHEAD_NS
from lfd_mpc.errors import UserError
from lfd_mpc.node_support import PIPELINE_QOS, declare_settings
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RadarSample,
    Sample,
)
from lfd_mpc.sensor_inputs import INPUT_TOPICS, SENSOR_OVERRIDES, sensor_qos
from lfd_msgs.srv import InjectFault
from lfd_replay.adapter_settings import InjectorSettings
from lfd_replay.faults import GRAMMAR, Fault, FaultInjector, parse_faults

KEPT_NS = 10_000_000_000
"""Samples of so long ago, as those before it made them, are known to a fault that begins now: what
it holds or delays."""


class LiveFaults:
    """Faults that come and go while samples pass."""

    def __init__(self, seed: int) -> None:
        """`seed`: of injected noise."""
        self._seed = seed
        self._recent: deque[tuple[int, Sample]] = deque()
        self._active: list[tuple[int, FaultInjector]] = []
        self._at_first: list[Fault] = []
        self._newest: int | None = None
        self._odd: Sample | None = None

    def inject_at_first(self, faults: list[Fault]) -> None:
        """Faults whose times count from the first sample."""
        self._at_first = faults

    def inject(self, faults: list[Fault]) -> int:
        """Faults whose times count from now; returns what stamp (ns) that is.

        Raises UserError where no sample has passed: there is no now.
        """
        if self._newest is None:
            raise UserError("no sample has passed yet: times count from the newest one")
        # The newest sample has passed: a fault from 0 s on begins right after it.
        self._add([replace(fault, start=max(fault.start, 1)) for fault in faults], self._newest)
        return self._newest

    def clear(self) -> int:
        """End all faults; returns how many there were."""
        count = len(self._active) + bool(self._at_first)
        self._active, self._at_first = [], []
        return count

    def __call__(self, sample: Sample) -> Sample | None:
        """The sample as a faulty sensor gives it; None where it says nothing."""
        if sample.input != LEAD_ACCELERATION:
            # Other cars have clocks of their own.
            self._follow_time(sample)
        if self._newest is None:
            return sample
        if self._at_first:
            self._add(self._at_first, self._newest)
            self._at_first = []
        self._active = [(end, one) for end, one in self._active if end > self._newest]
        changed: Sample | None = sample
        for _, injector in self._active:
            if changed is not None:
                changed = injector(changed)
        if changed is not None:
            self._recent.append((self._newest, changed))
        while self._recent and self._newest - self._recent[0][0] > KEPT_NS:
            self._recent.popleft()
        return changed

    def _follow_time(self, sample: Sample) -> None:
        """Take a stamp as that of now: one that jumps only where a second input agrees, or nothing
        contradicts it for a second."""
        if self._newest is not None and abs(sample.stamp - self._newest) > AHEAD_NS:
            odd, self._odd = self._odd, sample
            if odd is None:
                return
            since = sample.stamp - odd.stamp
            if odd.input != sample.input:
                believed = abs(since) <= AHEAD_NS
            elif 0 < since <= AHEAD_NS:
                self._odd = odd
                return
            else:
                believed = 0 < since <= 2 * AHEAD_NS
            if not believed:
                return
            if sample.stamp < self._newest:
                self._recent.clear()
                self._active = []
            self._newest = None
        self._odd = None
        if self._newest is None or sample.stamp > self._newest:
            self._newest = sample.stamp

    def _add(self, faults: list[Fault], zero: int) -> None:
        if not faults:
            return
        injector = FaultInjector(faults, zero, self._seed)
        for _, sample in self._recent:
            injector(sample)
        self._active.append((zero + max(fault.end for fault in faults), injector))


class FaultInjectorNode(Node):
    """Messages pass; faults change their values and nothing else of them."""

    def __init__(self, context: Context | None = None, **node_options) -> None:
        """Raises UserError for parameters that cannot work."""
        super().__init__("fault_injector", context=context, **node_options)
        settings = declare_settings(self, InjectorSettings)
        self._faults = LiveFaults(settings.seed)
        self._faults.inject_at_first(parse_faults([settings.fault]))
        self._outputs = {}
        for name, (kind, topic, _) in INPUT_TOPICS.items():
            self._outputs[name] = self.create_publisher(kind, topic, PIPELINE_QOS)
            self.create_subscription(
                kind,
                f"sensors/{topic}",
                partial(self._on_message, name),
                sensor_qos(),
                qos_overriding_options=SENSOR_OVERRIDES,
            )
        self.create_service(InjectFault, "~/inject", self._on_inject)
        self.create_service(Trigger, "~/clear", self._on_clear)

    def _on_message(self, name: str, message: Any) -> None:
        changed = self._faults(INPUT_TOPICS[name][2](message))
        if changed is not None:
            _write(message, changed)
            self._outputs[name].publish(message)

    def _on_inject(
        self, request: InjectFault.Request, response: InjectFault.Response
    ) -> InjectFault.Response:
        try:
            stamp = self._faults.inject(_faults_of(request.fault))
        except UserError as error:
            response.success, response.message = False, str(error)
            self.get_logger().warning(f"refused: {error}")
        else:
            response.success = True
            response.message = f"{request.fault}, from {stamp * 1e-9:.3f} s on"
            self.get_logger().info(response.message)
        return response

    def _on_clear(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        response.message = f"{self._faults.clear()} injections ended"
        self.get_logger().info(response.message)
        return response


def _faults_of(text: str) -> list[Fault]:
    """At least one. Raises UserError that says how a fault is written."""
    try:
        faults = parse_faults([text])
    except UserError as error:
        if GRAMMAR in str(error):
            raise
        raise UserError(f"{error}; a fault is written {GRAMMAR}") from error
    if not faults:
        raise UserError(f"fault '{text}': expected {GRAMMAR}")
    return faults


def _write(message: Any, sample: Sample) -> None:
    """Put the sample's values into the message that it was made of."""
    if isinstance(sample, RadarSample):
        message.clearance = sample.clearance
        message.relative_velocity = sample.relative_velocity
    elif sample.input == ACCELERATION:
        message.linear_acceleration.x = sample.value
    elif sample.input == HOST_SPEED:
        message.twist.linear.x = sample.value
    else:
        message.accel.linear.x = sample.value
