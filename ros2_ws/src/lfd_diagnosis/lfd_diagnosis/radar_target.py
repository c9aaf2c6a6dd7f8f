"""Which car the radar sees: the same, one that is known, or another (robust profile)."""

from math import isnan

import numpy as np

from lfd_diagnosis.evidence import repeats
from lfd_diagnosis.held_velocity import begin_to_hold
from lfd_diagnosis.lead_track import (
    believe,
    clearance_then,
    predict_track,
    start_track,
    velocity_then,
)
from lfd_diagnosis.new_target import follow_leap, forget_leap, is_far, judge_leap
from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_agreement import agrees_by_now
from lfd_diagnosis.radar_residual import deviation_about, is_bad
from lfd_diagnosis.radar_signal import (
    begin_to_judge,
    carry,
    forgive,
    is_known_offset,
    lose_reference,
    offset_of,
)
from lfd_diagnosis.radar_state import (
    GAP_SCANS,
    PERIOD_SHARE,
    READY_SCANS,
    REMEMBERED,
    TARGET_SETTLES,
    clearance_now,
    cut_path,
    go_over,
    is_radar_faulty,
    is_reference_lost,
    limits_about,
)
from lfd_diagnosis.roughness import empty_roughness, resolution_of, restart_roughness
from lfd_diagnosis.travelled_path import skip_path
from lfd_mpc.compiled import inner
from lfd_mpc.samples import UNKNOWN_TRACK

STANDS, STANDS_STILL = 0.1, 0.5
"""Share of the host's speed by which a relative velocity is off from that of what stands, and m/s
where the host stands, too."""

MEMORY = 0.6
"""Seconds for which a target is remembered that is not seen, or under another track id."""

FOLLOWED, LOSS, MOST_FOLLOWED = 20, 10, 100
"""Scans for which a healthy one must have been followed to be the same one after a moment unseen,
how many of them each such moment takes, and how many count at most: where targets come and go with
every scan it may be any of them."""

KNOWN_SCANS = 5
"""Scans after which it is known well enough to be faulty if it is seen elsewhere then."""

LOST_AFTER = 1.0
"""Seconds of silence after which a target that disagrees is another one, not a fault."""

REGAINED = 0.25
"""Seconds without the clearance after which it may lie on another part of the car."""

MOVED_ON = 0.5
"""Share of its limits by which a relative velocity differs where scans were missed and the
clearance lies where no other part of the car does: then it is another car's."""


@inner
def keeps_target(radar, settings, now):
    """Whether a target that the radar says it does not see may be seen again: one lost scan is no
    other car."""
    last_at = max(radar.clearance.last_at, radar.velocity.last_at)
    followed = radar.followed >= FOLLOWED or is_radar_faulty(radar)
    return settings.same_car and radar.has_track and followed and now - last_at < MEMORY


@inner
def change_target(radar, at):
    """A fault is the sensor's: an offset goes on with another target. Of others nothing is left
    that they could be told from."""
    for signal in (radar.clearance, radar.velocity):
        if signal.faulty and agrees_by_now(signal):
            forgive(signal)
    known = is_known_offset(radar.clearance) and is_known_offset(radar.velocity)
    goes_on = known and not is_reference_lost(radar)
    for signal in (radar.clearance, radar.velocity):
        if goes_on:
            carry(signal, at)
        else:
            lose_reference(signal, at)


@inner
def _beside_former(radar, settings):
    """How far (m) a scan lies beside a target that is healthy and just as fast; else NaN."""
    measured = radar.measured_velocity
    if not radar.has_track or is_radar_faulty(radar):
        return np.nan
    if measured.at - min(radar.clearance.last_at, radar.velocity.last_at) > MEMORY:
        return np.nan
    if abs(measured.value - radar.track.velocity) > limits_about(radar, settings)[1]:
        return np.nan
    return clearance_now(radar) - radar.track.clearance


@inner
def begin_target(radar, settings, track_id):
    """A target that nothing is known of, but for an offset that goes on with it."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    mean = settings.lead_acceleration_mean
    off_clearance = off_velocity = 0.0
    goes_on = is_radar_faulty(radar) and not is_reference_lost(radar)
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
    radar.has_track, radar.other_in_part = True, False
    radar.before_at = -np.inf
    radar.id, radar.scans, radar.followed = track_id, 1, 0
    radar.slow_acceleration = radar.slower_acceleration = mean
    radar.elsewhere, radar.undrifted = 0.0, np.nan
    # Nothing of another target says that this one's signals are held, or rough.
    radar.held.travelled = 0.0
    begin_to_hold(radar)
    empty_roughness(radar.clearance.roughness)
    empty_roughness(radar.velocity.roughness)
    cut_path(radar)
    forget_leap(radar.leap)
    for signal in (radar.clearance, radar.velocity):
        begin_to_judge(signal)


@inner
def _skip_step(radar):
    """The path goes on as if the clearance had moved as its relative velocity says."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    skip_path(radar.path, clearance.at, clearance.value, velocity.value)
    restart_roughness(radar.clearance.roughness)
    restart_roughness(radar.velocity.roughness)


