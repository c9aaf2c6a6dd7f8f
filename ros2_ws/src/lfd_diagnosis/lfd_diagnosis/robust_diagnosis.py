"""The robust diagnosis: every signal against independent evidence (`reasons` has the words)."""

from math import isnan

import numpy as np

from lfd_diagnosis.acceleration_direction import may_reverse
from lfd_diagnosis.acceleration_monitor import coast_acceleration, has_evidence, judge_acceleration
from lfd_diagnosis.acceleration_samples import follow_acceleration
from lfd_diagnosis.acceleration_state import ACCELERATION, restart_acceleration, start_acceleration
from lfd_diagnosis.evidence import BECAUSE, CHECK, is_gauged
from lfd_diagnosis.healthy_acceleration import expected_acceleration, expected_std, is_unheard
from lfd_diagnosis.host_speed import is_standing, is_usable
from lfd_diagnosis.lead_report import (
    LEAD_REPORT,
    follow_lead_report,
    is_trusted,
    lead_limit,
    restart_lead,
    tells_unseen,
)
from lfd_diagnosis.radar_agreement import ends_for_all_to_see
from lfd_diagnosis.radar_monitor import coast_radar, follow_radar
from lfd_diagnosis.radar_residual import deviation_about, index_of
from lfd_diagnosis.radar_signal import size_of
from lfd_diagnosis.radar_state import (
    RADAR,
    READY_SCANS,
    are_heard,
    is_radar_faulty,
    is_ready,
    is_reference_lost,
    radar_deviations,
    restart_radar,
    start_radar,
    start_target,
)
from lfd_diagnosis.report_book import BOOK, enter_outcome
from lfd_diagnosis.speed_spacing import is_too_seldom
from lfd_diagnosis.verdict import EVIDENCE, Kind, State, outcome_kind
from lfd_mpc.compiled import entry, inner
from lfd_mpc.settings import STEP_NS

INDEX_LIMIT = 0.5
"""Where a residual equals its limit, the index is one half."""

UNNOTICED, BRIDGED = 30, 600
"""Horizons that may be lost on the way as if nothing was, and steps that may be missing before
everything starts anew: up to then it is the same car on the same road, and nothing is heard."""

BAD_SPEEDS, BAD_REPORTS = 2, 1
"""Samples in a row after which a host speed that jumped, and what the lead says, is faulty."""

VALID_CLEARANCE_STD, VALID_VELOCITY_STD = 2.0, 1.5
"""Standard deviations in m and m/s up to which a coasted signal is offered."""

RADAR_EVIDENCE = np.dtype(
    [
        ("residual", "f8"),
        ("limit", "f8"),
        ("age", "f8"),
        ("outliers", "i8"),
        ("because", BECAUSE),
        ("tellable", "?"),
        ("must_agree", "f8"),
        ("lost", "?"),
    ],
    align=True,
)
"""Figures that the reason of one of the radar's signals is made of; `residual` and `limit` in m or
m/s, `age` and `must_agree` in s. `lost`: its reference is, or another target has come since."""

ROBUST_EVIDENCE = np.dtype(
    [
        ("clearance", RADAR_EVIDENCE),
        ("relative_velocity", RADAR_EVIDENCE),
        ("scans", "i8"),
        ("unseen", "?"),
        ("has_track", "?"),
        ("clearance_std", "f8"),
        ("relative_velocity_std", "f8"),
        ("check", CHECK),
        ("because", BECAUSE),
        ("acceleration_age", "f8"),
        ("acceleration_outliers", "i8"),
        ("may_reverse", "?"),
        ("speed_because", BECAUSE),
        ("speed_faulty", "?"),
        ("speed_doubt", "f8"),
        ("speed_outliers", "i8"),
        ("derivative", "f8"),
        ("speed_every", "f8"),
        ("host_speed_age", "f8"),
        ("lead_because", BECAUSE),
        ("lead_faulty", "?"),
        ("lead_off", "f8"),
        ("lead_limit", "f8"),
        ("lead_age", "f8"),
        ("silent", "?"),
        ("anew", "?"),
    ],
    align=True,
)
"""Figures that the reasons of an outcome are made of: ages in s, what is of the speed in m/s and
m/s^2, of the lead's word in m/s^2, deviations in m and m/s. `anew`: the target has not been ready
since time began anew; `silent`: nothing arrives at all."""

ROBUST_OUTCOME = outcome_kind(ROBUST_EVIDENCE)

HEARD = np.dtype(
    [(name, "?") for name in ("clearance", "relative_velocity", "acceleration", *EVIDENCE)],
    align=True,
)
"""Which inputs were there at all."""

