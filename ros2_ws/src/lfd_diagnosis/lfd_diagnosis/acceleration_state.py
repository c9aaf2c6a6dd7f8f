"""What is known of the host's accelerometer: its samples, what they are held against, its fault."""

import numpy as np

from lfd_diagnosis.acceleration_jump import AT_ONCE_SHARE, JUMP, LOOKED_AT, restart_jump, start_jump
from lfd_diagnosis.acceleration_shaking import SHAKING, lose_shaking
from lfd_diagnosis.evidence import BECAUSE, CHECK, Ground
from lfd_diagnosis.host_speed import HOST_SPEED, restart_speed, start_speed
from lfd_diagnosis.noise import LEARNT_NOISE, start_noise
from lfd_diagnosis.repetition import REPETITION, restart_repetition, start_repetition
from lfd_diagnosis.ring import RING, at, start_ring
from lfd_diagnosis.road_bend import ROAD_BEND, start_bend
from lfd_diagnosis.roughness import ROUGHNESS, empty_roughness, start_roughness
from lfd_diagnosis.speed_derivative import jerk_between
from lfd_diagnosis.speed_lag import SPEED_LAG, forget_felt, start_lag
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

BASELINE, BASELINE_DELAY = 0.7, 30
"""Time constant in s and delay in steps of what the difference was a moment ago."""

BASE_SHARE = share_of(BASELINE)

SHARP, SHARP_GAP = 8, 4
"""Steps that are averaged before and after a jump, and steps between them."""

SAMPLES = 2 * SHARP + SHARP_GAP
"""Steps that are looked at for a jump."""

LEVEL_ROAD = 0.6
"""m/s^2 up to which what is felt may be a level road."""

NOISELESS = 0.025
"""Second differences in m/s^2 that an accelerometer without noise hardly exceeds."""

ROUGH_WINDOW = 64
"""Samples of which it is counted how many are rough."""

EQUAL_LEAST = 8
"""Equal samples in a row that are never suspect."""

STEP_NOISE, SLOW_NOISE = (0.15, 0.03, 1.0), (0.2, 0.05, 1.0)
"""What accelerometer and speed differ by otherwise than a moment ago, and otherwise than the slope:
deviations in m/s^2 at first, at least, and at most."""

REPORT_NOISE, JUMP_NOISE = (0.25, 0.1, 1.0), (0.2, 0.05, 1.5)
"""The same of what the lead's acceleration as seen differs by from its word, unless the parameters
say more at first; and of what the mean of the newest samples differs by from that just before."""

NOISE_MEMORY = 2000
"""Samples that these deviations are learnt from."""

LEARNT_EVERY = 10
"""Steps of which one is learnt from: those between them are filtered, and say much the same."""

OFF_RATE = 3.0
"""Share in 1/s by which it is followed how far a faulty one is off."""

RADAR_GONE = 30
"""Steps for which the last relative acceleration stands in for one that is no longer known."""

BEFORE_JUMP = 8
"""Steps by which a jump may be noticed late."""

LATELY = 60
"""Steps after a leap in which it may be what the accelerometer changed by."""

MOST_POSSIBLE = 30.0
"""m/s^2 that no car does: what says so tells nothing of the car."""

DIRECTION = np.dtype(
    [
        ("reverses", "?"),
        ("gained", "f8"),
        ("gained_since", "f8"),
        ("rested", RING),
        ("at_rest", "f8"),
    ],
    align=True,
)
"""Which way the car moves, as its speed has no sign: whether it `reverses`.

`gained` (m/s): what is felt to be gained since the car stood, NaN where its direction is known, or
will not be before it stands again; `gained_since` is the same beside what it felt as it stood: that
is `at_rest` (m/s^2), made of `rested`.
"""

