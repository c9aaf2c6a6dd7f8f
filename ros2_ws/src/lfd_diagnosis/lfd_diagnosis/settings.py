"""Settings of the diagnosis."""

from typing import Literal

from pydantic import model_validator

from lfd_mpc.settings import HorizonSettings, setting
from lfd_observer.settings import LeadMotion


class DiagnosisSettings(HorizonSettings, LeadMotion):
    """Settings of fault indices, confidence and decision, eqs 25 and 26."""

    clearance_std: float = setting(
        0.15,
        "m",
        "standard deviation r1 of the radar's clearance",
        "algorithm notes, eq 25",
        ge=0.0,
        le=10.0,
    )
    relative_velocity_std: float = setting(
        0.08,
        "m/s",
        "standard deviation r2 of the radar's relative velocity",
        "algorithm notes, eq 25",
        ge=0.0,
        le=10.0,
    )
    clearance_threshold: float = setting(
        0.38411 + 0.25811,
        "1",
        "index of the clearance at or above which confidence grows",
        "Table 1, mean + standard deviation",
        gt=0.0,
        le=1.0,
    )
    relative_velocity_threshold: float = setting(
        0.45135 + 0.26806,
        "1",
        "index of the relative velocity at or above which confidence grows",
        "Table 1, mean + standard deviation",
        gt=0.0,
        le=1.0,
    )
    acceleration_threshold: float = setting(
        0.44431 + 0.23698,
        "1",
        "index of the acceleration at or above which confidence grows",
        "Table 1, mean + standard deviation",
        gt=0.0,
        le=1.0,
    )
    confidence_threshold: int = setting(
        10,
        "steps",
        "confidence at or above which a signal is faulty",
        "section 4, below eq 26",
        ge=1,
        le=1000,
    )
    confidence_max: int = setting(
        20, "steps", "ceiling of the confidence", "algorithm notes, section 5", ge=1, le=1000
    )

    profile: Literal["paper", "robust"] = setting("paper", "1", "profile", "own choice")
    gate_sigma: float = setting(4.0, "1", "gate", "own")
    clearance_floor: float = setting(1.0, "m", "x", "own")
    relative_velocity_floor: float = setting(0.8, "m/s", "x", "own")
    jerk_density: float = setting(3.0, "m^2/s^5", "x", "own")
    coasting_jerk_density: float = setting(0.3, "m^2/s^5", "x", "own")
    scan_confidence_threshold: int = setting(4, "1", "x", "own")
    scan_confidence_max: int = setting(8, "1", "x", "own")
    learn_noise: bool = setting(True, "1", "x", "own")
    same_car: bool = setting(True, "1", "x", "own")
    check_roughness: bool = setting(True, "1", "x", "own")
    check_repetition: bool = setting(True, "1", "x", "own")
    check_drift: bool = setting(True, "1", "x", "own")
    drift_window: float = setting(3.0, "s", "x", "own")
    drift_limit: float = setting(1.1, "m", "x", "own")
    latch: bool = setting(True, "1", "x", "own")
    clear_time: float = setting(0.5, "s", "x", "own")
    requalify_time: float = setting(5.0, "s", "x", "own")
    use_host_speed: bool = setting(True, "1", "x", "own")
    use_observers: bool = setting(True, "1", "x", "own")
    host_speed_filter_time: float = setting(0.15, "s", "x", "own")
    acceleration_step_limit: float = setting(1.0, "m/s^2", "x", "own")
    acceleration_limit: float = setting(1.3, "m/s^2", "x", "own")
    acceleration_sigma: float = setting(4.0, "1", "x", "own")
    jerk_allowance: float = setting(0.12, "s", "x", "own")
    bias_rate: float = setting(0.08, "m/s^3", "x", "own")
    sharp_limit: float = setting(2.5, "m/s^2", "x", "own")
    acceleration_confidence_threshold: int = setting(4, "steps", "x", "own")

    @model_validator(mode="after")
    def _check(self) -> "DiagnosisSettings":
        if self.confidence_max < self.confidence_threshold:
            raise ValueError(
                f"confidence_max ({self.confidence_max}) must not be below "
                f"confidence_threshold ({self.confidence_threshold})"
            )
        return self
