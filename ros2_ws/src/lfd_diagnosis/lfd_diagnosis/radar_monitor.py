"""The radar's two signals held against the lead's track, scan by scan (robust profile)."""

from math import exp, isfinite, sqrt

import numpy as np

from lfd_diagnosis.evidence import Ground, give_ground, repeats
from lfd_diagnosis.healthy_signal import (
    POSSIBLE_JERK,
    as_measured,
    at,
    deviation,
    excuse_repetition,
    is_beyond_chance,
    is_new,
    is_rough,
    learn_noise,
    note_change,
    resolution_of,
    restart_roughness,
    rough_share,
    take_repetition,
    take_roughness,
)
from lfd_diagnosis.held_radar import (
    catches_up,
    clearance_catches_up,
    follow_held_velocity,
    is_sent_again,
    is_stuck,
    should_have_changed,
    stand_both,
    stays_without_noise,
    take_back_held,
    velocity_seems_held,
)
from lfd_diagnosis.lead_report import report_deviation
from lfd_diagnosis.lead_track import (
    believe,
    clearance_then,
    correct_clearance,
    correct_velocity,
    inform,
    predict_track,
    set_clearance,
    set_velocity,
    velocity_then,
)
from lfd_diagnosis.radar_requalification import look_for_agreement, rebase, requalify
from lfd_diagnosis.radar_signal import (
    GRADUAL,
    HARDLY,
    acquit,
    classify,
    convict,
    count_scan,
    deviation_about,
    drifts_by,
    ends_the_last,
    forget_usual,
    forgive,
    is_bad,
    learn_swing,
    least_limit,
    may_be_outliers,
    move_reference,
)
from lfd_diagnosis.radar_state import (
    SLOW_STD,
    SLOW_TIME,
    USUAL_BIAS,
    WANDER_TIME,
    WANDERING,
    go_over,
    is_either_held,
    is_radar_faulty,
    is_ready,
    limits_about,
    start_target,
    wander_of,
    widening,
)
from lfd_diagnosis.radar_target import (
    begin_another,
    begin_target,
    change_target,
    is_another_in_part,
    is_settling,
    keeps_target,
    look_for_new_target,
    sort_out_target,
)
from lfd_diagnosis.scan_rows import begins_to_tell, is_scan
from lfd_diagnosis.travelled_path import (
    BEYOND_WINDOW,
    LARGEST_GAP,
    clear_path,
    explain_drift,
    follow_path,
    is_explainable,
    path_drift,
    path_limit,
    undone_rise,
)
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.samples import UNKNOWN_TRACK
from lfd_mpc.settings import STEP_S

BIAS_SCANS = 40
"""Scans over which it is averaged by how much the clearance lies beside the track for good."""

BESIDE_SHARE = 0.4
"""Share of a scan in what the clearance lately lay beside the track."""

ROUGH_CLEARANCE, ROUGH_VELOCITY = 0.6, 0.2
"""Second differences in m and m/s that are not called rough, however smooth the radar was."""

LEANING, LEANS = 3, 2.0
"""Residuals in a row on one side, beyond so many deviations, after which it is no noise."""

CORRELATION = 3.0
"""Seconds over which the lead's acceleration is known when it is not measured."""

SAME_SCAN = 1.5
"""Scans before the newest one in which both signals jumped if they did so at once."""

CLEARANCE_STD, VELOCITY_STD = 0.22, 0.3
"""How well a track is known, in m and m/s, that a contradiction was explained with."""

JOLT_LATE = 0.1
"""Seconds by which radar and host may differ in when a sudden change came."""

SHIFT_AGAIN = 1.0
"""Seconds in which a radar goes over to another part of the car but once."""

DRIFT_SEEN, DRIFT_DOUBT = 1.0, 0.35
"""Seconds in which it is seen how fast a clearance drifts, and share of a jump of the relative
velocity by which that may differ from it."""

DRIVES_OFF = 0.75
"""m/s^2 that no relative velocity drifts by."""

LEADS_TO_PART = 0.15
"""Share of a jump of the clearance by which it may lead beside where it was before."""

BACK_ON_PATH, LEFT_DOUBT, NEARER = 0.2, 3.0, 0.5
"""Share of a jump of the clearance by which it may lead beside where it came from; or deviations of
what is known of that, and share of the jump from which on it rather leads away."""

UNSEEN = 10.0
"""Seconds for which a new target may be a former one whose clearance is off, or what was believed
of a relative velocity may be wrong."""

