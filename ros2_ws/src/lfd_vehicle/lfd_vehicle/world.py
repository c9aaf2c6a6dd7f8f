"""The simulated world: the host behind its lead, what its sensors say, and their faults."""

from dataclasses import dataclass

from lfd_mpc.errors import UserError
from lfd_mpc.samples import Sample
from lfd_mpc.settings import STEP_NS, STEP_S, MpcSettings
from lfd_replay.faults import Fault, FaultInjector
from lfd_replay.generated.sensor_models import SENSORS
from lfd_vehicle.lead import FASTEST, Lead, LeadPlan
from lfd_vehicle.sensing import Moment, Sensing
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.vehicle import Vehicle

FARTHEST = 1000.0
"""m that the lead may be ahead at first."""


@dataclass(frozen=True)
class Scenario:
    """`lead` and what goes wrong; `gap` (m) and `speed` (m/s) of the host at first.

    Without them the host follows steadily at the desired clearance.
    """

    lead: LeadPlan
    faults: tuple[Fault, ...] = ()
    gap: float | None = None
    speed: float | None = None


class World:
    """One step of 10 ms after the other, until the lead's motion ends or the cars touch."""

    def __init__(self, scenario: Scenario, vehicle: VehicleSettings, control: MpcSettings) -> None:
        """Raises UserError for a beginning that cannot be."""
        if vehicle.sensors not in SENSORS:
            raise UserError(f"sensors '{vehicle.sensors}': there are: {', '.join(SENSORS)}")
        motion = scenario.lead
        speed = motion.speed if scenario.speed is None else scenario.speed
        gap = scenario.gap
        if gap is None:
            gap = control.desired_clearance(speed)
        if not (0.0 < gap < FARTHEST and 0.0 <= speed <= FASTEST):
            raise UserError(
                f"a gap of {gap:g} m at {speed:g} m/s: 0 to {FARTHEST:g} m and 0 to {FASTEST:g} m/s"
            )
        self.scenario = scenario
        self.lead = Lead(motion, gap)
        self.vehicle = Vehicle(vehicle, 0.0, speed)
        duration = motion.duration + 1.0
        suite = SENSORS[vehicle.sensors]
        self._sensing = Sensing(suite, duration, motion.bumps, vehicle.seed, motion.name)
        self._injector = FaultInjector(list(scenario.faults), 0, vehicle.seed)
        self.steps = 0

    @property
    def moment(self) -> Moment:
        """What really is now."""
        host, lead = self.vehicle.motion, self.lead
        return Moment(
            clearance=lead.position - host.position,
            relative_velocity=lead.speed - host.speed,
            host_speed=host.speed,
            host_acceleration=host.acceleration,
            lead_acceleration=lead.acceleration,
            grade=self._grade(),
            pitch=host.pitch,
            track_id=lead.track_id,
        )

    @property
    def stamp(self) -> int:
        """Now, in ns since the beginning."""
        return self.steps * STEP_NS

    @property
    def collided(self) -> bool:
        """Whether the cars touch."""
        return self.lead.position <= self.vehicle.motion.position

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to simulate."""
        return self.collided or self.steps * STEP_S >= self.scenario.lead.duration

    def sense(self) -> list[Sample]:
        """What the sensors say of the last 10 ms, faults included."""
        changed = (self._injector(sample) for sample in self._sensing.sense(self.moment))
        return [sample for sample in changed if sample is not None]

    def step(self) -> None:
        """Go on by 10 ms. Raises DivergenceError where the vehicle model cannot."""
        self.vehicle.step(self._grade())
        self.lead.step(self.vehicle.motion.position)
        self.steps += 1

    def _grade(self) -> float:
        grade = self.scenario.lead.grade
        return float(grade[min(self.steps, len(grade) - 1)])
