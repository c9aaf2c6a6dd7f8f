"""How rough a healthy signal is, and in which steps it comes."""

from math import isfinite

import numpy as np

from lfd_diagnosis.noise import GIVE
from lfd_mpc.compiled import inner

LEARNT = 2000
"""Samples over which roughness is averaged once so many are known."""

EQUAL = 1e-6
"""Differences below it are rounding, not resolution."""

ROUGH_STEPS = 0.6
"""Steps of a signal's resolution that its second differences are at least taken for."""

SECOND_DIFFERENCES = 6.0
"""How much larger than the variance of a white noise that of its second differences is."""

IRREGULAR, LONG_GAP = 1.6, 4.0
"""How many times longer than the one before a time between samples is if one is missing, and from
when on the next sample has nothing to do with those before."""

ROUGH_RATIO, ROUGH_SHARE = 5.0, 0.4
"""Rough: so many usual deviations are exceeded by such a share of the last samples."""

ROUGH_TIME, ROUGH_TIME_ALONE = 0.3, 1.5
"""Seconds of roughness that make a fault, and where nothing tells a bad road from a bad sensor."""

WIDEST_WINDOW, KNOWN_WINDOWS = 64, 3
"""Samples that such a share is taken of at most, and how many times as many healthy ones must be
known before any is called rough."""

QUIET, QUIET_SHARE = 0.8, 0.01
"""Share of second differences that are small where there is no noise, and share that each one
counts in it: some are a manoeuvre's, or rounding."""

LARGEST_ROUGHNESS = 100.0
"""Square of a second difference that is learnt at most, in the square of the unit."""

LEAST_STEPS = 5
"""Of the steps between two samples so many are kept, the least ones."""

PROVEN = 10.0
"""Seconds within which a drift is found, or is too slow to make a step look smaller."""

ROUGHNESS = np.dtype(
    [
        ("recent", "i1", (WIDEST_WINDOW,)),
        ("next", "i8"),
        ("window", "i8"),
        ("count", "i8"),
        ("noiseless", "f8"),
        ("quiet", "f8"),
        ("before", "f8", (2,)),
        ("samples_before", "i8"),
        ("last_at", "f8"),
        ("period", "f8"),
        ("usual", "f8"),
        ("resolution", "f8"),
        ("least_steps", "f8", (LEAST_STEPS,)),
        ("proving", "f8", (2, LEAST_STEPS)),
        ("proven_at", "f8"),
        ("known", "i8"),
    ],
    align=True,
)
"""Whether a signal jumps up and down from sample to sample far more than it used to.

Second differences: smooth motion, however fast, hardly has any. `usual` is their mean square over
the `known` healthy ones, in the square of the signal's unit; of the last `window` of all so many
(`count`) exceeded their limit (`recent`); `quiet` is the share of the last ones, repeats left out,
that were below what it has `noiseless`. `before`: the last two values that differed, so many as
are there (`samples_before`). `resolution` is the largest of the `least_steps` seen between two
samples, infinite before any was seen: an odd value of a coarse sensor makes two steps that are too
small. Later than `PROVEN` from the first sample on (`proven_at`), smaller ones count only once they
are `proving` for as long without a fault: a drift that is not found yet makes small steps of coarse
ones.
"""


@inner
def start_roughness(roughness, window, noiseless):
    """Begin with nothing; `window`: of how many samples the share is taken; `noiseless`: second
    differences, in the signal's unit, that one without noise hardly exceeds."""
    roughness.window, roughness.known = window, 0
    roughness.noiseless, roughness.quiet = noiseless, 1.0
    empty_roughness(roughness)
    roughness.usual = 0.0
    roughness.resolution = np.inf
    roughness.least_steps[:] = np.inf
    roughness.proving[:, :] = np.inf
    roughness.proven_at = -np.inf


@inner
def empty_roughness(roughness):
    """None of the last samples was rough; what is usual stays."""
    roughness.recent[:] = 0
    roughness.next = roughness.count = roughness.samples_before = 0


@inner
def is_rough(roughness):
    """Whether the signal is far rougher now than it was."""
    return roughness.count >= ROUGH_SHARE * roughness.window


@inner
def resolution_of(roughness):
    """The signal's resolution as far as known, else 0."""
    return roughness.resolution if isfinite(roughness.resolution) else 0.0


@inner
def is_noiseless(roughness):
    """Whether nothing but motion changes it, and it is not coarse: what goes on steadily a
    simulator says again and again."""
    return roughness.quiet > QUIET and resolution_of(roughness) <= roughness.noiseless