ONE_STEP = 1.2
"""Steps of its resolution by which a clearance jumps at least: one step it may take any time."""

ALONE = 0.5
"""Share of the limits within which a scan goes on from before the last one, if that was off."""

COAST_KEEP = exp(-STEP_S / CORRELATION)

FORGETTING = 2.0 / CORRELATION
"""1/s: what a coasting track forgets of the lead's acceleration may as well go on; so much of its
square is added to the density of its jerk. A lead that brakes on for seconds is not steady."""


@inner
def coast_radar(radar, settings, host_acceleration, host_jolt):
    """One step that nothing is known of, the host accelerating as stated (m/s^2)."""
    if radar.has_track:
        _predict(radar, settings, host_acceleration, host_jolt, np.nan)


@inner
def follow_radar(
    radar,
    settings,
    horizon,
    host_acceleration,
    host_jolt,
    lead_acceleration,
    host_speed,
    host_moves,
):
    """Take one step's measurements.

    The host's acceleration in m/s^2 as best known, and by how much it may just have changed at
    once; the lead's, NaN unless the lead says it; the host's speed in m/s, NaN unless it is
    believed, and whether it surely moves, so that equal samples mean something.
    """
    now = horizon.stamp * 1e-9
    radar.host_speed, radar.host_moves = host_speed, host_moves
    if not horizon.has_target and not keeps_target(radar, settings, now):
        if radar.has_track:
            change_target(radar, now)
        start_target(radar, settings)
        return
    if radar.has_track:
        _predict(radar, settings, host_acceleration, host_jolt, lead_acceleration)
    radar.host = host_acceleration
    if not horizon.has_target:
        radar.unseen = True
        return
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    _measure(
        clearance,
        now,
        radar.clearance,
        np.nan if horizon.clearance_stale else horizon.measured_clearance,
        horizon.clearance_age,
    )
    _measure(
        velocity,
        now,
        radar.velocity,
        np.nan if horizon.relative_velocity_stale else horizon.measured_relative_velocity,
        horizon.relative_velocity_age,
    )
    if (clearance.new or velocity.new) and _is_scan(radar, horizon.track_id):
        _scan(radar, settings, horizon.track_id)


@inner
def _is_scan(radar, track_id):
    """Whether the radar says something, if only that all is as it was."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    if not (clearance.new and velocity.new):
        return True
    same_target = track_id == radar.id
    scan = is_scan(radar.rows, clearance.at, clearance.value, velocity.value, same_target)
    if begins_to_tell(radar.rows):
        # How smooth it was, and how often the same, was said of rows.
        forget_usual(radar.clearance)
        forget_usual(radar.velocity)
    return scan


@inner
def _measure(measured, now, signal, value, age):
    measured.new = isfinite(value) and is_new(now - age, signal.last_at)
    measured.at, measured.value, measured.age = now - age, as_measured(value), age


@inner
def _predict(radar, settings, host_acceleration, host_jolt, lead_acceleration):
    track, clearance = radar.track, radar.clearance
    keep, jerk = 1.0, settings.jerk_density
    if radar.velocity.faulty:
        off = track.acceleration - settings.lead_acceleration_mean
        keep, jerk = COAST_KEEP, settings.coasting_jerk_density + FORGETTING * off * off
        # A clearance that is healthy tells more, and nothing that may be wrong.
        if isfinite(lead_acceleration) and clearance.faulty:
            jerk = settings.coasting_jerk_density
            inform(track, lead_acceleration, report_deviation(settings))
    mean = settings.lead_acceleration_mean
    predict_track(track, STEP_S, host_acceleration, keep, mean, jerk)
    track.vv += JOLT_LATE * STEP_S * host_jolt**2
    radar.held.host_path += STEP_S * (radar.held.host_gain + 0.5 * STEP_S * host_acceleration)
    radar.held.host_gain += STEP_S * host_acceleration
    radar.held.time += STEP_S
    if clearance.faulty:
        clearance.coasted += STEP_S
        track.cc += 2.0 * USUAL_BIAS**2 * clearance.coasted * STEP_S
    # A healthy clearance takes the track along; a faulty one would have wandered from it.
    track.cc += STEP_S / WANDER_TIME * wander_of(radar, settings)
    if not radar.velocity.faulty:
        off = track.acceleration - radar.slow_acceleration
        radar.slow_acceleration += STEP_S / SLOW_TIME * off
        off = radar.slow_acceleration - radar.slower_acceleration
        radar.slower_acceleration += STEP_S / SLOW_TIME * off


@inner
def _scan(radar, settings, track_id):
    """One scan, or the one signal of it that is there."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    # Where one of the two is held, the other may be, too.
    held = is_either_held(radar)
    if stand_both(radar):
        # The relative velocity is the same for long.
        excuse_repetition(radar.velocity.repetition, radar.velocity.faulty)
    learn = radar.host_moves and not held
    steady = stays_without_noise(radar)
    same_clearance = clearance.new and _repeats(radar.clearance, clearance.value, learn, steady)
    same_velocity = velocity.new and _repeats(radar.velocity, velocity.value, learn, steady)
    whole = clearance.new and velocity.new
    period = clearance.at - radar.clearance.last_at
    unheard = clearance.at - radar.velocity.last_at
    # What was travelled while nothing was seen, or nothing heard of how fast, is hardly known.
    followed = not radar.velocity.faulty and max(period, unheard) < LARGEST_GAP
    if not (same_clearance and radar.has_track and followed):
        radar.held.travelled = 0.0
    elif radar.host_moves or _drives_off(radar):
        radar.held.travelled += radar.track.velocity * period
    follow_held_velocity(radar, settings, same_velocity)
    if not radar.has_track:
        if whole:
            begin_target(radar, settings, track_id)
            radar.begun_at = clearance.at
            # While nothing was seen nothing has agreed.
            for signal in (radar.clearance, radar.velocity):
                signal.lost_since = signal.carried_since = clearance.at
    elif not whole and is_another_in_part(radar, settings, track_id):
        change_target(radar, max(radar.clearance.last_at, radar.velocity.last_at))
        start_target(radar, settings)
    elif not (whole and sort_out_target(radar, settings, track_id)):
        if track_id != UNKNOWN_TRACK:
            radar.id = track_id
        radar.scans += 1
        _judge(radar, settings, same_clearance and same_velocity and _says_again(radar, settings))
    if clearance.new:
        radar.clearance.last, radar.clearance.last_at = clearance.value, clearance.at
    if velocity.new:
        radar.velocity.last, radar.velocity.last_at = velocity.value, velocity.at


