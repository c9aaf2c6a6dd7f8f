"""By how much a relative velocity that repeats itself should have changed, and did not."""

from math import isnan, sqrt

import numpy as np

from lfd_diagnosis.held_radar import is_refuted
from lfd_diagnosis.lead_track import predict_track, set_clearance
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_repetition import LEAD_AT_REST
from lfd_diagnosis.radar_residual import is_bad
from lfd_diagnosis.ring import append, at, start_ring
from lfd_diagnosis.roughness import resolution_of
from lfd_diagnosis.sample import beyond, nearest_to_zero
from lfd_diagnosis.unseen_lead import may_be_unseen, unseen_for
from lfd_mpc.compiled import inner

LEAPT, LEAPT_STEPS = 0.15, 2.0
"""m/s, and steps of its resolution, the larger of both, by which a relative velocity must leap to
zero, beyond what is known of it, to be suspect."""

EXPECTED_SIGMA = 2.0
"""Standard deviations of the track within which a relative velocity of zero is as expected."""

SHIFT_SCANS = 4
"""Scans in which a clearance goes over to another part of the car."""

HELD_SHARE = 0.4
"""Share of a scan in what the clearance has left the path by."""

TAKEN_BACK = 2.0
"""Seconds of a held relative velocity that can be taken back from the track."""


@inner
def begin_to_hold(radar):
    """The relative velocity may repeat itself from now on: keep what is known of the lead now, to
    tell what should change."""
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
def follow_held_velocity(radar, settings, same):
    """Take a scan whose relative velocity is the `same` as before, or not: how far it should have
    changed meanwhile if host and lead went on as they did, and how far the clearance has left the
    path that it makes."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    if not velocity.new:
        return
    if not (same and radar.has_track):
        if radar.velocity.last_at > radar.held.since:
            radar.held.sees_again_at = velocity.at
            radar.held.unsaid_for = radar.velocity.last_at - radar.held.since
            radar.held.unseen_for = unseen_for(radar, radar.held.unsaid_for)
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
        off = nearest_to_zero(off, off - radar.held.beside)
        # One scan that jumps tells nothing, nor does any alone where both cars may stand for long;
        # with a host speed, which knows a car that stands, waiting for a second one would only be
        # late.
        alone = abs(off - radar.held.off_by_last) > radar.clearance.limit or isnan(radar.host_speed)
        told = nearest_to_zero(off, radar.held.off_by_last) if alone else off
        radar.held.off += HELD_SHARE * (told - radar.held.off)
        radar.held.off_by_last = off
        radar.held.most_at_once = max(
            radar.held.most_at_once, abs(radar.held.off - at(radar.held.off_lately, 0))
        )
        append(radar.held.off_lately, radar.held.off)
        if is_refuted(radar, settings) and not may_be_unseen(radar):
            # What it said so far was right.
            begin_to_hold(radar)


@inner
def take_back_held(radar, settings, age):
    """Undo what a relative velocity that only repeated itself taught the track, if that was not for
    too long: it goes on from what it was before; `age` (s) is that of the newest scan."""
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
