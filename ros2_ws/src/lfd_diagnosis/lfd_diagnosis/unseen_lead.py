"""Whether a radar that lost its lead goes on from what it knew, and catches up afterwards."""

import numpy as np

from lfd_diagnosis.noise import deviation
from lfd_diagnosis.radar_repetition import CALM_CHANCE, is_without_noise
from lfd_diagnosis.radar_residual import is_bad
from lfd_diagnosis.radar_state import wander_of
from lfd_diagnosis.repetition import run_by_chance
from lfd_diagnosis.roughness import resolution_of
from lfd_mpc.compiled import inner

UNSEEN_LEAD, UNSEEN_LEAST, UNSEEN_MOST = 2.0, 0.2, 0.5
"""m/s^2 that a lead may begin to accelerate by while a radar that lost it says what it knew, and
seconds for which it does so: what repeats itself for less does so by coincidence, what does for
longer is calm, coarse, or held."""

COMPUTED, TOO_SMOOTH = 2.0, 2.0
"""Seconds for which it does so at most where the clearance is surely made of what the radar knew,
and deviations of its noise that a clearance wavers by at least if it is measured."""

ROUNDED, STAMPS_WAVER = 1.5, 0.005
"""Steps of its resolution, and s of the way, by which a clearance may waver that is made of a
relative velocity."""

ONE_SCAN = 0.5
"""Scans by which the time between two stamps may waver."""

WEIGHED, WEIGHS, OFF_AT_ONCE = 0.5, 5.0, 0.5
"""Seconds in which the clearance tells whether a relative velocity catches up, deviations that this
must come to, and share of its limit by which it must be off as soon as it says something new."""

FOLLOWS, SURELY_FOLLOWS = 0.5, 0.25
"""Share of what it catches up by that the clearance must show; the same where it repeated itself by
no coincidence: some clearances are late."""


@inner
def unseen_for(radar, lasts):
    """Seconds for which the radar may have gone on without its target, the clearance just as the
    relative velocity says that repeats itself since `lasts` s; 0 where it does not go so."""
    wavers = STAMPS_WAVER * abs(radar.velocity.last)
    wavers += ROUNDED * resolution_of(radar.clearance.roughness)
    # Without a clearance nothing says so.
    if not 0.0 <= radar.held.most_off - radar.held.least_off <= wavers:
        return 0.0
    # Were it held, it would not have moved along.
    moved = abs(radar.velocity.last) * lasts > wavers
    computed = moved and TOO_SMOOTH * deviation(radar.clearance.noise) > wavers
    return (COMPUTED if computed else UNSEEN_MOST) + ONE_SCAN * radar.period


@inner
def may_be_unseen(radar):
    """Whether a relative velocity repeats itself for no longer than a radar goes on without its
    target, and the clearance goes just as that says, as if it were made of it."""
    lasts = radar.velocity.last_at - radar.held.since
    return not radar.held.leapt_to_zero and lasts <= unseen_for(radar, lasts)


@inner
def follow_catching_up(radar, settings):
    """Follow a relative velocity that may say by now, all at once, what it did not say while it
    repeated itself, scan by scan: a radar that lost its target goes on from what it knew."""
    velocity, catching = radar.measured_velocity, radar.catching
    if not velocity.new or radar.velocity.faulty:
        return
    since = velocity.at - catching.since
    if radar.held.sees_again_at == velocity.at and not radar.velocity.confidence:
        _begin_to_catch_up(radar, settings)
        since = 0.0
    elif since > WEIGHED:
        return
    else:
        period = velocity.at - radar.velocity.last_at
        way = 0.5 * (radar.velocity.last + velocity.value) - catching.jump
        catching.clearance += way * period
    if _clearance_tells(radar):
        # Where the lead was lost, it went over to the new relative velocity meanwhile.
        most = catching.jump * (0.5 * catching.lost_for + since)
        catching.told += (radar.measured_clearance.value - catching.clearance) * most
        catching.most += most * most


@inner
def _begin_to_catch_up(radar, settings):
    """The relative velocity has just ceased to repeat itself."""
    held, catching, wavers = radar.held, radar.catching, ONE_SCAN * radar.period
    catching.since = -np.inf
    lasted = held.unsaid_for
    for_a_moment = UNSEEN_LEAST - wavers <= lasted <= max(UNSEEN_MOST + wavers, held.unseen_for)
    if not (settings.check_repetition and for_a_moment) or is_without_noise(radar):
        return
    now = radar.measured_velocity.at
    catching.since, catching.jump = now, radar.velocity.residual
    catching.unsaid = held.unsaid
    catching.lost_for = lasted + now - radar.velocity.last_at
    by_chance = radar.period * run_by_chance(radar.velocity.repetition, CALM_CHANCE)
    catching.surely = by_chance <= lasted
    # What was expected of it all the same.
    expected = radar.measured_velocity.value - radar.velocity.last - catching.jump
    catching.clearance = held.went_on_to + 0.5 * expected * catching.lost_for
    catching.told = catching.most = 0.0


@inner
def catches_up(radar, settings):
    """Whether a relative velocity that is off catches up, for all that is known by now."""
    catching = radar.catching
    if not _may_catch_up(radar) or is_weighed(radar, settings):
        return False
    doubt = radar.velocity.limit + UNSEEN_LEAD * catching.lost_for
    if abs(catching.jump - catching.unsaid) > doubt:
        return False
    if _is_told(radar, settings):
        share = SURELY_FOLLOWS if catching.surely else FOLLOWS
        return catching.told > share * catching.most
    return catching.surely


@inner
def is_weighed(radar, settings):
    """Whether the clearance must yet tell if a relative velocity that is off catches up."""
    lasts = radar.measured_velocity.at - radar.catching.since
    # A zero that goes on tells by itself, and sooner.
    waits = lasts <= WEIGHED - radar.period and not radar.held.leapt_to_zero
    waits = waits and _clearance_tells(radar)
    return _may_catch_up(radar) and waits and not _is_told(radar, settings)


@inner
def _may_catch_up(radar):
    """Whether a relative velocity has been off, to the same side, since it ceased to repeat
    itself."""
    velocity, jump = radar.velocity, radar.catching.jump
    lasts = radar.measured_velocity.at - radar.catching.since
    at_once = jump * velocity.residual > 0.0 and abs(jump) >= OFF_AT_ONCE * velocity.limit
    return lasts <= WEIGHED and at_once


@inner
def _is_told(radar, settings):
    """Whether the clearance tells by now if a relative velocity catches up."""
    variance = radar.clearance.noise.variance + radar.held.track.cc + wander_of(radar, settings)
    return radar.catching.most >= WEIGHS**2 * variance


@inner
def _clearance_tells(radar):
    """Whether the clearance is no more off than that of a radar which catches up."""
    clearance = radar.clearance
    if clearance.faulty or not radar.measured_clearance.new:
        return False
    return not is_bad(clearance) or clearance_catches_up(radar)


@inner
def clearance_catches_up(radar):
    """Whether the clearance jumps as it must where it was made of a relative velocity that now
    catches up: that way, and no farther than that was wrong for."""
    jump, path = radar.clearance.residual, radar.catching.jump * radar.catching.lost_for
    return jump * path > 0.0 and abs(jump) <= abs(path) + radar.clearance.limit