@inner
def _regain(radar, settings):
    """After a moment without the clearance: it may see another part of the car since."""
    if radar.clearance.faulty or not settings.check_drift:
        return
    now = clearance_now(radar)
    limits = limits_about(radar, settings)
    moves_on = abs(radar.measured_velocity.value - radar.track.velocity) <= limits[1]
    # What a faulty one says of the moment is nothing, and nothing says that the clearance is off.
    moves_on = moves_on or radar.velocity.faulty
    beside = now - radar.track.clearance
    if moves_on and limits[0] < abs(beside) <= settings.largest_shift:
        radar.regained_at, radar.regained_beside = radar.measured_clearance.at, beside
        go_over(radar, now, radar.clearance.noise.variance)
        cut_path(radar)


@inner
def _follow_period(radar, gap):
    """Average the seconds between scans by those since the last one; many are a gap, no period."""
    radar.period += PERIOD_SHARE * (min(gap, 2.0 * radar.period) - radar.period)


@inner
def _is_elsewhere(radar, settings):
    """Whether what is seen, after missed scans, cannot be a healthy track's target: it is too far
    off, or off in both signals, as little as neither would say so alone."""
    if is_radar_faulty(radar):
        return False
    limits = limits_about(radar, settings)
    off = clearance_now(radar) - radar.track.clearance
    off_velocity = abs(radar.measured_velocity.value - radar.track.velocity)
    farther = abs(off) > max(limits[0], settings.largest_shift)
    return is_far(off) or (farther and MOVED_ON * limits[1] < off_velocity <= limits[1])


@inner
def _agrees(radar, settings):
    """Whether what is seen lies where the track says."""
    limits = limits_about(radar, settings)
    off = clearance_now(radar) - radar.track.clearance
    return abs(off) <= limits[0] and (
        abs(radar.measured_velocity.value - radar.track.velocity) <= limits[1]
    )


@inner
def has_another_id(radar, track_id):
    """Whether the target has an id, and had another one before."""
    known = track_id != UNKNOWN_TRACK and radar.id != UNKNOWN_TRACK
    return track_id != radar.id and known


@inner
def _says_as_before(radar):
    """Whether a scan is the last one once more: under another id it is no other car's."""
    same_clearance = radar.measured_clearance.value == radar.clearance.last
    return same_clearance and radar.measured_velocity.value == radar.velocity.last


@inner
def doubt_repeated(radar):
    """A clearance that repeats itself says of another id, or after a silence, what it said before:
    if that is its fault, nobody knows where the car is that it should tell of."""
    clearance, measured = radar.clearance, radar.measured_clearance
    radar.other_repeats &= not measured.new or measured.value == clearance.last
    if radar.other_repeats and repeats(clearance.kind) and not is_reference_lost(radar):
        # Another fault of the relative velocity goes on as it did, whichever car it is.
        for signal in (clearance, radar.velocity):
            if repeats(signal.kind):
                lose_reference(signal, measured.at)


@inner
def sort_out_target(radar, settings, track_id):
    """Sort out a new track id, or a silence; whether a new target was begun."""
    at = radar.measured_clearance.at
    gap = at - max(radar.clearance.last_at, radar.velocity.last_at)
    has_missed = gap > GAP_SCANS * radar.period
    _follow_period(radar, gap)
    silent = gap > LOST_AFTER or (has_missed and _is_elsewhere(radar, settings))
    changed = has_another_id(radar, track_id) and not _says_as_before(radar)
    goes_on = not (changed or silent)
    if goes_on and at - radar.clearance.last_at > REGAINED:
        _regain(radar, settings)
    # What was not seen for a moment may be another car.
    unseen, radar.unseen = radar.unseen, False
    if changed or silent:
        radar.other_repeats = radar.measured_clearance.value == radar.clearance.last
    followed = radar.followed + 1 - LOSS * unseen
    radar.followed = min(max(followed, 0), MOST_FOLLOWED)
    if goes_on and not unseen:
        return False
    if settings.same_car and _recognise(radar, settings, track_id, changed):
        if goes_on:
            return False
        if radar.path.count:
            # A drift is the sensor's, whichever part or car it sees: it goes on, but for the step.
            _skip_step(radar)
        else:
            cut_path(radar)
        return False
    begin_another(radar, settings, track_id)
    return True


