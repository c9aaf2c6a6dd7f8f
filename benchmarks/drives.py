"""The drives that are measured on: generated ones of any length, and the recorded one's states."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lfd_mpc.samples import RadarSample
from lfd_replay.drive import Drive, make_drive
from lfd_replay.drive_csv import COLUMNS
from lfd_replay.generated.car_following import Driver, simulate
from lfd_replay.generated.lead_profiles import Profile
from lfd_replay.generated.sensor_models import SENSORS


def long_drive(seconds: float) -> Drive:
    """Following a lead whose speed goes up and down."""

    def acceleration(time: NDArray[np.float64]) -> NDArray[np.float64]:
        return 0.5 * np.sin(2 * np.pi * time / 37.0) + 0.4 * np.sin(2 * np.pi * time / 11.0)

    truth = simulate(Profile(seconds, 20.0, acceleration), Driver())
    return make_drive("long", SENSORS["esr"].sense(truth, 1, "long"))


def write_csv(drive: Drive, file: Path) -> None:
    """The drive as a CSV file: one row per scan, the newest value of every other signal with it."""
    newest: dict[str, float] = {}
    zero = drive.zero
    with file.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(COLUMNS)
        for sample in drive.samples:
            if not isinstance(sample, RadarSample):
                newest[sample.input] = sample.value
            elif len(newest) == 2:
                time = f"{(sample.stamp - zero) * 1e-9:.6f}"
                scan = f"{sample.clearance:.4f}", f"{sample.relative_velocity:.4f}"
                others = f"{newest['host_speed']:.4f}", f"{newest['acceleration']:.4f}"
                writer.writerow((time, *scan, *others))
