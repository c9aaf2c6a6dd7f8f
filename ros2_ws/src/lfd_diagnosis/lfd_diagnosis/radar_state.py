"""What is known of a radar: its two signals, its target, and the limits around its track."""

from math import exp

import numpy as np

from lfd_diagnosis.drift_explanation import DRIFT
from lfd_diagnosis.evidence import repeats
from lfd_diagnosis.lead_track import LEAD_TRACK, set_clearance
from lfd_diagnosis.new_target import LEAP, forget_leap
from lfd_diagnosis.radar_residual import deviation_about, least_limit
from lfd_diagnosis.radar_signal import RADAR_SIGNAL, forgive, restart_signal, start_signal
from lfd_diagnosis.ring import RING
from lfd_diagnosis.roughness import restart_roughness
from lfd_diagnosis.scan_rows import SCAN_ROWS, restart_scan_rows, start_scan_rows
from lfd_diagnosis.travelled_path import TRAVELLED_PATH, clear_path, start_path, wander
from lfd_mpc.compiled import inner
from lfd_mpc.samples import UNKNOWN_TRACK

READY_SCANS, TARGET_SETTLES = 3, 0.5
"""Scans of one target after which it is judged, and seconds in which one whose first scans
contradict each other is begun anew."""

LEARNING, FEW_SCANS, TIMES_SEEN = 40.0, 10, 3.0
"""Scans over which limits come down from thrice to once their width while noise is learnt; sooner,
after some scans, to so many times the largest residual that was seen."""

SWUNG, WIDEST = 2.0, 1.5
"""How many times the largest residual of a healthy relative velocity its least limit is, and how
many times the first one at most: some radars swing farther, for two scans, than noise tells."""

SLOW_TIME, SLOW_STD = 0.5, 0.2
"""Seconds over which the lead's acceleration is averaged before it is relied on for long, and how
well it is known then, in m/s^2."""

FIRST_PERIOD, PERIOD_SHARE, GAP_SCANS = 0.05, 0.1, 2.5
"""Seconds between two scans before any was seen, share of a new one in their average, and how many
of them are a gap after which the same id may be another target's."""

VELOCITY_BIAS, USUAL_BIAS = 0.02, 0.012
"""m/s by which the relative velocity may be off for good, and by which it usually is: a coasted
clearance drifts with it."""

WANDERING, WANDER_TIME = 4.0, 2.0
"""Scans for which a clearance stays where it wandered to: so much less it tells of a velocity; s in
which it wanders so far: the track follows it."""

LEAST_CLEARANCE_STD, LEAST_VELOCITY_STD = 0.03, 0.015
"""Deviations in m and m/s of the least noise that is learnt."""

NOISELESS_CLEARANCE, NOISELESS_VELOCITY = 0.03, 0.0105
"""Second differences in m and m/s that a signal without noise hardly exceeds."""

REMEMBERED = 32
"""Targets that are remembered at once."""

MEASURED = np.dtype([("new", "?"), ("at", "f8"), ("value", "f8"), ("age", "f8")], align=True)
"""One signal at a step: whether it is new, its time in s, its value and its age in s."""

_SLOT = np.dtype([("id", "i8"), ("at", "f8"), ("scans", "i8"), ("track", LEAD_TRACK)], align=True)

HELD = np.dtype(
    [
        ("since", "f8"),
        ("time", "f8"),
        # The lead's acceleration then, and the mean over longer.
        ("lead", "f8"),
        ("slower_lead", "f8"),
        ("track", LEAD_TRACK),
        # What the host gained in speed since, and the path that this made.
        ("host_gain", "f8"),
        ("host_path", "f8"),
        # By how much the relative velocity should have changed, at most, and the path of that.
        ("changed", "f8"),
        ("most_changed", "f8"),
        ("expected_off", "f8"),
        ("leapt_to_zero", "?"),
        # Where the clearance would be, how far it is off, within some scans, and at most.
        ("clearance", "f8"),
        ("beside", "f8"),
        ("off", "f8"),
        ("off_by_last", "f8"),
        ("off_lately", RING),
        ("most_at_once", "f8"),
        ("least_off", "f8"),
        ("most_off", "f8"),
        # A clearance that repeats itself.
        ("travelled", "f8"),
        # Once it is over.
        ("sees_again_at", "f8"),
        ("unsaid", "f8"),
        ("unsaid_for", "f8"),
        ("unseen_for", "f8"),
        ("went_on_to", "f8"),
    ],
    align=True,
)
"""A relative velocity that may repeat itself, `since` a time in s, `time` s ago by the steps; m,
m/s and m/s^2.

`leapt_to_zero`: whether it began so; `beside` is how far the clearance lay beside the track then,
`most_at_once` by how much it left the path within a few scans (`off_lately`). `travelled` is the
path of the relative velocity while the clearance repeats itself. `unsaid` is by how much host and
lead should have changed one that repeated itself for `unsaid_for` s until `sees_again_at` (s), of
which the radar may have been without its target for `unseen_for`; that leads to a clearance of
`went_on_to`.
"""

