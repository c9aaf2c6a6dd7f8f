"""What jumps and drifts of a healthy radar signal mean: whether it still is (robust profile)."""

from math import isfinite

import numpy as np

from lfd_diagnosis.drift_explanation import explain_drift
from lfd_diagnosis.drift_history import drifts_by
from lfd_diagnosis.evidence import Ground, give_ground
from lfd_diagnosis.held_radar import is_stuck
from lfd_diagnosis.lead_track import believe, set_clearance, set_velocity
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_jump import GRADUAL, ends_the_last
from lfd_diagnosis.radar_repetition import velocity_seems_held
from lfd_diagnosis.radar_requalification import rebase
from lfd_diagnosis.radar_residual import HARDLY, is_bad, may_be_outliers
from lfd_diagnosis.radar_signal import acquit, convict, forgive
from lfd_diagnosis.radar_state import go_over, wander_of, widening
from lfd_diagnosis.repetition import is_beyond_chance
from lfd_diagnosis.ring import at
from lfd_diagnosis.roughness import is_rough, resolution_of, rough_share
from lfd_diagnosis.travelled_path import (
    BEYOND_WINDOW,
    HEALTHY,
    clear_path,
    follow_path,
    is_explainable,
    learn_lateness,
    path_drift,
    path_limit,
    undone_rise,
)
from lfd_diagnosis.unseen_lead import catches_up, clearance_catches_up, is_weighed
from lfd_diagnosis.velocity_step import explain_step, least_step, step_limit
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S

SAME_SCAN = 1.5
"""Scans before the newest one in which both signals jumped if they did so at once."""

CLEARANCE_STD, VELOCITY_STD = 0.22, 0.3
"""How well a track is known, in m and m/s, that a contradiction was explained with."""

SHIFT_AGAIN = 1.0
"""Seconds in which a radar goes over to another part of the car but once."""

DRIFT_SEEN, DRIFT_DOUBT = 1.0, 0.35
"""Seconds in which it is seen how fast a clearance drifts, and share of a jump of the relative
velocity by which that may differ from it."""

LEADS_TO_PART = 0.15
"""Share of a jump of the clearance by which it may lead beside where it was before."""

BACK_ON_PATH, LEFT_DOUBT, NEARER = 0.2, 3.0, 0.5
"""Share of a jump of the clearance by which it may lead beside where it came from; or deviations of
what is known of that, and share of the jump from which on it rather leads away."""

UNPROVEN = 10.0
"""Seconds for which a new target may be a former one whose clearance is off, or what was believed
of a relative velocity may be wrong."""

ONE_STEP = 1.2
"""Steps of its resolution by which a clearance jumps at least: one step it may take any time."""


@inner
def suspect(radar, settings, signal, of_clearance, changed):
    """Whether a signal that was healthy still is."""
    if radar.leap.waits:
        return
    stuck = settings.check_repetition and is_stuck(radar, settings, signal, of_clearance, changed)
    if signal.confidence >= settings.scan_confidence_threshold:
        gradual = of_clearance and radar.path.count > 0 and _is_gradual(radar, settings)
        if stuck and gradual:
            _convict_stuck(radar, settings, signal, of_clearance)
        elif of_clearance and _shifts_without_path(radar, settings):
            _take_along(radar)
        elif gradual:
            if abs(signal.residual) > settings.drift_limit and is_explainable(radar.path):
                reach = settings.drift_window + BEYOND_WINDOW
                _explain(radar, settings, signal.residual, signal.limit, reach)
        elif is_bad(signal):
            _judge_jump(radar, settings, signal, of_clearance)
    elif settings.check_roughness and is_rough(signal.roughness) and not is_bad(signal):
        # A jump is rough, too.
        give_ground(signal.because, Ground.ROUGHNESS, rough_share(signal.roughness), 0.0, 0.0)
        _convict(radar, settings, signal, Kind.NOISE)
        _take_bias(radar, settings, of_clearance)
    elif stuck:
        _convict_stuck(radar, settings, signal, of_clearance)


