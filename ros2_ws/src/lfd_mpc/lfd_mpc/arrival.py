"""Which samples are believed, and which steps they release.

Everything is decided by stamps and by the order of arrival, never by a clock, so that a replay
gives the same steps as the drive did. Stamps are integer nanoseconds.
"""

import numpy as np

from lfd_mpc.compiled import entry, inner
from lfd_mpc.newest_value import (
    RHYTHM,
    SIGNAL,
    forget_rhythm,
    forget_signal,
    note_rhythm,
    period,
)
from lfd_mpc.samples import INPUTS, SAMPLE, UNKNOWN_TRACK, Input
from lfd_mpc.settings import STEP_NS
from lfd_mpc.step_inputs import Restart

SILENCE_NS = 50_000_000
"""How long a step waits for the accelerometer."""

MAX_GAP_NS = 300_000_000
MAX_GAP_PERIODS = 5
"""No steps are made across a gap of all inputs longer than the larger of `MAX_GAP_NS` and so many
periods of the slowest input."""

AHEAD_NS = 1_000_000_000
"""A stamp this far ahead of all other inputs is refused; where others agree with it, time has
jumped."""

LONG_AGO = -(2**62)
"""Before any stamp."""

WAITING = 4096
"""Samples of one input that may wait for their steps; more, within about a second, are refused."""

OWN_INPUTS, ALL_INPUTS = len(INPUTS), len(Input)
"""How many inputs are the vehicle's own, which come first; and with what the lead says."""

_QUEUE = np.dtype([("samples", SAMPLE, (WAITING,)), ("first", "i8"), ("count", "i8")], align=True)
"""Samples that wait for their steps, in the order in which they came."""

_EPOCH = np.dtype(
    [
        ("clearance", SIGNAL),
        ("relative_velocity", SIGNAL),
        ("acceleration", SIGNAL),
        ("host_speed", SIGNAL),
        ("lead_acceleration", SIGNAL),
        ("rhythms", RHYTHM, (OWN_INPUTS,)),
        ("queues", _QUEUE, (ALL_INPUTS,)),
        ("last", "i8", (ALL_INPUTS,)),
        ("heard", "i1", (ALL_INPUTS,)),
        ("newest", "i8"),
        ("started", "?"),
        ("next_step", "i8"),
        ("not_before", "i8"),
        ("stepping", "?"),
        ("has_target", "?"),
        ("track_id", "i8"),
        ("sensor_flags", "i8"),
        ("text", "i8"),
        ("known_track", "i8"),
    ],
    align=True,
)
"""Everything that a restart in time throws away."""

SAMPLER = np.dtype(
    [
        ("epoch", _EPOCH),
        ("step", "i8"),
        ("restart", "i8"),
        ("restart_values", "f8", (2,)),
        ("late", "i8"),
        ("refused", "i8"),
        ("bad", "i8"),
        # A sample whose stamp does not fit waits here for another one that confirms it;
        # `contradicted` where one has fitted since.
        ("odd", SAMPLE),
        ("is_odd", "?"),
        ("contradicted", "?"),
        # What a sample has set off and `next_step` carries out.
        ("releasing", "?"),
        ("limit", "i8"),
        ("released_by", "i8"),
        ("held", SAMPLE, (2,)),
        ("held_count", "i8"),
        ("held_fits", "?"),
        # Whether two inputs agree on the time.
        ("settled", "?"),
        ("current", SAMPLE),
        ("restarting", "?"),
        ("gap_values", "f8", (2,)),
    ],
    align=True,
)
"""State of a sampler."""

NOBODY = np.iinfo(np.int64).min
"""Stands for no acceleration sample where one releases steps."""


@inner
def start_epoch(epoch):
    """Forget everything that a restart in time throws away."""
    for signal in (
        epoch.clearance,
        epoch.relative_velocity,
        epoch.acceleration,
        epoch.host_speed,
        epoch.lead_acceleration,
    ):
        forget_signal(signal)
        forget_rhythm(signal.rhythm)
    for i in range(OWN_INPUTS):
        forget_rhythm(epoch.rhythms[i])
    for i in range(ALL_INPUTS):
        epoch.queues[i].first = epoch.queues[i].count = 0
        epoch.heard[i] = 0
    epoch.started = epoch.stepping = epoch.has_target = False
    epoch.not_before = LONG_AGO
    epoch.track_id = epoch.known_track = UNKNOWN_TRACK
    epoch.sensor_flags = epoch.text = 0


@inner
def _max_gap(epoch):
    slowest = 0.0
    for i in range(OWN_INPUTS):
        slowest = max(slowest, period(epoch.rhythms[i]))
    return max(float(MAX_GAP_NS), MAX_GAP_PERIODS * slowest)


@entry
def start_sampler(samplers):
    """Begin with nothing."""
    sampler = samplers[0]
    start_epoch(sampler.epoch)
    sampler.restart = Restart.START
    sampler.step = sampler.late = sampler.refused = sampler.bad = sampler.held_count = 0
    sampler.is_odd = sampler.contradicted = sampler.settled = False
    sampler.releasing = sampler.restarting = sampler.held_fits = False


@inner
def _enqueue(sampler, sample):
    queue = sampler.epoch.queues[sample.input]
    if queue.count == WAITING:
        sampler.refused += 1
        return
    queue.samples[(queue.first + queue.count) % WAITING] = sample
    queue.count += 1


