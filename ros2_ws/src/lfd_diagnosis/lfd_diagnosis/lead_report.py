"""What the lead says of its own acceleration (V2V): whether it can serve as evidence."""

from math import isnan, sqrt

import numpy as np

from lfd_diagnosis.evidence import BECAUSE, Ground, give_ground
from lfd_diagnosis.sample import as_measured, is_new
from lfd_mpc.compiled import inner
from lfd_mpc.settings import STEP_S, share_of

FILTER = 0.3
"""Time constant in s through which what the lead says and what is seen of it are compared."""

DISAGREEMENT, NOISES = 1.5, 5.0
"""Least difference in m/s^2 that is called one, and in deviations of its noise."""

LEADS_JERK = 15.0
"""m/s^3 that a lead may reach."""

DISAGREEING = 0.3
"""Seconds of disagreement after which what the lead says is not believed."""

STILL_TELLS = 0.5
"""Seconds for which it may say the same and still tell how a lead goes on that nobody sees."""

SHARE = share_of(FILTER)

LEAD_REPORT = np.dtype(
    [
        ("faulty", "?"),
        ("because", BECAUSE),
        ("off", "f8"),
        ("filtered", "f8"),
        ("agreeing", "f8"),
        ("disagreeing", "f8"),
        ("acceleration", "f8"),
        ("heard", "?"),
        ("last_at", "f8"),
        ("same_for", "f8"),
    ],
    align=True,
)
"""What the lead says: `acceleration` (m/s^2), if it is `heard`, and for how many s it has said the
same (`same_for`); how far (m/s^2) it is `off` from what was seen of it last, `filtered` as long as
it is heard, and for how many s it has been `agreeing` or `disagreeing` with that."""


@inner
def restart_lead(lead):
    """Nothing that was said before counts."""
    lead.faulty, lead.heard = False, False
    lead.because.ground = Ground.NONE
    lead.off = lead.filtered = lead.acceleration = lead.last_at = np.nan
    lead.agreeing = lead.disagreeing = lead.same_for = 0.0


@inner
def lead_limit(settings):
    """Difference in m/s^2 beyond which what the lead says disagrees."""
    return max(DISAGREEMENT, NOISES * settings.lead_report_std)


@inner
def report_deviation(settings):
    """How far (m/s^2) what the lead says may be off by now: what it said was so some time ago."""
    since = settings.coasting_jerk_density * settings.lead_report_delay
    return sqrt(settings.lead_report_std**2 + since)


@inner
def is_trusted(lead, settings):
    """Whether it is evidence now: it has agreed for a while with what radar and host make of it."""
    return lead.heard and not lead.faulty and lead.agreeing >= settings.requalify_time


@inner
def tells_unseen(lead, settings):
    """Whether it tells how a lead goes on that the radar does not see: nothing contradicts then
    what is only said again and again."""
    return is_trusted(lead, settings) and lead.same_for <= STILL_TELLS


@inner
def _distrust(lead, ground, first, second, third):
    lead.agreeing = 0.0
    lead.faulty = True
    give_ground(lead.because, ground, first, second, third)


@inner
def follow_lead_report(lead, settings, horizon, seen):
    """Take one step; `seen`: the lead's acceleration in m/s^2 without it, NaN = not known."""
    age = horizon.lead_acceleration_age
    lead.heard = settings.use_lead_report and age <= settings.lead_report_timeout
    if not lead.heard:
        lead.acceleration = lead.filtered = lead.last_at = np.nan
        lead.agreeing = lead.disagreeing = 0.0
        return
    at = horizon.stamp * 1e-9 - age
    value = as_measured(horizon.measured_lead_acceleration)
    if is_new(at, lead.last_at):
        # No car changes its acceleration as fast; what jumps is not believed, seen or not.
        limit = NOISES * settings.lead_report_std + LEADS_JERK * (at - lead.last_at)
        if abs(value - lead.acceleration) > limit:
            _distrust(lead, Ground.LEAD_JUMPED, lead.acceleration, value, limit)
    lead.same_for = lead.same_for + STEP_S if value == lead.acceleration else 0.0
    lead.last_at, lead.acceleration = at, value
    if isnan(seen):
        return
    difference = value - seen
    if isnan(lead.filtered):
        lead.filtered = difference
    lead.filtered += SHARE * (difference - lead.filtered)
    lead.off = lead.filtered
    limit = lead_limit(settings)
    if abs(lead.off) <= limit:
        lead.disagreeing = 0.0
        lead.agreeing += STEP_S
        if lead.faulty and lead.agreeing >= settings.requalify_time:
            lead.faulty = False
            lead.because.ground = Ground.NONE
        return
    lead.disagreeing += STEP_S
    if lead.disagreeing >= DISAGREEING:
        _distrust(lead, Ground.LEAD_DISAGREES, value, value - lead.off, limit)
