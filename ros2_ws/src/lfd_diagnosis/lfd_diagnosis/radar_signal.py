"""What is known of one of the radar's two signals, and how its faults begin and end."""

import numpy as np

from lfd_diagnosis.drift_history import DRIFT_HISTORY, start_history
from lfd_diagnosis.evidence import BECAUSE, is_gauged
from lfd_diagnosis.noise import LEARNT_NOISE, start_noise
from lfd_diagnosis.repetition import REPETITION, restart_repetition, start_repetition
from lfd_diagnosis.ring import RING, append, at, mean_of, start_ring
from lfd_diagnosis.roughness import ROUGHNESS, restart_roughness, start_roughness
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

FIRST = 10
"""Residuals of a new fault from which the size of its jump is taken."""

RECENT = 28
"""Newest residuals of a faulty signal that are kept, to see whether the last of them jumped."""

NOISE_MEMORY, MOST_NOISE = 400, 10.0
"""Scans that the noise is learnt from, and how many times larger than at first it may get."""

ROUGH_WINDOW = 16
"""Scans of which it is counted how many are rough."""

EQUAL_LEAST = 8
"""Equal scans in a row that are never suspect."""

RADAR_SIGNAL = np.dtype(
    [
        # What is usual of it while it is healthy.
        ("floor", "f8"),
        ("noise", LEARNT_NOISE),
        ("roughness", ROUGHNESS),
        ("repetition", REPETITION),
        ("bias", "f8"),
        ("leaning", "f8"),
        ("roughest", "f8"),
        ("swung", "f8"),
        ("swings", "f8"),
        ("swings_for", "i8"),
        # Its newest scan.
        ("residual", "f8"),
        ("limit", "f8"),
        ("residual_before", "f8"),
        ("last", "f8"),
        ("last_at", "f8"),
        # Whether it is faulty, and how.
        ("confidence", "i8"),
        ("outliers", "i8"),
        ("faulty", "?"),
        ("faulty_scans", "i8"),
        ("faulty_at", "f8"),
        ("kind", "i8"),
        ("because", BECAUSE),
        ("estimate", "f8"),
        ("size", "f8"),
        ("first", RING),
        ("history", DRIFT_HISTORY),
        ("coasted", "f8"),
        # Whether it agrees again.
        ("tellable", "?"),
        ("agreeing", "f8"),
        ("agreed", "f8"),
        ("agreed_scans", "f8"),
        ("must_agree", "f8"),
        # Whether the jump that its fault began with was undone, or it jumped elsewhere.
        ("recent", RING),
        ("said", RING),
        ("came_back", "?"),
        ("returned", "?"),
        ("at_once", "?"),
        ("jumped_back_at", "f8"),
        ("again", RING),
        ("astray", "f8"),
        # What became of its reference as another target came.
        ("lost", "?"),
        ("lost_since", "f8"),
        ("carried", "?"),
        ("carried_since", "f8"),
        ("ended_size", "f8"),
        ("ended_at", "f8"),
    ],
    align=True,
)
"""State of one signal; lengths in its own unit (m or m/s), times in s.

Usual. `floor` is the least limit, `bias` what a clearance lies beside its track for good, `leaning`
how many residuals in a row were on one side (negative: below). In shares of `floor`: `roughest`,
the largest healthy residual so far, `swung`, that of the last minutes, and `swings`, a larger one
`swings_for` scans ago that may yet turn out to be the beginning of a fault.

Newest scan. `residual` is what it lies off its prediction, `residual_before` that of the last scan
within limits, `last` its value.

Fault. It lasts for `faulty_scans` so far; `faulty_at` is when it was faulty last. `estimate` is how
far the signal is off its reference by now, `size` how far the fault itself put it, `first` the
residuals that it began with, `history` those of a drift. `coasted`: seconds for which the track has
gone on without this signal.

Agreement. `tellable`: whether its reference is known well enough for agreement to mean anything. It
has been `agreeing` for so many s; its residuals of these `agreed_scans` sum up to `agreed`;
`must_agree` is for how long it must where that is longer than usual.

Jumps. `recent` are its newest residuals, `said` what it said then (a clearance: beyond the path
travelled). `came_back`: whether the jump was seen to be undone; `at_once`, whether it was so from
one scan to the next since it agrees; `returned`, whether it once was so at once. `jumped_back_at`
is when its last jump was if it was that way. `again` are its residuals since it jumped elsewhere,
`astray` what its reference was off then.

Another target. `lost`: the reference is, since `lost_since`; `carried`: the offset is taken to go
on with the new target, since `carried_since`. `ended_size` is how far the last fault was off that
nobody saw end: the signal is believed since `ended_at`.
"""


