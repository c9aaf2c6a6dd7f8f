"""How large the fault of an accelerometer is."""

from math import sqrt

from lfd_diagnosis.acceleration_jump import (
    find_jump,
    forget_jump,
    jump_deviation,
    jump_size,
)
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

BLIND_STD = 0.7
"""m/s^2 to which an acceleration is known from the lead's alone: how much that varies."""

JUMPED = 0.6
"""Share of its difference from the slow mean that came within the last moment where it jumped."""

SIZE_FROM, SIZE_TO = 30, 130
"""Steps after conviction over which the size of a jump is averaged."""

SLOPE_DRIFT, DRIFT_TIME, JUMP_TIME = 0.17, 4.0, 0.45
"""What a road's slope makes of the difference: m/s^2 per square root of a second, for so long, and
for so long until a jump has been measured."""


@inner
def find_size(monitor, off):
    """Look for where a new fault jumped; that is forgotten unless it makes most of what the fault
    is off by (m/s^2): then something else began before it."""
    jump = monitor.jump
    find_jump(jump)
    told = monitor.kind == Kind.OFFSET and jump.found
    if not told or jump_size(jump) * off < JUMPED * off * off:
        forget_jump(jump)


@inner
def estimate_size(monitor, residual, by_speed):
    """How large a fault is and how well that is known, from what it is off by now (m/s^2): a jump's
    size is taken just after it, when the slope has hardly changed, others' as they are now.

    `by_speed`: whether the host's speed tells, or the lead alone.
    """
    if monitor.jump.found:
        monitor.size = jump_size(monitor.jump)
        monitor.size_std = jump_deviation(monitor.jump)
        return
    settled = monitor.settled
    if monitor.kind == Kind.RAMP or settled < SIZE_FROM:
        monitor.size = monitor.off
    elif settled <= SIZE_TO:
        monitor.size += (residual - monitor.size) / (settled - SIZE_FROM + 1)
    if not by_speed:
        monitor.size_std = BLIND_STD
        return
    drift = SLOPE_DRIFT**2 * min(settled * STEP_S, JUMP_TIME)
    monitor.size_std = sqrt(monitor.step_noise.variance + drift)
