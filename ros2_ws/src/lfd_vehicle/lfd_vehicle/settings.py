"""Settings of the simulated vehicle."""

from typing import Literal

from lfd_mpc.settings import Settings, setting


class VehicleSettings(Settings):
    """The host car, and how it stands behind the lead at first."""

    model: Literal["multi_body", "point_mass"] = setting(
        "multi_body", "1", "vehicle model: multi_body or point_mass", "closed loop", fixed=True
    )
    powertrain_lag: float = setting(
        0.3, "s", "lag of the powertrain", "generated drives", fixed=True, ge=0.02, le=2.0
    )
    brake_lag: float = setting(
        0.15, "s", "lag of the brakes", "generated drives", fixed=True, ge=0.02, le=2.0
    )
    strongest_drive: float = setting(
        3.5,
        "m/s^2",
        "largest acceleration of the powertrain",
        "passenger car",
        fixed=True,
        gt=0.0,
        le=10.0,
    )
    power: float = setting(
        90_000.0,
        "W",
        "largest power of the powertrain",
        "passenger car",
        fixed=True,
        gt=0.0,
        le=1e6,
    )
    strongest_braking: float = setting(
        9.0,
        "m/s^2",
        "largest deceleration of the brakes",
        "generated drives",
        fixed=True,
        gt=0.0,
        le=12.0,
    )
    coast_after: float = setting(
        0.1,
        "s",
        "time without a command after which the car coasts",
        "docs/closed-loop.md",
        fixed=True,
        gt=0.0,
        le=5.0,
    )
    brake_after: float = setting(
        0.5,
        "s",
        "time without a command after which the car brakes to standstill",
        "docs/closed-loop.md",
        fixed=True,
        gt=0.0,
        le=10.0,
    )
    lost_braking: float = setting(
        3.0,
        "m/s^2",
        "deceleration of that braking",
        "docs/closed-loop.md",
        fixed=True,
        gt=0.0,
        le=9.0,
    )
    sensors: str = setting(
        "esr", "1", "sensors: esr, coarse, gnss or exact", "generated drives", fixed=True
    )
    seed: int = setting(0, "1", "seed of the sensors' noise", "own choice", fixed=True, ge=0)


class VehicleNodeSettings(VehicleSettings):
    """What is simulated, too, and how fast."""

    lead: str = setting(
        "data-1",
        "1",
        "the lead: a generated drive (data-1, braking:-6), a drive file, or steps "
        "SPEED[,ACCELERATION@START-END...]",
        "own choice",
        fixed=True,
    )
    faults: str = setting("", "1", "fault texts, several separated by ;", "own choice", fixed=True)
    rate: float = setting(
        1.0, "1", "x real time; 0 = lockstep", "own choice", fixed=True, ge=0.0, le=100.0
    )


TABLES = {"vehicle_node": (VehicleNodeSettings, False)}
"""For docs/parameters.md."""