@inner
def _judge_jump(radar, settings, signal, of_clearance):
    """Whether a signal that jumped out of its limits is wrong since, or right again."""
    if _came_back_with_the_other(radar, signal, of_clearance):
        _believe_measured(radar, of_clearance)
        return
    if of_clearance:
        right = _clearance_is_right_again(radar, settings)
    else:
        right = _velocity_is_right_again(radar, settings)
    if not (right or may_be_outliers(signal) or is_weighed(radar, settings)):
        give_ground(signal.because, Ground.RESIDUAL, signal.residual, signal.limit, 0.0)
        _convict(radar, settings, signal, Kind.OFFSET)
        _take_bias(radar, settings, of_clearance)


@inner
def _clearance_is_right_again(radar, settings):
    """Make the clearance the reference again where it jumps back; whether it does."""
    clearance = radar.clearance
    if _leads_back(radar, settings):
        _see_another_part(radar, radar.measured_clearance.value)
        return True
    if catches_up(radar, settings) and clearance_catches_up(radar):
        _believe_measured(radar, True)
        return True
    if _convict_of_unseen(radar, settings):
        return True
    if not ends_the_last(clearance):
        return False
    clearance.ended_size = np.nan
    # What was off was no part of the car.
    _see_another_part(radar, radar.measured_clearance.value)
    radar.elsewhere = 0.0
    return True


@inner
def _velocity_is_right_again(radar, settings):
    """Make the relative velocity the reference again where it jumps back; whether it does."""
    velocity = radar.velocity
    if ends_the_last(velocity):
        velocity.ended_size = np.nan
        _believe_measured(radar, False)
    elif _ends_a_drift(radar):
        _believe_both(radar)
    elif catches_up(radar, settings):
        if clearance_catches_up(radar):
            _believe_measured(radar, True)
        _believe_measured(radar, False)
    else:
        return False
    return True


@inner
def _believe_measured(radar, of_clearance):
    """One signal is right from now on, and the track where it says."""
    if of_clearance:
        rebase(radar.track, radar.clearance, radar.measured_clearance.value, True)
        acquit(radar.clearance)
    else:
        rebase(radar.track, radar.velocity, radar.measured_velocity.value, False)
        acquit(radar.velocity)


@inner
def _shifts_without_path(radar, settings):
    """Whether the clearance goes over to another part of the car, as far as can be told behind a
    relative velocity that is faulty and makes no path: little by little, and not too far."""
    off = abs(radar.clearance.residual)
    return radar.velocity.faulty and off <= settings.largest_shift and _is_gradual(radar, settings)


@inner
def _take_along(radar):
    """The track goes on from where the clearance is."""
    track, clearance, measured = radar.track, radar.clearance, radar.measured_clearance
    since = max(measured.at - radar.shifted_at, STEP_S)
    if since < SHIFT_AGAIN:
        # No part of a car again so soon: what is coasted is off, the lead does not go on as it did.
        off = clearance.residual / since
        set_velocity(track, track.velocity + off, off * off)
        believe(track, track.acceleration, abs(off) / since)
    set_clearance(track, measured.value, CLEARANCE_STD**2)
    radar.shifted_at = measured.at
    acquit(clearance)


@inner
def _see_another_part(radar, clearance):
    """The clearance (m) lies on another part of the same car, and nobody is wrong."""
    go_over(radar, clearance, CLEARANCE_STD**2)
    acquit(radar.clearance)
    radar.clearance.bias = 0.0
    clear_path(radar.path)


@inner
def _leads_back(radar, settings):
    """Whether the clearance is hardly off, and jumps back to the part of the car that was seen
    before, or from where a fault that was too small to be found had put it."""
    if _takes_back(radar):
        return True
    jump, beside = radar.clearance.residual, radar.elsewhere
    hardly = abs(jump) <= min(HARDLY * radar.clearance.limit, settings.largest_shift)
    back = beside * jump < 0.0 and abs(beside + jump) < LEADS_TO_PART * abs(jump)
    return settings.check_drift and hardly and back


@inner
def _takes_back(radar):
    """Whether the clearance is where it was expected before the last silence ended: its first scan
    after that was an old one that came late."""
    soon = radar.measured_clearance.at - radar.regained_at < SHIFT_AGAIN
    off = radar.clearance.residual + radar.regained_beside
    return soon and abs(off) <= radar.clearance.limit


