"""The host's accelerometer where its speed is not known: against the observers and the lead's word.

No car changes its acceleration by metres per second squared within a tenth of a second and keeps it
there, unless the lead seems to do the very same (then it is the accelerometer).
"""

from math import isnan, sqrt

import numpy as np

from lfd_diagnosis.acceleration_shaking import shaking_left, swings_over_bumps
from lfd_diagnosis.acceleration_size import estimate_size
from lfd_diagnosis.acceleration_state import (
    BASE_SHARE,
    BASELINE_DELAY,
    LEARNT_EVERY,
    RADAR_GONE,
    SAMPLES,
    SHARP,
    follow_off,
    has_leapt,
    leapt_lately,
    newest_sample,
)
from lfd_diagnosis.evidence import Ground, is_gauged, set_check
from lfd_diagnosis.host_speed import is_believed
from lfd_diagnosis.lead_report import is_trusted
from lfd_diagnosis.noise import deviation, learn_noise, while_learning
from lfd_diagnosis.ring import append, at, is_full, mean_of, start_ring
from lfd_diagnosis.sample import filter_share
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

SHAKEN_LIMIT, SHAKEN_JUMP_SIGMA = 1.6, 3.0
"""How much larger a jump must be while the road shakes the sensor, and deviations of what a shaking
makes of it that it must exceed."""

JUMP_SIGMA, WARM_UP_CHANGES = 5.0, 30
"""Learnt deviations of such a change that a jump must exceed, and learnt changes over which limits
come down from thrice to once their width."""

SMOOTH = 0.3
"""Time constant in s through which an acceleration is rebuilt from the relative one."""

SWINGS = 16
"""Steps in which a bump swings forth and back twice: their mean must have jumped, too."""

JUMP_MEMORY = 25
"""Steps after a jump in which it is held against the observers."""

BRAKED_TO_REST, RELEASED, ANSWER = 1.5, 1.75, 50
"""m/s^2 of braking that ends at once where a car comes to rest, m/s^2 up to which what is felt
afterwards is its end, and steps after which radar and observers have surely answered it."""

LEAP_STEPS, LEAP_SHARE = 2, 0.75
"""Steps within which an offset jumps, and share of all that has changed by then; brakes that come
on go on for longer."""

ANSWERED_SHARE, BRAKES_SHARE = 0.5, 0.3
"""Share of a jump that the observers answer if it is the car's own, and of one that goes on as
brakes do: behind a lead that brakes as well they see but the rest."""

HEALTHY, STILL_OFF = 0.8, 0.8
"""Share of the limit below which a difference from the lead's word is healthy, and of that of a
jump beyond which what has jumped by more than the limit is still off."""

OWN_SHARE = 0.7
"""Share of its difference from the lead's word that the accelerometer must have made itself."""

BACK_TO_USUAL = 2.0
"""Seconds over which a lead that nothing else is known of goes back to driving as most do."""

RELATIVE_SHARE = share_of(SMOOTH)

SEEN_SHARE = share_of(0.3)
"""Share of a change that observers behind a late radar see in a step, once it is over."""

RESTS_WITH = 0.3
"""m/s of relative velocity up to which the lead may as well rest with the car."""


@inner
def is_resting(relative_velocity):
    """Whether the lead may rest with the car; not where it is not known."""
    return abs(relative_velocity) < RESTS_WITH


@inner
def is_nearing(relative_velocity):
    """Whether the car surely moves, whatever it says itself."""
    return relative_velocity < -RESTS_WITH


@inner
def follow_lead(monitor, relative_acceleration):
    """The lead's acceleration as accelerometer and observers make it."""
    if is_full(monitor.samples) and not (monitor.ticks % LEARNT_EVERY or monitor.faulty):
        learn_noise(monitor.jump_noise, _change(monitor), 0.0)
    gone = isnan(relative_acceleration)
    if gone:
        monitor.radar_gone += 1
        if monitor.radar_gone > RADAR_GONE:
            # What is known of a jump by then is all that ever will be.
            monitor.lead, monitor.own_slow, monitor.jumped_for = np.nan, np.nan, 0
            start_ring(monitor.lead_recent, BASELINE_DELAY)
            start_ring(monitor.own_recent, BASELINE_DELAY)
            return
        relative_acceleration = monitor.relative
    else:
        monitor.radar_gone = 0
    # The injection switches from step to step.
    now = 0.5 * (relative_acceleration + monitor.relative_then)
    monitor.relative_then = relative_acceleration
    if not (gone or monitor.jumped_for):
        monitor.relative = now
    monitor.relative_now = now
    monitor.relative_slow += RELATIVE_SHARE * (now - monitor.relative_slow)
    monitor.lead = monitor.filtered + now
    # After a silence in its fault nothing that it says is the lead's.
    unknown = monitor.faulty and isnan(monitor.lead_slow)
    if not (monitor.confidence or monitor.jumped_for or unknown):
        append(monitor.lead_recent, monitor.lead)
        if isnan(monitor.lead_slow):
            monitor.lead_slow = monitor.lead
        monitor.lead_slow += BASE_SHARE * (at(monitor.lead_recent, 0) - monitor.lead_slow)
        append(monitor.own_recent, monitor.filtered)
        if isnan(monitor.own_slow):
            monitor.own_slow = monitor.filtered
        monitor.own_slow += BASE_SHARE * (at(monitor.own_recent, 0) - monitor.own_slow)


