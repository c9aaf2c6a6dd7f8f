"""vehicle_node: commands in; what the simulated car's sensors say, and the truth, out.

Give `lead` (a generated drive's lead, a drive, or steps such as 20,-3@10-14) and `faults`
(`KIND:SIGNAL=VALUE@START-END`, several separated by ;) as parameters. `lead/acceleration`
(std_msgs/Float64, m/s^2) steers the lead live. It ends with the run.
"""

import time
from dataclasses import dataclass

from geometry_msgs.msg import AccelStamped
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

from lfd_diagnosis.markers import MARKER_STEPS
from lfd_mpc.errors import UserError
from lfd_mpc.messages import from_time, to_message, to_time
from lfd_mpc.node_support import (
    PIPELINE_QOS,
    AwaitedNodes,
    ReadyAnnouncer,
    declare_settings,
)
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, Sample
from lfd_mpc.settings import STEP_S, MpcSettings
from lfd_msgs.msg import Decision, DrivingState, VehicleTruth
from lfd_replay.faults import parse_faults
from lfd_replay.lockstep import ANSWERS, Lockstep, LockstepError
from lfd_replay.player import GRAPH_NODES, HEARTBEAT
from lfd_replay.sample_publishers import SamplePublishers
from lfd_vehicle.lead import lead_plan
from lfd_vehicle.markers import markers
from lfd_vehicle.settings import VehicleNodeSettings
from lfd_vehicle.vehicle import DivergenceError
from lfd_vehicle.world import Scenario, World

LOOP_ANSWERS = {
    **ANSWERS,
    "diagnosis/decision": Decision,
    "mpc/driving": DrivingState,
}
"""What lockstep waits for in the closed loop."""

LOOP_NODES = (*GRAPH_NODES, "decision_node")

LOCKSTEP_PERIOD = 0.1
"""Seconds between looks for overdue answers in lockstep, where answers themselves go on."""

SLOWEST = 0.001
"""Least rate at which the car still is driven."""


@dataclass(slots=True)
class TrueState:
    """The fields, units and meanings of `lfd_msgs/VehicleTruth`; `stamp` in ns."""

    stamp: int
    step: int
    clearance: float
    relative_velocity: float
    host_position: float
    host_speed: float
    host_acceleration: float
    host_pitch: float
    lead_speed: float
    lead_acceleration: float
    grade: float
    command_lost: bool
    collided: bool
    model: str


