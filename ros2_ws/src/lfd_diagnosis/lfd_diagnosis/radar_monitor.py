"""The radar's two signals held against the lead's track, scan by scan (robust profile)."""

from math import exp, isfinite, sqrt

import numpy as np

from lfd_diagnosis.evidence import Ground, give_ground
from lfd_diagnosis.healthy_signal import (
    POSSIBLE_JERK,
    as_measured,
    at,
    deviation,
    empty_roughness,
    excuse_repetition,
    is_frozen,
    is_new,
    is_rough,
    learn_noise,
    resolution_of,
    restart_roughness,
    rough_share,
    take_repetition,
    take_roughness,
)
from lfd_diagnosis.lead_track import (
    LEAD_TRACK,
    believe,
    correct_clearance,
    correct_velocity,
    inform,
    predict_track,
    set_clearance,
    set_velocity,
    start_track,
)
from lfd_diagnosis.new_target import LEAP, follow_leap, forget_leap, is_far, is_new_target
from lfd_diagnosis.radar_signal import (
    RADAR_SIGNAL,
    acquit,
    agrees_by_now,
    agrees_long_enough,
    classify,
    convict,
    count_scan,
    deviation_about,
    follow_agreement,
    forgive,
    has_stopped,
    is_bad,
    is_held,
    is_known_offset,
    least_limit,
    may_have_shifted,
    offset_of,
    repeats,
    restart_agreement,
    restart_signal,
    returned_to,
    shows_itself,
    size_to_tell,
    start_signal,
    still_shows,
)
from lfd_diagnosis.travelled_path import (
    DRIFT,
    LARGEST_GAP,
    TRAVELLED_PATH,
    clear_path,
    explain_drift,
    follow_path,
    is_explainable,
    path_drift,
    path_length,
    path_limit,
    start_path,
    wander,
)
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.sampling import UNKNOWN_TRACK
from lfd_mpc.settings import STEP_S

BIAS_SCANS = 40
"""Scans over which it is averaged by how much the clearance lies beside the track for good."""

READY_SCANS, SETTLING = 3, 0.5
"""Scans of one target after which it is judged, and seconds in which one whose first scans
contradict each other is begun anew."""

ROUGH_CLEARANCE, ROUGH_VELOCITY = 0.4, 0.2
"""Second differences in m and m/s that are not called rough, however smooth the radar was."""

LEARNING, FEW_SCANS, SEEN = 40.0, 10, 3.0
"""Scans over which limits come down from thrice to once their width while noise is learnt; sooner,
after some scans, to so many times the largest residual that was seen."""

LEANING, LEANS = 3, 2.0
"""Residuals in a row on one side, beyond so many deviations, after which it is no noise."""

CORRELATION = 3.0
"""Seconds over which the lead's acceleration is known when it is not measured."""

SLOW, SLOW_STD = 0.5, 0.2
"""Seconds over which the lead's acceleration is averaged before it is relied on for long, and how
well it is known then, in m/s^2."""

STANDS = 0.1
"""Share of the host's speed by which a relative velocity is off from that of what stands."""

FIRST_PERIOD, PERIOD_SHARE, MISSED = 0.05, 0.1, 2.5
"""Seconds between two scans before any was seen, share of a new one in their average, and how many
of them are a gap after which the same id may be another target's."""

MEMORY = 0.6
"""Seconds for which a target is remembered under its track id."""

LOST_AFTER = 1.0
"""Seconds of silence after which a target that disagrees is another one, not a fault."""

VELOCITY_BIAS = 0.02
"""m/s by which the relative velocity may be off for good; a coasted clearance drifts with it."""

GRADUAL, GROWN = 0.9, 0.75
"""Share of its limit by which the first bad residual lies beyond the last good one at most where it
came on gradually; share of the present residual that the first bad one is where it still grows."""

HELD_PATH, HELD_SIGMA, HELD_STEPS = 0.45, 4.0, 3.0
"""What must have been travelled while the clearance repeats itself: m, deviations of its noise, and
steps of its resolution."""

HELD_CHANGE, CHANGE_STEPS, LEAD_DOUBT, HELD_SHARE, HELD_OFF = 0.13, 10.0, 0.15, 0.4, 3.0
"""What tells that a relative velocity which repeats itself should have changed: m/s, and steps of
its resolution, by host and lead, and m/s^2 of doubt about the lead after a second; or deviations of
the clearance's noise by which that leaves the path, filtered by a share."""

UNKNOWN_LEAD = 1.5
"""m/s^2 that a lead may accelerate by when it comes into view."""

TAKEN_BACK = 2.0
"""Seconds of a held relative velocity that the track can be taken back by."""

CLEARANCE_STD, VELOCITY_STD = 0.22, 0.3
"""How well a track is known, in m and m/s, that a contradiction was explained with."""

WANDERING, WANDER_TIME = 4.0, 2.0
"""Scans for which a clearance stays where it wandered to: so much less it tells of a velocity; s in
which it wanders so far: the track follows it."""

PATH_SIGMA = 3.0
"""Deviations of the clearance's noise that a path may be off."""

REMEMBERED = 32
"""Targets that are remembered at once."""

