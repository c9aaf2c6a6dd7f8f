"""Settings of the diagnosis."""

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

    @model_validator(mode="after")
    def _check(self) -> "DiagnosisSettings":
        if self.confidence_max < self.confidence_threshold:
            raise ValueError(
                f"confidence_max ({self.confidence_max}) must not be below "
                f"confidence_threshold ({self.confidence_threshold})"
            )
        return self
