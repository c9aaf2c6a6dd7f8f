"""How long a healthy signal says the same by chance."""

from math import log

import numpy as np

from lfd_mpc.compiled import inner

CHANCE, REMOTE, SELDOM = 1e-5, 1e-7, 1e-4
"""Probability below which a run of equal samples is no coincidence, where the signal should have
changed and where nothing says so, and below which it may well be none."""

NO_CHANCE = 2.0
"""How many times longer than chance would have it the longest run of a healthy signal is."""

LONGER_THAN_EVER, LONGER_UNCHANGED, MORE = 1.5, 2.0, 2.0
"""How many times the longest healthy run so far a run may last, the same where nothing says that
the signal should have changed, and equal samples beyond that."""

EQUAL_LEAST, EQUAL_MOST = 0.01, 0.99
"""Share of equal samples that is reckoned with at least and at most, whatever was seen so far."""

UNCHANGED = 4.0
"""How many times longer a run must be while the signal had no reason to change."""

OFTEN = 0.25
"""Share of equal samples above which it is no noise that makes the others differ."""

ENOUGH, LATELY = 100, 50
"""Samples that must be known before a run is called too long, and over which it is averaged how
often a signal repeats itself just now: a calm one does so more often."""

REPETITION = np.dtype(
    [
        ("least", "i8"),
        ("value", "f8"),
        ("longest", "i8"),
        ("equal", "i8"),
        ("samples", "i8"),
        ("run", "i8"),
        ("odd", "i8"),
        ("longest_odd", "i8"),
        ("lately", "f8"),
    ],
    align=True,
)
"""How long a signal has said the very same number, and whether that is longer than it may.

`run`: samples that equalled the one before them since `value` was said first, `least`: how many are
never suspect. Of `samples` healthy ones so many were `equal` to the one before. `lately`: how often
it repeated itself before the present run; `odd`: samples of the present run since the value should
have changed, `longest_odd` the most of them in a healthy one, `longest` the longest healthy run
without them.
"""


@inner
def start_repetition(repetition, least):
    """Begin with nothing; `least`: equal samples in a row that are never suspect."""
    repetition.least, repetition.value = least, np.nan
    repetition.longest = repetition.equal = repetition.samples = repetition.run = 0
    repetition.odd = repetition.longest_odd = 0
    repetition.lately = 0.0


@inner
def is_frozen(repetition, should_change):
    """Whether the run is longer than any healthy one could be; false while little is known."""
    return is_frozen_for(repetition, should_change, UNCHANGED)


@inner
def is_frozen_for(repetition, should_change, unchanged):
    """The same; `unchanged`: how many times longer a run must be without a reason to change.

    A filter inside the sensor may say the same for longer than chance would: where nothing says
    that the value `should_change`, the run must be far longer.
    """
    if repetition.samples < ENOUGH or repetition.run < repetition.least:
        return False
    if should_change:
        longest_odd = LONGER_THAN_EVER * repetition.longest_odd + MORE
        odd = min(longest_odd, run_by_chance(repetition, CHANCE))
        return repetition.odd >= odd and repetition.run >= _healthy_run(repetition)
    longest = LONGER_UNCHANGED * repetition.longest + MORE
    longest = max(longest, run_by_chance(repetition, REMOTE))
    return repetition.run >= unchanged * longest


@inner
def _healthy_run(repetition):
    """Equal samples in a row that a healthy signal may have: by chance, or since it had as many."""
    chance = run_by_chance(repetition, CHANCE)
    # A run that was too long to be chance may have been a fault that nobody could tell.
    longest = LONGER_THAN_EVER * repetition.longest + MORE
    return max(min(longest, NO_CHANCE * chance), chance)


@inner
def times_too_long(repetition):
    """How many times longer the run is than a healthy one may be, at least 1: the longer, the less
    else must tell that the signal should have changed."""
    return max(repetition.run / max(_healthy_run(repetition), repetition.least), 1.0)


@inner
def _share_of_equal(repetition):
    """Share of samples that equal the one before: of all so far or of the last ones."""
    return max(repetition.equal / max(repetition.samples, 1), repetition.lately)


@inner
def repeats_by_itself(repetition):
    """Whether its noise is so small that it repeats itself for as long as nothing changes."""
    return _share_of_equal(repetition) > OFTEN


@inner
def times_unchanged(repetition, noisy):
    """How many times longer a run must be without a reason to change: `noisy` times where noise
    changes the signal all the time."""
    return UNCHANGED if repeats_by_itself(repetition) else noisy


@inner
def run_by_chance(repetition, probability):
    """How many samples in a row are equal with that probability, by how many were so far."""
    share = min(max(_share_of_equal(repetition), EQUAL_LEAST), EQUAL_MOST)
    return log(probability) / log(share)


@inner
def is_beyond_chance(repetition, run):
    """Whether so many equal samples in a row are no coincidence."""
    return run >= max(repetition.least, run_by_chance(repetition, CHANCE))


@inner
def is_seldom(repetition, run):
    """Whether so many equal samples in a row may well be no coincidence, however few they are."""
    return repetition.samples >= ENOUGH and run >= run_by_chance(repetition, SELDOM)


@inner
def restart_repetition(repetition):
    """The next sample has nothing to do with those before."""
    repetition.value, repetition.run, repetition.odd = np.nan, 0, 0


@inner
def excuse_repetition(repetition, faulty):
    """Before a sample of a car that stands: it says the same for long. What was held before goes on
    being held."""
    if not (faulty and repetition.run > 0):
        restart_repetition(repetition)


@inner
def take_repetition(repetition, value, healthy):
    """Take one sample, only healthy ones are learnt from; whether it equals the one before."""
    equal = value == repetition.value
    if healthy:
        repetition.samples += 1
        repetition.equal += equal
        if not equal:
            repetition.longest = max(repetition.longest, repetition.run - repetition.odd)
            repetition.longest_odd = max(repetition.longest_odd, repetition.odd)
            keep = (1.0 - 1.0 / LATELY) ** (repetition.run + 1)
            # The run that ends: all of it but this sample was equal.
            repetition.lately = keep * repetition.lately + (1.0 - 1.0 / LATELY) - keep
    repetition.value = value
    repetition.run = repetition.run + 1 if equal else 0
    if not equal:
        repetition.odd = 0
    return equal


@inner
def note_change(repetition, should_change):
    """Count the samples of the present run since the value should have changed."""
    if repetition.run and (should_change or repetition.odd):
        repetition.odd += 1