COAST_KEEP = exp(-STEP_S / CORRELATION)

FORGETTING = 2.0 / CORRELATION
"""1/s: what a coasting track forgets of the lead's acceleration may as well go on; so much of its
square is added to the density of its jerk. A lead that brakes on for seconds is not steady."""

MEASURED = np.dtype([("new", "?"), ("at", "f8"), ("value", "f8"), ("age", "f8")], align=True)
"""One signal at a step: whether it is new, its time in s, its value and its age in s."""

_SLOT = np.dtype([("id", "i8"), ("at", "f8"), ("track", LEAD_TRACK)], align=True)

RADAR = np.dtype(
    [
        ("clearance", RADAR_SIGNAL),
        ("velocity", RADAR_SIGNAL),
        ("measured_clearance", MEASURED),
        ("measured_velocity", MEASURED),
        ("path", TRAVELLED_PATH),
        ("drift", DRIFT),
        ("track", LEAD_TRACK),
        ("has_track", "?"),
        ("scans", "i8"),
        ("begun_at", "f8"),
        ("period", "f8"),
        ("id", "i8"),
        ("remembered", _SLOT, (REMEMBERED,)),
        ("remembered_count", "i8"),
        ("slow_acceleration", "f8"),
        ("slower_acceleration", "f8"),
        ("host", "f8"),
        ("host_moves", "?"),
        ("host_speed", "f8"),
        ("travelled_while_held", "f8"),
        ("lead_when_held", "f8"),
        ("slower_lead_when_held", "f8"),
        ("changed_while_held", "f8"),
        ("most_changed", "f8"),
        ("held_since", "f8"),
        ("clearance_when_held", "f8"),
        ("off_while_held", "f8"),
        ("track_when_held", LEAD_TRACK),
        ("time_while_held", "f8"),
        ("host_gain_while_held", "f8"),
        ("host_path_while_held", "f8"),
        ("agreed_clearance", "f8"),
        ("agreed_path", "f8"),
        ("lost", "?"),
        ("lost_since", "f8"),
        ("carried", "?"),
        ("carried_since", "f8"),
        ("leap", LEAP),
    ],
    align=True,
)
"""State of one radar's two signals and of its target; `lost_since` (s) counts while `lost`,
`carried_since` while an offset is taken to go on with another target (`carried`).

`agreed_clearance` (m) is what was measured when a faulty relative velocity began to agree again,
`agreed_path` (m) the path that it makes since.
"""


@inner
def start_radar(radar, settings):
    """Begin with nothing."""
    learn = settings.learn_noise
    start_signal(radar.clearance, settings.clearance_floor, settings.clearance_std, 0.03, learn)
    start_signal(
        radar.velocity,
        settings.relative_velocity_floor,
        settings.relative_velocity_std,
        0.015,
        learn,
    )
    start_path(radar.path, learn)
    radar.host_moves, radar.host_speed, radar.period = True, np.nan, FIRST_PERIOD
    radar.lost = radar.carried = False
    _start_target(radar, settings)


@inner
def _start_target(radar, settings):
    radar.has_track = False
    radar.scans = 0
    radar.id = UNKNOWN_TRACK
    radar.remembered_count = 0
    radar.slow_acceleration = radar.slower_acceleration = settings.lead_acceleration_mean
    radar.host = radar.travelled_while_held = 0.0
    radar.lead_when_held = radar.changed_while_held = radar.most_changed = 0.0
    radar.clearance_when_held = radar.off_while_held = 0.0
    clear_path(radar.path)
    forget_leap(radar.leap)
    restart_signal(radar.clearance)
    restart_signal(radar.velocity)


@inner
def restart_radar(radar, settings):
    """Nothing from before counts, faults neither; what was learnt of the noise stays."""
    _start_target(radar, settings)
    radar.lost = radar.carried = False
    forgive(radar.clearance)
    forgive(radar.velocity)


@inner
def is_ready(radar):
    """Whether the target is known long enough to be judged."""
    return radar.has_track and radar.scans >= READY_SCANS


@inner
def is_radar_faulty(radar):
    """Whether either signal is."""
    return radar.clearance.faulty or radar.velocity.faulty


@inner
def _is_either_held(radar):
    """Whether the fault of either signal is that it repeats itself."""
    return repeats(radar.clearance) or repeats(radar.velocity)


@inner
def radar_deviations(radar):
    """Standard deviations of healthy measurements about the track, in m and m/s."""
    if not radar.has_track:
        return np.inf, np.inf
    return (
        deviation_about(radar.clearance, radar.track.cc),
        deviation_about(radar.velocity, radar.track.vv),
    )


@inner
def coast_radar(radar, settings, host_acceleration):
    """One step that nothing is known of, the host accelerating as stated (m/s^2)."""
    if radar.has_track:
        _predict(radar, settings, host_acceleration, np.nan)