ACCELERATION = np.dtype(
    [
        ("acceleration", "f8"),
        ("braked", "f8"),
        ("jolt", "f8"),
        ("stops_from", "f8"),
        # The samples.
        ("last_at", "f8"),
        ("fresh", "?"),
        ("taken", "f8"),
        ("doubted", "?"),
        ("leapt_at", "f8"),
        ("outliers", "i8"),
        ("new_samples", "i8"),
        ("samples", RING),
        ("filtered", "f8"),
        ("slow_filtered", "f8"),
        ("before_jump", RING),
        ("leapt_for", "i8"),
        ("leap", "f8"),
        ("leapt_ago", "i8"),
        ("roughness", ROUGHNESS),
        ("rough_for", "f8"),
        ("shaking", SHAKING),
        ("repetition", REPETITION),
        ("derivative_when_held", "f8"),
        ("felt_when_held", "f8"),
        # What they are held against: the host's speed.
        ("speed", HOST_SPEED),
        ("lead_rests_for", "f8"),
        ("direction", DIRECTION),
        ("lag", SPEED_LAG),
        ("slope", "f8"),
        ("slope_known", "f8"),
        ("slow_noise", LEARNT_NOISE),
        ("baseline", "f8"),
        ("difference", "f8"),
        ("recent", RING),
        ("bend", ROAD_BEND),
        ("step_noise", LEARNT_NOISE),
        ("jump", JUMP),
        # Without it: the lead as observers and accelerometer see it, and its own word.
        ("relative_then", "f8"),
        ("relative_now", "f8"),
        ("relative_slow", "f8"),
        ("relative", "f8"),
        ("radar_gone", "i8"),
        ("lead", "f8"),
        ("lead_slow", "f8"),
        ("lead_recent", RING),
        ("own_slow", "f8"),
        ("own_recent", RING),
        ("jump_noise", LEARNT_NOISE),
        ("jumped_for", "i8"),
        ("jump_sign", "f8"),
        ("before", "f8"),
        ("relative_before", "f8"),
        ("report_off", "f8"),
        ("unseen", "f8"),
        ("report_noise", LEARNT_NOISE),
        # The newest verdict.
        ("ticks", "i8"),
        ("check", CHECK),
        ("confidence", "i8"),
        ("exceeded_for", "i8"),
        # A fault, and what was there before it.
        ("faulty", "?"),
        ("kind", "i8"),
        ("because", BECAUSE),
        ("reference", "f8"),
        ("slope_before", "f8"),
        ("lead_reference", "f8"),
        ("off", "f8"),
        ("felt", "f8"),
        ("size", "f8"),
        ("size_std", "f8"),
        ("settled", "i8"),
        ("corrected", "?"),
        ("faded_for", "i8"),
        ("another_for", "i8"),
        ("came_at_once", "?"),
        ("level", "f8"),
        ("level_for", "f8"),
        ("silent_for", "f8"),
        ("back_for", "i8"),
        ("settling", "?"),
        ("undone", "f8"),
        ("undone_by", "f8"),
        ("agreeing", "f8"),
        ("must_agree", "f8"),
        # The fault before.
        ("ended_size", "f8"),
        ("ended_for", "f8"),
    ],
    align=True,
)
"""State of the acceleration signal; accelerations in m/s^2, times in s, what counts in `_for` as
an integer, `settled` and `ticks` in steps.

`acceleration` is how the host really accelerates, `braked` how hard it lately braked, `jolt` the
same while that may have ended at once, and `stops_from` while it comes to rest.

Samples. `taken`: the newest one that was taken; while newer ones leap from it, since `leapt_at`,
they are `doubted`; `new_samples` disagree since the confidence in a fault grows. `leap`: the last
one, `leapt_ago` steps ago, counts for `leapt_for` more. `derivative_when_held`: the speed's
derivative where it was nearest to what was felt when the newest value was first said
(`felt_when_held`).

Against the host's speed. `slope` is known as well as `slope_known` s of learning make it;
`difference` is what is felt beside what the speed tells; `baseline`, made of `recent`, is what
that was a moment ago.

Against the lead. `relative_now` is what observers say of two steps, `relative_slow` their mean,
`relative` the last one that was no answer to a jump; nothing for `radar_gone` steps. `lead` is what
it then does, `lead_slow` and `own_slow` what it and the host did a moment ago. A jump has
`jumped_for` more steps to be answered in; `before`, `relative_before`: samples and `relative_slow`
as it began. `report_off`: what the lead's word is off by, `unseen`: what observers may not have
seen yet of what is felt.

A fault. It is held against `reference`, the slope by now, or `lead_reference`; `off` and `felt` are
the means of what it is off by and of what it and the speed differ by; `settled` steps old.
`corrected`: whether it is off by its `size` still, so that the rest of it is healthy. `undone`:
what that would be as a jump, of `undone_by`, has just been undone, if all of it was.
`came_at_once`: whether the fault jumped; `level`: where what is felt has stayed for `level_for`;
`settling`: whether that is the road's. `silent_for`: how long nothing was heard. `must_agree`: for
how long what agrees must do so. `ended_size`: of the fault that was over last, `ended_for` by now,
NaN if none was.
"""


@inner
def start_acceleration(monitor, settings):
    """Begin with nothing."""
    learn = settings.learn_noise
    start_speed(monitor.speed, learn)
    start_roughness(monitor.roughness, ROUGH_WINDOW, NOISELESS)
    start_repetition(monitor.repetition, EQUAL_LEAST)
    monitor.derivative_when_held = monitor.felt_when_held = np.nan
    start_noise(monitor.step_noise, STEP_NOISE, learn, NOISE_MEMORY)
    start_noise(monitor.slow_noise, SLOW_NOISE, learn, NOISE_MEMORY)
    said = max(REPORT_NOISE[0], settings.lead_report_std)
    report = (said, REPORT_NOISE[1], REPORT_NOISE[2])
    start_noise(monitor.report_noise, report, learn, NOISE_MEMORY)
    start_noise(monitor.jump_noise, JUMP_NOISE, learn, NOISE_MEMORY)
    start_jump(monitor.jump, learn)
    start_lag(monitor.lag)
    monitor.ticks = monitor.outliers = 0
    restart_acceleration(monitor)


