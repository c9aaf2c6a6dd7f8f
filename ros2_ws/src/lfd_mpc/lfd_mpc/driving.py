"""The car's driver: which values to trust, what to do with them, and how gently.

| level | condition | command |
|---|---|---|
| normal, degraded | clearance and relative velocity known | the plan; a larger gap when degraded |
| any | no lead, and the radar says so | the set speed |
| any | a value of the lead unknown | never above what is applied now, never above 0 |
| any | the own speed unknown | never above 0 |
| take over | `WARN` | the plan, but no acceleration |
| take over | `STOP`, or no decision in time | a comfortable stop |
| emergency | `BRAKE` | full braking to standstill |
"""

from collections import deque
from dataclasses import dataclass
from enum import IntEnum
from math import inf, isfinite, isnan, nan, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.box_qp import solve_box_entry
from lfd_mpc.controller import roll_out_entry
from lfd_mpc.decision import Action, Decision, FaultLevel, braking_needed
from lfd_mpc.following_model import STATES, build_following_model
from lfd_mpc.horizon import Horizon, Mpc
from lfd_mpc.settings import STEP_NS, STEP_S, MpcSettings

FIRST_DECISION = 2.0
"""Seconds in which the first decision must come: its node takes as long to start at most."""

DOUBT_STEPS = 20
"""Steps before a fault of the host speed whose speed is believed: it is not found at once."""

CARRIED = 10.0
"""Seconds for which a host speed that is not measured is carried on by the acceleration."""

CRUISE_TIME = 3.0
"""Seconds in which a difference from the set speed would be made up."""

STANDING = 0.15
"""m/s below which the car, or its lead, is said to stand."""

CREEPING = 0.5
"""m/s below which the car stops for good behind a lead that stands, where it is near enough."""

NEAR_ENOUGH = 1.0
"""m beyond the clearance of a standstill at which a stop ends, and above which a start begins."""

ROLLING = 0.5
"""m/s of a lead that has set off."""

HOLDING, STOPPING = -1.5, -0.6
"""m/s^2 with which the brakes hold a standing car, and end a stop without a jerk."""

SOFT = 0.7
"""1/s: a stop that is not an emergency brakes with so many times the speed at the most."""

HARD = 1.5
"""Deceleration in m/s^2 that must be needed before the jerk is more than comfortable."""

HARDER = 2.0
"""m/s^2 needed beyond `HARD` at which the jerk is that of an emergency."""

STOPS = (Action.STOP, Action.BRAKE)
"""Actions that brake as hard as was decided."""


class Source(IntEnum):
    """Where a value that the car is driven by comes from; as in `lfd_msgs/DrivingState`."""

    NONE = 0
    MEASURED = 1
    RECONSTRUCTED = 2


@dataclass(slots=True)
class DrivingState:
    """The fields, units and meanings of `lfd_msgs/DrivingState`; `stamp` in ns."""

    stamp: int
    step: int
    level: int
    action: int
    command: float
    desired_clearance: float
    clearance: float
    clearance_source: int
    relative_velocity: float
    relative_velocity_source: int
    acceleration: float
    acceleration_source: int
    host_speed: float
    host_speed_source: int
    holding: bool
    reason: str


class Lead(NamedTuple):
    """The lead as it is driven by: m, m/s (relative) and m/s^2 (its own)."""

    clearance: float
    velocity: float
    acceleration: float


class Host(NamedTuple):
    """The own car as it is driven by: m/s^2 and m/s (NaN: not known), and where they come from."""

    acceleration: float
    acceleration_source: Source
    speed: float
    speed_source: Source

    @property
    def stands(self) -> bool:
        """Whether it is known to stand."""
        return isfinite(self.speed) and self.speed < STANDING


class Order(NamedTuple):
    """What is to be done in a step: as was decided, or in place of a decision.

    `age` in s: of the decision, or of the wait for one; `undecided`: whether the car is stopped
    because no decision came in time.
    """

    decision: Decision | None
    action: Action
    level: int
    reason: str
    age: float
    undecided: bool


