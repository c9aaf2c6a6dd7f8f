"""Radar signals that repeat themselves, and whether they had reason to change (robust profile)."""

from math import exp, isnan, sqrt

import numpy as np

from lfd_diagnosis.evidence import repeats
from lfd_diagnosis.lead_track import predict_track, set_clearance
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_fault_kind import is_held, repeats_wrongly
from lfd_diagnosis.radar_residual import is_bad
from lfd_diagnosis.radar_state import SLOW_TIME, WANDERING, is_either_held, wander_of
from lfd_diagnosis.repetition import (
    CHANCE,
    is_beyond_chance,
    is_frozen_for,
    repeats_by_itself,
    run_by_chance,
    times_too_long,
    times_unchanged,
)
from lfd_diagnosis.ring import append, at, start_ring
from lfd_diagnosis.roughness import is_noiseless, resolution_of
from lfd_diagnosis.sample import beyond
from lfd_diagnosis.travelled_path import drift_rate
from lfd_mpc.compiled import inner

HELD_PATH, HELD_SIGMA, PATH_STEPS = 0.45, 4.0, 3.0
"""What must have been travelled while the clearance repeats itself: m, deviations of its noise, and
steps of its resolution beside what it wanders by."""

VELOCITY_CHANGE, CHANGE_STEPS, LEAD_DOUBT, HELD_SHARE, HELD_OFF = 0.13, 10.0, 0.15, 0.4, 3.0
"""What tells that a relative velocity which repeats itself should have changed: m/s, and steps of
its resolution, by host and lead, and m/s^2 of doubt about the lead after a second; or deviations of
the clearance's noise by which that leaves the path, filtered by a share."""

TOO_CALM, UNCHANGED_CALM = 1.0, 2.0
"""Seconds, and how many times longer than chance or than ever, for which a clearance whose noise
seldom lets it say the same must do so while nothing tells that it should change."""

SHIFT_SCANS, GRADUALLY, CONFIRMED = 4, 1.5, 0.5
"""Scans in which a clearance goes over to another part of the car, deviations of its noise and
wandering that it must leave the path by beside that, and share of these that it need not if host
and lead say the same."""

NOISE_TIMES, WANDER_TIMES = 1.6, 4.0
"""How many times less noise and wandering of the clearance excuse at most, as a relative velocity
says the same for longer than a healthy one may."""

REFUTED = 2.0
"""Times that by which the clearance may be off by itself, by which it must have been expected to be
off before it says anything that it is not."""

LEAPT, LEAPT_STEPS, LEAPT_CHANCE = 0.15, 2.0, 1e-3
"""m/s, and steps of its resolution, by which a relative velocity must leap to zero, beyond what is
known of it, and probability below which it then repeats that by coincidence: both together are
rarer still."""

UNTOLD = 0.3
"""Share of what tells that a relative velocity without noise should have changed, below which the
clearance's leaving its path does not: it may rightly say the same, and the clearance drift."""

STAYS = 0.1
"""m that are travelled while a clearance stays, so that nothing contradicts that."""

NEAREST = 2.0
"""m below which many a radar says the least clearance that it can tell."""

BLIND_DOUBT = 0.5
"""m/s^2 of doubt about the host while nothing but its accelerometer tells how it moves."""

EXPECTED_SIGMA = 2.0
"""Standard deviations of the track by which what is expected may be off."""

LEAD_AT_REST = 0.5
"""Speed of a lead in m/s below which it brakes no further."""

SETTLES = 0.75
"""Share of its limit by which a clearance settles once both cars stand."""

UNKNOWN_LEAD = 1.5
"""m/s^2 that a lead may accelerate by when it comes into view."""

UNSEEN_LEAD, UNSEEN_LEAST, UNSEEN_MOST = 2.0, 0.2, 0.5
"""m/s^2 that a lead may begin to accelerate by while a radar that lost it says what it knew, and
seconds for which it does so: what repeats itself for less does so by coincidence, what does for
longer is calm, coarse, or held."""

WEIGHED, WEIGHS, AT_ONCE = 0.5, 5.0, 0.5
"""Seconds in which the clearance tells whether a relative velocity catches up, deviations that this
must come to, and share of its limit by which it must be off as soon as it says something new."""