@inner
def restart_acceleration(monitor):
    """Nothing from before counts but what was learnt."""
    monitor.check.ground = Ground.NONE
    # It may be another road.
    monitor.slope = monitor.slope_known = 0.0
    forgive_acceleration(monitor)
    restart_speed(monitor.speed)
    empty_roughness(monitor.roughness)
    restart_repetition(monitor.repetition)
    monitor.last_at, monitor.fresh, monitor.new_samples = -np.inf, False, 0
    lose_samples(monitor)
    monitor.lead_rests_for = monitor.silent_for = 0.0
    direction = monitor.direction
    direction.reverses = False
    direction.gained = direction.gained_since = direction.at_rest = np.nan
    monitor.relative_then = monitor.relative_now = monitor.relative_slow = 0.0
    monitor.before = monitor.relative_before = 0.0
    monitor.relative, monitor.radar_gone = 0.0, RADAR_GONE
    monitor.jump_sign = 0.0
    monitor.braked = monitor.jolt = monitor.stops_from = 0.0
    monitor.acceleration = 0.0
    monitor.ended_size, monitor.ended_for = np.nan, 0.0


@inner
def lose_samples(monitor):
    """None is new enough: what comes next may have little to do with those before."""
    monitor.taken, monitor.doubted = np.nan, False
    monitor.filtered = monitor.slow_filtered = np.nan
    monitor.leap, monitor.leapt_for, monitor.leapt_ago = 0.0, 0, 0
    forget_felt(monitor.lag)
    start_ring(monitor.before_jump, BEFORE_JUMP)
    start_ring(monitor.samples, SAMPLES)
    lose_shaking(monitor.shaking)
    monitor.rough_for = 0.0
    monitor.lead = monitor.lead_slow = monitor.own_slow = np.nan
    start_ring(monitor.lead_recent, BASELINE_DELAY)
    start_ring(monitor.own_recent, BASELINE_DELAY)
    monitor.report_off = monitor.unseen = 0.0
    monitor.jumped_for = 0


@inner
def forgive_acceleration(monitor):
    """It is not faulty any more, and nothing is known of a fault."""
    monitor.faulty, monitor.kind = False, Kind.UNKNOWN
    monitor.because.ground = Ground.NONE
    monitor.confidence, monitor.agreeing = 0, 0.0
    monitor.exceeded_for = 0
    monitor.reference = monitor.lead_reference = monitor.slope_before = np.nan
    monitor.corrected, monitor.faded_for, monitor.another_for = False, 0, 0
    monitor.level, monitor.level_for = np.nan, 0.0
    monitor.size = monitor.size_std = monitor.off = monitor.felt = np.nan
    monitor.settled = 0
    # The way back is no noise.
    forget_differences(monitor)
    monitor.back_for, monitor.settling = 0, False


@inner
def forget_differences(monitor):
    """What differed between accelerometer and speed until now tells nothing of what will."""
    forget_baseline(monitor)
    restart_jump(monitor.jump)
    start_bend(monitor.bend)


@inner
def forget_baseline(monitor):
    """What the difference was a moment ago is not known."""
    monitor.baseline = np.nan
    start_ring(monitor.recent, BASELINE_DELAY)


@inner
def felt_jerk(monitor):
    """The jerk that the accelerometer feels, in m/s^3."""
    return jerk_between(monitor.filtered, monitor.slow_filtered)


@inner
def has_leapt(monitor, by):
    """Whether the samples lately leapt by most of that many m/s^2."""
    return monitor.leapt_ago < LOOKED_AT and monitor.leap * by > AT_ONCE_SHARE * by * by


@inner
def leapt_lately(monitor):
    """Whether what its samples changed by just now may be a leap of its own."""
    return monitor.leapt_ago < LATELY


@inner
def follow_off(monitor, residual):
    """How far a faulty one is off (m/s^2), without its noise."""
    monitor.off += OFF_RATE * STEP_S * (residual - monitor.off)


@inner
def as_possible(value):
    """A sample (m/s^2), not beyond what is possible."""
    return min(max(value, -MOST_POSSIBLE), MOST_POSSIBLE)


@inner
def is_possible(monitor):
    """Whether the newest sample that was taken may be what the car does; not where there is
    none."""
    return abs(monitor.taken) < MOST_POSSIBLE


@inner
def newest_sample(monitor):
    """The newest measurement in m/s^2, as far as it is possible."""
    return at(monitor.samples, monitor.samples.count - 1)