@inner
def _convict_of_unseen(radar, settings):
    """Convict a clearance that jumps back from where a fault had put it whose beginning nobody
    saw; whether it does."""
    jump, measured = radar.clearance.residual, radar.measured_clearance
    lately = radar.clearance.last_at - radar.begun_at < UNPROVEN
    farther = settings.same_car and abs(jump) > settings.largest_shift
    usual = deviation(radar.path.noise)
    if settings.check_drift and _leads_to(jump, undone_rise(radar.path, jump), usual):
        # It had left the path travelled by as much.
        _convict_of_ended(radar, settings, Kind.RAMP)
    elif _was_blamed(radar) and _leads_to(jump, measured.value - jump - radar.undrifted, 0.0):
        # It is where it would be were the relative velocity right.
        forgive(radar.velocity)
        _believe_measured(radar, False)
        _convict_of_ended(radar, settings, Kind.RAMP)
    elif farther and lately and _leads_to(jump, radar.begun_beside, 0.0):
        # The target began as far beside the former one: it is no other car, nor another part.
        _convict_of_ended(radar, settings, Kind.OFFSET)
    else:
        return False
    return True


@inner
def _leads_to(jump, beside, usual):
    """Whether a `jump` (m) leads back to what the clearance was `beside` (m) before it, of which so
    much deviates as is `usual` (m)."""
    back, away = BACK_ON_PATH * abs(jump), NEARER * abs(jump)
    return abs(beside + jump) < max(back, min(LEFT_DOUBT * usual, away))


@inner
def _convict_of_ended(radar, settings, kind):
    """The clearance was off until just now, and is right again."""
    clearance, jump = radar.clearance, radar.clearance.residual
    give_ground(clearance.because, Ground.JUMPED_BACK, jump, clearance.limit, 0.0)
    rebase(radar.track, clearance, radar.measured_clearance.value, True)
    # It was off by what it jumped back by.
    clearance.residual = -jump
    _convict(radar, settings, clearance, kind)
    clearance.at_once = True


@inner
def _came_back_with_the_other(radar, signal, of_clearance):
    """Whether it jumped as the fault of the other signal ended: that of a radar, whose beginning
    nobody saw in this one."""
    other = radar.velocity if of_clearance else radar.clearance
    # What is rough jumps all the time.
    jumped = other.faulty and other.kind == Kind.OFFSET
    return jumped and signal.last_at - other.jumped_back_at <= SAME_SCAN * radar.period


@inner
def _ends_a_drift(radar):
    """Whether the relative velocity jumps back to what the clearance did all along: its own drift
    ends, which had been taken for the clearance's."""
    jump, drift = radar.velocity.residual, drifts_by(radar.clearance, DRIFT_SEEN)
    blamed = radar.clearance.faulty and radar.clearance.because.ground == Ground.PATH
    return blamed and not radar.clearance.lost and abs(jump - drift) < DRIFT_DOUBT * abs(jump)


@inner
def _was_blamed(radar):
    """Whether the relative velocity is, or was lately, blamed for a drift."""
    lately = radar.measured_clearance.at - radar.velocity.faulty_at < UNPROVEN
    return isfinite(radar.undrifted) and lately


@inner
def follow_undrifted(radar):
    """The clearance goes as the relative velocity says that was blamed."""
    velocity, measured = radar.velocity, radar.measured_velocity
    if measured.new:
        period = measured.at - velocity.last_at
        radar.undrifted += 0.5 * (velocity.last + measured.value) * period


@inner
def _believe_both(radar):
    """Both signals are right from now on."""
    forgive(radar.clearance)
    _believe_measured(radar, True)
    _believe_measured(radar, False)
    clear_path(radar.path)


@inner
def _convict_stuck(radar, settings, signal, of_clearance):
    kind = Kind.ZERO if signal.last == 0.0 else Kind.HOLD
    give_ground(signal.because, Ground.REPETITION, signal.repetition.run + 1, 0.0, 0.0)
    _convict(radar, settings, signal, kind)
    _take_bias(radar, settings, of_clearance)


@inner
def _take_bias(radar, settings, of_clearance):
    """A radar's own two signals contradict each other a little, for good: what its clearance would
    say is so far beside a track that its relative velocity carries."""
    if of_clearance:
        radar.track.clearance += radar.clearance.bias
        radar.clearance.bias = 0.0
        # Nor is it known where it has wandered to by then.
        radar.track.cc += 2.0 * wander_of(radar, settings)