@inner
def _repeats(signal, value, learn, steady):
    """Take a value of a signal; whether it repeats the one before. What goes on steadily tells
    nothing of how often that is a coincidence."""
    learn = learn and not signal.faulty and not (steady and signal.repetition.run > 0)
    return take_repetition(signal.repetition, value, learn)


@inner
def _says_again(radar, settings):
    """Whether a radar that says the same as before has nothing new to say, as one that says
    everything twice, or whose last message is sent again; where the car stands both signals may be
    as they were."""
    if not (radar.host_moves and settings.check_repetition):
        return False
    return radar.clearance.repetition.run == 1 or is_sent_again(radar, settings)


@inner
def _drives_off(radar):
    """Whether the lead of a car that stands surely drives off, faster than a relative velocity
    drifts: else either of the two may be wrong that say that one still stands."""
    changes = radar.measured_velocity.value != radar.velocity.last
    return changes and radar.slow_acceleration > DRIVES_OFF


@inner
def _hold_against(signal, measured, prediction, limit, repeated):
    if measured.new and not repeated:
        signal.residual, signal.limit = measured.value - prediction, limit


@inner
def _hold_scan(radar, settings, age, repeated):
    """Hold a scan of `age` s against the track."""
    track, limits = radar.track, limits_about(radar, settings)
    relative = track.acceleration - radar.host
    expected = clearance_then(track, age, relative)
    _hold_against(radar.clearance, radar.measured_clearance, expected, limits[0], repeated)
    expected = velocity_then(track, age, relative)
    _hold_against(radar.velocity, radar.measured_velocity, expected, limits[1], repeated)


@inner
def _try_without_last(radar, settings, age):
    """Take the track as it was before the last scan to now; whether a scan that disagrees goes on
    from there: then the last one alone was off, by less than the limits, and is not believed any
    more."""
    clearance, velocity, before = radar.clearance, radar.velocity, radar.before
    if is_radar_faulty(radar) or not (is_bad(clearance) or is_bad(velocity)):
        return False
    since = radar.measured_clearance.at + radar.measured_clearance.age - radar.before_at
    if since > LARGEST_GAP:
        return False
    relative, mean = before.acceleration - radar.host, settings.lead_acceleration_mean
    predict_track(before, since, radar.host, 1.0, mean, settings.jerk_density)
    off_clearance = radar.measured_clearance.value - clearance_then(before, age, relative)
    off_velocity = radar.measured_velocity.value - velocity_then(before, age, relative)
    return (
        abs(off_clearance) <= ALONE * clearance.limit
        and abs(off_velocity) <= ALONE * velocity.limit
    )


