"""What convicted a signal, as figures; `reasons` puts it into words."""

from enum import IntEnum

import numpy as np

from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner


class Ground(IntEnum):
    """What a conviction rests on; in brackets the figures that go with it."""

    NONE = 0
    RESIDUAL = 1  # prediction residual, limit
    ROUGHNESS = 2  # share of samples
    REPETITION = 3  # equal samples
    PATH = 4  # drift, or prediction residual of what goes on little by little, limit
    HOST_SPEED = 5  # difference, limit
    LEADS_WORD = 6  # difference, limit
    OBSERVERS = 7  # difference, limit
    SPEED_HELD = 8  # value, equal samples
    SPEED_JUMPED = 9  # jump, period, limit
    LEAD_JUMPED = 10  # from, to, limit
    LEAD_DISAGREES = 11  # what it says, what is seen, limit
    JUMPED_BACK = 12  # jump, limit
    SPEED_LEFT = 13  # difference, limit, how much of it the accelerometer made


BECAUSE = np.dtype(
    [("ground", "i8"), ("first", "f8"), ("second", "f8"), ("third", "f8")], align=True
)
"""A ground and its figures."""

CHECK = np.dtype(
    [
        ("ground", "i8"),
        ("residual", "f8"),
        ("limit", "f8"),
        ("kind", "i8"),
        ("reference", "f8"),
    ],
    align=True,
)
"""What one kind of evidence says: how far off, how far it may be, and since what; a ground of NONE
where there is nothing to hold a signal against."""


@inner
def repeats(kind):
    """Whether a fault of that kind is that a signal says the same again and again."""
    return kind == Kind.HOLD or kind == Kind.ZERO


@inner
def is_gauged(kind):
    """Whether a fault of that kind is off by some figure."""
    return kind == Kind.OFFSET or kind == Kind.RAMP


@inner
def give_ground(because, ground, first, second, third):
    """State a ground and its figures."""
    because.ground = ground
    because.first, because.second, because.third = first, second, third


@inner
def set_check(check, ground, residual, limit, kind, reference):
    """State the outcome of a check."""
    check.ground, check.residual, check.limit = ground, residual, limit
    check.kind, check.reference = kind, reference


@inner
def is_exceeded(check):
    """Whether the signal disagrees with this evidence."""
    return check.ground != Ground.NONE and abs(check.residual) > check.limit
