"""The radar's two signals held against the lead's track, scan by scan (robust profile)."""

from math import exp, isfinite, sqrt

import numpy as np

from lfd_diagnosis.evidence import repeats
from lfd_diagnosis.held_radar import should_have_changed
from lfd_diagnosis.held_velocity import follow_held_velocity, take_back_held
from lfd_diagnosis.lead_report import report_deviation
from lfd_diagnosis.lead_track import (
    believe,
    clearance_then,
    correct_clearance,
    correct_velocity,
    inform,
    predict_track,
    velocity_then,
)
from lfd_diagnosis.noise import learn_noise
from lfd_diagnosis.radar_fault_kind import classify
from lfd_diagnosis.radar_jump import move_reference
from lfd_diagnosis.radar_repetition import (
    is_sent_again,
    repeats_with_held,
    stand_both,
    stays_without_noise,
)
from lfd_diagnosis.radar_requalification import look_for_agreement, requalify
from lfd_diagnosis.radar_residual import (
    count_scan,
    deviation_about,
    is_bad,
    learn_swing,
    least_limit,
)
from lfd_diagnosis.radar_signal import forget_usual
from lfd_diagnosis.radar_state import (
    SLOW_STD,
    SLOW_TIME,
    USUAL_BIAS,
    WANDER_TIME,
    WANDERING,
    is_either_held,
    is_radar_faulty,
    is_ready,
    limits_about,
    start_target,
    wander_of,
)
from lfd_diagnosis.radar_suspicion import follow_undrifted, hold_against_path, suspect
from lfd_diagnosis.radar_target import (
    begin_another,
    begin_target,
    change_target,
    doubt_repeated,
    has_another_id,
    is_another_in_part,
    is_settling,
    keeps_target,
    look_for_new_target,
    sort_out_target,
)
from lfd_diagnosis.repetition import (
    excuse_repetition,
    note_change,
    restart_repetition,
    take_repetition,
)
from lfd_diagnosis.roughness import resolution_of, restart_roughness, take_roughness
from lfd_diagnosis.sample import POSSIBLE_JERK, as_measured, is_new
from lfd_diagnosis.scan_rows import begins_to_tell, is_scan
from lfd_diagnosis.travelled_path import LARGEST_GAP
from lfd_diagnosis.unseen_lead import follow_catching_up
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

JOLT_LATE = 0.1
"""Seconds by which radar and host may differ in when a sudden change came."""

DRIVES_OFF = 0.75
"""m/s^2 that no relative velocity drifts by."""

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
    now = radar.now = horizon.stamp * 1e-9
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
        # Both say the same for long; a clearance that jumped there, to zero maybe, tells by it.
        excuse_repetition(radar.velocity.repetition, radar.velocity.faulty)
        if not radar.clearance.faulty:
            restart_repetition(radar.clearance.repetition)
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
            radar.begun_at, radar.begun_beside = clearance.at, np.nan
            # While nothing was seen nothing has agreed.
            for signal in (radar.clearance, radar.velocity):
                signal.lost_since = signal.carried_since = clearance.at
    elif not whole and is_another_in_part(radar, settings, track_id):
        change_target(radar, max(radar.clearance.last_at, radar.velocity.last_at))
        start_target(radar, settings)
    elif not (whole and sort_out_target(radar, settings, track_id)):
        # What is not heard of another id may be another car's: a whole scan tells.
        radar.other_in_part = not whole and has_another_id(radar, track_id)
        if track_id != UNKNOWN_TRACK and not radar.other_in_part:
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
    since = radar.now - radar.before_at
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
        suspect(radar, settings, signal, of_clearance, changed)


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
    if not repeated:
        follow_catching_up(radar, settings)
    clearance_was_faulty, velocity_was_faulty = clearance.faulty, velocity.faulty
    radar.taught &= not velocity.faulty
    follow_undrifted(radar)
    _judge_signal(radar, settings, clearance, measured_clearance, True, repeated)
    _judge_signal(radar, settings, velocity, measured_velocity, False, repeated)
    _doubt_what_was_taught(radar, settings, age, clearance_was_faulty, velocity_was_faulty)
    doubt_repeated(radar)
    if repeated:
        return
    radar.before, radar.before_at = track, radar.now
    _learn_of_scan(radar, settings, clearance_variance, velocity_variance)
    _teach_track(radar, settings, age, relative)
    if not whole:
        return
    if not is_radar_faulty(radar):
        hold_against_path(radar, settings)
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
    if (held and begins) or (both and (held or repeats_with_held(radar))):
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
    if radar.measured_velocity.new and _is_good(velocity) and not repeats_with_held(radar):
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