class CarDriver:
    """One command per step of the controller; keeps what it sent before."""

    def __init__(self, settings: MpcSettings) -> None:
        """Raises ValueError for settings that cannot work."""
        self._settings = settings
        self._model = build_following_model(settings)
        self._plan = np.empty(settings.control_steps)
        self._start = np.zeros(len(STATES))
        self._decision: Decision | None = None
        self._undecided_since: int | None = None
        self._ever_decided = False
        self._command, self._holding = 0.0, False
        self._speeds: deque[tuple[int, float]] = deque(maxlen=DOUBT_STEPS)
        self._speed, self._speed_stamp, self._measured_at = nan, 0, 0

    def change(self, settings: MpcSettings) -> None:
        """Drive by other settings. Raises ValueError for those that cannot work."""
        self._model, self._settings = build_following_model(settings), settings

    def decide(self, decision: Decision) -> None:
        """Take the newest decision; it holds from the next step on.

        Raises ValueError for one that no decision node makes.
        """
        deceleration, stops = decision.deceleration, decision.action in STOPS
        if not 0.0 <= deceleration < inf or (stops and not deceleration):
            raise ValueError(f"a deceleration of {deceleration:g} m/s^2")
        self._decision, self._ever_decided = decision, True

    def drive(self, horizon: Horizon) -> DrivingState:
        """The command for one step, and what it rests on."""
        order = self._take_order(horizon)
        velocity, velocity_source = self._relative_velocity(horizon, order.decision)
        clearance, clearance_source = self._clearance(horizon, order, velocity)
        acceleration, acceleration_source = self._acceleration(horizon, order.decision)
        speed, speed_source = self._carry_host_speed(horizon, order.decision, acceleration)
        host = Host(acceleration, acceleration_source, speed, speed_source)
        lead = Lead(clearance, velocity, self._lead_acceleration(order.decision, acceleration))
        desired = self._desired_clearance(order.action, speed, clearance)
        self._command = self._gently(*self._aim(horizon, order, lead, host, desired))
        reason = order.reason
        if isnan(speed) and not reason:
            reason = "the own speed is not known: the car does not speed up"
        return DrivingState(
            stamp=horizon.stamp,
            step=horizon.step,
            level=order.level,
            action=int(order.action),
            command=self._command,
            desired_clearance=desired,
            clearance=clearance,
            clearance_source=int(clearance_source),
            relative_velocity=velocity,
            relative_velocity_source=int(velocity_source),
            acceleration=acceleration,
            acceleration_source=int(acceleration_source),
            host_speed=speed,
            host_speed_source=int(speed_source),
            holding=self._holding,
            reason=reason,
        )

    def _take_order(self, horizon: Horizon) -> Order:
        """The newest decision, unless it is too old or of a time before a restart went back."""
        settings, decision = self._settings, self._decision
        if decision is not None and horizon.restart and decision.stamp > horizon.stamp:
            decision = self._decision = None
        if decision is None:
            if self._undecided_since is None or self._undecided_since > horizon.stamp:
                self._undecided_since = horizon.stamp
            since = self._undecided_since
            patience = settings.decision_timeout if self._ever_decided else FIRST_DECISION
        else:
            self._undecided_since = None
            since, patience = decision.stamp, settings.decision_timeout
        age = (horizon.stamp - since) * 1e-9
        # Half a step more: a decision of exactly that age is in time, however it is rounded.
        if abs(age) - patience > 0.5 * STEP_S:
            reason = f"no decision for {age:.2f} s: the car is stopped"
            if age < 0.0:
                reason = f"a decision of {-age:.2f} s later: the car is stopped"
            return Order(decision, Action.STOP, int(FaultLevel.TAKE_OVER), reason, age, True)
        if decision is None:
            # Before the first one there is nothing that speaks against a sensor.
            level = int(FaultLevel.NORMAL)
            return Order(None, Action.FOLLOW, level, "no decision yet", age, False)
        return Order(
            decision, decision.action, int(decision.level), decision.reason, age, undecided=False
        )

    @staticmethod
    def _relative_velocity(horizon: Horizon, decision: Decision | None) -> tuple[float, Source]:
        usable = decision is None or decision.relative_velocity_usable
        usable = usable and horizon.has_target and not horizon.relative_velocity_stale
        if usable and isfinite(horizon.measured_relative_velocity):
            return horizon.measured_relative_velocity, Source.MEASURED
        if decision is not None and isfinite(decision.relative_velocity):
            return decision.relative_velocity, Source.RECONSTRUCTED
        return nan, Source.NONE

    @staticmethod
    def _clearance(horizon: Horizon, order: Order, velocity: float) -> tuple[float, Source]:
        """Carried to now by the relative velocity, where that is known."""
        decision = order.decision
        velocity = velocity if isfinite(velocity) else 0.0
        usable = decision is None or decision.clearance_usable
        usable = usable and horizon.has_target and not horizon.clearance_stale
        if usable and isfinite(horizon.measured_clearance):
            carried = velocity * horizon.clearance_age
            return horizon.measured_clearance + carried, Source.MEASURED
        if decision is not None and isfinite(decision.clearance):
            return decision.clearance + velocity * max(order.age, 0.0), Source.RECONSTRUCTED
        return nan, Source.NONE

    def _acceleration(self, horizon: Horizon, decision: Decision | None) -> tuple[float, Source]:
        if (decision is None or decision.acceleration_usable) and not horizon.acceleration_stale:
            return horizon.measured_acceleration, Source.MEASURED
        if decision is not None and isfinite(decision.acceleration):
            return decision.acceleration, Source.RECONSTRUCTED
        # What was commanded is the best guess that is left.
        return self._command, Source.NONE

    @staticmethod
    def _lead_acceleration(decision: Decision | None, acceleration: float) -> float:
        """As reconstructed; else the lead is said to keep its speed."""
        relative = nan if decision is None else decision.relative_acceleration
        return relative + acceleration if isfinite(relative) else 0.0

    def _carry_host_speed(
        self, horizon: Horizon, decision: Decision | None, acceleration: float
    ) -> tuple[float, Source]:
        """Measured, or one from before it was doubted, carried on by the acceleration."""
        usable = decision is None or decision.host_speed_usable
        if usable and not horizon.host_speed_stale and isfinite(horizon.measured_host_speed):
            self._speed, self._speed_stamp = horizon.measured_host_speed, horizon.stamp
            self._speeds.append((horizon.stamp, self._speed))
            return self._speed, Source.MEASURED
        if self._speeds:
            self._speed_stamp, self._speed = self._speeds[0]
            self._measured_at = self._speed_stamp
            self._speeds.clear()
        since = (horizon.stamp - self._measured_at) * 1e-9
        if isnan(self._speed) or not 0.0 <= since <= CARRIED:
            return nan, Source.NONE
        steps = max(horizon.stamp - self._speed_stamp, 0) // STEP_NS
        self._speed = max(self._speed + acceleration * steps * STEP_S, 0.0)
        self._speed_stamp = horizon.stamp
        return self._speed, Source.RECONSTRUCTED

    def _desired_clearance(self, action: Action, speed: float, clearance: float) -> float:
        """In m: eq 1, with a larger gap where something is wrong."""
        settings = self._settings
        gap = settings.degraded_gap if action != Action.FOLLOW else 1.0
        # Where the speed is not known any more, as far as it was last.
        known = speed if isfinite(speed) else self._speed
        if isfinite(known):
            return settings.desired_clearance(max(known, 0.0), gap)
        # No nearer than now, where that is known.
        return max(settings.minimum_clearance, clearance)

    def _aim(
        self, horizon: Horizon, order: Order, lead: Lead, host: Host, desired: float
    ) -> tuple[float, float]:
        """Acceleration to go for in m/s^2, and the jerk in m/s^3 that is allowed on the way.

        Takes note of whether the car is held at a standstill. `desired`: clearance in m.
        """
        settings, action = self._settings, order.action
        deceleration = self._deceleration(order)
        if action == Action.BRAKE:
            self._holding = host.stands
            return -deceleration, settings.emergency_jerk
        wanted, jerk = self._aim_by_traffic(horizon, action, lead, host, desired)
        if action in (Action.WARN, Action.STOP):
            wanted = min(wanted, 0.0)
        if action == Action.STOP:
            # A speed that is carried may be too low.
            measured = host.speed_source == Source.MEASURED
            soft = max(-STOPPING, SOFT * host.speed) if measured else deceleration
            wanted = min(wanted, -min(deceleration, soft))
            if deceleration > settings.stopping_deceleration:
                jerk = settings.emergency_jerk
            self._holding = self._holding or host.stands
        if self._holding:
            wanted = HOLDING if host.stands else STOPPING
        return wanted, jerk

    def _deceleration(self, order: Order) -> float:
        """How hard a stop brakes, in m/s^2."""
        least, decision = self._settings.stopping_deceleration, order.decision
        if decision is None or decision.action not in STOPS:
            return least
        # The last word of a decision node that fell silent may be harder, not softer.
        return max(least, decision.deceleration) if order.undecided else decision.deceleration

    def _aim_by_traffic(
        self, horizon: Horizon, action: Action, lead: Lead, host: Host, desired: float
    ) -> tuple[float, float]:
        """As `_aim`, by the lead and the set speed alone."""
        settings = self._settings
        cruise = 0.0
        if isfinite(host.speed):
            to_set_speed = (settings.set_speed - host.speed) / CRUISE_TIME
            cruise = min(settings.comfortable_acceleration, to_set_speed)
        if isfinite(lead.clearance) and isfinite(lead.velocity):
            follow, jerk = self._follow(lead, host, desired)
            return min(follow, cruise), jerk
        if not horizon.has_target and not horizon.clearance_stale:
            # The radar works and sees an empty road.
            self._holding = False
            return max(cruise, settings.acceleration_lower), settings.comfortable_jerk
        # Nobody speeds up towards what is not seen, or lets go of the brakes but to end a stop.
        self._holding = self._holding or host.stands
        most = 0.0 if action == Action.STOP else min(0.0, self._command)
        return min(cruise, most), settings.comfortable_jerk

    def _follow(self, lead: Lead, host: Host, desired: float) -> tuple[float, float]:
        """As `_aim`, by the plan behind a lead that is known."""
        model = self._model
        self._start[:] = (
            self._approach(lead.clearance - desired),
            lead.velocity,
            host.acceleration,
            lead.acceleration,
            self._command,
        )
        solve_box_entry(model.problem, model.f @ self._start, self._plan)
        self._hold_behind(lead, host.speed)
        return float(self._plan[0]), self._jerk_behind(lead)

    def _jerk_behind(self, lead: Lead) -> float:
        """m/s^3 that a lead calls for: comfortable, or more where hard braking is needed."""
        settings = self._settings
        # What must be braked to keep half the distance of a standstill behind this lead.
        needed = braking_needed(lead.clearance, lead.velocity, 0.5 * settings.minimum_clearance)
        needed += max(-lead.acceleration, 0.0) if lead.velocity < 0.0 else 0.0
        share = min(max((needed - HARD) / HARDER, 0.0), 1.0)
        return settings.comfortable_jerk + share * (
            settings.emergency_jerk - settings.comfortable_jerk
        )

    def _approach(self, error: float) -> float:
        """The clearance error that the plan is given, in m.

        A plan that is linear in the error would meet a lead far ahead at any speed and brake hard
        at the end. Farther away than can be paid off at a comfortable braking the wanted closing
        speed grows with the root of the distance.
        """
        braking, approach = self._settings.comfortable_braking, self._model.approach
        linear = braking * approach * approach
        if error <= linear:
            return error
        return approach * sqrt(2.0 * braking * (error - 0.5 * linear))

    def _hold_behind(self, lead: Lead, speed: float) -> None:
        """Stand still behind a standing lead, without creeping, until it has driven off."""
        if not isfinite(speed):
            return
        lead_speed = speed + lead.velocity
        near = self._settings.minimum_clearance + NEAR_ENOUGH
        if self._holding:
            self._holding = not (lead_speed > ROLLING and lead.clearance > near)
        elif speed < CREEPING and lead_speed < STANDING + speed:
            self._holding = lead.clearance < near

    def _gently(self, wanted: float, jerk: float) -> float:
        """The next command on the way to `wanted`, in m/s^2."""
        settings = self._settings
        if not isfinite(wanted):
            # What no lead can be makes no plan.
            wanted = min(self._command, 0.0)
        down = jerk * STEP_S
        # Letting go of hard braking may be as quick as is comfortable, or it would last too long.
        up = max(settings.comfortable_jerk, -self._command) * STEP_S
        return min(max(wanted, self._command - down), self._command + up)