ROBUST_STATE = np.dtype(
    [
        ("radar", RADAR),
        ("acceleration", ACCELERATION),
        ("lead", LEAD_REPORT),
        ("book", BOOK),
        ("last_stamp", "i8"),
        ("begun", "?"),
        ("heard", HEARD),
        ("anew", "?"),
    ],
    align=True,
)
"""State of the robust diagnosis; `last_stamp` (ns) is of the newest horizon, once it has `begun`,
`anew` as in `ROBUST_EVIDENCE`."""


@inner
def start_robust(state, settings):
    """Forget every fault and all that was learnt: everything is judged anew."""
    start_radar(state.radar, settings)
    start_acceleration(state.acceleration, settings)
    restart_lead(state.lead)
    _forget_heard(state.heard)
    state.begun, state.anew = False, True


@inner
def _forget_heard(heard):
    """Nothing was there yet."""
    heard.clearance = heard.relative_velocity = heard.acceleration = False
    heard.host_speed = heard.lead_acceleration = False


@inner
def _note_heard(heard, horizon, lead):
    """Take note of what is there; what is silent later has stopped, whatever happened since."""
    heard.clearance |= not isnan(horizon.clearance_age)
    heard.relative_velocity |= not isnan(horizon.relative_velocity_age)
    heard.acceleration |= not isnan(horizon.acceleration_age)
    heard.host_speed |= not isnan(horizon.host_speed_age)
    # An age is known of messages that were never fit to be used, too.
    heard.lead_acceleration |= lead.heard


@inner
def _follow_time(state, settings, horizon):
    """Coast through steps that are missing; whether signals must be judged anew after it, as where
    time begins anew."""
    radar, host = state.radar, state.acceleration
    steps = (horizon.stamp - state.last_stamp) // STEP_NS if state.begun else 0
    had_begun = state.begun
    state.last_stamp, state.begun = horizon.stamp, True
    if not (had_begun and 1 <= steps <= BRIDGED):
        restart_radar(radar, settings)
        restart_acceleration(host)
        restart_lead(state.lead)
        return had_begun or horizon.restart
    silent = steps > UNNOTICED
    if silent and is_radar_faulty(radar):
        # Stamps may as well have jumped: a lead that is not where it would be is another one.
        radar.unseen = True
    elif silent:
        start_target(radar, settings)
    for _ in range(steps - 1):
        if silent:
            coast_acceleration(host)
        coast_radar(radar, settings, host.acceleration, host.jolt)
    return silent


@inner
def _lead_seen(state, settings, believed):
    """The lead's acceleration as a radar that is `believed` and the host make it, in m/s^2."""
    acceleration = state.acceleration
    host_known = not acceleration.faulty or is_usable(acceleration.speed, settings)
    return state.radar.track.acceleration if believed and host_known else np.nan


@inner
def robust_step(state, settings, horizon, relative_acceleration, outcome):
    """Answer one horizon; `relative_acceleration` in m/s^2 is that of the first observer, NaN
    where the bank did not answer."""
    radar, acceleration, lead = state.radar, state.acceleration, state.lead
    outcome.stamp, outcome.step = horizon.stamp, horizon.step
    outcome.starts_anew = _follow_time(state, settings, horizon)
    follow_acceleration(acceleration, settings, horizon)
    told = lead.acceleration if tells_unseen(lead, settings) else np.nan
    moves = not is_standing(acceleration.speed)
    speed = acceleration.speed.last if is_usable(acceleration.speed, settings) else np.nan
    host, jolt = acceleration.acceleration, acceleration.jolt
    follow_radar(radar, settings, horizon, host, jolt, told, speed, moves)
    state.anew = (state.anew or outcome.starts_anew) and not is_ready(radar)
    # What the observers make of a radar that is not to be believed is not to be believed either.
    seen = horizon.has_target and is_ready(radar)
    fresh = not (horizon.clearance_stale or horizon.relative_velocity_stale)
    believed = seen and fresh and not is_radar_faulty(radar)
    relative = relative_acceleration if believed else np.nan
    velocity = radar.track.velocity if believed else np.nan
    judge_acceleration(acceleration, settings, horizon, relative, velocity, lead)
    follow_lead_report(lead, settings, horizon, _lead_seen(state, settings, believed))
    _note_heard(state.heard, horizon, lead)
    outcome.evidence.silent = False
    _judge_radar(state, settings, horizon, outcome)
    _judge_acceleration(state, settings, horizon, outcome)
    _judge_host_speed(state, settings, horizon, outcome)
    _judge_lead(state, settings, horizon, outcome)
    _reconstruct(state, settings, seen, relative, outcome)
    enter_outcome(state.book, outcome)


@inner
def _say(verdict, state, kind, index, confidence, confidence_threshold, size, size_std):
    verdict.state, verdict.kind = state, kind
    verdict.index, verdict.threshold = index, INDEX_LIMIT
    if state == State.SUSPECT:
        confidence = max(min(confidence, confidence_threshold - 1), 0)
    if state == State.FAULT:
        # A fault that is latched is no less certain for agreeing meanwhile.
        confidence = max(confidence, confidence_threshold)
    verdict.confidence, verdict.confidence_threshold = confidence, confidence_threshold
    verdict.size, verdict.size_std = size, size_std


