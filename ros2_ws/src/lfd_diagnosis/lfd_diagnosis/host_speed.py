"""What is known of the host's speed: its samples, its derivative, and whether it is believed."""

from math import isnan

import numpy as np

from lfd_diagnosis.evidence import BECAUSE, Ground, give_ground, is_gauged
from lfd_diagnosis.noise import LEARNT_NOISE, deviation, start_noise
from lfd_diagnosis.repetition import REPETITION, restart_repetition, start_repetition
from lfd_diagnosis.roughness import ROUGHNESS, empty_roughness, resolution_of, start_roughness
from lfd_diagnosis.speed_derivative import SPEED_MOTION, has_settled, lose_motion
from lfd_diagnosis.speed_spacing import SPACING, lose_spacing, start_spacing
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import inner

STANDING = 0.3
"""m/s up to which the car may as well stand: then equal samples mean nothing."""

SLOW = 2.0
"""m/s below which a wheel turns so quietly that it tells nothing of a shaken car."""

NOISE, NOISE_MEMORY = (0.03, 0.003, 1.0), 400
"""What a healthy speed jumps by from sample to sample: deviations in m/s at first, at least, and at
most; and samples that they are learnt from."""

ROUGH_WINDOW = 32
"""Samples of which it is counted how many are rough."""

NOISELESS = 0.0105
"""Second differences in m/s that a speed without noise hardly exceeds."""

EQUAL_MOST = 10
"""Equal samples in a row that are never suspect, at most: of a speed that is heard very often."""

RATTLES, BUMP = 9, 30
"""Steps for which a wheel that was shaken is not believed to the last, and steps for which the road
may still shake the car."""

COARSE = 0.15
"""m/s of resolution beyond which each step of the speed makes its derivative go up and down as a
road that bends would."""

HEARD_OFTEN = 0.02
"""Seconds between two samples up to which a speed is heard all the time."""

LONGEST_FELT = 1.0
"""Seconds over which the acceleration at a sample may be taken for that since the one before."""

DRIFT_DOUBT = 0.3
"""m/s^2 by which the rate of a drift may be wrong all along: accelerometers are off by as much for
long."""

HELD_SPEED = np.dtype(
    [
        ("repetition", REPETITION),
        ("same", "i8"),
        ("same_for", "f8"),
        ("missed", "f8"),
        ("still", "?"),
        ("changed_at", "f8"),
        ("refresh", "f8"),
    ],
    align=True,
)
"""How a speed repeats itself: `same` samples in a row are equal, also those of a car that seems to
stand, for `same_for` s, in which what is felt should have changed it by `missed` (m/s).

`still`: whether it has said the same ever since it was called held. `refresh` (s): for how long the
sensor, or a table it was put into, says each value again and again; it changed at `changed_at`.
"""

DOUBTED_SPEED = np.dtype(
    [("jump", "f8"), ("since", "f8"), ("possible", "f8"), ("outliers", "i8")], align=True
)
"""What the newest sample jumps by (`jump`, m/s), as long as that is in doubt, else NaN, and how far
a car may jump (`possible`). `since` (s): when the first one came that was in doubt, where none is,
the newest one; `outliers`: how many were, and turned out to be nothing but that."""

HOST_SPEED = np.dtype(
    [
        # What is usual of it while it is healthy.
        ("noise", LEARNT_NOISE),
        ("roughness", ROUGHNESS),
        # Its newest sample, and those just before.
        ("spacing", SPACING),
        ("last", "f8"),
        ("last_at", "f8"),
        ("felt", "f8"),
        ("rough_for", "f8"),
        ("calm_for", "i8"),
        ("doubt", DOUBTED_SPEED),
        ("held", HELD_SPEED),
        ("motion", SPEED_MOTION),
        # Whether it is faulty, and how.
        ("faulty", "?"),
        ("kind", "i8"),
        ("because", BECAUSE),
        ("size", "f8"),
        ("size_std", "f8"),
        ("off", "f8"),
        ("quiet", "f8"),
    ],
    align=True,
)
"""State of the host's speed; m/s, s and m/s^2.

Samples. How often they come is in `spacing`; `last`, of `last_at`, is the newest one that was
taken, since it is in no doubt; `felt` is how the host accelerated then. It is rough for `rough_for`
s; `calm_for`: steps since a wheel was shaken.

Fault. `size` is what it is said to be off by; `off` sums up the jumps of a faulty one, or what it
drifted by; nothing was wrong with it for `quiet` s.
"""


