"""Whether both signals of a radar say the same: held, without noise, at rest, or sent again."""

from math import isnan

from lfd_diagnosis.evidence import repeats
from lfd_diagnosis.radar_residual import is_bad
from lfd_diagnosis.radar_state import is_either_held
from lfd_diagnosis.repetition import CHANCE, is_beyond_chance, run_by_chance
from lfd_diagnosis.roughness import is_noiseless, resolution_of
from lfd_mpc.compiled import inner

LEAD_AT_REST = 0.5
"""Speed in m/s below which a lead may stand: it brakes no further."""

STAYS = 0.1
"""m that may be travelled while a clearance says the same, and nothing contradicts that."""

CALM_CHANCE = 1e-2
"""Probability below which what repeats itself for a moment may be that of a radar which lost its
target, or whose message is sent again."""

SENT_AGAIN = 0.25
"""Seconds for which a radar's last message may be sent again and again."""


@inner
def stand_both(radar):
    """Whether the car stands, and its lead may, too."""
    return not radar.host_moves and abs(radar.measured_velocity.value) < LEAD_AT_REST


@inner
def may_both_stand(radar):
    """Whether both cars may stand, where the host's speed is not known."""
    return isnan(radar.host_speed) and abs(radar.measured_velocity.value) < LEAD_AT_REST


@inner
def is_without_noise(radar):
    """Whether neither of its signals has any noise."""
    return is_noiseless(radar.clearance.roughness) and is_noiseless(radar.velocity.roughness)


@inner
def stays_without_noise(radar):
    """Whether neither of its signals has any noise and hardly any way is travelled: a clearance
    may then rightly say the same."""
    most = STAYS + resolution_of(radar.clearance.roughness)
    stays = abs(radar.held.travelled) <= most and not is_either_held(radar)
    return stays and is_without_noise(radar)


@inner
def velocity_seems_held(radar):
    """Whether the relative velocity has said the same for longer than its noise would have it."""
    signal = radar.velocity
    beyond_chance = is_beyond_chance(signal.repetition, signal.repetition.run)
    return beyond_chance and not is_noiseless(signal.roughness)


@inner
def repeat_together(radar):
    """Whether the radar says the same again and again: one signal does, the other since then."""
    own, other = radar.clearance.repetition, radar.velocity.repetition
    if stays_without_noise(radar):
        return False
    if own.value == 0.0 and other.value != 0.0:
        # A clearance of zero beside a relative velocity that is not: no radar stopped at that.
        return False
    apart = other.run - own.run
    together = -run_by_chance(own, CHANCE) <= apart <= run_by_chance(other, CHANCE)
    return is_either_held(radar) and together


@inner
def repeats_with_held(radar):
    """Whether a relative velocity has said the same since a clearance that is held did: it may be
    held, too, and teaches nothing."""
    same = radar.velocity.repetition.run > 0 and repeat_together(radar)
    return same and repeats(radar.clearance.kind)


@inner
def is_sent_again(radar, settings):
    """Whether both signals repeat themselves for a moment, not by coincidence, nor because hardly
    anything moves: the last message is sent again. Scans that are off are not taken for that: each
    of them counts."""
    clearance, velocity = radar.clearance, radar.velocity
    if not settings.check_repetition or is_bad(clearance) or is_bad(velocity):
        return False
    if is_without_noise(radar):
        return False
    run = min(clearance.repetition.run, velocity.repetition.run)
    time = run * radar.period
    if isnan(radar.host_speed) or time > SENT_AGAIN:
        return False
    if abs(velocity.last) * time < resolution_of(clearance.roughness):
        return False
    by_chance = run_by_chance(clearance.repetition, CALM_CHANCE)
    return run / by_chance + run / run_by_chance(velocity.repetition, CALM_CHANCE) >= 1.0