@inner
def start_signal(signal, floor, std, lowest, noiseless, learn):
    """Begin with the noise of the parameter file, a deviation `std` that is `lowest` at least, and
    limits that are `floor` at least, in the signal's unit; `noiseless` as in `start_roughness`."""
    signal.floor, signal.roughness.noiseless = floor, noiseless
    first = max(std, lowest)
    start_noise(signal.noise, (first, lowest, MOST_NOISE * first), learn, NOISE_MEMORY)
    forget_usual(signal)
    signal.leaning = signal.roughest = 0.0
    signal.swung = signal.swings = 0.0
    signal.swings_for = 0
    signal.outliers = 0
    signal.coasted = 0.0
    signal.faulty_scans = 0
    signal.estimate = signal.size = np.nan
    start_ring(signal.first, FIRST)
    signal.ended_size = np.nan
    _begin_fault(signal)
    restart_signal(signal)
    forgive(signal)


@inner
def forget_usual(signal):
    """Nothing is known of how rough it is, and of how often it says the same by chance."""
    start_roughness(signal.roughness, ROUGH_WINDOW, signal.roughness.noiseless)
    start_repetition(signal.repetition, EQUAL_LEAST)


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
    """No scan of the target that is seen now was held against a prediction yet."""
    signal.residual = signal.limit = np.nan
    signal.residual_before = 0.0
    if not signal.faulty:
        signal.confidence = 0


@inner
def restart_agreement(signal):
    """How long a faulty signal has agreed counts from now on."""
    signal.agreeing = signal.agreed = signal.agreed_scans = 0.0


@inner
def forget_recent(signal):
    """What it said so far is no longer to be compared with what it says from now on."""
    start_ring(signal.recent, RECENT)
    start_ring(signal.said, RECENT)


@inner
def _begin_fault(signal):
    """Nothing is known yet of what has become of the fault since it began."""
    start_ring(signal.again, FIRST)
    signal.came_back = signal.at_once = signal.returned = False
    signal.jumped_back_at = np.nan
    restart_agreement(signal)
    forget_recent(signal)
    start_history(signal.history)


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
    _begin_fault(signal)


@inner
def forgive(signal):
    """Healthy from now on."""
    signal.faulty, signal.kind = False, Kind.UNKNOWN
    signal.lost = signal.carried = False
    signal.because.ground = 0
    signal.confidence, signal.tellable, signal.must_agree = 0, True, 0.0
    start_ring(signal.first, FIRST)


@inner
def acquit(signal):
    """It is not to blame for the scans that were off: the other signal is, or nobody is."""
    signal.confidence, signal.residual = 0, 0.0
    start_ring(signal.first, FIRST)


@inner
def lose_reference(signal, time):
    """Since a time in s there is nothing left that a faulty signal could be held against."""
    if signal.faulty:
        signal.lost, signal.lost_since, signal.carried = True, time, False


@inner
def carry(signal, time):
    """The offset of a faulty signal goes on with another target, since a time in s."""
    if signal.faulty:
        signal.carried, signal.carried_since = True, time


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
def began_with(signal):
    """By how much the scans that the fault began with were off, in the mean."""
    return mean_of(signal.first, 0, signal.first.count)


@inner
def largest_jump(signal):
    """The largest of the residuals that the fault began with."""
    size = 0.0
    for i in range(signal.first.count):
        size = max(size, abs(at(signal.first, i)))
    return size


@inner
def size_to_tell(signal):
    """How far off the fault was, no less than the least fault that is looked for: agreement with a
    reference that may be off by more says nothing."""
    return max(largest_jump(signal), signal.floor)
