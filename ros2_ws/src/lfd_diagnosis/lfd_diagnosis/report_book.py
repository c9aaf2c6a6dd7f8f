"""What has been said so far: since when, which states changed, and the radar as a whole."""

import numpy as np

from lfd_diagnosis.verdict import VERDICTS, State
from lfd_mpc.compiled import inner

BOOK = np.dtype(
    [("state", "i1", (len(VERDICTS),)), ("since", "i8", (len(VERDICTS),)), ("begun", "?")],
    align=True,
)
"""State and its beginning (ns) of each verdict that was published last."""

_BADNESS = np.zeros(len(State), np.int64)
for _rank, _state in enumerate(
    (State.OK, State.SUSPECT, State.NOT_READY, State.NO_TARGET, State.NO_DATA, State.FAULT)
):
    _BADNESS[_state] = _rank


@inner
def _enter(book, outcome, verdict, number):
    """Date a verdict, and note whether its state has changed."""
    stamp = outcome.stamp
    old_state, old_since = State.NOT_READY.value, stamp
    if book.begun:
        # Where time went back nothing has lasted for longer.
        old_state, old_since = book.state[number], min(book.since[number], stamp)
    same = book.begun and verdict.state == old_state
    verdict.since = old_since if same else stamp
    outcome.old_state[number], outcome.old_since[number] = old_state, old_since
    if verdict.state != old_state:
        outcome.changed |= 1 << number
    book.state[number], book.since[number] = verdict.state, verdict.since


@inner
def _velocity_is_worse(outcome):
    """Whether the relative velocity is worse than the clearance: the radar is as bad as that."""
    clearance, velocity = outcome.clearance, outcome.relative_velocity
    worse = _BADNESS[velocity.state] - _BADNESS[clearance.state]
    return worse > 0 or (worse == 0 and velocity.confidence > clearance.confidence)


@inner
def enter_outcome(book, outcome):
    """Make the radar's verdict of those on its two signals; date all, and note what changed."""
    radar = outcome.radar
    outcome.radar_is_velocity = _velocity_is_worse(outcome)
    worse = outcome.relative_velocity if outcome.radar_is_velocity else outcome.clearance
    radar.state, radar.kind, radar.index = worse.state, worse.kind, worse.index
    radar.threshold, radar.confidence = worse.threshold, worse.confidence
    radar.confidence_threshold = worse.confidence_threshold
    radar.size = radar.size_std = np.nan
    outcome.changed = 0
    _enter(book, outcome, outcome.clearance, 0)
    _enter(book, outcome, outcome.relative_velocity, 1)
    _enter(book, outcome, radar, 2)
    _enter(book, outcome, outcome.acceleration, 3)
    _enter(book, outcome, outcome.host_speed, 4)
    _enter(book, outcome, outcome.lead_acceleration, 5)
    book.begun = True