class VehicleNode(Node):
    """Moves the world by 10 ms at a time: by the wall clock, or when the graph has answered."""

    def __init__(
        self,
        context: Context | None = None,
        wait_for: tuple[str, ...] = LOOP_NODES,
        **node_options,
    ) -> None:
        """Raises UserError for a lead, faults or parameters that cannot be."""
        super().__init__("vehicle_node", context=context, **node_options)
        settings = declare_settings(self, VehicleNodeSettings)
        if 0.0 < settings.rate < SLOWEST:
            raise UserError(
                f"vehicle_node: parameter rate: {settings.rate:g}; expected: 0 or {SLOWEST:g} to "
                "100"
            )
        try:
            scenario = Scenario(lead_plan(settings.lead), tuple(parse_faults([settings.faults])))
        except UserError as error:
            raise UserError(f"vehicle_node: {error}") from error
        self.world = World(scenario, settings, MpcSettings())
        self.total = scenario.lead.duration
        self.error: Exception | None = None
        self.done = False
        self._waiting: list[Sample] = []
        self._awaited = AwaitedNodes(self, wait_for)
        self._clock = self.create_publisher(Clock, "/clock", 10)
        self._truth = self.create_publisher(VehicleTruth, "vehicle/truth", PIPELINE_QOS)
        self._markers = self.create_publisher(MarkerArray, "vehicle/markers", 10)
        inputs = (RADAR, ACCELERATION, HOST_SPEED)
        self._outputs = SamplePublishers(self, PIPELINE_QOS, inputs)
        self.create_subscription(AccelStamped, "mpc/command", self._on_command, PIPELINE_QOS)
        self.create_subscription(Float64, "lead/acceleration", self._on_lead, 10)
        self._commanded = -1
        self._told = 0.0
        self._lockstep = (
            Lockstep(self, LOOP_ANSWERS, ("decision",), self._on_timer)
            if settings.rate == 0.0
            else None
        )
        steady = RosClock(clock_type=ClockType.STEADY_TIME)
        period = LOCKSTEP_PERIOD if self._lockstep is not None else STEP_S / settings.rate
        self._timer = self.create_timer(period, self._on_timer, clock=steady)
        ReadyAnnouncer(self, ["mpc/command"])

    @property
    def status(self) -> int | None:
        """Exit status of a run that is over: 2 for a mistake of the user's, 1 for another error."""
        if self.error is not None:
            return 2 if isinstance(self.error, UserError) else 1
        return 0 if self.done else None

    def _on_command(self, message: AccelStamped) -> None:
        try:
            self.world.vehicle.command(message.accel.linear.x)
        except ValueError as error:
            self.get_logger().error(f"mpc/command: {error}", throttle_duration_sec=1.0)
        self._commanded = from_time(message.header.stamp)
        if self._lockstep is not None:
            self._on_timer()

    def _on_lead(self, message: Float64) -> None:
        try:
            self.world.lead.tell(message.data)
        except ValueError as error:
            self.get_logger().error(f"lead/acceleration: {error}", throttle_duration_sec=1.0)

    def _on_timer(self) -> None:
        if self.done or self.error is not None:
            return
        try:
            if self._awaited.missing or (self.world.steps == 0 and not self._outputs.heard):
                self._awaited.check("someone to hear the sensors")
            elif self._lockstep is None:
                self._advance()
            else:
                self._pump(self._lockstep)
        except (UserError, LockstepError, DivergenceError) as error:
            self.error = error
            self.get_logger().error(str(error))

    def _advance(self) -> None:
        for sample in self._observe():
            self._outputs.publish(sample)
        self._go_on()

    def _pump(self, lockstep: Lockstep) -> None:
        """Send what may be sent; go on by a step when everything is answered."""
        lockstep.check()
        if time.monotonic() - self._told > HEARTBEAT:
            self._tell_time()
        if self.world.steps == 0 and not self._waiting:
            lockstep.check_reliable(self._outputs.topics)
            self._waiting = self._observe()
        while True:
            while self._waiting and lockstep.take_turn(self._waiting[0]):
                self._outputs.publish(self._waiting.pop(0))
            if self._waiting or lockstep.waiting or self._commanded < lockstep.released:
                return
            self._go_on()
            if self.done:
                return
            self._waiting = self._observe()

    def _tell_time(self) -> None:
        self._told = time.monotonic()
        self._clock.publish(Clock(clock=to_time(self.world.stamp)))

    def _observe(self) -> list[Sample]:
        """Tell the time and the truth; the samples of the last 10 ms."""
        world = self.world
        self._tell_time()
        moment, motion = world.moment, world.vehicle.motion
        truth = TrueState(
            stamp=world.stamp,
            step=world.steps,
            clearance=moment.clearance,
            relative_velocity=moment.relative_velocity,
            host_position=motion.position,
            host_speed=moment.host_speed,
            host_acceleration=moment.host_acceleration,
            host_pitch=moment.pitch,
            lead_speed=world.lead.speed,
            lead_acceleration=moment.lead_acceleration,
            grade=moment.grade,
            command_lost=world.vehicle.actuation.lost,
            collided=world.collided,
            model=world.vehicle.model,
        )
        self._truth.publish(to_message(truth, VehicleTruth()))
        if world.steps % MARKER_STEPS == 0:
            self._markers.publish(markers(moment, to_time(world.stamp)))
        return world.sense()

    def _go_on(self) -> None:
        self.world.step()
        if self.world.ended:
            self._observe()
            self.done = True
            ending = "the cars touch" if self.world.collided else "the lead's motion ends"
            self.get_logger().info(f"{ending} after {self.world.steps * STEP_S:.2f} s")