FOLLOWS, SURELY_FOLLOWS = 0.5, 0.25
"""Share of what it catches up by that the clearance must show; the same where it repeated itself by
no coincidence: some clearances are late."""

COMPUTED, TOO_SMOOTH = 2.0, 2.0
"""The same at most where the clearance is surely made of what the radar knew, and deviations of its
noise that it would waver by at least, were it measured."""

ROUNDED, STAMPS_WAVER = 1.5, 0.005
"""Steps of its resolution, and s of the way, by which a clearance may waver that is made of a
relative velocity."""

ONE_SCAN = 0.5
"""Scans by which a stamp may waver from that of the scan before."""

CALM_CHANCE = 1e-2
"""Probability below which what repeats itself for a moment may be that of a radar which lost its
target, or whose message is sent again."""

SENT_AGAIN = 0.25
"""Seconds for which a radar's last message may be sent again and again."""

TAKEN_BACK = 2.0
"""Seconds of a held relative velocity that the track can be taken back by."""


@inner
def follow_held_velocity(radar, settings, same):
    """What a relative velocity that repeats itself leaves unsaid: by what was expected of it, host
    and lead going on as they did, and by the clearance."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    if not velocity.new:
        return
    if not (same and radar.has_track):
        if radar.velocity.last_at > radar.held.since:
            radar.held.sees_again_at = velocity.at
            radar.held.unsaid_for = radar.velocity.last_at - radar.held.since
            radar.held.unseen_for = _unseen_for(radar, radar.held.unsaid_for)
            way = radar.velocity.last * (velocity.at - radar.velocity.last_at)
            radar.held.went_on_to = radar.held.clearance + radar.held.beside + way
            # For so short a time a lead goes on as it just did, not as in the mean.
            more = radar.held.track.acceleration - radar.held.lead
            radar.held.unsaid = radar.held.changed + more * radar.held.unsaid_for
        begin_to_hold(radar)
        return
    period = velocity.at - radar.velocity.last_at
    lead = radar.held.lead
    if radar.host_speed + velocity.value < LEAD_AT_REST:
        lead = max(lead, 0.0)
    radar.held.changed += (lead - radar.host) * period
    radar.held.most_changed = max(radar.held.most_changed, abs(radar.held.changed))
    radar.held.expected_off += radar.held.changed * period
    radar.held.clearance += velocity.value * period
    if clearance.new:
        off = clearance.value - radar.held.clearance
        radar.held.least_off = min(radar.held.least_off, off)
        radar.held.most_off = max(radar.held.most_off, off)
        off = _nearest_to_zero(off, off - radar.held.beside)
        # One scan that jumps tells nothing, nor does any alone where both cars may stand for long;
        # with a host speed, which knows a car that stands, waiting for a second one would only be
        # late.
        alone = abs(off - radar.held.off_by_last) > radar.clearance.limit or isnan(radar.host_speed)
        told = _nearest_to_zero(off, radar.held.off_by_last) if alone else off
        radar.held.off += HELD_SHARE * (told - radar.held.off)
        radar.held.off_by_last = off
        radar.held.most_at_once = max(
            radar.held.most_at_once, abs(radar.held.off - at(radar.held.off_lately, 0))
        )
        append(radar.held.off_lately, radar.held.off)
        if _is_refuted(radar, settings) and not _may_be_unseen(radar):
            # What it said so far was right.
            begin_to_hold(radar)


@inner
def _nearest_to_zero(first, second):
    """The one nearer to zero, as what both of them say; 0 where they say the opposite."""
    if first * second <= 0.0:
        return 0.0
    return first if abs(first) < abs(second) else second


@inner
def follow_catching_up(radar, settings):
    """Follow a relative velocity that may say by now, all at once, what it did not say while it
    repeated itself, scan by scan: a radar that lost its target goes on from what it knew."""
    velocity, catching = radar.measured_velocity, radar.catching
    if not velocity.new or radar.velocity.faulty:
        return
    since = velocity.at - catching.since
    if radar.held.sees_again_at == velocity.at and not radar.velocity.confidence:
        _begin_to_catch_up(radar, settings)
        since = 0.0
    elif since > WEIGHED:
        return
    else:
        period = velocity.at - radar.velocity.last_at
        way = 0.5 * (radar.velocity.last + velocity.value) - catching.jump
        catching.clearance += way * period
    if _clearance_tells(radar):
        # Where the lead was lost, it went over to the new relative velocity meanwhile.
        most = catching.jump * (0.5 * catching.lost_for + since)
        catching.told += (radar.measured_clearance.value - catching.clearance) * most
        catching.most += most * most


@inner
def _begin_to_catch_up(radar, settings):
    """The relative velocity has just ceased to repeat itself."""
    held, catching, wavers = radar.held, radar.catching, ONE_SCAN * radar.period
    catching.since = -np.inf
    lasted = held.unsaid_for
    for_a_moment = UNSEEN_LEAST - wavers <= lasted <= max(UNSEEN_MOST + wavers, held.unseen_for)
    if not (settings.check_repetition and for_a_moment) or is_without_noise(radar):
        return
    at = radar.measured_velocity.at
    catching.since, catching.jump = at, radar.velocity.residual
    catching.unsaid = held.unsaid
    catching.lost_for = lasted + at - radar.velocity.last_at
    by_chance = radar.period * run_by_chance(radar.velocity.repetition, CALM_CHANCE)
    catching.surely = by_chance <= lasted
    # What was expected of it all the same.
    expected = radar.measured_velocity.value - radar.velocity.last - catching.jump
    catching.clearance = held.went_on_to + 0.5 * expected * catching.lost_for
    catching.told = catching.most = 0.0


@inner
def catches_up(radar, settings):
    """Whether a relative velocity that is off catches up, for all that is known by now."""
    catching = radar.catching
    if not _may_catch_up(radar) or is_weighed(radar, settings):
        return False
    doubt = radar.velocity.limit + UNSEEN_LEAD * catching.lost_for
    if abs(catching.jump - catching.unsaid) > doubt:
        return False
    if _is_told(radar, settings):
        share = SURELY_FOLLOWS if catching.surely else FOLLOWS
        return catching.told > share * catching.most
    return catching.surely


@inner
def is_weighed(radar, settings):
    """Whether the clearance must yet tell if a relative velocity that is off catches up."""
    lasts = radar.measured_velocity.at - radar.catching.since
    # A zero that goes on tells by itself, and sooner.
    waits = lasts <= WEIGHED - radar.period and not radar.held.leapt_to_zero
    waits = waits and _clearance_tells(radar)
    return _may_catch_up(radar) and waits and not _is_told(radar, settings)


@inner
def _may_catch_up(radar):
    """Whether a relative velocity is off, that way, since it ceased to repeat itself."""
    velocity, jump = radar.velocity, radar.catching.jump
    lasts = radar.measured_velocity.at - radar.catching.since
    at_once = jump * velocity.residual > 0.0 and abs(jump) >= AT_ONCE * velocity.limit
    return lasts <= WEIGHED and at_once


@inner
def _is_told(radar, settings):
    """Whether the clearance tells by now if a relative velocity catches up."""
    variance = radar.clearance.noise.variance + radar.held.track.cc + wander_of(radar, settings)
    return radar.catching.most >= WEIGHS**2 * variance


@inner
def _clearance_tells(radar):
    """Whether the clearance is no more off than that of a radar which catches up."""
    clearance = radar.clearance
    if clearance.faulty or not radar.measured_clearance.new:
        return False
    return not is_bad(clearance) or clearance_catches_up(radar)


@inner
def clearance_catches_up(radar):
    """Whether the clearance says with a relative velocity that catches up what it did not say
    meanwhile, made of the same."""
    jump, path = radar.clearance.residual, radar.catching.jump * radar.catching.lost_for
    return jump * path > 0.0 and abs(jump) <= abs(path) + radar.clearance.limit


@inner
def _may_be_unseen(radar):
    """Whether a relative velocity repeats itself for no longer than a radar goes on without its
    target, and the clearance goes just as that says, as if it were made of it."""
    lasts = radar.velocity.last_at - radar.held.since
    return not radar.held.leapt_to_zero and lasts <= _unseen_for(radar, lasts)


@inner
def _unseen_for(radar, lasts):
    """Seconds for which the radar may have gone on without its target, the clearance just as the
    relative velocity says that repeats itself since `lasts` s; 0 where it does not go so."""
    wavers = STAMPS_WAVER * abs(radar.velocity.last)
    wavers += ROUNDED * resolution_of(radar.clearance.roughness)
    # Without a clearance nothing says so.
    if not 0.0 <= radar.held.most_off - radar.held.least_off <= wavers:
        return 0.0
    # Were it held, it would not have moved along.
    moved = abs(radar.velocity.last) * lasts > wavers
    computed = moved and TOO_SMOOTH * deviation(radar.clearance.noise) > wavers
    return (COMPUTED if computed else UNSEEN_MOST) + ONE_SCAN * radar.period


@inner
def is_sent_again(radar, settings):
    """Whether both signals repeat themselves for a moment, not by coincidence, nor because hardly
    anything moves; what was off is off again."""
    clearance, velocity = radar.clearance, radar.velocity
    if not settings.check_repetition or is_bad(clearance) or is_bad(velocity):
        return False
    if is_without_noise(radar):
        return False
    run = min(clearance.repetition.run, velocity.repetition.run)
    time = run * radar.period
    if isnan(radar.host_speed) or time > SENT_AGAIN:
        return False
    if abs(velocity.last) * time < resolution_of(clearance.roughness):
        return False
    by_chance = run_by_chance(clearance.repetition, CALM_CHANCE)
    return run / by_chance + run / run_by_chance(velocity.repetition, CALM_CHANCE) >= 1.0


@inner
def stand_both(radar):
    """Whether the car stands, and its lead may, too."""
    return not radar.host_moves and abs(radar.measured_velocity.value) < LEAD_AT_REST


@inner
def velocity_seems_held(radar):
    """Whether the relative velocity has said the same for longer than its noise would have it."""
    signal = radar.velocity
    beyond_chance = is_beyond_chance(signal.repetition, signal.repetition.run)
    return beyond_chance and not is_noiseless(signal.roughness)


@inner
def begin_to_hold(radar):
    """A relative velocity may repeat itself from now on."""
    velocity, track = radar.measured_velocity, radar.track
    radar.held.lead = radar.slow_acceleration
    radar.held.slower_lead = radar.slower_acceleration
    radar.held.track = track
    radar.held.time = radar.held.host_gain = radar.held.host_path = 0.0
    # What is held was measured; a zero was not, and may be off from its first sample on.
    expected = track.velocity - velocity.age * (track.acceleration - radar.host)
    vague = EXPECTED_SIGMA * sqrt(track.vv)
    radar.held.changed = beyond(expected, vague) if velocity.value == 0.0 else 0.0
    radar.held.most_changed = abs(radar.held.changed)
    leap = max(LEAPT, LEAPT_STEPS * resolution_of(radar.velocity.roughness))
    radar.held.leapt_to_zero = radar.held.most_changed > leap
    radar.velocity.repetition.odd = 0
    radar.held.since = velocity.at
    radar.held.clearance = track.clearance - velocity.age * track.velocity
    # What it lay beside the track before, beyond its noise, is no reason.
    noise = deviation(radar.clearance.noise)
    radar.held.beside = beyond(radar.beside, noise)
    radar.held.expected_off = radar.held.off = 0.0
    radar.held.off_by_last = radar.held.most_at_once = 0.0
    radar.held.least_off, radar.held.most_off = np.inf, -np.inf
    start_ring(radar.held.off_lately, SHIFT_SCANS)
    append(radar.held.off_lately, 0.0)


@inner
def take_back_held(radar, settings, age):
    """What the track was taught by a relative velocity that only repeated itself: it goes on from
    what it was before."""
    if radar.held.time > TAKEN_BACK:
        return
    track, clearance = radar.track, radar.clearance
    mean = settings.lead_acceleration_mean
    radar.track = radar.held.track
    radar.slow_acceleration = radar.held.lead
    radar.slower_acceleration = radar.held.slower_lead
    predict_track(track, radar.held.time, 0.0, 1.0, mean, settings.jerk_density)
    track.velocity -= radar.held.host_gain
    track.clearance -= radar.held.host_path
    if radar.measured_clearance.new and not clearance.faulty:
        now = radar.measured_clearance.value + age * track.velocity
        if is_bad(clearance):
            clearance.residual = now - track.clearance
        else:
            # It was right all along, and knows by now where the lead is.
            set_clearance(track, now, clearance.noise.variance)
            clearance.residual = 0.0


@inner
def is_stuck(radar, settings, signal, of_clearance, changed):
    """A value repeated for too long, or though it should have `changed`."""
    if of_clearance and 0.0 < signal.last <= NEAREST:
        return False
    if of_clearance and not _repeats_together(radar):
        if changed:
            return is_held(signal)
        moves = radar.host_moves and not _may_both_stand(radar)
        return moves and _is_too_calm(radar)
    if stand_both(radar) or (of_clearance and not radar.host_moves):
        return False
    if not of_clearance:
        if _may_be_unseen(radar):
            return False
        may_stand = _may_both_stand(radar)
        settles = may_stand and abs(radar.held.off) <= SETTLES * radar.clearance.limit
        if not settles and _has_left(radar, settings) and velocity_seems_held(radar):
            return True
        if may_stand and not _repeats_together(radar):
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
def _may_both_stand(radar):
    """Whether both cars may stand, where the host's speed is not known."""
    return isnan(radar.host_speed) and abs(radar.measured_velocity.value) < LEAD_AT_REST


