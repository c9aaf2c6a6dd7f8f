"""What the closed loop is tried on: leads, faults, and healthy drives."""

from dataclasses import dataclass

ONSET = 15.5
"""Seconds at which faults begin, half a second after the lead has begun to brake."""

LASTING = 12.0
"""Seconds that faults last."""


@dataclass(frozen=True)
class Situation:
    """`lead` as of `--lead`; `gap` (m) and `speed` (m/s) of the host where it does not follow."""

    name: str
    lead: str
    gap: float | None = None
    speed: float | None = None


SITUATIONS = (
    Situation("steady following", "20,0@0-25"),
    Situation("approaching", "12,0@0-25", 260.0, 25.0),
    Situation("lead braking at -3", "20,-3@15-21.5,2@27-30"),
    Situation("lead braking at -6", "20,-6@15-18.2,2@27-30"),
)

FAULTS = (
    *(f"offset:clearance={size:g}" for size in (-4.0, -2.0, 2.0, 4.0)),
    *(f"offset:relative_velocity={size:g}" for size in (-10.0, -5.0, 5.0, 10.0)),
    "offset:clearance=4,relative_velocity=10",
    "offset:clearance=4,relative_velocity=-10",
    "offset:clearance=-4,relative_velocity=10",
    "offset:clearance=-4,relative_velocity=-10",
    "offset:acceleration=-4",
    "offset:acceleration=4",
    "offset:host_speed=-5",
    "offset:host_speed=5",
    "offset:clearance=4,relative_velocity=10,acceleration=4",
    "ramp:clearance=-1",
    "ramp:clearance=1",
    "ramp:relative_velocity=-1",
    "ramp:relative_velocity=1",
    "gain:clearance=0.7",
    "gain:clearance=1.3",
    "noise:clearance=2",
    "noise:relative_velocity=1",
    "delay:clearance=0.5,relative_velocity=0.5",
    "hold:clearance",
    "hold:relative_velocity",
    "hold:radar",
    "hold:acceleration",
    "zero:clearance",
    "zero:relative_velocity",
    "zero:radar",
    "dropout:clearance",
    "dropout:relative_velocity",
    "dropout:radar",
    "dropout:acceleration",
)
"""Fault texts without their times."""

MUST_COLLIDE = "offset:clearance=4,relative_velocity=10"
"""Without the diagnosis this one collides, or nearly so, while the lead brakes."""

HEALTHY = (
    *("data-1", "data-2", "data-3", "braking:-3", "braking:-6", "braking:-8"),
    *("cut-in", "stop-and-go", "hill", "bumps"),
    "20,-3@15-21.5,2@27-30",
    "20,-6@15-18.2,2@27-30",
)
"""Leads behind which nothing may be done about a sensor."""


def timed(fault: str, onset: float = ONSET) -> str:
    """A fault with its times."""
    return f"{fault}@{onset:g}-{onset + LASTING:g}"