@inner
def _judge_signal(radar, settings, signal, measured, of_clearance, repeated):
    """Count a scan of one signal: whether it becomes faulty, or is to be believed again."""
    if not measured.new:
        return
    healthy = not is_radar_faulty(radar) and not is_bad(signal)
    period = measured.at - signal.last_at
    possible = ROUGH_CLEARANCE
    if not of_clearance:
        possible = max(ROUGH_VELOCITY, POSSIBLE_JERK * period * period)
    if radar.leap.scans and radar.leap.far and not signal.faulty:
        # It may be another target for a moment: how far they lie apart is no noise.
        restart_roughness(signal.roughness)
    elif not repeated:
        take_roughness(signal.roughness, measured.at, measured.value, healthy, possible)
    # Of two scans alike the second counts as well: a fault must be told by then.
    count_scan(signal, settings.scan_confidence_max)
    changed = should_have_changed(radar, settings, of_clearance)
    note_change(signal.repetition, changed)
    if signal.faulty:
        signal.faulty_at = measured.at
        classify(signal, settings, changed)
        requalify(radar, settings, signal, measured, of_clearance, repeated)
    elif is_ready(radar):
        _suspect(radar, settings, signal, of_clearance, changed)


@inner
def _judge(radar, settings, repeated):
    """Hold a scan against the track, then teach the track what is good of it."""
    track, clearance, velocity = radar.track, radar.clearance, radar.velocity
    measured_clearance, measured_velocity = radar.measured_clearance, radar.measured_velocity
    whole = measured_clearance.new and measured_velocity.new
    age = 0.0
    if measured_clearance.new:
        age = measured_clearance.age
    if measured_velocity.new:
        age = max(age, measured_velocity.age)
    _hold_scan(radar, settings, age, repeated)
    if not repeated and whole and _try_without_last(radar, settings, age):
        radar.track = radar.before
        for signal in (clearance, velocity):
            signal.outliers += is_bad(signal)
        _hold_scan(radar, settings, age, repeated)
    relative = track.acceleration - radar.host
    clearance_variance, velocity_variance = track.cc, track.vv
    if whole and is_settling(radar):
        begin_target(radar, settings, radar.id)
        return
    if not repeated and look_for_new_target(radar):
        begin_another(radar, settings, radar.id)
        return
    clearance_was_faulty, velocity_was_faulty = clearance.faulty, velocity.faulty
    radar.taught &= not velocity.faulty
    _follow_undrifted(radar)
    _judge_signal(radar, settings, clearance, measured_clearance, True, repeated)
    _judge_signal(radar, settings, velocity, measured_velocity, False, repeated)
    _doubt_what_was_taught(radar, settings, age, clearance_was_faulty, velocity_was_faulty)
    if repeated:
        return
    radar.before, radar.before_at = track, measured_clearance.at + measured_clearance.age
    _learn_of_scan(radar, settings, clearance_variance, velocity_variance)
    _teach_track(radar, settings, age, relative)
    if not whole:
        return
    if not is_radar_faulty(radar):
        _follow_path(radar, settings)
    elif clearance.faulty:
        look_for_agreement(radar, settings)


@inner
def _doubt_what_was_taught(radar, settings, age, clearance_was_faulty, velocity_was_faulty):
    """A relative velocity whose fault is found was wrong before: undo what the track learnt of it
    while it was held, and believe the lead to go on as it did in the mean."""
    clearance, velocity = radar.clearance, radar.velocity
    begins = velocity.faulty and not velocity_was_faulty
    held = repeats(velocity.kind)
    both = repeats(clearance.kind) and not clearance_was_faulty
    if held and (begins or both):
        take_back_held(radar, settings, age)
    if begins or (held and both):
        believe(radar.track, 2.0 * radar.slow_acceleration - radar.slower_acceleration, SLOW_STD)


@inner
def _is_good(signal):
    """Whether the newest scan of a signal may teach anything."""
    return not signal.faulty and not is_bad(signal)


