"""Whether a radar signal that repeats itself is held, by chance and by its reasons to change."""

from math import exp, isnan, sqrt

from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_fault_kind import is_held, repeats_wrongly
from lfd_diagnosis.radar_repetition import (
    may_both_stand,
    repeat_together,
    stand_both,
    velocity_seems_held,
)
from lfd_diagnosis.radar_residual import is_bad
from lfd_diagnosis.radar_state import SLOW_TIME, WANDERING, wander_of
from lfd_diagnosis.repetition import (
    is_frozen_for,
    repeats_by_itself,
    run_by_chance,
    times_too_long,
    times_unchanged,
)
from lfd_diagnosis.roughness import is_noiseless, resolution_of
from lfd_diagnosis.sample import beyond, nearest_to_zero
from lfd_diagnosis.travelled_path import drift_rate
from lfd_diagnosis.unseen_lead import may_be_unseen
from lfd_mpc.compiled import inner

NEAREST = 2.0
"""m below which many radars say the least clearance that they can tell."""

TOO_CALM, UNCHANGED_CALM = 1.0, 2.0
"""Seconds, and how many times longer than chance or than ever, for which a clearance whose noise
seldom lets it say the same must do so while nothing tells that it should change."""

LEAPT_CHANCE = 1e-3
"""Probability below which a relative velocity that leapt to zero repeats that by coincidence: both
together are rarer still."""

SETTLES = 0.75
"""Share of its limit by which a clearance may still move once both cars stand."""

HELD_PATH, HELD_SIGMA, PATH_STEPS = 0.45, 4.0, 3.0
"""What must have been travelled while the clearance repeats itself: m, deviations of its noise, and
steps of its resolution beside what it wanders by."""

VELOCITY_CHANGE, CHANGE_STEPS, LEAD_DOUBT = 0.13, 10.0, 0.15
"""What tells that a relative velocity which repeats itself should have changed by what host and
lead did: m/s, or steps of its resolution, and m/s^2 of doubt about the lead after a second."""

UNKNOWN_LEAD = 1.5
"""m/s^2 that a lead may accelerate by when it comes into view."""

BLIND_DOUBT = 0.5
"""m/s^2 of doubt about the host while its speed is not known."""

HELD_OFF = 3.0
"""Deviations of the clearance's noise and wandering by which it leaves the path of a relative
velocity that should have changed."""

NOISE_TIMES, WANDER_TIMES = 1.6, 4.0
"""How many times less the noise and the wandering of the clearance excuse at most: the less, the
longer a relative velocity says the same than a healthy one may."""

GRADUALLY, CONFIRMED = 1.5, 0.5
"""Deviations of its noise and wandering that a clearance must leave the path by beyond what it did
within a few scans, as it does where another part of the car is seen; and share of these that it
need not if host and lead say the same."""

REFUTED = 2.0
"""How many times farther than by itself the clearance must have been expected to leave the path
before its staying there tells that the relative velocity is right."""

UNTOLD = 0.3
"""Share of what tells that a relative velocity without noise should have changed, below which it
tells nothing that the clearance leaves the path: it may be the clearance that drifts."""


@inner
def is_stuck(radar, settings, signal, of_clearance, changed):
    """Whether a signal has said the same for too long, or though it should have `changed`."""
    if of_clearance and 0.0 < signal.last <= NEAREST:
        return False
    if of_clearance and not repeat_together(radar):
        if changed:
            return is_held(signal)
        moves = radar.host_moves and not may_both_stand(radar)
        return moves and _is_too_calm(radar)
    if stand_both(radar) or (of_clearance and not radar.host_moves):
        return False
    if not of_clearance:
        if may_be_unseen(radar):
            return False
        may_stand = may_both_stand(radar)
        settles = may_stand and abs(radar.held.off) <= SETTLES * radar.clearance.limit
        if not settles and _has_left(radar, settings) and velocity_seems_held(radar):
            return True
        if may_stand and not repeat_together(radar):
            return False
        if radar.held.leapt_to_zero and _stays_at_zero(signal.repetition):
            return True
        if not changed and _is_followed(radar) and repeats_by_itself(signal.repetition):
            # What it repeats is still true.
            return False
    return repeats_wrongly(signal, changed)


@inner
def _is_too_calm(radar):
    """Whether a clearance says the same for too long, though nothing tells that it should change:
    not even its noise does."""
    repetition = radar.clearance.repetition
    long = not is_noiseless(radar.clearance.roughness) and repetition.run * radar.period >= TOO_CALM
    unchanged = times_unchanged(repetition, UNCHANGED_CALM)
    return long and is_frozen_for(repetition, False, unchanged)


@inner
def _stays_at_zero(repetition):
    """Whether a relative velocity that leapt there is still zero."""
    return repetition.run >= max(repetition.least, run_by_chance(repetition, LEAPT_CHANCE))


