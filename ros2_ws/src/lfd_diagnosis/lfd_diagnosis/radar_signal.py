"""One of the radar's two signals: how it stands against its prediction, and what its fault is."""

from math import isfinite, isnan, sqrt

import numpy as np

from lfd_diagnosis.evidence import BECAUSE, Ground, is_gauged, repeats
from lfd_diagnosis.noise import LEARNT_NOISE, deviation, start_noise
from lfd_diagnosis.repetition import (
    REPETITION,
    is_beyond_chance,
    is_frozen,
    restart_repetition,
    run_by_chance,
    start_repetition,
)
from lfd_diagnosis.ring import RING, append, at, is_full, mean_of, start_ring
from lfd_diagnosis.roughness import (
    ROUGHNESS,
    is_noiseless,
    is_rough,
    resolution_of,
    restart_roughness,
    start_roughness,
)
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

BAD, GOOD = 2, 1
"""How much a disagreeing scan adds to the confidence, and an agreeing one takes away: two
disagreeing scans in a row make a fault, or three of five; one alone is an outlier."""

FIRST = 10
"""Residuals from which the size of a jump is taken."""

FEW_BEFORE, FEW_AFTER, FEW_DOUBT = 6, 3, 5.4
"""Residuals that a jump back must stand out from, those that must have jumped, and four deviations
of what is then found for it, in those of the sensor's noise."""

BEFORE, AFTER, DOUBT = 12, 5, 3.9
"""The same where the noise is not small against the jump."""

MANY_BEFORE, MANY_AFTER, MANY_DOUBT = 20, 8, 2.9
"""The same where even so it could not be told from the noise."""

LAST, SEEN = 3, 0.5
"""Residuals just before a jump back, and share of it by which the new ones must differ."""

SIZE_TIME, CHANGED = 0.3, 0.5
"""Time constant in s of the size of a fault, and share by which a jump must have changed."""

TOLERANCE, MOST_DOUBT = 0.3, 0.6
"""Share of a jump by which the jump back may differ from it, and share that noise may be of it."""

GRADUAL = 0.9
"""Share of its limit that a signal which leaves it little by little goes at most from one scan to
the next."""

AT_ONCE = 0.5
"""Share of a jump that must be undone from one scan to the next if it is to be undone at once."""

SWING_KEEP, SWING_SCANS = 1.0 - 1.0 / 12000, 20
"""What is left of the largest healthy residual after a scan, so that some ten minutes count, and
scans without a fault after which it surely was healthy."""

HARDLY, UNALIKE = 1.5, 0.25
"""Times its limit below which a residual is hardly off, and share of two residuals of one fault by
which they may differ, beyond their limit."""

LIMIT_STEPS = 1.5
"""Steps of its resolution that a signal may be off from its prediction."""

HELD_SCANS, ZERO_SCANS, ZERO_CHANCE = 6, 3, 1e-2
"""Equal scans below which nothing is thought of it, and from which on a zero is one, unless that
may be a coincidence."""

AVERAGED, AGREED = 4.0, 0.4
"""Scans over which noise averages out while a faulty signal agrees, and share of the fault that it
may then be off in the mean."""

NOISE_CLEARS = 1.6
"""A noise leaves its limits now and then only: it must agree for so many times longer."""

SAME, SAME_SIGMA, MOST_OF = 0.6, 4.0, 0.9
"""Share of the least limit, and deviations of the noise, within which a drift that has stopped
stays, and share of the time for that that must have been seen."""

TELLABLE, TELLABLE_FLOORS = 0.7, 1.5
"""Share of the fault, and least limits, that what its reference may be off must stay below if
agreement is to tell anything."""

HALF, WITHIN = 0.5, 3.0
"""Share of what a fault was off by, and deviations, that what has come back may still be off."""

BACK_FLOORS, BACK_SHARE = 0.8, 0.4
"""Least limits, and share of the fault, by which what is no offset jumps back at least."""

AGAIN, AGAIN_SIGMA = 3, 6.0
"""Scans after which what is faulty has surely jumped to somewhere else, and deviations of its noise
that such a jump is from one scan to the next at least."""