@inner
def follow_radar(
    radar, settings, horizon, host_acceleration, lead_acceleration, host_speed, host_moves
):
    """Take one step's measurements.

    The host's acceleration in m/s^2 as best known; the lead's, NaN unless the lead says it; the
    host's speed in m/s, NaN unless it is believed, and whether it surely moves, so that equal
    samples mean something.
    """
    now = horizon.stamp * 1e-9
    radar.host_speed, radar.host_moves = host_speed, host_moves
    if not horizon.has_target:
        if radar.has_track:
            _change_target(radar, now)
        _start_target(radar, settings)
        return
    if radar.has_track:
        _predict(radar, settings, host_acceleration, lead_acceleration)
    radar.host = host_acceleration
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
    if clearance.new or velocity.new:
        _scan(radar, settings, horizon.track_id)


@inner
def _measure(measured, now, signal, value, age):
    measured.new = isfinite(value) and is_new(now - age, signal.last_at)
    measured.at, measured.value, measured.age = now - age, as_measured(value), age


@inner
def _predict(radar, settings, host_acceleration, lead_acceleration):
    track, clearance = radar.track, radar.clearance
    keep, jerk = 1.0, settings.jerk_density
    if radar.velocity.faulty:
        off = track.acceleration - settings.lead_acceleration_mean
        keep, jerk = COAST_KEEP, settings.coasting_jerk_density + FORGETTING * off * off
        if isfinite(lead_acceleration):
            jerk = settings.coasting_jerk_density
            inform(track, lead_acceleration, settings.lead_report_std)
    mean = settings.lead_acceleration_mean
    predict_track(track, STEP_S, host_acceleration, keep, mean, jerk)
    radar.host_path_while_held += STEP_S * (
        radar.host_gain_while_held + 0.5 * STEP_S * host_acceleration
    )
    radar.host_gain_while_held += STEP_S * host_acceleration
    radar.time_while_held += STEP_S
    if clearance.faulty:
        clearance.coasted += STEP_S
        track.cc += 2.0 * VELOCITY_BIAS**2 * clearance.coasted * STEP_S
    else:
        track.cc += STEP_S / WANDER_TIME * _wander(radar, settings)
    if not radar.velocity.faulty:
        off = track.acceleration - radar.slow_acceleration
        radar.slow_acceleration += STEP_S / SLOW * off
        off = radar.slow_acceleration - radar.slower_acceleration
        radar.slower_acceleration += STEP_S / SLOW * off


@inner
def _scan(radar, settings, track_id):
    """One scan, or the one signal of it that is there."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    # Where one of the two is held, the other may be, too.
    held = _is_either_held(radar)
    if not radar.host_moves:
        # Behind a car that stands, too, the relative velocity is the same for long.
        excuse_repetition(radar.velocity.repetition, radar.velocity.faulty)
    learn = radar.host_moves and not held
    same_clearance = clearance.new and take_repetition(
        radar.clearance.repetition, clearance.value, learn and not radar.clearance.faulty
    )
    same_velocity = velocity.new and take_repetition(
        radar.velocity.repetition, velocity.value, learn and not radar.velocity.faulty
    )
    whole = clearance.new and velocity.new
    period = clearance.at - radar.clearance.last_at
    # What was travelled while nothing was seen is hardly known.
    if same_clearance and radar.has_track and not radar.velocity.faulty and period < LARGEST_GAP:
        radar.travelled_while_held += radar.track.velocity * period
    else:
        radar.travelled_while_held = 0.0
    _follow_held_velocity(radar, same_velocity)
    if not radar.has_track:
        if whole:
            _begin(radar, settings, track_id)
            radar.begun_at = clearance.at
    elif not (whole and _is_another(radar, settings, track_id)):
        radar.id = track_id
        radar.scans += 1
        # A sensor that says everything twice has nothing new to say the second time.
        repeated = same_clearance and same_velocity and radar.clearance.repetition.run == 1
        _judge(radar, settings, repeated)
    if clearance.new:
        radar.clearance.last, radar.clearance.last_at = clearance.value, clearance.at
    if velocity.new:
        radar.velocity.last, radar.velocity.last_at = velocity.value, velocity.at


@inner
def _follow_held_velocity(radar, same):
    """What a relative velocity that repeats itself leaves unsaid: by what was expected of it, host
    and lead going on as they did, and by the clearance."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    if not (same and radar.has_track):
        _begin_to_hold(radar)
        return
    period = velocity.at - radar.velocity.last_at
    radar.changed_while_held += (radar.lead_when_held - radar.host) * period
    radar.most_changed = max(radar.most_changed, abs(radar.changed_while_held))
    radar.clearance_when_held += velocity.value * period
    if clearance.new:
        off = clearance.value - radar.clearance_when_held
        radar.off_while_held += HELD_SHARE * (off - radar.off_while_held)


@inner
def _begin_to_hold(radar):
    """A relative velocity may repeat itself from now on."""
    velocity, track = radar.measured_velocity, radar.track
    radar.lead_when_held = radar.slow_acceleration
    radar.slower_lead_when_held = radar.slower_acceleration
    radar.track_when_held = track
    radar.time_while_held = radar.host_gain_while_held = radar.host_path_while_held = 0.0
    # What is held was measured; a zero was not, and may be off from its first sample on.
    expected = track.velocity - velocity.age * (track.acceleration - radar.host)
    radar.changed_while_held = expected if velocity.value == 0.0 else 0.0
    radar.most_changed = abs(radar.changed_while_held)
    radar.held_since = velocity.at
    radar.clearance_when_held = track.clearance - velocity.age * track.velocity
    radar.off_while_held = 0.0