CATCHING = np.dtype(
    [
        ("since", "f8"),
        ("lost_for", "f8"),
        ("jump", "f8"),
        ("unsaid", "f8"),
        ("surely", "?"),
        ("clearance", "f8"),
        ("told", "f8"),
        ("most", "f8"),
    ],
    align=True,
)
"""A relative velocity that no longer repeats itself `since` a time in s, and may catch up with what
it did not say for `lost_for` s; m and m/s.

It came with a `jump` against the track, of which so much was expected as it left `unsaid`; whether
the repetition alone says that the lead was lost (`surely`). `clearance` is where that would be, had
the relative velocity been wrong by the jump since then only. `told` (m^2) sums up how far it is
beyond that, times how far it would be if the lead was lost, and `most` the square of the latter.
"""

RADAR = np.dtype(
    [
        ("clearance", RADAR_SIGNAL),
        ("velocity", RADAR_SIGNAL),
        ("measured_clearance", MEASURED),
        ("measured_velocity", MEASURED),
        ("now", "f8"),
        ("rows", SCAN_ROWS),
        ("path", TRAVELLED_PATH),
        ("drift", DRIFT),
        ("track", LEAD_TRACK),
        ("before", LEAD_TRACK),
        ("before_at", "f8"),
        ("has_track", "?"),
        ("taught", "?"),
        ("scans", "i8"),
        ("unseen", "?"),
        ("other_in_part", "?"),
        ("other_repeats", "?"),
        ("followed", "i8"),
        ("begun_at", "f8"),
        ("begun_beside", "f8"),
        ("period", "f8"),
        ("id", "i8"),
        ("remembered", _SLOT, (REMEMBERED,)),
        ("remembered_count", "i8"),
        ("slow_acceleration", "f8"),
        ("slower_acceleration", "f8"),
        ("host", "f8"),
        ("host_moves", "?"),
        ("host_speed", "f8"),
        ("held", HELD),
        ("catching", CATCHING),
        ("beside", "f8"),
        ("agreed_clearance", "f8"),
        ("agreed_path", "f8"),
        ("undrifted", "f8"),
        ("shifted_at", "f8"),
        ("elsewhere", "f8"),
        ("regained_at", "f8"),
        ("regained_beside", "f8"),
        ("leap", LEAP),
    ],
    align=True,
)
"""State of one radar's two signals and of its target; m, m/s and m/s^2, `now` in s.

The target. `id`, seen first at `begun_at` (s), of so many `scans`, so far `begun_beside` (m) the
one before if it is just as fast, else NaN; other ids' targets are `remembered`. `track` is where it
is, if that is known (`has_track`), `before` the same as it was at `before_at` (s), when the last
scan was not yet taken; `taught`: whether the relative velocity has corrected it since it was
faulty. While it is `unseen` the radar says that it sees no lead, while it is `other_in_part` scans
of which one signal is missing have another id; `other_repeats`: whether it may be another car since
the clearance repeats itself; `followed`: scans that it was seen in, less what was lost of it.
`slow_acceleration` and `slower_acceleration`: the lead's through one and two filters, while the
relative velocity is healthy. `leap`: what jumps and may be another target.

The host. How it accelerates (`host`), its speed (`host_speed`, NaN unless it is believed), and
whether it surely moves (`host_moves`). `period` (s): between two scans, on average; `rows` tells a
row that is one from one that but repeats it.

The clearance against the relative velocity. `path`, which `drift` explains where they contradict
each other; `held`: whether one of the two but repeats itself; `catching`: whether the relative
velocity catches up with what it did not say meanwhile. `beside` (m) is what the clearance
lately lay beside the track. `elsewhere` (m) is how far the part of the car that is seen lies from
the one that was seen first, `shifted_at` (s) when it last went over to another one behind a faulty
relative velocity; a silence ended at `regained_at` (s) with a clearance `regained_beside` (m) the
track. `agreed_clearance` (m) is what was measured when that began to agree again,
`agreed_path` (m) the path that it makes since. `undrifted` (m) is where the clearance would be were
it the one that drifts, where the relative velocity is blamed for that.
"""


@inner
def start_radar(radar, settings):
    """Begin with nothing."""
    learn = settings.learn_noise
    start_signal(
        radar.clearance,
        settings.clearance_floor,
        settings.clearance_std,
        LEAST_CLEARANCE_STD,
        NOISELESS_CLEARANCE,
        learn,
    )
    start_signal(
        radar.velocity,
        settings.relative_velocity_floor,
        settings.relative_velocity_std,
        LEAST_VELOCITY_STD,
        NOISELESS_VELOCITY,
        learn,
    )
    start_scan_rows(radar.rows)
    start_path(radar.path, learn)
    radar.host_moves, radar.host_speed, radar.period = True, np.nan, FIRST_PERIOD
    start_target(radar, settings)