LONGEST_PERIOD = 0.2
"""Seconds that one scan's agreement counts for at most."""

END_UNSEEN = 60.0
"""Seconds in which a jump back may be the end of an offset that is believed since another target
came."""

HISTORY = 4096
"""Residuals of a drift that are remembered; over long times not every one is."""

RADAR_SIGNAL = np.dtype(
    [
        ("floor", "f8"),
        ("noise", LEARNT_NOISE),
        ("roughness", ROUGHNESS),
        ("repetition", REPETITION),
        ("residual", "f8"),
        ("limit", "f8"),
        ("residual_before", "f8"),
        ("last", "f8"),
        ("last_at", "f8"),
        ("confidence", "i8"),
        ("outliers", "i8"),
        ("faulty", "?"),
        ("faulty_scans", "i8"),
        ("faulty_at", "f8"),
        ("kind", "i8"),
        ("because", BECAUSE),
        ("tellable", "?"),
        ("coasted", "f8"),
        ("bias", "f8"),
        ("leaning", "f8"),
        ("roughest", "f8"),
        ("swung", "f8"),
        ("swings", "f8"),
        ("swings_for", "i8"),
        ("estimate", "f8"),
        ("size", "f8"),
        ("agreeing", "f8"),
        ("agreed", "f8"),
        ("agreed_scans", "f8"),
        ("came_back", "?"),
        ("returned", "?"),
        ("again", RING),
        ("astray", "f8"),
        ("at_once", "?"),
        ("jumped_back_at", "f8"),
        ("must_agree", "f8"),
        ("lost", "?"),
        ("lost_since", "f8"),
        ("carried", "?"),
        ("carried_since", "f8"),
        ("ended_size", "f8"),
        ("ended_at", "f8"),
        ("first", RING),
        ("recent", RING),
        ("said", RING),
        ("history", "f8", (HISTORY, 2)),
        ("history_first", "i8"),
        ("history_count", "i8"),
    ],
    align=True,
)
"""State of one signal; lengths in its own unit (m or m/s), times in s.

`faulty_at` is when it was faulty last, `estimate` how far a faulty signal is off its reference,
`size` how far its fault put it, `recent` its newest residuals, `said` what it said then (a
clearance: beyond the path travelled), `at_once` whether that was undone from one scan to the next
since it agrees, `returned` whether it once was seen to jump back at once, `again` its residuals
since it jumped elsewhere and `astray` what its reference was off then, `jumped_back_at` when its
last jump was if it was that way, `must_agree` for how long what agrees must go on where that is
longer than usual, `history` times and residuals of a drift. `lost_since` counts while the reference
of a faulty signal is `lost`: another target came; `carried_since` while its offset is taken to go
on with that (`carried`); `ended_size` is how far the last one was off that is believed since
`ended_at` though nobody saw its end. In shares of `floor`: `roughest`, the largest healthy
residual, `swung`, that of some minutes, and `swings`, a larger one `swings_for` scans ago.
"""


@inner
def start_signal(signal, floor, std, lowest, noiseless, learn):
    """Begin with the noise of the parameter file (in the signal's unit) and nothing else."""
    signal.floor, signal.roughness.noiseless = floor, noiseless
    first = max(std, lowest)
    start_noise(signal.noise, first, lowest, 10.0 * first, learn, 400)
    forget_usual(signal)
    signal.leaning = signal.roughest = 0.0
    signal.swung = signal.swings = 0.0
    signal.swings_for = 0
    signal.outliers = 0
    signal.coasted = 0.0
    signal.faulty_scans = 0
    signal.estimate = signal.size = np.nan
    start_ring(signal.first, FIRST)
    start_ring(signal.recent, MANY_BEFORE + MANY_AFTER)
    start_ring(signal.said, MANY_BEFORE + MANY_AFTER)
    signal.history_count = signal.history_first = 0
    start_ring(signal.again, FIRST)
    signal.came_back = signal.at_once = signal.returned = False
    signal.jumped_back_at = signal.ended_size = np.nan
    signal.agreeing = 0.0
    restart_signal(signal)
    forgive(signal)