@inner
def _change_target(radar, at):
    """A fault is the sensor's: an offset goes on with another target. Of others nothing is left
    that they could be told from."""
    for signal in (radar.clearance, radar.velocity):
        if signal.faulty and agrees_by_now(signal):
            forgive(signal)
    if not is_radar_faulty(radar):
        return
    if is_known_offset(radar.clearance) and is_known_offset(radar.velocity) and not radar.lost:
        radar.carried, radar.carried_since = True, at
    else:
        radar.lost, radar.lost_since = True, at


@inner
def _begin(radar, settings, track_id):
    """A target that nothing is known of, but for an offset that goes on with it."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    mean = settings.lead_acceleration_mean
    off_clearance = off_velocity = 0.0
    goes_on = is_radar_faulty(radar) and not radar.lost
    if goes_on:
        off_clearance, off_velocity = offset_of(radar.clearance), offset_of(radar.velocity)
    relative = velocity.value - off_velocity
    start_track(
        radar.track,
        clearance.value - off_clearance + relative * clearance.age,
        relative,
        mean,
        radar.clearance.noise.variance,
        radar.velocity.noise.variance,
    )
    if goes_on:
        believe(radar.track, mean, settings.lead_acceleration_std)
        radar.clearance.coasted = 0.0
    radar.has_track = True
    radar.id, radar.scans = track_id, 1
    radar.slow_acceleration = radar.slower_acceleration = mean
    # Nothing of another target says that this one's signals are held, or rough.
    radar.travelled_while_held = 0.0
    _begin_to_hold(radar)
    empty_roughness(radar.clearance.roughness)
    empty_roughness(radar.velocity.roughness)
    _cut_path(radar)
    forget_leap(radar.leap)
    for signal in (radar.clearance, radar.velocity):
        signal.residual = signal.limit = np.nan
        if not signal.faulty:
            signal.confidence = 0


@inner
def _cut_path(radar):
    """The clearance may have stepped for a good reason."""
    clear_path(radar.path)
    restart_roughness(radar.clearance.roughness)
    restart_roughness(radar.velocity.roughness)


@inner
def _skip_step(radar):
    """The path goes on as if the clearance had moved as its relative velocity says."""
    clearance, velocity, path = radar.measured_clearance, radar.measured_velocity, radar.path
    period = clearance.at - path.then
    path.clearance = clearance.value - 0.5 * (velocity.value + path.velocity) * period
    restart_roughness(radar.clearance.roughness)
    restart_roughness(radar.velocity.roughness)


@inner
def _regain(radar, settings):
    """After a moment without a scan: it may see another part of the car since."""
    if is_radar_faulty(radar) or not settings.check_drift:
        return
    now = _clearance_now(radar)
    limits = _limits(radar, settings)
    moves_on = abs(radar.measured_velocity.value - radar.track.velocity) <= limits[1]
    if moves_on and limits[0] < abs(now - radar.track.clearance) <= settings.largest_shift:
        set_clearance(radar.track, now, radar.clearance.noise.variance)
        _cut_path(radar)


@inner
def _clearance_now(radar):
    """The clearance (m) that the scan says for this step."""
    clearance = radar.measured_clearance
    return clearance.value + radar.measured_velocity.value * clearance.age


@inner
def _follow_period(radar, gap):
    """Average the seconds between scans by those since the last one; many are a gap, no period."""
    radar.period += PERIOD_SHARE * (min(gap, 2.0 * radar.period) - radar.period)


@inner
def _is_far_away(radar):
    """Whether what is seen is too far from a healthy track to be its target."""
    off = _clearance_now(radar) - radar.track.clearance
    return not is_radar_faulty(radar) and is_far(off)


@inner
def _is_another(radar, settings, track_id):
    """Sort out a new track id, or a silence; whether a new target was begun."""
    at = radar.measured_clearance.at
    gap = at - max(radar.clearance.last_at, radar.velocity.last_at)
    has_missed = gap > MISSED * radar.period
    _follow_period(radar, gap)
    silent = gap > LOST_AFTER or (has_missed and _is_far_away(radar))
    known = track_id != UNKNOWN_TRACK and radar.id != UNKNOWN_TRACK
    changed = track_id != radar.id and known
    if not changed and not silent:
        if gap > LARGEST_GAP:
            _regain(radar, settings)
        return False
    if settings.same_car and _knows(radar, settings, track_id, changed):
        if is_radar_faulty(radar) and radar.path.count:
            # What agrees since goes on, but for the step.
            _skip_step(radar)
        else:
            _cut_path(radar)
        return False
    _begin_another(radar, settings, track_id)
    return True


@inner
def _begin_another(radar, settings, track_id):
    """The radar sees another target from this scan on."""
    _change_target(radar, radar.measured_clearance.at)
    _begin(radar, settings, track_id)
    radar.begun_at = radar.measured_clearance.at


@inner
def _remember(radar, at):
    """Remember the target under its id, and forget what is too old."""
    kept = 0
    for i in range(radar.remembered_count):
        slot = radar.remembered[i]
        if at - slot.at < MEMORY and slot.id != radar.id:
            radar.remembered[kept] = slot
            kept += 1
    if kept == REMEMBERED:
        for i in range(1, kept):
            radar.remembered[i - 1] = radar.remembered[i]
        kept -= 1
    slot = radar.remembered[kept]
    slot.id, slot.at, slot.track = radar.id, at, radar.track
    radar.remembered_count = kept + 1


@inner
def _recall(radar, settings, track_id, at):
    """Go on from what was last seen under an id; whether anything was."""
    for i in range(radar.remembered_count):
        slot = radar.remembered[i]
        if slot.id != track_id or at - slot.at >= MEMORY:
            continue
        radar.track = slot.track
        if at > slot.at:
            mean, jerk = settings.lead_acceleration_mean, settings.jerk_density
            predict_track(radar.track, at - slot.at, radar.host, 1.0, mean, jerk)
        slot.at = -np.inf
        return True
    return False


@inner
def _knows(radar, settings, track_id, changed):
    """Whether a target under another id, or after a silence, is a car that is known."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    faulty = is_radar_faulty(radar)
    if changed and not faulty:
        _remember(radar, clearance.at)
    limits = _limits(radar, settings)
    now = _clearance_now(radar)
    off = now - radar.track.clearance
    if (
        abs(off) <= limits[0]
        and (faulty or not is_far(off))
        and abs(velocity.value - radar.track.velocity) <= limits[1]
    ):
        if changed and not faulty:
            # Another id is another part of it: that lies where it is seen.
            set_clearance(radar.track, now, radar.clearance.noise.variance)
        return True
    if faulty:
        # The faulty signals go on as they were: the car is the same, its reference still good.
        return (
            abs(clearance.value - radar.clearance.last) <= radar.clearance.floor
            and abs(velocity.value - radar.velocity.last) <= radar.velocity.floor
        )
    return changed and _recall(radar, settings, track_id, clearance.at)