@inner
def against_lead(monitor, settings, relative_velocity, lead_report):
    """Without the host's speed: against its own past, the observers and the lead's word."""
    check = monitor.check
    if monitor.faulty:
        _follow_fault(monitor, settings, lead_report)
        return
    check.ground = Ground.NONE
    if not (monitor.confidence or monitor.jumped_for):
        # How the lead drove before a suspicion counts no longer than that.
        monitor.lead_reference = np.nan
    if not is_full(monitor.lead_recent) or isnan(monitor.lead):
        return
    if is_trusted(lead_report, settings):
        _against_report(monitor, settings, lead_report)
    if settings.use_observers:
        _against_observers(monitor, settings, relative_velocity)


@inner
def _take_if_worse(check, ground, residual, limit):
    """Of several kinds of evidence the one that disagrees most counts."""
    first = check.ground == Ground.NONE
    if first or abs(residual) / limit > abs(check.residual) / check.limit:
        set_check(check, ground, residual, limit, Kind.OFFSET, np.nan)


@inner
def _report_limit(monitor, settings):
    """How far the lead's acceleration as seen may lie from its word, in m/s^2."""
    sigma = settings.acceleration_sigma
    return max(settings.acceleration_limit, sigma * deviation(monitor.report_noise))


@inner
def _follow_unseen(monitor):
    """What the accelerometer lately changed by as a car does: a radar that is late has not seen it
    yet. What leapt is the sensor's own."""
    monitor.unseen *= 1.0 - SEEN_SHARE
    if leapt_lately(monitor):
        monitor.unseen = 0.0
    elif is_full(monitor.own_recent):
        monitor.unseen = max(monitor.unseen, abs(monitor.filtered - at(monitor.own_recent, 0)))


@inner
def _against_report(monitor, settings, lead_report):
    """Blamed only for what it did itself: the lead's word or the radar may be wrong as well."""
    off = monitor.lead - lead_report.acceleration
    share = filter_share(settings.host_speed_filter_time)
    monitor.report_off += share * (off - monitor.report_off)
    residual = monitor.report_off
    own = monitor.filtered - monitor.own_slow
    limit = _report_limit(monitor, settings)
    if abs(residual) < HEALTHY * limit and monitor.ticks % LEARNT_EVERY == 0:
        learn_noise(monitor.report_noise, residual, 0.0)
    if own * residual < 0.0 or abs(own) < OWN_SHARE * abs(residual):
        residual = 0.0
    _follow_unseen(monitor)
    limit += monitor.unseen
    if abs(residual) > limit:
        monitor.lead_reference = monitor.lead_slow
    _take_if_worse(monitor.check, Ground.LEADS_WORD, residual, limit)


@inner
def _change(monitor):
    """By how much the mean of the last samples differs from that just before (m/s^2)."""
    return newest_mean(monitor) - mean_of(monitor.samples, 0, SHARP)


@inner
def newest_mean(monitor):
    """The mean of the last samples (m/s^2)."""
    return mean_of(monitor.samples, SAMPLES - SHARP, SAMPLES)


@inner
def mean_of_swings(monitor):
    """The mean of the last samples that a bump's swings do not change (m/s^2)."""
    return mean_of(monitor.samples, SAMPLES - SWINGS, SAMPLES)


@inner
def _jump_limit(monitor, settings):
    """What no car changes its acceleration by at once, nor this sensor's noise (m/s^2)."""
    # On a bad road, or over a kerb, even the mean of some samples jumps.
    limit = settings.jump_limit * (SHAKEN_LIMIT if monitor.shaking.bad_road else 1.0)
    noise = sqrt(2.0) * shaking_left(monitor, SHARP * STEP_S)
    least = max(limit, SHAKEN_JUMP_SIGMA * noise, JUMP_SIGMA * deviation(monitor.jump_noise))
    # A car that has braked to rest jerks back as it does at no other time.
    least += monitor.stops_from
    return least * while_learning(monitor.jump_noise.count, WARM_UP_CHANGES)


@inner
def ends_braking(monitor):
    """Whether what jumped was braking that ends, as far as it is seen."""
    ended = newest_mean(monitor) < RELEASED
    return monitor.jump_sign > 0.0 and monitor.before < -BRAKED_TO_REST and ended


@inner
def waits(monitor):
    """Whether a jump is not judged before the observers have had the time to answer it."""
    return monitor.jumped_for >= JUMP_MEMORY


