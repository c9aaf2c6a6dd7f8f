"""Settings of the diagnosis."""

from typing import Literal

from pydantic import model_validator

from lfd_mpc.settings import HorizonSettings, Settings, setting
from lfd_observer.settings import LeadMotion

ROBUST = "own choice, docs/robust.md"
"""Where the robust profile's figures come from."""

TABLE_1 = {
    "clearance": (0.38411, 0.25811),
    "relative_velocity": (0.45135, 0.26806),
    "acceleration": (0.44431, 0.23698),
}
"""Mean and standard deviation of the non-zero indices as printed in the paper."""

CLOSED_LOOP = "docs/closed-loop.md"
"""Where the decision's figures come from."""


class RadarChecks(Settings):
    """The robust profile's settings for clearance and relative velocity."""

    gate_sigma: float = setting(
        4.0,
        "1",
        "standard deviations of a prediction residual beyond which a scan disagrees",
        ROBUST,
        gt=0.0,
        le=20.0,
    )
    clearance_floor: float = setting(
        1.3, "m", "least limit of the clearance's prediction residual", ROBUST, gt=0.0, le=20.0
    )
    relative_velocity_floor: float = setting(
        0.8,
        "m/s",
        "least limit of the relative velocity's prediction residual",
        ROBUST,
        gt=0.0,
        le=20.0,
    )
    jerk_density: float = setting(
        3.0,
        "m^2/s^5",
        "how fast the lead's acceleration may change: density of its random jerk",
        ROBUST,
        gt=0.0,
        le=1000.0,
    )
    coasting_jerk_density: float = setting(
        0.15,
        "m^2/s^5",
        "the same while the relative velocity is not believed and the track coasts",
        ROBUST,
        gt=0.0,
        le=1000.0,
    )
    scan_confidence_threshold: int = setting(
        4,
        "1",
        "confidence at or above which a radar signal is faulty; a disagreeing scan adds 2",
        ROBUST,
        ge=1,
        le=100,
    )
    scan_confidence_max: int = setting(
        8, "1", "ceiling of the radar signals' confidence", ROBUST, ge=1, le=100
    )
    same_car: bool = setting(
        True,
        "1",
        "a target under a new track id, or not seen for a moment, that agrees is the same car",
        ROBUST,
    )
    check_drift: bool = setting(
        True,
        "1",
        "hold the clearance against the path that the relative velocity makes",
        ROBUST,
    )
    drift_window: float = setting(
        3.0, "s", "time over which that path is compared", ROBUST, ge=2.0, le=30.0
    )
    drift_limit: float = setting(
        1.25, "m", "least limit of the difference over that time", ROBUST, gt=0.0, le=20.0
    )
    largest_shift: float = setting(
        3.0,
        "m",
        "how far apart a radar may see two parts of one car; 0 = it never does",
        ROBUST,
        ge=0.0,
        le=20.0,
    )


class AccelerationChecks(Settings):
    """The robust profile's settings for the acceleration."""

    use_host_speed: bool = setting(
        True, "1", "hold the acceleration against the host speed's derivative", ROBUST
    )
    host_speed_filter_time: float = setting(
        0.15,
        "s",
        "time constant of the filter that both go through",
        ROBUST,
        ge=0.02,
        le=0.5,
    )
    acceleration_step_limit: float = setting(
        1.0,
        "m/s^2",
        "least limit of their difference against what it was a moment ago",
        ROBUST,
        gt=0.0,
        le=20.0,
    )
    acceleration_limit: float = setting(
        1.25,
        "m/s^2",
        "least limit of their difference against its slow mean (gravity on a slope)",
        ROBUST,
        gt=0.0,
        le=20.0,
    )
    acceleration_sigma: float = setting(
        4.0, "1", "the same limits in learnt standard deviations", ROBUST, gt=0.0, le=20.0
    )
    acceleration_steps: int = setting(
        4,
        "steps",
        "confidence at or above which the acceleration is faulty",
        ROBUST,
        ge=1,
        le=1000,
    )
    jerk_allowance: float = setting(
        0.12,
        "s",
        "how much the two may lag behind each other beyond the lag that was learnt",
        ROBUST,
        ge=0.0,
        le=1.0,
    )
    slope_rate: float = setting(
        0.08,
        "m/s^3",
        "how fast the slow mean may change: a road that becomes steeper",
        ROBUST,
        ge=0.0,
        le=10.0,
    )
    steepest_road: float = setting(
        2.5,
        "m/s^2",
        "difference up to which what changes faster than a drift and slower than a jump is a road "
        "that bends up or down, largest slope whose end is not taken for a drift, largest fault "
        "that a bend may hide, and most that a slope changes by under a fault; 0: none is",
        ROBUST,
        ge=0.0,
        le=10.0,
    )
    check_speed: bool = setting(
        True,
        "1",
        "where the speed's derivative alone changed, it is the road that bent, or the speed drifts",
        ROBUST,
    )
    use_observers: bool = setting(
        True,
        "1",
        "without host speed: a jump of the acceleration that the observers do not see is a fault",
        ROBUST,
    )
    jump_limit: float = setting(
        2.5,
        "m/s^2",
        "change of the acceleration within 0.1 s that no car makes",
        ROBUST,
        gt=0.0,
        le=20.0,
    )
    use_lead_report: bool = setting(
        True, "1", "take what the lead says of its acceleration (V2V) as evidence", ROBUST
    )
    lead_report_delay: float = setting(
        0.1,
        "s",
        "age of what the lead says when it is stamped; its acceleration may have changed since",
        ROBUST,
        ge=0.0,
        le=1.0,
    )
    lead_report_std: float = setting(
        0.2, "m/s^2", "standard deviation of what the lead says", ROBUST, gt=0.0, le=5.0
    )
    lead_report_timeout: float = setting(
        0.5, "s", "age at which what the lead says is no longer used", ROBUST, gt=0.0, le=5.0
    )