@inner
def forget_usual(signal):
    """Nothing is known of how rough it is, and how often the same."""
    start_roughness(signal.roughness, 16, signal.roughness.noiseless)
    start_repetition(signal.repetition, 8)


@inner
def restart_signal(signal):
    """The next scan has nothing to do with those before."""
    signal.last, signal.bias = np.nan, 0.0
    signal.last_at = signal.faulty_at = -np.inf
    begin_to_judge(signal)
    restart_roughness(signal.roughness)
    restart_repetition(signal.repetition)


@inner
def begin_to_judge(signal):
    """Nothing was judged yet of what is seen."""
    signal.residual = signal.limit = np.nan
    signal.residual_before = 0.0
    if not signal.faulty:
        signal.confidence = 0


@inner
def is_bad(signal):
    """Whether the newest scan left its limits."""
    return not abs(signal.residual) <= signal.limit


@inner
def index_of(signal):
    """Residual against limit, 0..1; one half at the limit. NaN before anything was judged."""
    return abs(signal.residual) / (abs(signal.residual) + signal.limit)


@inner
def size_of(signal):
    """How far a faulty signal is off; NaN where that says nothing."""
    return signal.size if is_gauged(signal.kind) else np.nan


@inner
def is_known_offset(signal):
    """Whether it is healthy, or off by a jump that was measured."""
    return not signal.faulty or signal.kind == Kind.OFFSET


@inner
def offset_of(signal):
    """How far a jump put it off, in its unit; 0 where it is healthy."""
    return signal.size if signal.faulty else 0.0


@inner
def least_limit(signal):
    """Least limit: a coarse sensor may be off by its resolution, and some noise."""
    return max(signal.floor, LIMIT_STEPS * resolution_of(signal.roughness))


@inner
def learn_swing(signal, off):
    """From a healthy residual (in the signal's unit): how far it swings within its limits. It is
    known only a while later: a fault may begin like that."""
    share = abs(off) / signal.floor
    signal.roughest = max(signal.roughest, share)
    signal.swung *= SWING_KEEP
    if share > max(signal.swung, signal.swings):
        signal.swings, signal.swings_for = share, 0
    signal.swings_for += 1
    if signal.swings_for > SWING_SCANS:
        signal.swung = max(signal.swung, signal.swings)
        signal.swings = 0.0


@inner
def is_held(signal):
    """Whether it repeats itself for longer than a moment, though maybe by coincidence."""
    return signal.repetition.run >= HELD_SCANS


@inner
def repeats_wrongly(signal, should_have_changed):
    """Whether it has said the same for longer than any healthy one could; one without noise only
    where it should have changed."""
    tells = should_have_changed or not is_noiseless(signal.roughness)
    return tells and is_frozen(signal.repetition, should_have_changed)


@inner
def shows_itself(signal):
    """Whether its fault was told by what the signal does, not by where it lies."""
    ground, kind = signal.because.ground, signal.kind
    # A noise may have been told by where it lay first; what jumped once and repeats itself may
    # still be off when it does not.
    return ground in (Ground.REPETITION, Ground.ROUGHNESS) or kind in (Kind.ZERO, Kind.NOISE)


@inner
def still_shows(signal):
    """Whether it has said the same ever since its fault began, or for longer than chance would have
    it, or is rough now."""
    return _still_repeats(signal) or is_rough(signal.roughness)


@inner
def _still_repeats(signal):
    """A coarse signal that is not held any more repeats itself for a moment, too."""
    run = signal.repetition.run
    ever_since = run >= signal.faulty_scans
    return is_held(signal) and (ever_since or is_beyond_chance(signal.repetition, run))


@inner
def deviation_about(signal, variance):
    """Standard deviation of a measurement about a prediction of that variance."""
    return sqrt(variance + signal.noise.variance)


@inner
def count_scan(signal, ceiling):
    """Confidence in a fault, by scans (eq 26 with scans for steps)."""
    if isnan(signal.residual):
        return
    if is_bad(signal):
        if not signal.confidence and not signal.faulty:
            start_ring(signal.first, FIRST)
        signal.confidence = min(signal.confidence + BAD, ceiling)
        if not is_full(signal.first):
            append(signal.first, signal.residual)
        return
    signal.residual_before = signal.residual
    if signal.confidence == BAD and not signal.faulty:
        signal.outliers += 1
    signal.confidence = max(signal.confidence - GOOD, 0)
    if not signal.confidence and not signal.faulty:
        # No later fault began with that.
        start_ring(signal.first, FIRST)