@inner
def _widening(radar):
    """How much wider limits are while the noise is being learnt."""
    scans = radar.clearance.noise.count
    wide = 1.0 + 2.0 * exp(-scans / LEARNING)
    if scans < FEW_SCANS:
        return wide
    return min(wide, max(1.0, SEEN * max(radar.clearance.roughest, radar.velocity.roughest)))


@inner
def _limits(radar, settings):
    """Limits of clearance (m) and relative velocity (m/s) around the track."""
    wide, sigma = _widening(radar), settings.gate_sigma
    clearance = deviation_about(radar.clearance, radar.track.cc)
    velocity = deviation_about(radar.velocity, radar.track.vv)
    return (
        wide * max(least_limit(radar.clearance), sigma * clearance),
        wide * max(least_limit(radar.velocity), sigma * velocity),
    )


@inner
def _hold_against(signal, measured, prediction, limit, repeated):
    if measured.new and not repeated:
        signal.residual, signal.limit = measured.value - prediction, limit


@inner
def _judge_signal(radar, settings, signal, measured, of_clearance, repeated):
    """Count a scan of one signal, and see what becomes of it."""
    if not measured.new:
        return
    healthy = not is_radar_faulty(radar) and not is_bad(signal)
    period = measured.at - signal.last_at
    possible = ROUGH_CLEARANCE
    if not of_clearance:
        possible = max(ROUGH_VELOCITY, POSSIBLE_JERK * period * period)
    take_roughness(signal.roughness, measured.value, healthy, possible)
    count_scan(signal, settings.scan_confidence_max)
    if signal.faulty:
        classify(signal, _should_have_changed(radar, settings, signal, of_clearance))
        _requalify(radar, settings, signal, measured, of_clearance, repeated)
    elif is_ready(radar):
        _suspect(radar, settings, signal, of_clearance)


@inner
def _is_settling(radar):
    """Whether the first scans of a target contradict each other: a radar may not know it yet."""
    clearance, velocity = radar.clearance, radar.velocity
    young = radar.scans <= READY_SCANS and not is_radar_faulty(radar)
    disagrees = is_bad(clearance) or is_bad(velocity)
    return young and disagrees and radar.measured_clearance.at - radar.begun_at < SETTLING


@inner
def _has_leapt(radar):
    """Whether the radar sees another target under the same id."""
    clearance, velocity = radar.clearance, radar.velocity
    measured_clearance, measured_velocity = radar.measured_clearance, radar.measured_velocity
    whole = measured_clearance.new and measured_velocity.new
    disagrees = is_bad(velocity) or (is_bad(clearance) and not clearance.faulty)
    if not (whole and disagrees) or velocity.faulty:
        forget_leap(radar.leap)
        return False
    follow_leap(
        radar.leap,
        measured_clearance.at,
        measured_clearance.value,
        measured_velocity.value,
        clearance.residual - offset_of(clearance),
        velocity.residual,
        deviation_about(velocity, radar.track.vv),
        abs(radar.host_speed + measured_velocity.value) < STANDS * radar.host_speed,
    )
    return is_new_target(
        radar.leap,
        measured_clearance.value,
        deviation(clearance.noise),
        resolution_of(clearance.roughness),
        is_bad(velocity),
    )