class FaultHandling(Settings):
    """The robust profile's settings for all signals."""

    profile: Literal["robust", "paper"] = setting(
        "robust", "1", "robust, or paper: as published", "docs/robust.md"
    )
    learn_noise: bool = setting(
        True, "1", "learn each sensor's noise and lag while it is healthy", ROBUST
    )
    check_roughness: bool = setting(
        True, "1", "a signal that is far rougher than it was is faulty", ROBUST
    )
    check_repetition: bool = setting(
        True,
        "1",
        "a signal that repeats itself longer than it ever did is faulty, a message that is sent"
        " again tells nothing, and what a radar says after a run may be what it did not see",
        ROBUST,
    )
    latch: bool = setting(
        True,
        "1",
        "agreement with a reference too uncertain to tell does not clear a radar fault",
        ROBUST,
    )
    clear_time: float = setting(
        0.5, "s", "agreement after which a fault is over", ROBUST, gt=0.0, le=60.0
    )
    requalify_time: float = setting(
        5.0,
        "s",
        "agreement of a new target, or of host speed or V2V, after which it is believed again",
        "docs/robust.md",
        gt=0.0,
        le=600.0,
    )


NOT_BELOW = (
    ("confidence_max", "confidence_threshold"),
    ("confidence_max", "acceleration_steps"),
    ("requalify_time", "clear_time"),
    ("scan_confidence_max", "scan_confidence_threshold"),
)
"""Settings that must not be below others."""


class DiagnosisSettings(
    HorizonSettings, LeadMotion, RadarChecks, AccelerationChecks, FaultHandling
):
    """Settings of the diagnosis.

    Its own fields are the paper's (eqs 25 and 26). The robust profile shares `confidence_max`, for
    the acceleration, and takes the deviations r1 and r2 for a start and learns them.
    """

    clearance_std: float = setting(
        0.15,
        "m",
        "standard deviation r1 of the radar's clearance",
        "docs/algorithm.md, eq 25",
        ge=0.0,
        le=10.0,
    )
    relative_velocity_std: float = setting(
        0.08,
        "m/s",
        "standard deviation r2 of the radar's relative velocity",
        "docs/algorithm.md, eq 25",
        ge=0.0,
        le=10.0,
    )
    clearance_threshold: float = setting(
        sum(TABLE_1["clearance"]),
        "1",
        "index of the clearance at or above which confidence grows",
        "Table 1, mean + standard deviation",
        gt=0.0,
        le=1.0,
    )
    relative_velocity_threshold: float = setting(
        sum(TABLE_1["relative_velocity"]),
        "1",
        "index of the relative velocity at or above which confidence grows",
        "Table 1, mean + standard deviation",
        gt=0.0,
        le=1.0,
    )
    acceleration_threshold: float = setting(
        sum(TABLE_1["acceleration"]),
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
        20,
        "steps",
        "ceiling of the confidence; the robust profile: of the acceleration's",
        "docs/algorithm.md, section 6",
        ge=1,
        le=1000,
    )

    @model_validator(mode="after")
    def _check(self) -> "DiagnosisSettings":
        for larger, smaller in NOT_BELOW:
            most, least = getattr(self, larger), getattr(self, smaller)
            if most < least:
                raise ValueError(f"{larger} ({most}) must not be below {smaller} ({least})")
        return self


class DecisionSettings(Settings):
    """Settings of the decision: what is done with sensors that are faulty."""

    take_over_after: float = setting(
        10.0,
        "s",
        "time of a radar fault that others make up for, then the driver is called",
        CLOSED_LOOP,
        ge=0.0,
        le=600.0,
    )
    stop_after: float = setting(
        10.0,
        "s",
        "time that the driver then has, before the car is stopped",
        CLOSED_LOOP,
        ge=0.0,
        le=600.0,
    )
    blind_for: float = setting(
        0.5,
        "s",
        "time without any believed radar signal, then the car is stopped",
        CLOSED_LOOP,
        ge=0.0,
        le=10.0,
    )
    recover_after: float = setting(
        1.0,
        "s",
        "time that a lower level must have lasted before it is believed",
        CLOSED_LOOP,
        ge=0.0,
        le=60.0,
    )
    stopping_deceleration: float = setting(
        2.5,
        "m/s^2",
        "deceleration of a stop that the driver did not take over",
        "ISO 15622: 3.5 at most",
        gt=0.0,
        le=5.0,
    )
    lead_braking: float = setting(
        1.5,
        "m/s^2",
        "deceleration of the lead that, once it is not seen, is taken to go on",
        CLOSED_LOOP,
        ge=0.0,
        le=10.0,
    )
    blind_margin: float = setting(
        1.0,
        "m/s^2",
        "by so much more than the lead did the car brakes when it is not seen",
        CLOSED_LOOP,
        ge=0.0,
        le=5.0,
    )
    emergency_deceleration: float = setting(
        4.0,
        "m/s^2",
        "deceleration needed above which a degraded car brakes fully",
        CLOSED_LOOP,
        gt=0.0,
        le=10.0,
    )
    emergency_braking: float = setting(
        8.0, "m/s^2", "deceleration of that braking", "dry road", gt=0.0, le=12.0
    )
    emergency_room: float = setting(
        2.0, "m", "clearance that is to be left behind the lead", CLOSED_LOOP, ge=0.0, le=20.0
    )