@inner
def may_be_outliers(signal):
    """Whether of the two scans that were off so far one was hardly so, by an amount that the other
    one's fault does not make: both may be outliers, a third one must tell."""
    if signal.first.count != 2:
        return False
    former, latter = at(signal.first, 0), at(signal.first, 1)
    less, more = min(abs(former), abs(latter)), max(abs(former), abs(latter))
    hardly = less < HARDLY * signal.limit
    return hardly and abs(latter - former) > UNALIKE * more + signal.limit


@inner
def acquit(signal):
    """What it did wrong was another signal's fault."""
    signal.confidence, signal.residual = 0, 0.0
    start_ring(signal.first, FIRST)


@inner
def lose_reference(signal, time):
    """Nothing is left that a faulty signal could be told from, since a time in s."""
    if signal.faulty:
        signal.lost, signal.lost_since, signal.carried = True, time, False


@inner
def carry(signal, time):
    """The offset of a faulty signal goes on with another target, since a time in s."""
    if signal.faulty:
        signal.carried, signal.carried_since = True, time


@inner
def convict(signal, kind, confidence):
    """Faulty from now on; its `because` is for the caller to state."""
    signal.faulty, signal.kind, signal.faulty_scans = True, kind, 0
    signal.lost = signal.carried = False
    signal.confidence = confidence
    signal.estimate = signal.size = signal.residual
    if not signal.first.count:
        append(signal.first, signal.residual)
    signal.ended_size = np.nan
    # What it did just before was its fault.
    signal.swings = 0.0
    start_ring(signal.again, FIRST)
    signal.came_back = signal.at_once = signal.returned = False
    signal.jumped_back_at = np.nan
    restart_agreement(signal)
    start_ring(signal.recent, MANY_BEFORE + MANY_AFTER)
    start_ring(signal.said, MANY_BEFORE + MANY_AFTER)
    signal.history_first = signal.history_count = 0


@inner
def note_end(signal, time):
    """What is believed since a time in s, another target having come, may still be off."""
    unseen = (signal.lost or signal.carried) and has_not_jumped_back(signal)
    signal.ended_size = _began_with(signal) if unseen else np.nan
    signal.ended_at = time


@inner
def ends_the_last(signal):
    """Whether a jump undoes the offset whose end nobody saw."""
    off, recent = signal.ended_size, signal.last_at - signal.ended_at < END_UNSEEN
    doubt = max(TOLERANCE * abs(off), 0.5 * signal.floor)
    return recent and abs(signal.residual + off) < doubt


@inner
def forgive(signal):
    """Healthy from now on."""
    signal.faulty, signal.kind = False, Kind.UNKNOWN
    signal.lost = signal.carried = False
    signal.because.ground = 0
    signal.confidence, signal.tellable, signal.must_agree = 0, True, 0.0
    start_ring(signal.first, FIRST)


@inner
def _is_zero(signal):
    """Whether it says zero, for no moment, nor as a coarse signal does that is near it."""
    repetition = signal.repetition
    least = max(ZERO_SCANS, run_by_chance(repetition, ZERO_CHANCE))
    return signal.last == 0.0 and repetition.run >= least


@inner
def classify(signal, settings, should_have_changed):
    """What began as a jump may turn out to be something else."""
    signal.faulty_scans += 1
    if not is_gauged(signal.kind):
        return
    # What was held has said the same ever since.
    ever_since = settings.check_repetition and signal.repetition.run >= signal.faulty_scans
    if ever_since and _is_zero(signal):
        signal.kind = Kind.ZERO
    elif ever_since and is_held(signal) and repeats_wrongly(signal, should_have_changed):
        signal.kind = Kind.HOLD
    elif settings.check_roughness and is_rough(signal.roughness) and signal.kind == Kind.OFFSET:
        signal.kind = Kind.NOISE