@inner
def _silent_kind(heard):
    """What the silence of a signal is called that was `heard` before, or never."""
    return Kind.DROPOUT.value if heard else Kind.UNKNOWN.value


@inner
def _judge_signal(radar, settings, horizon, of_clearance, heard, verdict):
    """What is said of one of the radar's signals, which was `heard` before, or never."""
    state, kind, index = State.NOT_READY, Kind.UNKNOWN.value, np.nan
    size = size_std = np.nan
    if of_clearance:
        signal, variance = radar.clearance, radar.track.cc
        measured, stale = horizon.measured_clearance, horizon.clearance_stale
    else:
        signal, variance = radar.velocity, radar.track.vv
        measured, stale = horizon.measured_relative_velocity, horizon.relative_velocity_stale
    if stale:
        state, kind = State.NO_DATA, _silent_kind(heard)
    elif not (horizon.has_target or (signal.faulty and radar.has_track)):
        state = State.NO_TARGET
    elif signal.faulty:
        state, kind, index = State.FAULT, signal.kind, index_of(signal)
        size = size_of(signal)
        if radar.has_track and not isnan(size):
            size_std = deviation_about(signal, variance)
    elif is_ready(radar) and not isnan(signal.residual) and np.isfinite(measured):
        state = State.SUSPECT if signal.confidence else State.OK
        index = index_of(signal)
    threshold = settings.scan_confidence_threshold
    _say(verdict, state, kind, index, signal.confidence, threshold, size, size_std)


@inner
def _give_evidence(evidence, settings, signal, age):
    """What reasons about one of the radar's signals, `age` s old, are made of."""
    evidence.residual, evidence.limit, evidence.age = signal.residual, signal.limit, age
    evidence.outliers, evidence.because = signal.outliers, signal.because
    evidence.tellable = signal.tellable or ends_for_all_to_see(signal) or not settings.latch
    evidence.must_agree = signal.must_agree
    evidence.lost = signal.lost or signal.carried


@inner
def _judge_radar(state, settings, horizon, outcome):
    radar, heard, evidence = state.radar, state.heard, outcome.evidence
    _judge_signal(radar, settings, horizon, True, heard.clearance, outcome.clearance)
    _give_evidence(evidence.clearance, settings, radar.clearance, horizon.clearance_age)
    verdict = outcome.relative_velocity
    _judge_signal(radar, settings, horizon, False, heard.relative_velocity, verdict)
    age = horizon.relative_velocity_age
    _give_evidence(evidence.relative_velocity, settings, radar.velocity, age)
    evidence.scans = min(radar.scans, READY_SCANS)
    evidence.unseen = not horizon.has_target
    evidence.anew = state.anew


@inner
def _judge_acceleration(state, settings, horizon, outcome):
    monitor, evidence = state.acceleration, outcome.evidence
    verdict, kind, index = State.NOT_READY, Kind.UNKNOWN.value, np.nan
    size = size_std = np.nan
    if has_evidence(monitor):
        off = abs(monitor.check.residual)
        index = off / (off + monitor.check.limit)
    if horizon.acceleration_stale:
        verdict, kind = State.NO_DATA, _silent_kind(state.heard.acceleration)
    elif monitor.faulty:
        verdict, kind = State.FAULT, monitor.kind
        if is_gauged(kind):
            size, size_std = monitor.size, monitor.size_std
    elif monitor.check.ground:
        verdict = State.SUSPECT if monitor.confidence else State.OK
    threshold = settings.acceleration_steps
    _say(outcome.acceleration, verdict, kind, index, monitor.confidence, threshold, size, size_std)
    evidence.check, evidence.because = monitor.check, monitor.because
    evidence.acceleration_age = horizon.acceleration_age
    evidence.acceleration_outliers = monitor.outliers
    evidence.may_reverse = verdict == State.SUSPECT and may_reverse(monitor)


@inner
def _judge_host_speed(state, settings, horizon, outcome):
    speed, evidence = state.acceleration.speed, outcome.evidence
    verdict, kind = State.NOT_READY, Kind.UNKNOWN.value
    size = size_std = np.nan
    if settings.use_host_speed:
        if horizon.host_speed_stale:
            verdict, kind = State.NO_DATA, _silent_kind(state.heard.host_speed)
        elif speed.faulty:
            verdict, kind = State.FAULT, speed.kind
            if is_gauged(kind):
                size, size_std = speed.size, speed.size_std
        elif is_usable(speed, settings):
            verdict = State.OK if isnan(speed.doubt.jump) else State.SUSPECT
    bad = 0 if isnan(speed.doubt.jump) else 1
    _say(outcome.host_speed, verdict, kind, np.nan, bad, BAD_SPEEDS, size, size_std)
    evidence.speed_because = speed.because
    evidence.speed_faulty = speed.faulty and settings.use_host_speed
    evidence.speed_doubt, evidence.speed_outliers = speed.doubt.jump, speed.doubt.outliers
    evidence.derivative, evidence.host_speed_age = speed.motion.derivative, horizon.host_speed_age
    evidence.speed_every = speed.spacing.period if is_too_seldom(speed.spacing) else np.nan


