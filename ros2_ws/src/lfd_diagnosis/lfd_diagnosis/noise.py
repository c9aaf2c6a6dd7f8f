"""The noise of a healthy signal, as it is learnt."""

from math import sqrt

import numpy as np

from lfd_mpc.compiled import inner

PRIOR = 20
"""Samples that the parameter file's value counts for."""

GIVE = 3.0
"""Deviations beyond which a sample does not add to what is learnt."""

VAGUE = 30.0
"""How much larger than the noise's variance that of a prediction may be to tell anything of it."""


@inner
def while_learning(known, enough):
    """How many times wider a limit is while less than `enough` is known: thrice at first."""
    return 1.0 + 2.0 * max(0.0, 1.0 - known / enough)


LEARNT_NOISE = np.dtype(
    [
        ("variance", "f8"),
        ("lowest", "f8"),
        ("highest", "f8"),
        ("memory", "i8"),
        ("count", "i8"),
        ("learn", "?"),
    ],
    align=True,
)
"""Variance of a signal's noise, in the square of its unit, between a lowest and a highest one. It
is made of the last `memory` or so of `count` samples, if it is to `learn`, else it stays."""


@inner
def start_noise(noise, deviations, learn, memory):
    """Begin with three `deviations` in the signal's unit: that of the first samples, and the lowest
    and the highest one that is learnt, from so many samples (`memory`); without `learn` the first
    one stays."""
    first, lowest, highest = deviations
    noise.variance = first * first
    noise.lowest, noise.highest = lowest * lowest, highest * highest
    noise.memory, noise.learn = memory, learn
    noise.count = 0


@inner
def learn_noise(noise, innovation, predicted_variance):
    """Learn from one innovation whose prediction was as uncertain as stated."""
    if predicted_variance > VAGUE * noise.variance:
        return
    noise.count += 1
    if not noise.learn:
        return
    spread = predicted_variance + noise.variance
    excess = min(innovation * innovation, GIVE * GIVE * spread) - predicted_variance
    share = 1.0 / min(noise.count + PRIOR, noise.memory)
    variance = noise.variance + share * (excess - noise.variance)
    noise.variance = min(max(variance, noise.lowest), noise.highest)


@inner
def deviation(noise):
    """Standard deviation of a noise, in the signal's unit."""
    return sqrt(noise.variance)
