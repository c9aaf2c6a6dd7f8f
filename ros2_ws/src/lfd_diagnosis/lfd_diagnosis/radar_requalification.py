"""When a radar's faulty signals are believed again (robust profile)."""

from math import isfinite, sqrt

import numpy as np

from lfd_diagnosis.drift_history import follow_drift, has_stopped
from lfd_diagnosis.lead_track import believe, set_clearance, set_velocity
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_agreement import agrees_long_enough, follow_agreement
from lfd_diagnosis.radar_fault_kind import shows_itself, still_shows
from lfd_diagnosis.radar_jump import (
    came_back_and_shifts,
    has_not_jumped_back,
    look_for_return,
    may_have_shifted,
    note_end,
)
from lfd_diagnosis.radar_residual import deviation_about, is_bad
from lfd_diagnosis.radar_signal import forgive, lose_reference, restart_agreement, size_to_tell
from lfd_diagnosis.radar_state import is_radar_faulty, is_reference_lost, wander_of
from lfd_diagnosis.radar_target import begin_target
from lfd_diagnosis.roughness import resolution_of
from lfd_diagnosis.travelled_path import (
    LEAST_TIME,
    clear_path,
    follow_path,
    path_drift,
    path_length,
    path_limit,
)
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

PATH_SIGMA = 3.0
"""Deviations of the clearance's noise that a path may be off."""

SAID_STD = 0.3
"""How well the lead's acceleration is known by what a relative velocity said before it jumped back,
in m/s^2."""

UNSEEN_TIME = 2.0
"""Seconds for which a relative velocity that jumped away must agree if it was not seen to jump
back: for a moment a coasted reference may come to meet it."""


@inner
def requalify(radar, settings, signal, measured, of_clearance, repeated):
    """Whether a faulty signal is to be believed again."""
    track = radar.track
    period = measured.at - signal.last_at
    step = measured.value - signal.last
    if of_clearance:
        step -= track.velocity * period
    if _rebase_where_undone(radar, settings, signal, measured, of_clearance, repeated, step):
        forgive(signal)
        return
    spread = deviation_about(signal, track.cc if of_clearance else track.vv)
    agreeing = follow_agreement(signal, period, step, spread, settings.gate_sigma)
    latch = settings.latch
    shifted = of_clearance and may_have_shifted(signal, settings.largest_shift)
    needed = settings.requalify_time if shifted else settings.clear_time
    if not of_clearance:
        _follow_agreed_path(radar, period)
        off_path, on_path = _hold_against_path(radar, settings)
        latch = latch and not on_path
        if has_not_jumped_back(signal) and not on_path:
            needed = max(needed, UNSEEN_TIME)
        if off_path:
            restart_agreement(signal)
            agreeing = False
    signal.must_agree = needed if agreeing and needed > settings.clear_time else 0.0
    agrees = agreeing and agrees_long_enough(signal, needed, latch)
    carried = of_clearance and signal.carried and not radar.velocity.faulty
    if carried and not agreeing:
        signal.must_agree = settings.requalify_time
    if carried and measured.at - signal.carried_since >= settings.requalify_time:
        # Nothing else would tell that it ended in between.
        rebase(track, signal, measured.value, of_clearance)
        agrees = True
    if signal.lost:
        # A new target: its own agreement with itself must do, but for longer, unless the fault
        # would show itself.
        if not agreeing:
            signal.lost_since = measured.at
        needed = settings.clear_time if shows_itself(signal) else settings.requalify_time
        signal.must_agree = needed
        agrees = agreeing and measured.at - signal.lost_since >= needed
    if agrees:
        _end_fault(radar, settings, signal, measured, of_clearance)


