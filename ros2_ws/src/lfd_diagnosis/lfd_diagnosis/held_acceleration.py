"""An accelerometer that repeats itself, and whether it had reason to change (robust profile)."""

from lfd_diagnosis.acceleration_against_lead import is_nearing
from lfd_diagnosis.acceleration_allowance import allowance_of
from lfd_diagnosis.acceleration_direction import acceleration_by_speed
from lfd_diagnosis.evidence import repeats
from lfd_diagnosis.host_speed import is_believed, is_coarse, is_standing
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.repetition import is_frozen, is_frozen_for, note_change, times_unchanged
from lfd_diagnosis.roughness import is_noiseless, resolution_of
from lfd_mpc.compiled import inner

HELD_CHANGE, HELD_STEPS, SPEED_STEPS = 0.2, 2.5, 0.15
"""m/s^2, steps of its resolution, and of a coarse speed's resolution over the time that its
derivative is filtered for, by which that must change while the accelerometer repeats itself."""

UNCHANGED_NOISY = 3.0
"""How many times longer than chance would have it a noisy accelerometer must repeat itself without
a reason to change."""

ZERO_SIGMA = 2.0
"""Deviations of the slow mean by which a zero may be what speed and slope say."""


@inner
def look_for_hold(monitor, settings, usable, relative_velocity):
    """Take note of whether the newest sample had reason to differ; whether it is held."""
    should_change = _should_have_changed(monitor, settings, usable, relative_velocity)
    if monitor.fresh:
        note_change(monitor.repetition, should_change)
    # What nears its lead moves, but may do so steadily.
    if not (should_change and usable) and is_noiseless(monitor.roughness):
        return False
    # Where noise changes it all the time, a car that moves makes it repeat nothing for long.
    unchanged = times_unchanged(monitor.repetition, UNCHANGED_NOISY)
    return (
        settings.check_repetition
        and is_frozen_for(monitor.repetition, should_change, unchanged)
        # A car that may stand repeats itself for as long as it stands.
        and (not is_standing(monitor.speed) if usable else should_change)
    )


@inner
def is_still_held(monitor):
    """Whether a faulty one says the same again and again: what was held is, whatever told of it,
    until it changes; a coarse sensor repeats itself then as it did before."""
    repetition = monitor.repetition
    # The run that convicted it only grows, and others are shorter.
    held = repeats(monitor.kind) and repetition.run + 1 >= monitor.because.first
    return held or is_frozen(repetition, True)


@inner
def _should_have_changed(monitor, settings, usable, relative_velocity):
    """Whether an accelerometer that repeats itself had reason to change."""
    speed = monitor.speed
    if not usable:
        # Nothing tells a car that stands but that it nears its lead.
        return not is_believed(speed) and is_nearing(relative_velocity)
    change = max(HELD_CHANGE, HELD_STEPS * resolution_of(monitor.roughness))
    if is_coarse(speed):
        # Each of its steps shows in its derivative.
        change += SPEED_STEPS * resolution_of(speed.roughness) / settings.host_speed_filter_time
    change += allowance_of(monitor, settings)
    derivative = acceleration_by_speed(monitor)
    if abs(derivative - monitor.derivative_when_held) > change:
        return True
    # What is held was measured once; a zero was not.
    zero_for = derivative + monitor.slope
    doubt = ZERO_SIGMA * deviation(monitor.slow_noise)
    return monitor.repetition.value == 0.0 and abs(zero_for) > change + doubt