@inner
def _leapt(monitor):
    """Whether what jumped did so from one moment to the next, as brakes do not."""
    samples, sign = monitor.samples, monitor.jump_sign
    leap = 0.0
    for k in range(LEAP_STEPS, SAMPLES):
        leap = max(leap, sign * (at(samples, k) - at(samples, k - LEAP_STEPS)))
    return leap > LEAP_SHARE * sign * (newest_sample(monitor) - monitor.before)


@inner
def _answer(monitor):
    """What observers have answered a jump with in the mean (m/s^2): single ones swing as far."""
    return monitor.relative_slow - monitor.relative_before


@inner
def _is_answered(monitor, jumped):
    """Whether the observers have surely answered a jump."""
    share = BRAKES_SHARE if waits(monitor) and not swings_over_bumps(monitor) else ANSWERED_SHARE
    return -monitor.jump_sign * _answer(monitor) > share * jumped


@inner
def _against_observers(monitor, settings, relative_velocity):
    samples, swings = monitor.samples, swings_over_bumps(monitor)
    jump = _change(monitor) if is_full(samples) else 0.0
    limit = _jump_limit(monitor, settings)
    if abs(jump) > limit:
        if not monitor.jumped_for:
            monitor.lead_reference = mean_of(monitor.lead_recent, 0, 2 * BASELINE_DELAY // 3)
            monitor.before = mean_of(samples, 0, SHARP)
            monitor.relative_before = monitor.relative_slow
        monitor.jumped_for, monitor.jump_sign = JUMP_MEMORY, 1.0 if jump > 0 else -1.0
        if swings or ends_braking(monitor) or not _leapt(monitor):
            monitor.jumped_for += ANSWER
    if not monitor.jumped_for:
        _take_if_worse(monitor.check, Ground.OBSERVERS, jump, limit)
        return
    monitor.jumped_for -= 1
    # A jump that the observers answer with the opposite one is the car's own.
    jumped = mean_of_swings(monitor) - monitor.before
    if swings:
        # What swings back is where it was a moment before.
        left = mean_of_swings(monitor) - monitor.own_slow
        jumped = max(min(jumped, 0.0), min(max(jumped, 0.0), left))
    if abs(jump) <= limit and _is_answered(monitor, max(abs(jumped), STILL_OFF * limit)):
        monitor.jumped_for = 0
    if waits(monitor) or (ends_braking(monitor) and not is_nearing(relative_velocity)):
        # It takes the radar a moment to see brakes come on, or a car that jerks back as it stops.
        monitor.confidence = 0
        _take_if_worse(monitor.check, Ground.OBSERVERS, 0.0, STILL_OFF * limit)
        return
    answered = monitor.relative_now - monitor.relative
    if swings:
        # There has been time enough to know it in the mean.
        answered = _answer(monitor)
    residual = jumped + (answered if answered * monitor.jump_sign < 0.0 else 0.0)
    if residual * monitor.jump_sign < 0.0:
        residual = 0.0
    _take_if_worse(monitor.check, Ground.OBSERVERS, residual, STILL_OFF * limit)


@inner
def _was_seen_better(monitor, lead_report):
    """Whether what told of the fault is silent now, rather than wrong: the lead alone would not
    have told of one so small, nor does it tell that it is over."""
    ground = monitor.because.ground
    by_speed = ground == Ground.HOST_SPEED and not monitor.speed.faulty
    by_word = ground == Ground.LEADS_WORD and not lead_report.faulty
    return is_gauged(monitor.kind) and (by_speed or by_word)


@inner
def _follow_fault(monitor, settings, lead_report):
    """A faulty signal against the lead, who goes back to driving as most do."""
    trusted = is_trusted(lead_report, settings)
    mean = settings.lead_acceleration_mean
    if isnan(monitor.lead_reference):
        monitor.lead_reference = monitor.lead_slow
    if isnan(monitor.lead_reference) and not is_believed(monitor.speed):
        # After a silence nothing is known of how the lead drove before, and no speed tells soon.
        monitor.lead_reference = mean
    monitor.lead_reference += STEP_S / BACK_TO_USUAL * (mean - monitor.lead_reference)
    if trusted:
        monitor.lead_reference = lead_report.acceleration
    if isnan(monitor.lead) or isnan(monitor.lead_reference):
        # Nothing to hold it against: it stays what it was.
        if is_gauged(monitor.kind):
            monitor.agreeing = 0.0
        monitor.check.ground = Ground.NONE
        return
    residual = monitor.lead - monitor.lead_reference
    monitor.settled += 1
    follow_off(monitor, residual)
    estimate_size(monitor, residual, False)
    limit = _report_limit(monitor, settings) if trusted else settings.jump_limit
    if not trusted and _was_seen_better(monitor, lead_report):
        residual, limit = monitor.off, min(limit, 0.5 * abs(monitor.size))
        if not has_leapt(monitor, -monitor.size):
            monitor.must_agree = settings.requalify_time
    ground = Ground.LEADS_WORD if trusted else Ground.OBSERVERS
    set_check(monitor.check, ground, residual, limit, monitor.kind, np.nan)