@inner
def _judge_lead(state, settings, horizon, outcome):
    lead, evidence = state.lead, outcome.evidence
    verdict, kind, size = State.NOT_READY, Kind.UNKNOWN.value, np.nan
    if settings.use_lead_report:
        if not lead.heard:
            verdict, kind = State.NO_DATA, _silent_kind(state.heard.lead_acceleration)
        elif lead.faulty:
            verdict, size = State.FAULT, lead.off
        elif is_trusted(lead, settings):
            verdict = State.OK
    _say(outcome.lead_acceleration, verdict, kind, np.nan, 0, BAD_REPORTS, size, np.nan)
    evidence.lead_because = lead.because
    evidence.lead_faulty = lead.faulty and settings.use_lead_report
    evidence.lead_off, evidence.lead_limit = lead.off, lead_limit(settings)
    evidence.lead_age = horizon.lead_acceleration_age


@inner
def _reconstruct(state, settings, seen, relative, outcome):
    """Each signal from everything but a faulty one; of a lead that is not `seen` nothing is."""
    radar, acceleration = state.radar, state.acceleration
    made, evidence = outcome.reconstructed, outcome.evidence
    tracked = seen and not is_reference_lost(radar)
    clearance_std, velocity_std = radar_deviations(radar)
    evidence.has_track = tracked
    evidence.clearance_std, evidence.relative_velocity_std = clearance_std, velocity_std
    # A lead that was coasted to behind the own bumper is not there.
    possible = radar.track.clearance >= 0.0
    clearance_known, velocity_known = are_heard(radar)
    made.clearance_valid = (
        tracked and clearance_known and possible and clearance_std <= VALID_CLEARANCE_STD
    )
    made.clearance = radar.track.clearance if made.clearance_valid else np.nan
    made.clearance_std = clearance_std if made.clearance_valid else np.nan
    made.relative_velocity_valid = tracked and velocity_known and velocity_std <= VALID_VELOCITY_STD
    made.relative_velocity = radar.track.velocity if made.relative_velocity_valid else np.nan
    made.relative_velocity_std = velocity_std if made.relative_velocity_valid else np.nan
    made.relative_acceleration_valid = not isnan(relative)
    made.relative_acceleration = relative
    expected = expected_acceleration(acceleration, settings)
    made.acceleration_valid = is_usable(acceleration.speed, settings) or (
        np.isfinite(expected) and not isnan(relative) and not is_unheard(acceleration)
    )
    made.acceleration = expected if made.acceleration_valid else np.nan
    std = expected_std(acceleration, settings)
    made.acceleration_std = std if made.acceleration_valid else np.nan


@inner
def _say_silent(verdict, heard, threshold):
    """Nothing is said any more."""
    _say(verdict, State.NO_DATA, _silent_kind(heard), np.nan, 0, threshold, np.nan, np.nan)


@inner
def robust_silence(state, settings, stamp, outcome):
    """Nothing arrives at all: what is said (of no step) at `stamp` (ns)."""
    heard = state.heard
    outcome.stamp, outcome.step, outcome.starts_anew = stamp, 0, False
    outcome.evidence.silent = True
    scans = settings.scan_confidence_threshold
    _say_silent(outcome.clearance, heard.clearance, scans)
    _say_silent(outcome.relative_velocity, heard.relative_velocity, scans)
    _say_silent(outcome.acceleration, heard.acceleration, settings.acceleration_steps)
    speed = heard.host_speed and settings.use_host_speed
    _say_silent(outcome.host_speed, speed, BAD_SPEEDS)
    lead = heard.lead_acceleration and settings.use_lead_report
    _say_silent(outcome.lead_acceleration, lead, BAD_REPORTS)
    enter_outcome(state.book, outcome)


@entry
def start_robust_entry(state, settings):
    """`start_robust` for callers from outside."""
    start_robust(state[0], settings[0])


@entry
def robust_step_entry(state, settings, horizon, relative_acceleration, outcome):
    """`robust_step` for callers from outside."""
    robust_step(state[0], settings[0], horizon[0], relative_acceleration, outcome[0])


@entry
def robust_silence_entry(state, settings, stamp, outcome):
    """`robust_silence` for callers from outside."""
    robust_silence(state[0], settings[0], stamp, outcome[0])