@inner
def _rebase_where_undone(radar, settings, signal, measured, of_clearance, repeated, step):
    """Take the signal for its reference again where its fault is undone, or it would never agree
    with what is left of that; whether the fault is over with it. `step`: since the scan before,
    beyond the lead's own motion."""
    track = radar.track
    follow_drift(signal, measured.at, settings.requalify_time)
    disagrees = not signal.agreeing and not still_shows(signal)
    shifted = of_clearance and is_bad(signal) and abs(signal.residual) <= settings.largest_shift
    if disagrees and (signal.lost or (shows_itself(signal) and shifted)):
        # Where nothing is known of a target, agreement with what it says begins anew. And while it
        # was held a clearance may have gone over to another part of the car.
        rebase(track, signal, measured.value, of_clearance)
    elif not signal.lost:
        said = signal.residual if of_clearance else measured.value
        level, rise = look_for_return(signal, said, repeated)
        if isfinite(level):
            off = signal.residual - level
            rebase(track, signal, measured.value - off, of_clearance)
            # The newest scan may have jumped on since.
            signal.residual = off
            if not of_clearance:
                # What was wrong about it stayed the same: how it rose was right all along.
                believe(track, rise / radar.period + radar.host, SAID_STD)
        elif of_clearance and came_back_and_shifts(signal, step, settings.largest_shift):
            rebase(track, signal, measured.value, of_clearance)
        elif has_stopped(signal, settings.requalify_time):
            rebase(track, signal, measured.value, of_clearance)
            return True
    return False


@inner
def _end_fault(radar, settings, signal, measured, of_clearance):
    went_on = signal.carried
    note_end(signal, measured.at)
    forgive(signal)
    if not is_radar_faulty(radar):
        # What was followed while it was faulty tells nothing about it now.
        clear_path(radar.path)
    elif went_on and not of_clearance and radar.clearance.carried:
        # One of two faults that went on with another target did not: did the other?
        lose_reference(radar.clearance, measured.at)
        begin_target(radar, settings, radar.id)


@inner
def _follow_agreed_path(radar, period):
    """The path that a faulty relative velocity makes since it began to agree."""
    signal, measured = radar.velocity, radar.measured_velocity
    if signal.agreeing <= period:
        clearance = radar.measured_clearance
        radar.agreed_clearance = clearance.value if clearance.new else np.nan
        radar.agreed_path = 0.0
    else:
        radar.agreed_path += 0.5 * (signal.last + measured.value) * period


@inner
def _hold_against_path(radar, settings):
    """Whether the clearance says that a relative velocity which agrees with a track that was
    coasted for long is still off, or that it is not: half of what it was off would have led as far
    astray, and further than the clearance wanders."""
    signal, clearance = radar.velocity, radar.clearance
    if not radar.measured_clearance.new:
        # The path went on without it.
        return False, False
    if signal.kind != Kind.OFFSET or (clearance.faulty and clearance.kind != Kind.OFFSET):
        return False, False
    off = radar.measured_clearance.value - radar.agreed_clearance - radar.agreed_path
    astray = 0.5 * size_to_tell(signal) * signal.agreeing
    doubt = PATH_SIGMA * deviation(clearance.noise) + resolution_of(clearance.roughness)
    wandered = PATH_SIGMA * sqrt(wander_of(radar, settings))
    return abs(off) > astray + doubt, abs(off) < 0.5 * astray and astray > 2.0 * (doubt + wandered)


@inner
def rebase(track, signal, measured, of_clearance):
    """The jump that made a fault was undone: the signal is the reference again, as it says now."""
    if of_clearance:
        set_clearance(track, measured, signal.noise.variance)
    else:
        set_velocity(track, measured, signal.noise.variance)
    signal.residual = 0.0


@inner
def look_for_agreement(radar, settings):
    """Whether faulty signals agree with each other since: a relative velocity that makes the path
    which the clearance goes is right, whatever the track was coasted to.

    Signals that repeated themselves or were rough are over with it. Others may have been another
    car, of a radar that gives no ids, or a fault that began with the target and ended: they must
    agree with a track of their own for longer.
    """
    clearance, velocity, path = radar.clearance, radar.velocity, radar.path
    over = shows_itself(clearance) and (shows_itself(velocity) or not velocity.faulty)
    if is_reference_lost(radar) or not (velocity.faulty or over):
        return
    if still_shows(clearance) or still_shows(velocity):
        clear_path(path)
        return
    at = radar.measured_clearance.at
    follow_path(
        path, settings, at, radar.measured_clearance.value, radar.measured_velocity.value, 0.0
    )
    limit = path_limit(path, settings, 1.0, resolution_of(clearance.roughness))
    if path_length(path) < (LEAST_TIME if over else settings.drift_window):
        return
    if abs(path_drift(path, settings, limit)) >= 0.5 * limit:
        return
    if over:
        forgive(clearance)
        forgive(velocity)
    else:
        lose_reference(clearance, at)
        lose_reference(velocity, at)
    begin_target(radar, settings, radar.id)
