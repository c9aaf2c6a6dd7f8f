"""What is learnt of a healthy signal: its noise, how rough it is, how long it repeats itself."""

from math import isfinite, log, sqrt

import numpy as np

from lfd_mpc.compiled import inner
from lfd_mpc.settings import share_of

LEARNT = 2000
"""Samples over which roughness is averaged once so many are known."""

PRIOR = 20
"""Samples that the parameter file's value counts for."""

GIVE = 3.0
"""Deviations beyond which a sample does not add to what is learnt."""

VAGUE = 30.0
"""How much larger than the noise's variance that of a prediction may be to tell anything of it."""

SAME_STAMP = 1e-4
"""Seconds below which two stamps are the same."""

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

WIDEST_WINDOW, KNOWN_WINDOWS = 64, 3
"""Samples that such a share is taken of at most, and how many times as many healthy ones must be
known before any is called rough."""

QUIET, QUIET_SHARE = 0.8, 0.01
"""Share of second differences that are small where there is no noise, and share that each one
counts in it: some are a manoeuvre's, or rounding."""

CHANCE, REMOTE = 1e-5, 1e-7
"""Probability below which a run of equal samples is no coincidence, where the signal should have
changed and where nothing says so."""

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


LARGEST = 1e4
"""What a signal says at most, in its unit: sensors that say more cannot be farther off."""

LARGEST_ROUGHNESS = 100.0
"""Square of a second difference that is learnt at most, in the square of the unit."""

POSSIBLE_JERK = 40.0
"""m/s^3 that a car may reach: cars brake hard all of a sudden."""


@inner
def is_new(at, last_at):
    """Whether a sample of time `at` (s) is another one than that of `last_at`."""
    return at > last_at + SAME_STAMP


@inner
def as_measured(value):
    """The value, not larger than anything is measured; NaN stays."""
    return min(max(value, -LARGEST), LARGEST) if isfinite(value) else np.nan


@inner
def while_learning(known, enough):
    """How many times wider a limit is while less than `enough` is known: thrice at first."""
    return 1.0 + 2.0 * max(0.0, 1.0 - known / enough)


@inner
def beyond(value, limit):
    """By how much a value exceeds a limit, to the side that it is on."""
    return value - max(-limit, min(limit, value))


filter_share = inner(share_of)
"""The same for compiled functions."""


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
def start_noise(noise, first, lowest, highest, learn, memory):
    """Begin with deviations in the signal's unit; without `learn` the first one stays."""
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


LARGEST_RING = 32
"""Values that a ring holds at most."""

RING = np.dtype(
    [("values", "f8", (LARGEST_RING,)), ("size", "i8"), ("count", "i8"), ("next", "i8")], align=True
)
"""The last `size` values of something."""


@inner
def start_ring(ring, size):
    """Begin with no values, of which `size` will be kept, `LARGEST_RING` at most."""
    ring.size, ring.count, ring.next = size, 0, 0


@inner
def append(ring, value):
    """Add a value; the oldest one goes where there are too many."""
    ring.values[ring.next] = value
    ring.next = (ring.next + 1) % ring.size
    ring.count = min(ring.count + 1, ring.size)


@inner
def range_of(ring):
    """How far the values lie apart."""
    least = most = ring.values[0]
    for i in range(1, ring.count):
        least, most = min(least, ring.values[i]), max(most, ring.values[i])
    return most - least


@inner
def is_full(ring):
    """Whether there are as many as are kept."""
    return ring.count == ring.size


@inner
def at(ring, number):
    """The value of that number, 0 = oldest."""
    return ring.values[(ring.next - ring.count + number) % ring.size]


@inner
def mean_of(ring, first, last):
    """Mean of the values from number `first` to before `last`."""
    total = 0.0
    for i in range(first, last):
        total += at(ring, i)
    return total / (last - first)


@inner
def deviation(noise):
    """Standard deviation of a noise, in the signal's unit."""
    return sqrt(noise.variance)
