"""What kind of fault a radar signal has: an offset, a hold, a zero, or noise."""

from lfd_diagnosis.evidence import Ground, is_gauged
from lfd_diagnosis.repetition import is_beyond_chance, is_frozen, run_by_chance
from lfd_diagnosis.roughness import is_noiseless, is_rough
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

HELD_SCANS, ZERO_SCANS, ZERO_CHANCE = 6, 3, 1e-2
"""Equal scans below which a signal is not called held; and those from which on it is called zero,
unless so many are as likely as this by chance."""


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
def _is_zero(signal):
    """Whether it says zero for longer than a moment, and than a coarse signal that is near it."""
    repetition = signal.repetition
    least = max(ZERO_SCANS, run_by_chance(repetition, ZERO_CHANCE))
    return signal.last == 0.0 and repetition.run >= least


@inner
def classify(signal, settings, should_have_changed):
    """Count one more scan of a fault; what began as a jump may turn out to be something else.

    `should_have_changed`: whether there was a reason for that while the signal said the same.
    """
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
def shows_itself(signal):
    """Whether its fault was told by what the signal does, not by where it lies."""
    ground, kind = signal.because.ground, signal.kind
    # A noise may have been told by where it lay first; what jumped once and repeats itself may
    # still be off when it does not.
    return ground in (Ground.REPETITION, Ground.ROUGHNESS) or kind in (Kind.ZERO, Kind.NOISE)


@inner
def still_repeats(signal):
    """Whether it has said the same ever since its fault began, or for longer than chance explains:
    for a moment a coarse signal that is not held any more repeats itself, too."""
    run = signal.repetition.run
    ever_since = run >= signal.faulty_scans
    return is_held(signal) and (ever_since or is_beyond_chance(signal.repetition, run))


@inner
def still_shows(signal):
    """Whether it has said the same ever since its fault began, or for longer than chance would have
    it, or is rough now."""
    return still_repeats(signal) or is_rough(signal.roughness)