@inner
def release(sampler, limit, released_by):
    """Let `next_step` make the steps up to `limit`."""
    sampler.releasing, sampler.limit, sampler.released_by = True, limit, released_by


@inner
def _count_heard(epoch):
    """How many of the vehicle's own inputs have been heard."""
    heard = 0
    for i in range(OWN_INPUTS):
        heard += epoch.heard[i]
    return heard


@inner
def accept(sampler, sample):
    """Let a sample wait for its step, and release the steps that need no other."""
    epoch, stamp = sampler.epoch, sample.stamp
    epoch.last[sample.input] = stamp
    epoch.heard[sample.input] = 1
    sampler.settled = sampler.settled or _count_heard(epoch) > 1
    note_rhythm(epoch.rhythms[sample.input], stamp)
    epoch.newest = max(epoch.newest, stamp) if epoch.started else stamp
    epoch.started = True
    _enqueue(sampler, sample)
    begin = epoch.next_step if epoch.stepping else epoch.not_before
    if stamp <= begin - STEP_NS:
        sampler.late += 1
    if sample.input == Input.ACCELERATION:
        release(sampler, stamp, stamp)
    else:
        release(sampler, stamp - SILENCE_NS, NOBODY)


@inner
def _overhear(sampler, sample):
    """Take what the lead says, where it fits in with what is measured here."""
    epoch, stamp = sampler.epoch, sample.stamp
    if (
        not epoch.started
        or abs(stamp - epoch.newest) > AHEAD_NS
        or (epoch.heard[sample.input] and stamp <= epoch.last[sample.input])
    ):
        sampler.refused += 1
        return
    epoch.last[sample.input] = stamp
    epoch.heard[sample.input] = 1
    _enqueue(sampler, sample)


@inner
def take_next(sampler, sample):
    """Take a sample that fits; across a gap of all inputs that means to start anew."""
    epoch = sampler.epoch
    newest, stamp = epoch.newest, sample.stamp
    if stamp > newest + MAX_GAP_NS:
        max_gap = _max_gap(epoch)
        if stamp > newest + max_gap:
            release(sampler, newest, NOBODY)
            sampler.restarting = True
            sampler.gap_values[0] = (stamp - newest) * 1e-9
            sampler.gap_values[1] = max_gap * 1e-9
            # It comes before what may be held already.
            if sampler.held_count:
                sampler.held[1] = sampler.held[0]
            sampler.held[0] = sample
            sampler.held_count += 1
            return
    accept(sampler, sample)


@inner
def _drop_odd(sampler):
    """Refuse the sample that nothing confirmed."""
    sampler.refused += sampler.is_odd
    sampler.is_odd = False


@inner
def _jump(sampler, sample):
    """A stamp that went backwards, or far ahead: believed if a second input agrees."""
    newest, stamp, odd = sampler.epoch.newest, sample.stamp, sampler.odd
    ahead = stamp > newest
    confirmed = False
    if sampler.is_odd and (odd.stamp > newest) == ahead:
        if odd.input != sample.input:
            confirmed = abs(stamp - odd.stamp) <= AHEAD_NS
        elif not sampler.contradicted:
            # A lone input may have skipped: it is believed once nothing contradicts it for long.
            if 0 < stamp - odd.stamp <= AHEAD_NS:
                sampler.refused += 1
                return
            confirmed = AHEAD_NS < stamp - odd.stamp <= 2 * AHEAD_NS
    if not confirmed:
        _drop_odd(sampler)
        sampler.odd, sampler.is_odd, sampler.contradicted = sample, True, False
        return
    sampler.is_odd = False
    sampler.held[0], sampler.held_count = sample, 1
    sampler.settled = False
    if ahead:
        # With one input alone its second sample is ahead of the first by a second.
        take_next(sampler, odd)
        return
    sampler.held_fits = True
    sampler.restart = Restart.TIME_WENT_BACK
    sampler.restart_values[0] = (newest - odd.stamp) * 1e-9
    start_epoch(sampler.epoch)
    accept(sampler, odd)


@inner
def push_sample(sampler, sample):
    """Take one sample; `next_step` gives the steps that it releases.

    Samples that do not fit are counted, never raised. Two inputs that agree on a jump of time make
    a restart, and one that nothing contradicts for a second; else it is taken for a wrong stamp.
    """
    epoch, stamp = sampler.epoch, sample.stamp
    if sample.input == Input.LEAD_ACCELERATION:
        _overhear(sampler, sample)
        return
    if not epoch.started:
        accept(sampler, sample)
        return
    backward = False
    useless = False
    if epoch.heard[sample.input]:
        previous = epoch.last[sample.input]
        backward, useless = stamp < previous, stamp == previous
    elif stamp < epoch.newest - AHEAD_NS:
        # Of two inputs either may be the wrong one; against two a third one is, or comes late.
        backward, useless = not sampler.settled, sampler.settled
    if useless:
        sampler.refused += 1
    elif backward or stamp > epoch.newest + AHEAD_NS:
        _jump(sampler, sample)
    else:
        if sampler.is_odd and (
            sampler.odd.stamp > epoch.newest or sampler.odd.input == sample.input
        ):
            _drop_odd(sampler)
        sampler.contradicted = True
        take_next(sampler, sample)