class DrivingMpc(Mpc):
    """The controller where it drives the car: its horizon predicts the command that is sent.

    The diagnosis holds the lead against this prediction: what another plan would do differently
    from the car would come back as a prediction error of `(u - a_s) * tau`.
    """

    def __init__(self, settings: MpcSettings) -> None:
        """Raises ValueError for settings that cannot work."""
        super().__init__(settings)
        self.driver = CarDriver(settings)
        self.driven: list[DrivingState] = []
        self._followed = self._share_followed(settings)

    def _share_followed(self, settings: MpcSettings) -> NDArray:
        """How much of a new command is applied 1..N steps later."""
        steps = np.arange(1, self.controller.steps + 1)
        return 1.0 - np.exp(-steps * STEP_S / settings.actuator_lag)

    def change(self, settings: MpcSettings) -> None:
        """As of the controller; the car goes on from the command that was sent last."""
        super().change(settings)
        self.driver.change(settings)
        self._followed = self._share_followed(settings)

    def _steps(self) -> list[Horizon]:
        self.driven = []
        return super()._steps()

    def _horizon(self, plan: NDArray, states: NDArray) -> Horizon:
        made = super()._horizon(plan, states)
        driven = self.driver.drive(made)
        self.driven.append(driven)
        made.command = driven.command
        made.record["command"] = driven.command
        if made.valid:
            now = made.acceleration
            plan[:] = now + self._followed * (driven.command - now)
            roll_out_entry(
                self.controller.model, made.clearance, made.relative_velocity, now, plan, states
            )
        return made
