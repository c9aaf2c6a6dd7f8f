"""How often the host's speed is heard, and whether that is often enough to be evidence."""

import numpy as np

from lfd_mpc.compiled import inner

LONGEST, SHARE = 2.5, 0.2
"""Longest time in s between two samples that is learnt, and the share by which a new one is."""

TOO_SELDOM = 0.3
"""Seconds between two samples of a speed that tells too late how the car accelerates."""

SPACING = np.dtype([("heard_at", "f8"), ("gap", "f8"), ("period", "f8")], align=True)
"""The newest sample came at `heard_at`, a `gap` after the one before; usually one comes once a
`period`. All in s."""


@inner
def start_spacing(spacing):
    """Begin with nothing."""
    spacing.period = 0.0
    lose_spacing(spacing)


@inner
def lose_spacing(spacing):
    """The next sample has nothing to do with those before."""
    spacing.heard_at, spacing.gap = -np.inf, np.inf


@inner
def follow_spacing(spacing, at):
    """Take note of a new sample of time `at` (s)."""
    gap = at - spacing.heard_at
    # One alone may be a silence; two in a row are none.
    least = min(gap, spacing.gap)
    if least < LONGEST:
        spacing.period += SHARE * (least - spacing.period)
    spacing.heard_at, spacing.gap = at, gap


@inner
def is_too_seldom(spacing):
    """Whether what it says is over before it is heard."""
    return spacing.period > TOO_SELDOM