@inner
def _stays_at_zero(repetition):
    """Whether a relative velocity that leapt there is still zero."""
    return repetition.run >= max(repetition.least, run_by_chance(repetition, LEAPT_CHANCE))


@inner
def _repeats_together(radar):
    """Whether the radar says the same again and again: one signal does, the other since then."""
    own, other = radar.clearance.repetition, radar.velocity.repetition
    if stays_without_noise(radar):
        return False
    if own.value == 0.0 and other.value != 0.0:
        # No radar that stopped: it never said that.
        return False
    apart = other.run - own.run
    together = -run_by_chance(own, CHANCE) <= apart <= run_by_chance(other, CHANCE)
    return is_either_held(radar) and together


@inner
def repeats_with_held(radar):
    """Whether a relative velocity has said the same since a clearance that is held did: it may be
    held, too, and teaches nothing."""
    same = radar.velocity.repetition.run > 0 and _repeats_together(radar)
    return same and repeats(radar.clearance.kind)


@inner
def is_without_noise(radar):
    """Whether neither of its signals has any noise."""
    return is_noiseless(radar.clearance.roughness) and is_noiseless(radar.velocity.roughness)


@inner
def stays_without_noise(radar):
    """Whether such signals say that the clearance stays, and it does."""
    most = STAYS + resolution_of(radar.clearance.roughness)
    stays = abs(radar.held.travelled) <= most and not is_either_held(radar)
    return stays and is_without_noise(radar)


@inner
def should_have_changed(radar, settings, of_clearance):
    """Whether a value that repeats itself had reason to change."""
    clearance = radar.clearance
    if _repeats_together(radar):
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
            travelled = _nearest_to_zero(travelled, travelled + rate * held_for)
        return abs(travelled) > moved
    return radar.held.most_changed > _change_in_doubt(radar) or _has_left(radar, settings)


@inner
def _change_in_doubt(radar):
    """How much (m/s) host and lead must have changed a relative velocity that repeats itself."""
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
def _is_refuted(radar, settings):
    """Whether the clearance says that the relative velocity did not change as was expected: it
    should have left the path by far, and has not."""
    if not _is_followed(radar):
        return False
    expected = abs(radar.held.expected_off)
    far = expected > REFUTED * _usually_off(radar, settings)
    return far and abs(radar.held.off) < 0.5 * expected


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
        left = _nearest_to_zero(left, left - rate * held_for)
    return abs(left) > off
