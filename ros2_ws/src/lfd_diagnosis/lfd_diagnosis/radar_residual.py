"""One scan of a radar signal against its prediction: its limits, and how many scans disagree."""

from math import isnan, sqrt

from lfd_diagnosis.radar_signal import FIRST
from lfd_diagnosis.ring import append, at, is_full, start_ring
from lfd_diagnosis.roughness import resolution_of
from lfd_mpc.compiled import inner

BAD, GOOD = 2, 1
"""How much a disagreeing scan adds to the confidence, and an agreeing one takes away: two
disagreeing scans in a row make a fault, or three of five; one alone is an outlier."""

LIMIT_STEPS = 1.5
"""Steps of its resolution that a signal may be off from its prediction."""

SWING_KEEP, SWING_SCANS = 1.0 - 1.0 / 12000, 20
"""What is left of the largest healthy residual after a scan, so that some ten minutes count, and
scans without a fault after which a residual surely was healthy."""

HARDLY, UNALIKE = 1.5, 0.25
"""Times its limit below which a residual is hardly off, and share of two residuals of one fault by
which they may differ, beyond their limit."""


@inner
def is_bad(signal):
    """Whether the newest scan is beyond its limit; a residual that is not known is, too."""
    return not abs(signal.residual) <= signal.limit


@inner
def index_of(signal):
    """Residual against limit, 0..1; one half at the limit. NaN before anything was judged."""
    return abs(signal.residual) / (abs(signal.residual) + signal.limit)


@inner
def least_limit(signal):
    """Least limit: a coarse sensor may be off by its resolution, and some noise."""
    return max(signal.floor, LIMIT_STEPS * resolution_of(signal.roughness))


@inner
def deviation_about(signal, variance):
    """Standard deviation of a measurement about a prediction of that variance."""
    return sqrt(variance + signal.noise.variance)


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
        # It was an outlier: no later fault began with it.
        start_ring(signal.first, FIRST)


@inner
def may_be_outliers(signal):
    """Whether a third scan must tell, of the only two that were off so far one being hardly so: one
    fault would put both off by about the same, so each may be an outlier."""
    if signal.first.count != 2:
        return False
    former, latter = at(signal.first, 0), at(signal.first, 1)
    less, more = min(abs(former), abs(latter)), max(abs(former), abs(latter))
    hardly = less < HARDLY * signal.limit
    return hardly and abs(latter - former) > UNALIKE * more + signal.limit
