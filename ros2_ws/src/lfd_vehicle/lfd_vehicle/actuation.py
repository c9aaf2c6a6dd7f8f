"""Powertrain and brakes: what becomes of a command, and of its absence."""

from lfd_mpc.settings import STEP_S
from lfd_vehicle.settings import VehicleSettings

CORRECTION_TIME = 1.0
"""Seconds in which the car's own control makes up for what a slope or drag takes."""

LARGEST_CORRECTION = 1.5
"""m/s^2"""


FOLLOWED = 0.3
"""m/s^2 between what is wanted and applied below which a change of command has been followed."""


class Actuation:
    """First-order lags with limits, and the slow correction every such actuator has."""

    def __init__(self, settings: VehicleSettings) -> None:
        self._settings = settings
        self._command, self._silent = 0.0, 0
        self._coast_after = round(settings.coast_after / STEP_S)
        self._brake_after = round(settings.brake_after / STEP_S)
        self._correction = 0.0
        self.applied = 0.0

    def command(self, acceleration: float) -> None:
        """Take a command in m/s^2."""
        self._command, self._silent = acceleration, 0

    @property
    def lost(self) -> bool:
        """Whether there has been no command for so long that the car brakes by itself."""
        return self._silent > self._brake_after

    def step(self, speed: float, acceleration: float, mass: float) -> float:
        """Acceleration that the wheels are asked for in the next 10 ms, in m/s^2.

        `speed` (m/s) and `acceleration` (m/s^2) are the car's, `mass` in kg.
        """
        settings = self._settings
        wanted = self._command
        if self.lost:
            wanted = -settings.lost_braking
        elif self._silent > self._coast_after:
            wanted = min(self._command, 0.0)
        self._silent += 1
        strongest = min(settings.strongest_drive, settings.power / (mass * max(speed, 1.0)))
        goal = wanted + self._correction
        if speed > 1.0 and -settings.strongest_braking < goal < strongest:
            off = wanted - acceleration
            # While it still follows a change of command, its lag is not to be made up for.
            if abs(wanted - self.applied + self._correction) < FOLLOWED:
                self._correction += off * STEP_S / CORRECTION_TIME
                limit = LARGEST_CORRECTION
                self._correction = min(max(self._correction, -limit), limit)
        goal = min(max(goal, -settings.strongest_braking), strongest)
        lag = settings.powertrain_lag if goal > self.applied else settings.brake_lag
        self.applied += STEP_S / lag * (goal - self.applied)
        return self.applied