@inner
def start_speed(speed, learn):
    """Begin with nothing."""
    start_noise(speed.noise, NOISE, learn, NOISE_MEMORY)
    start_roughness(speed.roughness, ROUGH_WINDOW, NOISELESS)
    start_repetition(speed.held.repetition, EQUAL_MOST)
    start_spacing(speed.spacing)
    speed.doubt.outliers, speed.held.refresh = 0, 0.0
    restart_speed(speed)


@inner
def restart_speed(speed):
    """Nothing from before counts but what was learnt."""
    believe_again(speed)
    speed.quiet = 0.0
    empty_roughness(speed.roughness)
    restart_repetition(speed.held.repetition)
    lose_speed(speed)


@inner
def believe_again(speed):
    """It is not faulty any more, and nothing is known of a fault."""
    speed.faulty, speed.kind = False, Kind.UNKNOWN
    speed.size = speed.size_std = np.nan
    speed.off, speed.held.still = 0.0, False
    speed.because.ground = Ground.NONE


@inner
def lose_speed(speed):
    """No sample, or none that is new enough."""
    lose_spacing(speed.spacing)
    forget_samples(speed)


@inner
def forget_samples(speed):
    """Those until now tell nothing."""
    speed.last, speed.last_at = np.nan, -np.inf
    speed.held.changed_at = -np.inf
    speed.doubt.jump, speed.doubt.since = np.nan, -np.inf
    speed.rough_for, speed.held.same, speed.felt = 0.0, 0, 0.0
    speed.calm_for = BUMP
    lose_motion(speed.motion)


@inner
def felt_for(speed, at):
    """Seconds that passed between the last sample and one of time `at` (s), no more than for which
    the host may be taken to have accelerated as it does by then."""
    return min(at - speed.last_at, LONGEST_FELT)


@inner
def seldom_heard(speed):
    """Seconds for which nothing is heard of it, beyond what its filter is made for."""
    return max(max(speed.held.refresh, speed.roughness.period) - HEARD_OFTEN, 0.0)


@inner
def is_believed(speed):
    """Whether it is heard and not called faulty: its derivative is evidence, or will be in a
    moment."""
    return not (isnan(speed.last) or speed.faulty)


@inner
def is_usable(speed, settings):
    """Whether its derivative is evidence now."""
    return not speed.faulty and has_settled(speed.motion, settings)


@inner
def may_be_right(speed):
    """Whether it is called faulty, but its derivative may be right by now."""
    return speed.faulty and is_gauged(speed.kind)


@inner
def seems_to_stand(speed):
    """Whether it says that the car stands."""
    return abs(speed.last) <= STANDING


@inner
def is_standing(speed):
    """Whether the car stands, as far as its speed is believed."""
    return not speed.faulty and seems_to_stand(speed)


@inner
def is_coarse(speed):
    """Whether its derivative goes up and down with each of its steps."""
    return resolution_of(speed.roughness) > COARSE


@inner
def rattles(speed):
    """Whether a wheel was shaken just now."""
    return speed.calm_for < RATTLES


@inner
def is_road_calm(speed):
    """Whether no wheel was shaken for a moment."""
    return speed.calm_for >= BUMP


@inner
def convict(speed, kind, size, ground, first, second, third):
    """It is wrong now. Unless it was called faulty before, it is from now on, with this kind of
    fault, its `size` (m/s), and the ground with its figures."""
    speed.quiet = 0.0
    if not speed.faulty:
        speed.faulty, speed.kind = True, kind
        speed.size, speed.size_std = size, deviation(speed.noise)
        give_ground(speed.because, ground, first, second, third)


@inner
def doubt_again(speed):
    """A faulty one still is wrong."""
    speed.quiet = 0.0


@inner
def drifts(speed):
    """Whether it is called faulty for leaving what the accelerometer feels."""
    return speed.faulty and speed.kind == Kind.RAMP


@inner
def convict_drift(speed, rate, limit, felt, since, filter_time):
    """It drifts from what the accelerometer feels, by `rate` (m/s^2) since so many s, give or take
    the filter's time; what is `felt` changed by so much (m/s^2) meanwhile."""
    convict(speed, Kind.RAMP, 0.0, Ground.SPEED_LEFT, rate, limit, felt)
    speed.off, speed.size_std = 0.0, abs(rate) * filter_time
    follow_drift(speed, rate, since)


@inner
def follow_drift(speed, rate, time):
    """One that drifts went on to do so, by `rate` (m/s^2) for a `time` (s)."""
    speed.off += rate * time
    speed.size = speed.off
    speed.size_std += DRIFT_DOUBT * time
