"""Settings of the observer bank, and the lead's motion that bank and diagnosis share."""

from typing import Annotated

from pydantic import Field, model_validator

from lfd_mpc.settings import HorizonSettings, Settings, setting
from lfd_observer.sliding_mode_observer import reachability_margin


class LeadMotion(Settings):
    """How the lead accelerates in normal driving: mean, standard deviation and width of limits."""

    lead_acceleration_mean: float = setting(
        0.0728,
        "m/s^2",
        "mean mu of the lead's acceleration",
        "section 4, below eq 22",
        ge=-5.0,
        le=5.0,
    )
    lead_acceleration_std: float = setting(
        0.6698,
        "m/s^2",
        "standard deviation sigma of the lead's acceleration",
        "section 4, below eq 22",
        gt=0.0,
        le=10.0,
    )
    n_sigma: float = setting(
        3.0, "1", "width of all limits in standard deviations", "eq 23", gt=0.0, le=10.0
    )

    @property
    def lead_acceleration_limits(self) -> tuple[float, float]:
        """Lower and upper limit of the lead's acceleration in m/s^2 (eq 23)."""
        width = self.n_sigma * self.lead_acceleration_std
        return self.lead_acceleration_mean - width, self.lead_acceleration_mean + width


class BankSettings(HorizonSettings, LeadMotion):
    """Settings of the bank, eqs 11 to 24."""

    lags: tuple[Annotated[int, Field(ge=0, le=100)], ...] = setting(
        (0, 3, 6, 9, 12, 15),
        "steps",
        "lag of each observer; 0 is fed the measurement",
        "section 4, eq 24",
        fixed=True,
        min_length=1,
    )
    weight_decay: float = setting(
        0.95,
        "1",
        "weight of each observer relative to the one before it",
        "section 4, below eq 24",
        gt=0.0,
        le=1.0,
    )
    injection_gain: float = setting(
        10.0,
        "m/s^2",
        "magnitude rho of the injection",
        "docs/algorithm.md, eq 18",
        gt=0.0,
        le=1000.0,
    )
    injection_filter_time: float = setting(
        0.1,
        "s",
        "time constant of the low-pass that gives the equivalent injection",
        "docs/algorithm.md, eq 21",
        ge=0.01,
        le=10.0,
    )
    boundary_layer: float = setting(
        0.0,
        "m + m/s",
        "output error within which the injection is proportional; 0 = sign",
        "docs/algorithm.md, eq 18",
        ge=0.0,
        le=10.0,
    )
    restart_error: float = setting(
        1.0,
        "m + m/s",
        "output error at which an observer starts anew from its measurement, keeping its relative "
        "acceleration; 0 = never, as in the paper",
        "own choice, docs/robust.md",
        ge=0.0,
        le=100.0,
    )
    largest_relative_acceleration: float = setting(
        8.0,
        "m/s^2",
        "largest relative acceleration that the observers must follow",
        "own choice: hard braking of one car",
        gt=0.0,
        le=100.0,
    )

    @model_validator(mode="after")
    def _check(self) -> "BankSettings":
        if list(self.lags) != sorted(set(self.lags)):
            raise ValueError(f"lags must increase, got {list(self.lags)}")
        if self.lags[-1] > self.prediction_steps:
            raise ValueError(
                f"the largest lag ({self.lags[-1]}) must not exceed prediction_steps "
                f"({self.prediction_steps})"
            )
        largest = self.largest_relative_acceleration
        if reachability_margin(self.injection_gain, largest, 0.0) <= 0.0:
            raise ValueError(
                f"injection_gain ({self.injection_gain:g}) must exceed "
                f"largest_relative_acceleration ({largest:g} m/s^2)"
            )
        return self
