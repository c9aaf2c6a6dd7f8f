"""Generated drives: a lead profile, a human-like follower and the sensors of a car."""

from lfd_mpc.errors import UserError
from lfd_replay.drive import Drive, make_drive
from lfd_replay.generated.car_following import Driver, Truth, simulate
from lfd_replay.generated.lead_profiles import lead_profile
from lfd_replay.generated.sensor_models import SENSORS


def drive_truth(name: str, peak: float | None = None) -> Truth:
    """What really happens in a drive, whatever the sensors say. Raises UserError."""
    return simulate(lead_profile(name, peak), Driver())


def generate_drive(name: str, seed: int, sensor: str, peak: float | None = None) -> Drive:
    """A drive by name, the same for the same seed, which changes the sensors only.

    `peak` in m/s^2 belongs to `braking`. Raises UserError for an unknown name or an unfit peak.
    """
    truth = drive_truth(name, peak)
    if sensor not in SENSORS:
        raise UserError(f"unknown sensor '{sensor}'; there are: {', '.join(SENSORS)}")
    return make_drive(name, SENSORS[sensor].sense(truth, seed, name))
