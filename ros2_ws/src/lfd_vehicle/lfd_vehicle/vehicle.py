"""The host car: a multi-body model with 29 states, or a point mass; driven straight ahead.

The multi-body model divides by zero at standstill. Below `HAND_OVER` it hands its position, speed,
acceleration and pitch to a point mass whose body goes on pitching on the same springs, and takes
them back above `TAKE_BACK`.
"""

from dataclasses import dataclass
from math import atan, ceil, isfinite, sin

import numpy as np
from vehiclemodels.init_mb import init_mb

from lfd_mpc.compiled import entry
from lfd_mpc.settings import GRAVITY, STEP_S
from lfd_vehicle.actuation import Actuation
from lfd_vehicle.library_model import CONSTANTS, PARAMETERS, X, derivative
from lfd_vehicle.settings import VehicleSettings

HAND_OVER, TAKE_BACK = 1.0, 1.3
"""m/s between which the model in use stays the one that it is."""

LONGEST_STEP = 0.002
"""Seconds of one integration step, at speed."""

SLIP_STEP = 0.0005
"""Seconds of one integration step per m/s: the tyres answer the faster the slower the car is."""

KEPT = 0.95
"""Share of the models' difference in acceleration that is left after 10 ms of the point mass."""

LARGEST_PITCH = 0.5
"""rad of the body beyond which the multi-body model has diverged."""

_SPEED = X.speed
_FIRST_WHEEL, _END_OF_WHEELS = X.first_wheel, X.end_of_wheels


class DivergenceError(Exception):
    """The simulation left what is physically possible."""


@entry
def _integrate(state, acceleration, slope, steps):
    """Go on by 10 ms in `steps` steps (Runge-Kutta of fourth order)."""
    h = STEP_S / steps
    n = len(state)
    inputs = np.array([0.0, acceleration])
    rates, point = np.empty((4, n)), np.empty(n)
    for _ in range(steps):
        for stage in range(4):
            reach = 0.0 if stage == 0 else (h if stage == 3 else 0.5 * h)
            for i in range(n):
                point[i] = state[i] + (reach * rates[stage - 1, i] if stage else 0.0)
            found = derivative(point, inputs, CONSTANTS)
            for i in range(n):
                rates[stage, i] = found[i]
            rates[stage, _SPEED] -= GRAVITY * slope
        for i in range(n):
            state[i] += (
                h / 6.0 * (rates[0, i] + 2.0 * rates[1, i] + 2.0 * rates[2, i] + rates[3, i])
            )
        for i in range(_FIRST_WHEEL, _END_OF_WHEELS):
            state[i] = max(state[i], 0.0)


@dataclass
class Motion:
    """Where the car is: `position` of its front bumper in m, m/s, m/s^2 and rad (nose up)."""

    position: float
    speed: float
    acceleration: float
    pitch: float


class Body:
    """The pitching body on its springs, for speeds at which the multi-body model cannot be used.

    The same springs, dampers and heights; what the wheels' own springs add is left out.
    """

    def __init__(self) -> None:
        p = CONSTANTS
        self._stiffness = 2.0 * (p.a**2 * p.K_sf + p.b**2 * p.K_sr)
        self._damping = 2.0 * (p.a**2 * p.K_sdf + p.b**2 * p.K_sdr)
        self.pitch, self.rate = 0.0, 0.0

    def step(self, acceleration: float) -> None:
        """Go on by 10 ms under an acceleration in m/s^2."""
        moment = CONSTANTS.m * acceleration * CONSTANTS.h_s
        moment -= self._stiffness * self.pitch + self._damping * self.rate
        self.rate += STEP_S * moment / CONSTANTS.I_y_s
        self.pitch += STEP_S * self.rate


class Vehicle:
    """Takes commands, moves by 10 ms at a time."""

    def __init__(self, settings: VehicleSettings, position: float, speed: float) -> None:
        """Begin with the front bumper at `position` (m), at a steady `speed` (m/s)."""
        self.actuation = Actuation(settings)
        self.motion = Motion(position, speed, 0.0, 0.0)
        self._body, self._carried = Body(), 0.0
        self._multi_body = settings.model == "multi_body"
        self._state = self._multi_body_state() if self._multi_body and speed > HAND_OVER else None

    @property
    def model(self) -> str:
        """Which model moves the car now."""
        return "point_mass" if self._state is None else "multi_body"

    def command(self, acceleration: float) -> None:
        """Take a command in m/s^2. Raises ValueError for one that is no number."""
        if not isfinite(acceleration):
            raise ValueError(f"a command of {acceleration} m/s^2")
        self.actuation.command(acceleration)

    def step(self, grade: float) -> Motion:
        """Go on by 10 ms on a road of slope `grade` (1 = 45 degrees).

        Raises DivergenceError where the model has left what is possible.
        """
        motion, slope = self.motion, sin(atan(grade))
        applied = self.actuation.step(motion.speed, motion.acceleration, CONSTANTS.m)
        if self._state is None:
            self._roll(applied, slope)
            if self._multi_body and motion.speed > TAKE_BACK:
                self._state = self._multi_body_state()
        else:
            self._move(applied, slope)
            if motion.speed < HAND_OVER:
                self._body.pitch, self._body.rate = self._state[[X.pitch, X.pitch_rate]]
                self._carried = motion.acceleration - (applied - GRAVITY * slope)
                self._state = None
        return motion

    def _roll(self, applied: float, slope: float) -> None:
        motion = self.motion
        acceleration = applied - GRAVITY * slope + self._carried
        self._carried *= KEPT
        speed = max(motion.speed + STEP_S * acceleration, 0.0)
        # Brakes hold a standing car; they do not push it back.
        motion.acceleration = (speed - motion.speed) / STEP_S
        motion.position += 0.5 * STEP_S * (motion.speed + speed)
        motion.speed = speed
        self._body.step(motion.acceleration)
        motion.pitch = self._body.pitch

    def _move(self, applied: float, slope: float) -> None:
        motion, state = self.motion, self._state
        assert state is not None
        steps = ceil(STEP_S / min(LONGEST_STEP, SLIP_STEP * motion.speed))
        _integrate(state, applied, slope, steps)
        if not np.isfinite(state).all() or abs(state[X.pitch]) > LARGEST_PITCH:
            raise DivergenceError(
                f"the multi-body model diverged at {motion.speed:.1f} m/s under "
                f"{applied:.1f} m/s^2; the point mass (model: point_mass) does not"
            )
        speed = max(float(state[X.speed]), 0.0)
        motion.acceleration = (speed - motion.speed) / STEP_S
        motion.position += 0.5 * STEP_S * (motion.speed + speed)
        motion.speed, motion.pitch = speed, float(state[X.pitch])

    def _multi_body_state(self) -> np.ndarray:
        state = np.array(init_mb([0.0, 0.0, 0.0, self.motion.speed, 0.0, 0.0, 0.0], PARAMETERS))
        state[X.pitch], state[X.pitch_rate] = self._body.pitch, self._body.rate
        return state