@inner
def rough_share(roughness):
    """Share of the window's samples that exceed their limit."""
    return roughness.count / roughness.window


@inner
def restart_roughness(roughness):
    """The next sample has nothing to do with those before."""
    roughness.samples_before = 0


@inner
def _spacing(roughness, at):
    """How many times longer than before the last one the time since the last sample is."""
    period = at - roughness.last_at
    spacing = period / roughness.period
    roughness.last_at, roughness.period = at, period
    # Stamps of a regular sensor waver.
    return 1.0 if 1.0 / IRREGULAR < spacing < IRREGULAR else spacing


@inner
def _keep_step(steps, step):
    """One of the least steps, if it is less than one of them."""
    k = LEAST_STEPS - 1
    if not EQUAL < step < steps[k]:
        return
    while k and step < steps[k - 1]:
        steps[k] = steps[k - 1]
        k -= 1
    steps[k] = step


@inner
def _learn_step(roughness, at, step, healthy):
    """Learn the resolution from a step at time `at` (s)."""
    steps, proving = roughness.least_steps, roughness.proving
    if not isfinite(roughness.proven_at):
        roughness.proven_at = at + PROVEN
    elif roughness.proven_at > at + PROVEN:
        # Time went back.
        roughness.proven_at = at
        proving[:, :] = np.inf
    if not healthy:
        proving[:, :] = np.inf
        roughness.proven_at = max(roughness.proven_at, at)
        return
    if at < roughness.proven_at:
        _keep_step(steps, step)
    else:
        _keep_step(proving[1], step)
        if at <= roughness.proven_at + PROVEN:
            return
        for i in range(LEAST_STEPS):
            _keep_step(steps, proving[0, i])
        proving[0, :] = proving[1, :]
        proving[1, :] = np.inf
        roughness.proven_at = at
    for i in range(LEAST_STEPS):
        if isfinite(steps[i]):
            roughness.resolution = steps[i]


@inner
def take_roughness(roughness, at, value, healthy, possible):
    """Take one sample of time `at` (s); only healthy ones are learnt from. Second differences up to
    `possible`, in the signal's unit, are motion; what moves does so for longer where a sample is
    missing.

    One that repeats the sample before it is smooth, and what follows is held against those before:
    a sensor that says everything twice climbs in stairs, and is no rougher for that.
    """
    before = roughness.before
    if roughness.samples_before < 2:
        before[roughness.samples_before] = value
        roughness.samples_before += 1
        roughness.period = at - roughness.last_at
        roughness.last_at = at
        return
    spacing = _spacing(roughness, at)
    if spacing > LONG_GAP:
        roughness.samples_before = 1
        before[0] = value
        return
    first = abs(value - before[1])
    _learn_step(roughness, at, first, healthy)
    repeats = first <= EQUAL
    square = 0.0
    if not repeats:
        differs = value - before[1] - spacing * (before[1] - before[0])
        # As noisy as one of even samples.
        variances = 1.0 + (1.0 + spacing) ** 2 + spacing**2
        square = SECOND_DIFFERENCES * differs**2 / variances
        before[0], before[1] = before[1], value
    known = roughness.known >= KNOWN_WINDOWS * roughness.window
    usual = max(roughness.usual, (ROUGH_STEPS * roughness.resolution) ** 2)
    exceeds = known and square > max(ROUGH_RATIO * ROUGH_RATIO * usual, possible * possible)
    _count_rough(roughness, exceeds)
    if healthy and not repeats:
        roughness.quiet += QUIET_SHARE * ((square < roughness.noiseless**2) - roughness.quiet)
    # A sensor that has said the same ever since tells nothing of how rough it is.
    if healthy and (square > 0.0 or roughness.usual > 0.0):
        _learn_usual(roughness, square, known)


@inner
def _count_rough(roughness, exceeds):
    """Of the window's samples those that exceed their limit, as the newest one does or does not."""
    roughness.count += exceeds - roughness.recent[roughness.next]
    roughness.recent[roughness.next] = exceeds
    roughness.next = (roughness.next + 1) % roughness.window


@inner
def _learn_usual(roughness, square, known):
    """From the square of a healthy second difference: single large ones hardly count once enough
    are `known`."""
    roughness.known += 1
    square = min(square, LARGEST_ROUGHNESS)
    if known:
        square = min(square, GIVE * GIVE * roughness.usual)
    roughness.usual += (square - roughness.usual) / min(roughness.known, LEARNT)