@inner
def should_have_changed(radar, settings, of_clearance):
    """Whether a value that repeats itself had reason to change."""
    clearance = radar.clearance
    if repeat_together(radar):
        return True
    if of_clearance:
        # Where both say the same, they are told together.
        longer = 1.0 if is_held(radar.velocity) else times_too_long(clearance.repetition)
        moved = max(
            max(HELD_PATH, HELD_SIGMA * deviation(clearance.noise)) / longer,
            PATH_STEPS * clearance.roughness.resolution + sqrt(wander_of(radar, settings)),
        )
        travelled = radar.held.travelled
        if abs(travelled) > moved:
            # Where the path was wrong before, it is no reason.
            held_for = clearance.repetition.run * radar.period
            rate = _rate_before(radar, clearance.last_at - held_for)
            travelled = nearest_to_zero(travelled, travelled + rate * held_for)
        return abs(travelled) > moved
    return radar.held.most_changed > _change_in_doubt(radar) or _has_left(radar, settings)


@inner
def _change_in_doubt(radar):
    """How far (m/s) host and lead must have changed a relative velocity to be a reason: the longer
    it lasts, the less is known of both."""
    velocity = radar.velocity
    step, held_for = resolution_of(velocity.roughness), velocity.last_at - radar.held.since
    # A lead whose relative velocity was faulty is known no better than one that came into view.
    known_for = max(radar.held.since - max(radar.begun_at, velocity.faulty_at), 0.0)
    change = max(VELOCITY_CHANGE, CHANGE_STEPS * step) + LEAD_DOUBT * max(held_for - 1.0, 0.0)
    change += UNKNOWN_LEAD * exp(-known_for / SLOW_TIME) * held_for
    return change + BLIND_DOUBT * held_for if isnan(radar.host_speed) else change


@inner
def _rate_before(radar, time):
    """How fast clearance and path came apart (m/s) before one of the signals was held."""
    return drift_rate(radar.path, radar.clearance.noise.variance, time)


@inner
def _is_followed(radar):
    """Whether a clearance tells of the path since the relative velocity began to repeat itself."""
    clearance = radar.clearance
    # Off, now or as that began, or held itself, it tells nothing.
    was_off = clearance.faulty or clearance.faulty_at >= radar.held.since
    useless = was_off or is_bad(clearance) or is_held(clearance)
    return clearance.last_at > radar.held.since and not useless


@inner
def _usually_off(radar, settings):
    """How far (m) the clearance may be off the path of a relative velocity that repeats itself
    rightly."""
    return HELD_OFF * _beside(radar, settings, WANDERING) + _rounded(radar)


@inner
def _beside(radar, settings, share):
    """Deviation (m) of the clearance's noise, and a share of how it wanders: the longer the
    relative velocity says the same, the less that excuses."""
    times = times_too_long(radar.velocity.repetition)
    noise = deviation(radar.clearance.noise) / min(times, NOISE_TIMES)
    wander = share * wander_of(radar, settings) / min(times, WANDER_TIMES) ** 2
    return sqrt(noise * noise + wander)


@inner
def _rounded(radar):
    """What is lost (m) between the steps of both signals' resolutions meanwhile."""
    held_for = radar.velocity.last_at - radar.held.since
    lost = resolution_of(radar.velocity.roughness) * held_for
    return 0.5 * (lost + resolution_of(radar.clearance.roughness))


@inner
def _has_left(radar, settings):
    """Whether the clearance has left the path of a relative velocity that repeats itself: by far,
    or little by little, as it does not where another part of the car is seen."""
    if not _is_followed(radar):
        return False
    changed = radar.held.most_changed >= UNTOLD * _change_in_doubt(radar)
    if is_noiseless(radar.velocity.roughness) and not changed:
        return False
    left, once = radar.held.off, radar.held.most_at_once
    if _has_left_by(radar, left, _usually_off(radar, settings)):
        return True
    little = GRADUALLY * _beside(radar, settings, 1.0)
    if radar.held.changed * left > 0.0:
        told = min(abs(radar.held.changed) / _change_in_doubt(radar), 1.0)
        little *= 1.0 - CONFIRMED * told
    return _has_left_by(radar, beyond(left, once), little + _rounded(radar))


@inner
def _has_left_by(radar, left, off):
    """Whether a clearance that `left` its path by so much (m) did so by more than `off`."""
    if abs(left) > off:
        # What had been leaving it before leaves it for another reason.
        held_for = radar.velocity.last_at - radar.held.since
        rate = _rate_before(radar, radar.held.since)
        left = nearest_to_zero(left, left - rate * held_for)
    return abs(left) > off


@inner
def is_refuted(radar, settings):
    """Whether the clearance says that the relative velocity did not change as was expected: it
    should have left the path by far, and has not."""
    if not _is_followed(radar):
        return False
    expected = abs(radar.held.expected_off)
    far = expected > REFUTED * _usually_off(radar, settings)
    return far and abs(radar.held.off) < 0.5 * expected