@inner
def _judge(radar, settings, repeated):
    """Hold a scan against the track, then teach the track what is good of it."""
    track, clearance, velocity = radar.track, radar.clearance, radar.velocity
    measured_clearance, measured_velocity = radar.measured_clearance, radar.measured_velocity
    has_clearance, has_velocity = measured_clearance.new, measured_velocity.new
    age = 0.0
    if has_clearance:
        age = measured_clearance.age
    if has_velocity:
        age = max(age, measured_velocity.age) if has_clearance else measured_velocity.age
    relative = track.acceleration - radar.host
    limits = _limits(radar, settings)
    clearance_variance, velocity_variance = track.cc, track.vv
    expected = track.clearance - age * (track.velocity - 0.5 * age * relative)
    _hold_against(clearance, measured_clearance, expected, limits[0], repeated)
    expected = track.velocity - age * relative
    _hold_against(velocity, measured_velocity, expected, limits[1], repeated)
    if has_clearance and has_velocity and _is_settling(radar):
        _begin(radar, settings, radar.id)
        return
    if not repeated and _has_leapt(radar):
        _begin_another(radar, settings, radar.id)
        return
    clearance_was_faulty, velocity_was_faulty = clearance.faulty, velocity.faulty
    _judge_signal(radar, settings, clearance, measured_clearance, True, repeated)
    _judge_signal(radar, settings, velocity, measured_velocity, False, repeated)
    begins = velocity.faulty and not velocity_was_faulty
    held = velocity.faulty and repeats(velocity)
    both = repeats(clearance) and clearance.faulty and not clearance_was_faulty
    if held and (begins or both):
        _take_back_held(radar, settings, age)
    if begins or (held and both):
        believe(track, 2.0 * radar.slow_acceleration - radar.slower_acceleration, SLOW_STD)
    if repeated:
        return
    good_clearance = not clearance.faulty and not is_bad(clearance)
    good_velocity = not velocity.faulty and not is_bad(velocity)
    if (good_clearance or not has_clearance) and (good_velocity or not has_velocity):
        if has_clearance:
            # What it lies beside the track for good is no noise: that would widen the limits and
            # leave the track to the relative velocity alone, which takes it further away.
            _learn(clearance, clearance.residual - clearance.bias, clearance_variance)
        if has_velocity:
            _learn(velocity, velocity.residual, velocity_variance)
    if has_clearance and good_clearance:
        variance = clearance.noise.variance
        if velocity.faulty:
            variance += WANDERING * _wander(radar, settings)
        correct_clearance(track, clearance.residual, variance)
    if has_velocity and good_velocity:
        now = track.velocity - age * (track.acceleration - radar.host)
        correct_velocity(track, measured_velocity.value - now, velocity.noise.variance)
    if has_clearance and good_clearance and not is_radar_faulty(radar):
        now = track.clearance - age * (track.velocity - 0.5 * age * relative)
        clearance.bias += (measured_clearance.value - now - clearance.bias) / BIAS_SCANS
    if not (has_clearance and has_velocity):
        return
    if not is_radar_faulty(radar):
        _follow_path(radar, settings)
    elif clearance.faulty:
        _look_for_agreement(radar, settings)


@inner
def _wander(radar, settings):
    """Variance in m^2 of what the clearance lies beside the path for a while."""
    drifted = VELOCITY_BIAS * settings.drift_window
    return wander(radar.path, radar.clearance.noise.variance, drifted)


@inner
def _learn(signal, off, variance):
    """Noise is now on this side, now on that; what stays on one side is something else."""
    # The steps of a coarse signal are noise, though they stay on one side for a while.
    usual = LEANS * deviation_about(signal, variance) + resolution_of(signal.roughness)
    if abs(off) <= usual or off * signal.leaning < 0.0:
        signal.leaning = 0.0
    if abs(off) > usual:
        signal.leaning += 1.0 if off > 0.0 else -1.0
    if abs(signal.leaning) <= LEANING:
        learn_noise(signal.noise, off, variance)
        signal.roughest = max(signal.roughest, abs(off) / signal.floor)


@inner
def _take_back_held(radar, settings, age):
    """What the track was taught by a relative velocity that only repeated itself: it goes on from
    what it was before."""
    if radar.time_while_held > TAKEN_BACK:
        return
    track, clearance = radar.track, radar.clearance
    mean = settings.lead_acceleration_mean
    radar.track = radar.track_when_held
    radar.slow_acceleration = radar.lead_when_held
    radar.slower_acceleration = radar.slower_lead_when_held
    predict_track(track, radar.time_while_held, 0.0, 1.0, mean, settings.jerk_density)
    track.velocity -= radar.host_gain_while_held
    track.clearance -= radar.host_path_while_held
    if radar.measured_clearance.new and not clearance.faulty:
        clearance.residual = radar.measured_clearance.value - track.clearance + age * track.velocity