@inner
def _levels(recent, before, after):
    """The newest `after` values against the `before` ones before them: how far they lie off the
    line through those, where they lie, how far apart, how far off the last few before, and how much
    those rose from one to the next. Medians: single outliers on either side do not count."""
    first = recent.count - before - after
    old, new = np.empty(before), np.empty(after)
    rises = np.empty(before * (before - 1) // 2)
    for i in range(before):
        old[i] = at(recent, first + i)
    count = 0
    for i in range(before):
        for j in range(i):
            rises[count] = (old[i] - old[j]) / (i - j)
            count += 1
    for i in range(after):
        new[i] = at(recent, first + before + i)
    level = np.median(new)
    # A later one may be an outlier itself, the first one may be from before the jump.
    off = np.abs(new - level)
    apart = max(off[0], np.sort(off)[after - 2])
    scans, rise = 0.5 * (before + after), np.median(rises)
    jump = level - (np.median(old) + scans * rise)
    return jump, level, apart, level - np.median(old[-LAST:]), rise


@inner
def _began_with(signal):
    """By how much the scans that the fault began with were off, in the mean."""
    return mean_of(signal.first, 0, signal.first.count)


@inner
def _scans_to_tell(signal, offset):
    """How many scans before a jump back and after it tell one of that size, and how far off it may
    seem by noise and rounding: the larger the noise is against it, the more."""
    noise = deviation(signal.noise)
    before, after, doubt = FEW_BEFORE, FEW_AFTER, FEW_DOUBT * noise
    if doubt > TOLERANCE * abs(offset):
        before, after, doubt = BEFORE, AFTER, DOUBT * noise
    rounding = 0.5 * resolution_of(signal.roughness)
    if doubt + rounding > MOST_DOUBT * abs(offset):
        before, after, doubt = MANY_BEFORE, MANY_AFTER, MANY_DOUBT * noise
    return before, after, doubt + rounding


@inner
def look_for_return(signal, said, repeated):
    """Take note of a scan, and of whether the jump that made the fault was undone, whatever became
    of the reference: some scans lie as far off those before as the first ones did, the other way.

    Returns where it is now, off its reference, and how much it rose before from scan to scan; NaN
    if it did not return. Of the scans the median: the newest may be an outlier.
    """
    if signal.kind != Kind.OFFSET:
        return np.nan, np.nan
    recent = signal.recent
    if not repeated:
        append(recent, signal.residual)
        append(signal.said, said)
    offset = _began_with(signal)
    before, after, doubt = _scans_to_tell(signal, offset)
    tolerance = max(TOLERANCE * abs(offset), 0.5 * signal.floor, doubt)
    told = doubt <= MOST_DOUBT * abs(offset) and tolerance < abs(offset)
    if recent.count < before + after or not told:
        return np.nan, np.nan
    jump, level, apart, seen, drift = _levels(recent, before, after)
    if abs(jump + offset) >= tolerance or apart >= tolerance:
        return np.nan, np.nan
    # What jumped back before and now jumps away that way is off anew, to the other side.
    if signal.returned and abs(level) > abs(level - jump):
        return np.nan, np.nan
    # The reference itself may have jumped: one that is coasted follows the other signal's noise.
    itself, _, _, _, rise = _levels(signal.said, before, after)
    if -itself * offset < SEEN * offset * offset:
        return np.nan, np.nan
    # Against a reference that is known well, a line that was drawn wrong is no jump.
    if signal.tellable and -seen * offset < SEEN * offset * offset:
        return np.nan, np.nan
    largest = 0.0
    for i in range(recent.count - before - after + 1, recent.count):
        largest = max(largest, abs(at(recent, i) - at(recent, i - 1)))
    signal.at_once = largest > AT_ONCE * abs(offset)
    # What was undone is what it must be told from now.
    signal.estimate = signal.size = offset
    start_ring(recent, MANY_BEFORE + MANY_AFTER)
    start_ring(signal.said, MANY_BEFORE + MANY_AFTER)
    signal.came_back, signal.returned = True, signal.at_once
    restart_agreement(signal)
    # The median lies in their middle; a reference that was coasted has gone on since, by no more
    # than they lie apart.
    gone_on = 0.5 * (after - 1) * drift
    return level + max(-apart, min(apart, gone_on)), rise


@inner
def follow_drift(signal, time, duration):
    """Keep where a drift was, at a time in s, over the last `duration` s."""
    if signal.kind != Kind.RAMP:
        return
    history, first, count = signal.history, signal.history_first, signal.history_count
    newest = (first + count - 1) % HISTORY
    if not count or time - history[newest, 0] >= 2.0 * duration / HISTORY:
        newest = (first + count) % HISTORY
        history[newest, 0], history[newest, 1] = time, signal.residual
        count += 1
    while history[newest, 0] - history[first, 0] > duration:
        first, count = (first + 1) % HISTORY, count - 1
    signal.history_first, signal.history_count = first, count


@inner
def move_reference(signal, by):
    """What a faulty signal is held against was found elsewhere: that is no jump of its own."""
    for values in (signal.recent.values, signal.said.values):
        for i in range(len(values)):
            values[i] -= by


@inner
def has_stopped(signal, duration):
    """Whether a drift has not gone on for `duration` s: nothing contradicts anything now."""
    history, first, count = signal.history, signal.history_first, signal.history_count
    newest = (first + count - 1) % HISTORY
    if signal.kind != Kind.RAMP or not count:
        return False
    if history[newest, 0] - history[first, 0] <= MOST_OF * duration:
        return False
    lowest, highest = np.inf, -np.inf
    for i in range(count):
        value = history[(first + i) % HISTORY, 1]
        lowest, highest = min(lowest, value), max(highest, value)
    return highest - lowest < SAME * signal.floor + SAME_SIGMA * deviation(signal.noise)


@inner
def drifts_by(signal, duration):
    """How fast a drift went on over the last seconds, in the signal's unit per s; NaN where that is
    not known."""
    history, first, count = signal.history, signal.history_first, signal.history_count
    if signal.kind != Kind.RAMP:
        return np.nan
    newest = (first + count - 1) % HISTORY
    time = history[newest, 0]
    k = newest
    while count > 1 and time - history[k, 0] < duration:
        k, count = (k - 1) % HISTORY, count - 1
    since = time - history[k, 0]
    if since < duration:
        return np.nan
    return (history[newest, 1] - history[k, 1]) / since


@inner
def _largest_jump(signal):
    """The largest of the residuals that the fault began with."""
    size = 0.0
    for i in range(signal.first.count):
        size = max(size, abs(at(signal.first, i)))
    return size


@inner
def size_to_tell(signal):
    """What agreement must be told from: how far off the fault was, no less than is looked for."""
    return max(_largest_jump(signal), signal.floor)


@inner
def restart_agreement(signal):
    """Agreement counts from now on."""
    signal.agreeing = signal.agreed = signal.agreed_scans = 0.0


@inner
def _begin_again(signal):
    """The last jump was undone: the newest one, `again`, is another fault's."""
    signal.returned, signal.jumped_back_at = False, np.nan
    start_ring(signal.first, FIRST)
    for i in range(signal.again.count):
        append(signal.first, at(signal.again, i))


@inner
def _follow_jump(signal, step):
    """Take note of a scan that is off; whether an offset has jumped elsewhere, or may have: what it
    was off before is no part then of what it is off now. `step` as in `follow_agreement`."""
    again = signal.again
    if signal.kind != Kind.OFFSET:
        return False
    least = max(least_limit(signal), AGAIN_SIGMA * deviation(signal.noise))
    if abs(step) > least:
        if not 0 < again.count < AGAIN:
            # What its reference had wandered by is no part of the fault.
            signal.astray = 0.0 if signal.agreeing > 0.0 else signal.estimate - signal.size
        start_ring(again, FIRST)
    elif not again.count or is_full(again):
        return False
    append(again, signal.residual)
    if again.count < AGAIN:
        return True
    level = mean_of(again, 0, again.count)
    if again.count == AGAIN and abs(level - signal.astray - signal.size) <= least:
        # It was an outlier, or is back from one.
        start_ring(again, FIRST)
        return False
    if again.count == AGAIN and signal.returned:
        _begin_again(signal)
    signal.estimate, signal.size = level, level - signal.astray
    return True


@inner
def follow_agreement(signal, period, step, spread, sigma):
    """Take note of whether a faulty signal agrees; false where it does not.

    `period` since the scan before and `step` since then beyond the lead's own motion; `spread`
    is the deviation of a healthy measurement about the reference, `sigma` how many of them count.
    """
    size = _largest_jump(signal)
    # Noise averages out while it agrees; what the reference is off does not.
    averaged = 1.0 - 1.0 / AVERAGED
    known = sqrt(max(spread * spread - averaged * signal.noise.variance, 0.0))
    signal.tellable = sigma * known < max(TELLABLE * size, TELLABLE_FLOORS * signal.floor)
    bound = signal.limit
    if is_gauged(signal.kind):
        # What is known to be off by so much has not come back while it is off by half of it.
        bound = min(bound, max(HALF * abs(signal.estimate), WITHIN * spread))
    off = is_bad(signal) or abs(signal.residual) > bound
    if abs(step) > AT_ONCE * size:
        signal.at_once = True
        back = step * signal.size < 0.0
        signal.jumped_back_at = signal.last_at + period if back else np.nan
    if off and not _follow_jump(signal, step):
        share = min(period / SIZE_TIME, 1.0)
        signal.estimate += share * (signal.residual - signal.estimate)
    # A jump is known best just after it, before its reference has been coasted for long.
    jumped = signal.kind == Kind.OFFSET and is_full(signal.first)
    if not jumped or abs(signal.estimate - signal.size) > CHANGED * abs(signal.size):
        signal.size = signal.estimate
    if off or (repeats(signal.kind) and _still_repeats(signal)) or is_rough(signal.roughness):
        signal.came_back = signal.at_once = False
        restart_agreement(signal)
        return False
    start_ring(signal.again, FIRST)
    back = max(BACK_FLOORS * signal.floor, BACK_SHARE * size)
    if signal.kind != Kind.OFFSET and abs(step) > back:
        signal.came_back = True
        restart_agreement(signal)
    signal.agreed += signal.residual
    signal.agreed_scans += 1.0
    signal.agreeing += min(period, LONGEST_PERIOD)
    return True


@inner
def has_not_jumped_back(signal):
    """Whether what jumped away agrees again though it was not seen to jump back."""
    back = signal.came_back or isfinite(signal.jumped_back_at)
    return signal.kind == Kind.OFFSET and not back


@inner
def may_have_shifted(signal, largest):
    """Whether a clearance that agrees again may be off as before, the radar seeing another part of
    the car since: so far (m) that may lie off, and it did not come back at once."""
    return signal.kind == Kind.OFFSET and not signal.at_once and _largest_jump(signal) <= largest


@inner
def came_back_and_shifts(signal, step, largest):
    """Whether a clearance that jumped back goes over to another part of the car now, `step` m since
    the scan before: little by little, and by `largest` m at most."""
    gradual = abs(step) <= GRADUAL * signal.limit
    return signal.came_back and gradual and 0.5 * signal.limit < abs(signal.residual) <= largest


@inner
def agrees_by_now(signal):
    """Whether a faulty signal seems to be over its fault, though it has not agreed for long."""
    return signal.agreeing > 0.0 and (signal.tellable or signal.came_back)


@inner
def ends_for_all_to_see(signal):
    """Whether its fault's end is seen whatever became of the reference: it jumped back, or repeated
    itself or was rough and is not any more."""
    return signal.came_back or shows_itself(signal)


@inner
def agrees_long_enough(signal, clear_time, latch):
    """Whether a faulty signal that agrees does so for long enough to be believed."""
    needed = clear_time * (NOISE_CLEARS if signal.kind == Kind.NOISE else 1.0)
    # Agreement with limits as wide as the fault is large says nothing.
    off = abs(signal.agreed) > AGREED * size_to_tell(signal) * signal.agreed_scans
    told = (signal.tellable and not off) or ends_for_all_to_see(signal)
    return signal.agreeing >= needed and (told or not latch)