@inner
def _jumped(signal):
    """Whether it went out of its limits by one jump, not little by little: a coarse signal's steps
    are larger than they seem."""
    step = abs(at(signal.first, 0) - signal.residual_before)
    resolution = resolution_of(signal.roughness)
    return step > max(GRADUAL * signal.limit - 0.5 * resolution, ONE_STEP * resolution)


@inner
def _is_gradual(radar, settings):
    """Whether the clearance goes out of its limits little by little."""
    signal = radar.clearance
    goes_on = signal.residual_before * signal.residual > 0.0
    return settings.check_drift and goes_on and not _jumped(signal)


@inner
def _convict(radar, settings, signal, kind):
    convict(signal, kind, settings.scan_confidence_max)
    signal.coasted = 0.0
    clear_path(radar.path)
    radar.undrifted = np.nan


@inner
def hold_against_path(radar, settings):
    """Hold the clearance against the path that the relative velocity makes."""
    clearance, velocity, path = radar.clearance, radar.velocity, radar.path
    if is_bad(velocity) or (is_bad(clearance) and not _is_gradual(radar, settings)):
        return
    limit = path_limit(path, settings, widening(radar), resolution_of(clearance.roughness))
    follow_path(
        path,
        settings,
        radar.measured_clearance.at,
        radar.measured_clearance.value,
        radar.measured_velocity.value,
        velocity.residual,
    )
    drift = path_drift(path, settings, limit)
    if settings.learn_noise and abs(drift) < HEALTHY * limit:
        learn_lateness(path)
    if not (settings.check_drift and is_explainable(path)):
        return
    if abs(drift) > limit:
        _explain(radar, settings, drift, limit, path.reach)
        return
    limit = step_limit(path, limit)
    least = least_step(deviation(velocity.noise), resolution_of(velocity.roughness))
    apart = explain_step(path, settings, limit, least, radar.drift)
    if apart:
        _convict_velocity(radar, settings, apart, limit)


@inner
def _explain(radar, settings, difference, limit, reach):
    """Clearance and relative velocity contradict each other in the last `reach` s: convict one."""
    path, track, drift = radar.path, radar.track, radar.drift
    clearance = radar.clearance
    may_be_held = settings.check_repetition and velocity_seems_held(radar)
    if may_be_held and abs(radar.held.off) > 0.5 * abs(difference):
        # Then it is not the clearance that drifts: in a moment the relative velocity tells.
        return
    # That of a coarse radar repeats itself though nothing is held.
    repeats_itself = is_beyond_chance(clearance.repetition, clearance.repetition.run)
    held = repeats_itself and abs(radar.held.travelled) > 0.5 * abs(difference)
    excess, noise = abs(difference) / limit, clearance.noise.variance
    explain_drift(path, settings, reach, excess, held, noise, drift)
    if drift.shifted:
        _see_another_part(radar, path.clearance)
        return
    if not drift.told:
        return
    if drift.of_clearance:
        set_clearance(track, path.clearance - drift.error, CLEARANCE_STD**2)
        clearance.residual = drift.error
        give_ground(clearance.because, Ground.PATH, difference, limit, 0.0)
        _convict(radar, settings, clearance, drift.kind)
        return
    _convict_velocity(radar, settings, difference, limit)


@inner
def _convict_velocity(radar, settings, difference, limit):
    """The relative velocity is wrong since clearance and path came apart by so much (m)."""
    path, track, clearance, velocity = radar.path, radar.track, radar.clearance, radar.velocity
    error, kind = radar.drift.error, radar.drift.kind
    # Blamed again, for what goes on.
    undrifted = radar.undrifted if _was_blamed(radar) else path.clearance - difference
    set_clearance(track, path.clearance, CLEARANCE_STD**2)
    set_velocity(track, path.velocity - error, VELOCITY_STD**2)
    acquit(clearance)
    velocity.residual = error
    give_ground(velocity.because, Ground.PATH, difference, limit, 0.0)
    _convict(radar, settings, velocity, kind)
    radar.undrifted = undrifted