@inner
def is_another_in_part(radar, settings, track_id):
    """Whether a scan of which one signal alone is there is another target's: nothing can be begun
    with that."""
    track, clearance, velocity = radar.track, radar.measured_clearance, radar.measured_velocity
    limits, relative = limits_about(radar, settings), track.acceleration - radar.host
    if clearance.new:
        signal, measured, limit = radar.clearance, clearance, limits[0]
        off = clearance.value - clearance_then(track, clearance.age, relative)
    else:
        signal, measured, limit = radar.velocity, velocity, limits[1]
        off = velocity.value - velocity_then(track, velocity.age, relative)
    last_at = max(radar.clearance.last_at, radar.velocity.last_at)
    gone = radar.unseen or measured.at - last_at > LOST_AFTER
    if not (gone or has_another_id(radar, track_id)):
        return False
    # What is faulty and goes on as it was is of the same car.
    return abs(off) > limit and abs(measured.value - signal.last) > signal.floor


@inner
def begin_another(radar, settings, track_id):
    """The radar sees another target from this scan on."""
    at, beside = radar.measured_clearance.at, _beside_former(radar, settings)
    change_target(radar, at)
    begin_target(radar, settings, track_id)
    radar.begun_at, radar.begun_beside = at, beside


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
    slot.id, slot.at, slot.scans, slot.track = radar.id, at, radar.scans, radar.track
    radar.remembered_count = kept + 1


@inner
def _recall(radar, settings, track_id, at):
    """Go on from what was last seen under an id; whether anything was."""
    for i in range(radar.remembered_count):
        slot = radar.remembered[i]
        if slot.id != track_id or at - slot.at >= MEMORY:
            continue
        since = at - slot.at
        radar.before, radar.before_at = radar.track, -np.inf
        radar.track = slot.track
        if since > 0.0:
            mean, jerk = settings.lead_acceleration_mean, settings.jerk_density
            predict_track(radar.track, since, radar.host, 1.0, mean, jerk)
        slot.at = -np.inf
        far = is_far(clearance_now(radar) - radar.track.clearance)
        missed = since > GAP_SCANS * radar.period
        given_away = (missed or far) and _is_elsewhere(radar, settings)
        vague = slot.scans < KNOWN_SCANS and not _agrees(radar, settings)
        if given_away or vague:
            radar.track = radar.before
            return False
        radar.scans, radar.elsewhere = slot.scans, 0.0
        begin_to_hold(radar)
        return True
    return False


@inner
def _recognise(radar, settings, track_id, changed):
    """Go on with a target that is under another id, or came after a silence, where it is a car that
    is known; whether it is."""
    clearance, velocity = radar.measured_clearance, radar.measured_velocity
    faulty = is_radar_faulty(radar)
    if changed and not faulty:
        _remember(radar, clearance.at)
    now = clearance_now(radar)
    off = now - radar.track.clearance
    if _agrees(radar, settings) and (faulty or not is_far(off)):
        if changed and not faulty:
            # Another id is another part of it: that lies where it is seen.
            radar.held.clearance += off
            go_over(radar, now, radar.clearance.noise.variance)
        return True
    if faulty:
        # The faulty signals go on as they were: the car is the same, its reference still good.
        return (
            abs(clearance.value - radar.clearance.last) <= radar.clearance.floor
            and abs(velocity.value - radar.velocity.last) <= radar.velocity.floor
        )
    return changed and _recall(radar, settings, track_id, clearance.at)


@inner
def is_settling(radar):
    """Whether the first scans of a target contradict each other: a radar may not know it yet."""
    clearance, velocity = radar.clearance, radar.velocity
    young = radar.scans <= READY_SCANS and not is_radar_faulty(radar)
    # What is not there, or was said before, contradicts nothing.
    one = is_bad(clearance) and not isnan(clearance.residual)
    other = is_bad(velocity) and not isnan(velocity.residual)
    begins = radar.measured_clearance.at - radar.begun_at < TARGET_SETTLES
    return young and (one or other) and begins


@inner
def look_for_new_target(radar):
    """Follow what jumped; whether the radar sees another target under the same id."""
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
        abs(radar.host_speed + measured_velocity.value)
        < max(STANDS * radar.host_speed, STANDS_STILL),
        radar.id != UNKNOWN_TRACK,
    )
    return judge_leap(
        radar.leap,
        measured_clearance.value,
        deviation(clearance.noise),
        resolution_of(clearance.roughness),
        is_bad(velocity),
    )