@inner
def start_target(radar, settings):
    """Nothing is seen; what was learnt of the signals stays."""
    radar.has_track, radar.taught = False, True
    radar.before_at = -np.inf
    radar.scans = 0
    radar.unseen = radar.other_in_part = radar.other_repeats = False
    radar.followed = 0
    radar.id = UNKNOWN_TRACK
    radar.remembered_count = 0
    radar.slow_acceleration = radar.slower_acceleration = settings.lead_acceleration_mean
    radar.host = radar.held.travelled = 0.0
    radar.held.lead = radar.held.changed = radar.held.most_changed = 0.0
    radar.held.clearance = radar.held.off = radar.held.expected_off = 0.0
    radar.beside = radar.held.beside = 0.0
    radar.held.leapt_to_zero = False
    radar.held.sees_again_at = radar.shifted_at = radar.regained_at = -np.inf
    radar.catching.since = -np.inf
    restart_scan_rows(radar.rows)
    clear_path(radar.path)
    forget_leap(radar.leap)
    restart_signal(radar.clearance)
    restart_signal(radar.velocity)


@inner
def restart_radar(radar, settings):
    """Nothing from before counts, faults neither; what was learnt of the noise stays."""
    start_target(radar, settings)
    forgive(radar.clearance)
    forgive(radar.velocity)
    radar.clearance.ended_size = radar.velocity.ended_size = np.nan


@inner
def is_ready(radar):
    """Whether the target is known long enough to be judged."""
    return radar.has_track and radar.scans >= READY_SCANS


@inner
def is_radar_faulty(radar):
    """Whether either signal is."""
    return radar.clearance.faulty or radar.velocity.faulty


@inner
def is_reference_lost(radar):
    """Whether there is a faulty signal that nothing can be told from."""
    return radar.clearance.lost or radar.velocity.lost


@inner
def are_heard(radar):
    """Whether clearance and relative velocity are of the target that is seen now, though maybe not
    measured any more."""
    later = radar.clearance.last_at - radar.velocity.last_at
    return not (radar.other_in_part and later < 0.0), not (radar.other_in_part and later > 0.0)


@inner
def is_either_held(radar):
    """Whether the fault of either signal is that it repeats itself."""
    return repeats(radar.clearance.kind) or repeats(radar.velocity.kind)


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
def cut_path(radar):
    """The clearance may have stepped for a good reason."""
    clear_path(radar.path)
    restart_roughness(radar.clearance.roughness)
    restart_roughness(radar.velocity.roughness)


@inner
def go_over(radar, clearance, variance):
    """The radar sees another part of the same car: the track goes on from there (m, m^2)."""
    radar.elsewhere += clearance - radar.track.clearance
    radar.undrifted += clearance - radar.track.clearance
    set_clearance(radar.track, clearance, variance)


@inner
def clearance_now(radar):
    """The clearance (m) that the scan says for this step."""
    clearance = radar.measured_clearance
    return clearance.value + radar.measured_velocity.value * clearance.age


@inner
def widening(radar):
    """How much wider limits are while the noise is being learnt."""
    scans = radar.clearance.noise.count
    wide = 1.0 + 2.0 * exp(-scans / LEARNING)
    if scans < FEW_SCANS:
        return wide
    return min(wide, max(1.0, TIMES_SEEN * max(radar.clearance.roughest, radar.velocity.roughest)))


@inner
def _least_of_velocity(radar, settings):
    """Least limit of the relative velocity (m/s), by how far it swung so far."""
    least = least_limit(radar.velocity)
    if not settings.learn_noise or radar.measured_velocity.value == 0.0:
        # What swings is nowhere exactly.
        return least
    return least * max(1.0, min(SWUNG * radar.velocity.swung, WIDEST))


@inner
def limits_about(radar, settings):
    """Limits of clearance (m) and relative velocity (m/s) around the track."""
    wide, sigma = widening(radar), settings.gate_sigma
    clearance = deviation_about(radar.clearance, radar.track.cc)
    velocity = deviation_about(radar.velocity, radar.track.vv)
    return (
        wide * max(least_limit(radar.clearance), sigma * clearance),
        wide * max(_least_of_velocity(radar, settings), sigma * velocity),
    )


@inner
def wander_of(radar, settings):
    """Variance in m^2 of what the clearance lies beside the path for a while."""
    drifted = VELOCITY_BIAS * settings.drift_window
    return wander(radar.path, radar.clearance.noise.variance, drifted)
