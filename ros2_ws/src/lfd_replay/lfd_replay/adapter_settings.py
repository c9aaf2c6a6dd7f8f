"""Settings of what stands between a car and the graph: adapters and fault injector."""

from typing import Literal

from lfd_mpc.settings import Settings, setting
from lfd_replay.recordings.recorded_messages import Mounting

OWN = "own choice"


class MountingSettings(Settings):
    """How the accelerometer sits in the car."""

    imu_roll: float = setting(0.0, "deg", "roll of the sensor in the car", OWN, ge=-180.0, le=180.0)
    imu_pitch: float = setting(
        0.0, "deg", "pitch of the sensor in the car", OWN, ge=-180.0, le=180.0
    )
    imu_yaw: float = setting(
        0.0, "deg", "yaw of the sensor in the car; 180 = backwards", OWN, ge=-180.0, le=180.0
    )
    imu_offset: float = setting(
        0.0, "m/s^2", "taken off the forward acceleration", OWN, ge=-20.0, le=20.0
    )

    @property
    def mounting(self) -> Mounting:
        """The same as the converters take it."""
        return Mounting((self.imu_roll, self.imu_pitch, self.imu_yaw), self.imu_offset)


class InjectorSettings(Settings):
    """What the fault injector does from the start."""

    fault: str = setting(
        "", "1", "fault texts, several separated by ;, times from the first sample", OWN
    )
    seed: int = setting(0, "1", "seed of injected noise", OWN, ge=0, le=2**31 - 1)


class RadarAdapterSettings(Settings):
    """Where the radar's tracks come from."""

    source: Literal["esr_tracks", "radar_tracks", "can_frames", "can_bus"] = setting(
        "esr_tracks",
        "1",
        "esr_tracks (delphi_esr_msgs), radar_tracks (radar_msgs), can_frames (can_msgs) or can_bus",
        OWN,
    )
    can_interface: str = setting("socketcan", "1", "of can_bus: interface name of python-can", OWN)
    can_channel: str = setting("can0", "1", "of can_bus: channel", OWN)
    host_dbc: str = setting("", "1", "DBC file of the car's own CAN; empty = none", OWN)
    speed_signal: str = setting("", "1", "its signal of the host speed; empty = none", OWN)
    accel_signal: str = setting("", "1", "its signal of the acceleration; empty = none", OWN)
