"""The newest value of a signal, how old it is, and how often the signal comes.

Stamps and periods are integer nanoseconds.
"""

import numpy as np

from lfd_mpc.compiled import inner

STALE_NS = 150_000_000
STALE_PERIODS = 3
"""A signal is stale when older than the larger of `STALE_NS` and so many of its own periods."""

PERIODS = 19
"""A signal's period is the median over so many, the last ones."""

RHYTHM = np.dtype(
    [
        ("periods", "i8", (PERIODS,)),
        ("count", "i8"),
        ("next", "i8"),
        ("last", "i8"),
        ("started", "?"),
    ],
    align=True,
)
"""Stamp of the last sample of one signal and the periods between the last ones, in ns."""

SIGNAL = np.dtype(
    [("rhythm", RHYTHM), ("value", "f8"), ("stamp", "i8"), ("known", "?")], align=True
)
"""The newest value of one signal."""


@inner
def note_rhythm(rhythm, stamp):
    """A sample came at `stamp`."""
    if rhythm.started:
        rhythm.periods[rhythm.next] = stamp - rhythm.last
        rhythm.next = (rhythm.next + 1) % PERIODS
        rhythm.count = min(rhythm.count + 1, PERIODS)
    rhythm.last = stamp
    rhythm.started = True


@inner
def period(rhythm):
    """Median period in ns, 0 while none is known."""
    n = rhythm.count
    if not n:
        return 0.0
    ordered = np.sort(rhythm.periods[:n])
    if n % 2:
        return float(ordered[n // 2])
    return (ordered[n // 2 - 1] + ordered[n // 2]) / 2


@inner
def forget_rhythm(rhythm):
    """Nothing has been sampled yet."""
    rhythm.started = False
    rhythm.count = rhythm.next = 0


@inner
def note_signal(signal, stamp, value):
    """The signal had this `value` at `stamp`."""
    note_rhythm(signal.rhythm, stamp)
    signal.stamp, signal.value, signal.known = stamp, value, True


@inner
def forget_signal(signal):
    """Its value is no longer known; how often it comes is."""
    signal.known = False


@inner
def read_signal(signal, stamp, reading):
    """What is known of the signal at `stamp`, into `reading`."""
    if not signal.known:
        reading.measured = reading.age = np.nan
        reading.stale = True
        return
    age = stamp - signal.stamp
    reading.measured, reading.age = signal.value, age * 1e-9
    # The period is asked for only where it matters: a median takes its time.
    reading.stale = age > STALE_NS and age > STALE_PERIODS * period(signal.rhythm)