@inner
def _suspect(radar, settings, signal, of_clearance):
    """Whether a signal that was healthy still is."""
    if radar.leap.waits:
        return
    if signal.confidence >= settings.scan_confidence_threshold:
        explainable = of_clearance and is_explainable(radar.path)
        if explainable and _is_gradual(radar, settings):
            if abs(signal.residual) > settings.drift_limit:
                _explain(radar, settings, signal.residual, signal.limit)
        elif explainable and _is_growing(radar, settings):
            pass  # The path will tell what it is.
        else:
            give_ground(signal.because, Ground.RESIDUAL, signal.residual, signal.limit, 0.0)
            _convict(radar, settings, signal, Kind.OFFSET)
            _take_bias(radar, settings, of_clearance)
    elif settings.check_roughness and is_rough(signal.roughness) and not is_bad(signal):
        # A jump is rough, too.
        give_ground(signal.because, Ground.ROUGHNESS, rough_share(signal.roughness), 0.0, 0.0)
        _convict(radar, settings, signal, Kind.NOISE)
        _take_bias(radar, settings, of_clearance)
    elif settings.check_repetition and _is_frozen(radar, settings, signal, of_clearance):
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
        # Nor is it known where it has wandered to by then, and where it would wander to meanwhile.
        radar.track.cc += 2.0 * _wander(radar, settings)


@inner
def _is_frozen(radar, settings, signal, of_clearance):
    """A value repeated for too long, or while the relative velocity says that it changed."""
    changed = _should_have_changed(radar, settings, signal, of_clearance)
    if of_clearance and not _repeats_itself(radar):
        return changed and is_held(signal)
    return radar.host_moves and is_frozen(signal.repetition, changed)


@inner
def _repeats_itself(radar):
    """Whether the radar says the same again and again: one signal does, the other since then."""
    own, other = radar.clearance.repetition, radar.velocity.repetition
    together = -own.longest <= other.run - own.run <= other.longest
    return _is_either_held(radar) and together


@inner
def _should_have_changed(radar, settings, signal, of_clearance):
    """Whether a value that repeats itself had reason to change."""
    clearance = radar.clearance
    if _repeats_itself(radar):
        return True
    if of_clearance:
        return abs(radar.travelled_while_held) > max(
            HELD_PATH,
            HELD_SIGMA * deviation(clearance.noise),
            HELD_STEPS * clearance.roughness.resolution,
        )
    step, held_for = resolution_of(signal.roughness), signal.last_at - radar.held_since
    known_for = max(radar.held_since - radar.begun_at, 0.0)
    change = max(HELD_CHANGE, CHANGE_STEPS * step) + LEAD_DOUBT * max(held_for - 1.0, 0.0)
    change += UNKNOWN_LEAD * exp(-known_for / SLOW) * held_for
    beside = sqrt(clearance.noise.variance + WANDERING * _wander(radar, settings))
    off = HELD_OFF * beside + 0.5 * step * held_for
    off += 0.5 * resolution_of(clearance.roughness)
    # A clearance that is off itself tells nothing.
    tells = not clearance.faulty and not is_bad(clearance)
    return radar.most_changed > change or (tells and abs(radar.off_while_held) > off)


@inner
def _jumped(signal):
    """Whether it went out of its limits by one jump, not little by little: a coarse signal's steps
    are larger than they seem."""
    step = abs(at(signal.first, 0) - signal.residual_before)
    return step > GRADUAL * signal.limit - 0.5 * resolution_of(signal.roughness)


@inner
def _is_gradual(radar, settings):
    """Whether the clearance goes out of its limits little by little."""
    signal = radar.clearance
    if not settings.check_drift or not signal.first.count:
        return False
    return signal.residual_before * signal.residual > 0.0 and not _jumped(signal)


@inner
def _is_growing(radar, settings):
    """Whether the clearance, out of its limits, goes on from there: no fault that jumps does."""
    signal = radar.clearance
    if not settings.check_drift or not signal.first.count:
        return False
    first, now = at(signal.first, 0), signal.residual
    return not _jumped(signal) and first * now > 0.0 and abs(first) < GROWN * abs(now)


@inner
def _convict(radar, settings, signal, kind):
    convict(signal, kind, settings.scan_confidence_max)
    signal.coasted = 0.0
    clear_path(radar.path)