@inner
def _learn_of_scan(radar, settings, clearance_variance, velocity_variance):
    """Learn each signal's noise from a scan all of which is good; the variances (m^2, m^2/s^2) are
    the track's before that scan."""
    clearance, velocity = radar.clearance, radar.velocity
    has_clearance, has_velocity = radar.measured_clearance.new, radar.measured_velocity.new
    if (has_clearance and not _is_good(clearance)) or (has_velocity and not _is_good(velocity)):
        return
    if has_clearance:
        # What it lies beside the track for good is no noise: that would widen the limits and
        # leave the track to the relative velocity alone, which takes it further away.
        _learn(clearance, settings, clearance.residual - clearance.bias, clearance_variance)
    if has_velocity:
        _learn(velocity, settings, velocity.residual, velocity_variance)


@inner
def _teach_track(radar, settings, age, relative):
    """Correct the track by what is good of a scan of `age` s; `relative`: the lead's acceleration
    less the host's (m/s^2) before that."""
    track, clearance, velocity = radar.track, radar.clearance, radar.velocity
    takes_clearance = radar.measured_clearance.new and _is_good(clearance)
    if takes_clearance:
        variance = clearance.noise.variance
        if velocity.faulty:
            variance += WANDERING * wander_of(radar, settings)
        correct_clearance(track, clearance.residual, variance)
    if radar.measured_velocity.new and _is_good(velocity):
        then = velocity_then(track, age, track.acceleration - radar.host)
        before = track.clearance
        correct_velocity(track, radar.measured_velocity.value - then, velocity.noise.variance)
        if not radar.taught and clearance.faulty:
            # The first scan that is believed again.
            move_reference(clearance, track.clearance - before)
        radar.taught = True
    if takes_clearance and not is_radar_faulty(radar):
        beside = radar.measured_clearance.value - clearance_then(track, age, relative)
        clearance.bias += (beside - clearance.bias) / BIAS_SCANS
        radar.beside += BESIDE_SHARE * (beside - radar.beside)


@inner
def _learn(signal, settings, off, variance):
    """Noise is now on this side, now on that; what stays on one side is something else."""
    # The steps of a coarse signal are noise, though they stay on one side for a while.
    usual = LEANS * deviation_about(signal, variance) + resolution_of(signal.roughness)
    if abs(off) <= usual or off * signal.leaning < 0.0:
        signal.leaning = 0.0
    if abs(off) > usual:
        signal.leaning += 1.0 if off > 0.0 else -1.0
    if abs(signal.leaning) <= LEANING:
        learn_noise(signal.noise, off, variance)
        # After a silence or a fault it is the track that is off.
        if settings.gate_sigma * sqrt(variance) <= least_limit(signal):
            learn_swing(signal, off)


@inner
def _suspect(radar, settings, signal, of_clearance, changed):
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
    if not (right or may_be_outliers(signal)):
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
    if clearance_catches_up(radar, settings):
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
        if clearance_catches_up(radar, settings):
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
    jump, beside = radar.clearance.residual, radar.elsewhere
    hardly = abs(jump) <= min(HARDLY * radar.clearance.limit, settings.largest_shift)
    back = beside * jump < 0.0 and abs(beside + jump) < LEADS_TO_PART * abs(jump)
    return settings.check_drift and hardly and back


@inner
def _convict_of_unseen(radar, settings):
    """Convict a clearance that jumps back from where a fault had put it whose beginning nobody
    saw; whether it does."""
    jump, measured = radar.clearance.residual, radar.measured_clearance
    lately = radar.clearance.last_at - radar.begun_at < UNSEEN
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
    give_ground(clearance.because, Ground.RESIDUAL, jump, clearance.limit, 0.0)
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
    lately = radar.measured_clearance.at - radar.velocity.faulty_at < UNSEEN
    return isfinite(radar.undrifted) and lately


@inner
def _follow_undrifted(radar):
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
def _follow_path(radar, settings):
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
    if settings.check_drift and abs(drift) > limit and is_explainable(path):
        _explain(radar, settings, drift, limit, path.reach)


@inner
def _explain(radar, settings, difference, limit, reach):
    """Clearance and relative velocity contradict each other in the last `reach` s: convict one."""
    path, track, drift = radar.path, radar.track, radar.drift
    clearance, velocity = radar.clearance, radar.velocity
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
    # Blamed again, for what goes on.
    undrifted = radar.undrifted if _was_blamed(radar) else path.clearance - difference
    set_clearance(track, path.clearance, CLEARANCE_STD**2)
    set_velocity(track, path.velocity - drift.error, VELOCITY_STD**2)
    acquit(clearance)
    velocity.residual = drift.error
    give_ground(velocity.because, Ground.PATH, difference, limit, 0.0)
    _convict(radar, settings, velocity, drift.kind)
    radar.undrifted = undrifted