@inner
def _requalify(radar, settings, signal, measured, of_clearance, repeated):
    """Whether a faulty signal is to be believed again."""
    track = radar.track
    period = measured.at - signal.last_at
    step = measured.value - signal.last
    if of_clearance:
        step -= track.velocity * period
    if not radar.lost:
        level = returned_to(signal, repeated)
        if isfinite(level):
            _rebase(track, signal, measured.value - signal.residual + level, of_clearance)
        elif has_stopped(signal, measured.at, settings.requalify_time):
            _rebase(track, signal, measured.value, of_clearance)
            forgive(signal)
            return
    spread = deviation_about(signal, track.cc if of_clearance else track.vv)
    agreeing = follow_agreement(signal, period, step, spread, settings.gate_sigma)
    latch = settings.latch
    if not of_clearance:
        _follow_agreed_path(radar, period)
        off_path, on_path = _hold_against_path(radar, settings)
        latch = latch and not on_path
        if off_path:
            restart_agreement(signal)
            agreeing = False
    shifted = of_clearance and may_have_shifted(signal, settings.largest_shift)
    signal.doubted = agreeing and shifted
    needed = settings.requalify_time if shifted else settings.clear_time
    agrees = agreeing and agrees_long_enough(signal, needed, latch)
    carried = of_clearance and radar.carried and not radar.velocity.faulty
    if carried and measured.at - radar.carried_since >= settings.requalify_time and not agrees:
        # Nothing else would tell that it ended in between.
        _rebase(track, signal, measured.value, of_clearance)
        agrees = True
    if radar.lost:
        # A new target: its own agreement with itself must do, but for longer.
        if not agreeing:
            radar.lost_since = measured.at
        agrees = measured.at - radar.lost_since >= settings.requalify_time
    if agrees:
        forgive(signal)
        if not is_radar_faulty(radar):
            # What was followed while it was faulty tells nothing about it now.
            clear_path(radar.path)
            radar.lost = radar.carried = False
        elif radar.carried and not of_clearance:
            # One of two faults that went on with another target did not: did the other?
            radar.lost, radar.lost_since = True, measured.at
            radar.carried = False
            _begin(radar, settings, radar.id)


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
    if signal.kind != Kind.OFFSET or (clearance.faulty and clearance.kind != Kind.OFFSET):
        return False, False
    off = radar.measured_clearance.value - radar.agreed_clearance - radar.agreed_path
    astray = 0.5 * size_to_tell(signal) * signal.agreeing
    doubt = PATH_SIGMA * deviation(clearance.noise) + resolution_of(clearance.roughness)
    wandered = PATH_SIGMA * sqrt(_wander(radar, settings))
    return abs(off) > astray + doubt, abs(off) < 0.5 * astray and astray > 2.0 * (doubt + wandered)


@inner
def _rebase(track, signal, measured, of_clearance):
    """The jump that made a fault was undone: the signal is the reference again."""
    if of_clearance:
        set_clearance(track, measured, signal.noise.variance)
    else:
        set_velocity(track, measured, signal.noise.variance)
    signal.residual = 0.0


@inner
def _follow_path(radar, settings):
    """Hold the clearance against the path that the relative velocity makes."""
    clearance, velocity, path = radar.clearance, radar.velocity, radar.path
    if is_bad(velocity):
        return
    if is_bad(clearance) and not _is_gradual(radar, settings):
        if not _is_growing(radar, settings):
            return
        if path.count and is_new(clearance.last_at, path.then):
            # The first bad one could have been an outlier.
            follow_path(path, settings, clearance.last_at, clearance.last, velocity.last, 0.0)
    limit = path_limit(path, settings, _widening(radar), resolution_of(clearance.roughness))
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
        _explain(radar, settings, drift, limit)


@inner
def _look_for_agreement(radar, settings):
    """Whether faulty signals agree with each other since: a relative velocity that makes the path
    which the clearance goes is right, whatever the track was coasted to.

    Signals that repeated themselves or were rough are over with it. Others may have been another
    car, of a radar that gives no ids, or a fault that began with the target and ended: they must
    agree with a track of their own for longer.
    """
    clearance, velocity, path = radar.clearance, radar.velocity, radar.path
    over = shows_itself(clearance) and (shows_itself(velocity) or not velocity.faulty)
    if radar.lost or not (velocity.faulty or over):
        return
    if still_shows(clearance) or still_shows(velocity):
        clear_path(path)
        return
    at = radar.measured_clearance.at
    follow_path(
        path, settings, at, radar.measured_clearance.value, radar.measured_velocity.value, 0.0
    )
    limit = path_limit(path, settings, 1.0, resolution_of(clearance.roughness))
    if path_length(path) < settings.drift_window:
        return
    if abs(path_drift(path, settings, limit)) >= 0.5 * limit:
        return
    if over:
        forgive(clearance)
        forgive(velocity)
    else:
        radar.lost, radar.lost_since = True, at
    _begin(radar, settings, radar.id)


@inner
def _explain(radar, settings, difference, limit):
    """Clearance and relative velocity contradict each other: convict one of them."""
    path, track, drift = radar.path, radar.track, radar.drift
    clearance, velocity = radar.clearance, radar.velocity
    held = is_held(clearance) and abs(radar.travelled_while_held) > 0.5 * abs(difference)
    excess, noise = abs(difference) / limit, clearance.noise.variance
    explain_drift(path, settings, excess, held, noise, drift)
    if drift.shifted:
        # Another part of the same car: the track goes on from there.
        set_clearance(track, path.clearance, CLEARANCE_STD**2)
        acquit(clearance)
        clearance.bias = 0.0
        clear_path(path)
        return
    if not drift.told:
        return
    if drift.of_clearance:
        set_clearance(track, path.clearance - drift.error, CLEARANCE_STD**2)
        clearance.residual = drift.error
        give_ground(clearance.because, Ground.PATH, difference, limit, 0.0)
        _convict(radar, settings, clearance, drift.kind)
        return
    set_clearance(track, path.clearance, CLEARANCE_STD**2)
    set_velocity(track, path.velocity - drift.error, VELOCITY_STD**2)
    acquit(clearance)
    velocity.residual = drift.error
    give_ground(velocity.because, Ground.PATH, difference, limit, 0.0)
    _convict(radar, settings, velocity, drift.kind)
