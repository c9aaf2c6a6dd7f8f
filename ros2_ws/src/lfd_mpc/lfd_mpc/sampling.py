"""From samples to steps: when a step happens and which samples it uses.

Everything is decided by stamps and by the order of arrival, never by a clock, so that a replay
gives the same steps as the drive did. Stamps are integer nanoseconds.

Rules, in short: a step lies on every whole multiple of 10 ms. An acceleration sample releases the
steps up to its stamp; where the accelerometer is silent, any other input, or the clock, does so
50 ms later. A step uses the newest sample of each signal at or before it.

`take_sample` and `take_clock` take what arrives, `next_step` then gives the steps that this
releases, one after the other.
"""

from dataclasses import dataclass
from enum import IntEnum
from math import isfinite

import numpy as np

from lfd_mpc.compiled import borrowing, entry, inner, make_state
from lfd_mpc.samples import (
    INPUTS,
    LEAD_ACCELERATION,
    SAMPLE,
    UNKNOWN_TRACK,
    Input,
    Sample,
    SensorTexts,
    sample_fields,
)
from lfd_mpc.settings import STEP_NS

SILENCE_NS = 50_000_000
"""How long a step waits for the accelerometer."""

STALE_NS = 150_000_000
STALE_PERIODS = 3
"""A signal is stale when older than the larger of `STALE_NS` and so many of its own periods."""

MAX_GAP_NS = 300_000_000
MAX_GAP_PERIODS = 5
"""No steps are made across a gap of all inputs longer than the larger of `MAX_GAP_NS` and so many
periods of the slowest input."""

AHEAD_NS = 1_000_000_000
"""A stamp this far ahead of all other inputs is refused."""

PERIODS = 19
"""A signal's period is the median over so many, the last ones."""

LONG_AGO = -(2**62)
"""Before any stamp."""

WAITING = 4096
"""Samples of one input that may wait for their steps; more, within about a second, are refused."""


OWN_INPUTS, ALL_INPUTS = len(INPUTS), len(Input)
"""How many inputs are the vehicle's own, which come first; and with what the lead says."""


class Restart(IntEnum):
    """Why a step restarts."""

    NONE = 0
    START = 1
    TIME_WENT_BACK = 2
    GAP = 3
    NEW_LEAD = 4


READING = np.dtype([("measured", "f8"), ("age", "f8"), ("stale", "?")], align=True)
"""A signal at a step: newest sample `measured`, its `age` in s (both NaN = none), `stale`."""

STEP_INPUTS = np.dtype(
    [
        ("step", "i8"),
        ("stamp", "i8"),
        ("restart", "i8"),
        ("restart_values", "f8", (2,)),
        ("restart_tracks", "i8", (2,)),
        ("without_acceleration", "?"),
        ("has_target", "?"),
        ("track_id", "i8"),
        ("sensor_flags", "i8"),
        ("text", "i8"),
        ("clearance", READING),
        ("relative_velocity", READING),
        ("acceleration", READING),
        ("host_speed", READING),
        ("lead_acceleration", READING),
        ("clearance_now", "f8"),
        ("late_samples", "i8"),
        ("refused_samples", "i8"),
        ("bad_samples", "i8"),
    ],
    align=True,
)
"""What one step has to work with: the fields of `StepInputs`."""

_RHYTHM = np.dtype(
    [
        ("periods", "i8", (PERIODS,)),
        ("count", "i8"),
        ("next", "i8"),
        ("last", "i8"),
        ("started", "?"),
    ],
    align=True,
)
"""Stamp of the last sample of one signal and the periods between the last ones, in ns."""

_SIGNAL = np.dtype(
    [("rhythm", _RHYTHM), ("value", "f8"), ("stamp", "i8"), ("known", "?")], align=True
)
"""The newest value of one signal."""

_QUEUE = np.dtype([("samples", SAMPLE, (WAITING,)), ("first", "i8"), ("count", "i8")], align=True)
"""Samples that wait for their steps, in the order in which they came."""

_EPOCH = np.dtype(
    [
        ("clearance", _SIGNAL),
        ("relative_velocity", _SIGNAL),
        ("acceleration", _SIGNAL),
        ("host_speed", _SIGNAL),
        ("lead_acceleration", _SIGNAL),
        ("rhythms", _RHYTHM, (OWN_INPUTS,)),
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
def _note_rhythm(rhythm, stamp):
    if rhythm.started:
        rhythm.periods[rhythm.next] = stamp - rhythm.last
        rhythm.next = (rhythm.next + 1) % PERIODS
        rhythm.count = min(rhythm.count + 1, PERIODS)
    rhythm.last = stamp
    rhythm.started = True


@inner
def _period(rhythm):
    """Median period in ns, 0 while none is known."""
    n = rhythm.count
    if not n:
        return 0.0
    ordered = np.sort(rhythm.periods[:n])
    if n % 2:
        return float(ordered[n // 2])
    return (ordered[n // 2 - 1] + ordered[n // 2]) / 2


@inner
def _note_signal(signal, stamp, value):
    _note_rhythm(signal.rhythm, stamp)
    signal.stamp, signal.value, signal.known = stamp, value, True


@inner
def _forget_signal(signal):
    signal.known = False


@inner
def _read_signal(signal, stamp, reading):
    if not signal.known:
        reading.measured = reading.age = np.nan
        reading.stale = True
        return
    age = stamp - signal.stamp
    reading.measured, reading.age = signal.value, age * 1e-9
    # The period is asked for only where it matters: a median takes its time.
    reading.stale = age > STALE_NS and age > STALE_PERIODS * _period(signal.rhythm)


@inner
def _start_epoch(epoch):
    """Forget everything that a restart in time throws away."""
    for signal in (
        epoch.clearance,
        epoch.relative_velocity,
        epoch.acceleration,
        epoch.host_speed,
        epoch.lead_acceleration,
    ):
        signal.known = signal.rhythm.started = False
        signal.rhythm.count = signal.rhythm.next = 0
    for i in range(OWN_INPUTS):
        epoch.rhythms[i].started = False
        epoch.rhythms[i].count = epoch.rhythms[i].next = 0
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
        slowest = max(slowest, _period(epoch.rhythms[i]))
    return max(float(MAX_GAP_NS), MAX_GAP_PERIODS * slowest)


@entry
def start_sampler(samplers):
    """Begin with nothing."""
    sampler = samplers[0]
    _start_epoch(sampler.epoch)
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
def _release(sampler, limit, released_by):
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
def _accept(sampler, sample):
    epoch, stamp = sampler.epoch, sample.stamp
    epoch.last[sample.input] = stamp
    epoch.heard[sample.input] = 1
    sampler.settled = sampler.settled or _count_heard(epoch) > 1
    _note_rhythm(epoch.rhythms[sample.input], stamp)
    epoch.newest = max(epoch.newest, stamp) if epoch.started else stamp
    epoch.started = True
    _enqueue(sampler, sample)
    begin = epoch.next_step if epoch.stepping else epoch.not_before
    if stamp <= begin - STEP_NS:
        sampler.late += 1
    if sample.input == Input.ACCELERATION:
        _release(sampler, stamp, stamp)
    else:
        _release(sampler, stamp - SILENCE_NS, NOBODY)


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
def _continue(sampler, sample):
    """Take a sample that fits; across a gap of all inputs that means to start anew."""
    epoch = sampler.epoch
    newest, stamp = epoch.newest, sample.stamp
    if stamp > newest + MAX_GAP_NS:
        max_gap = _max_gap(epoch)
        if stamp > newest + max_gap:
            _release(sampler, newest, NOBODY)
            sampler.restarting = True
            sampler.gap_values[0] = (stamp - newest) * 1e-9
            sampler.gap_values[1] = max_gap * 1e-9
            # It comes before what may be held already.
            if sampler.held_count:
                sampler.held[1] = sampler.held[0]
            sampler.held[0] = sample
            sampler.held_count += 1
            return
    _accept(sampler, sample)


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
        _continue(sampler, odd)
        return
    sampler.held_fits = True
    sampler.restart = Restart.TIME_WENT_BACK
    sampler.restart_values[0] = (newest - odd.stamp) * 1e-9
    _start_epoch(sampler.epoch)
    _accept(sampler, odd)


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
        _accept(sampler, sample)
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
        _continue(sampler, sample)


@inner
def is_due(sampler):
    """Whether `next_step` may have a step to give."""
    epoch = sampler.epoch
    due = sampler.releasing and not (epoch.stepping and epoch.next_step > sampler.limit)
    return due or sampler.held_count > 0


@entry
def take_sample(
    samplers, room, stamp, value, relative_velocity, track_id, sensor_flags, text, source, target
):
    """`push_sample` for callers from outside; returns whether a step is due.

    The fields of `SAMPLE` one by one, with `room` for one: that is faster than to fill a record.
    """
    sample = room[0]
    sample.stamp, sample.value, sample.relative_velocity = stamp, value, relative_velocity
    sample.track_id, sample.sensor_flags, sample.text = track_id, sensor_flags, text
    sample.input, sample.has_target = source, target
    push_sample(samplers[0], sample)
    return is_due(samplers[0])


@entry
def take_clock(samplers, stamp):
    """The clock has reached `stamp`: release what a silent accelerometer holds back.

    Steps after the newest input wait for the next one, since nobody can tell yet whether the
    gap that they lie in is too long for steps.
    """
    epoch = samplers[0].epoch
    if epoch.started and stamp <= epoch.newest + AHEAD_NS:
        _release(samplers[0], min(stamp - SILENCE_NS, epoch.newest), NOBODY)


@borrowing
def next_step(sampler, inputs):
    """Make the next step that is released into `inputs`; false when there is none."""
    epoch = sampler.epoch
    while True:
        if sampler.releasing:
            if _find_next_step(epoch) and epoch.next_step <= sampler.limit:
                by = sampler.released_by
                in_time = by != NOBODY and by < epoch.next_step + SILENCE_NS
                _make_step(sampler, epoch.next_step, not in_time, inputs)
                epoch.next_step += STEP_NS
                epoch.stepping = True
                return True
            sampler.releasing = False
        if not sampler.held_count:
            return False
        # A copy: what it sets off may hold it anew.
        sampler.current = sampler.held[0]
        sampler.held[0] = sampler.held[1]
        sampler.held_count -= 1
        if sampler.restarting:
            sampler.restarting, sampler.restart = False, Restart.GAP
            sampler.restart_values[0] = sampler.gap_values[0]
            sampler.restart_values[1] = sampler.gap_values[1]
            # Samples of another input may have been late only: no step is made a second time.
            not_before = epoch.next_step if epoch.stepping else epoch.not_before
            _start_epoch(epoch)
            epoch.not_before = not_before
            _accept(sampler, sampler.current)
        elif sampler.held_fits:
            sampler.held_fits = False
            _accept(sampler, sampler.current)
        else:
            _continue(sampler, sampler.current)


@inner
def _find_next_step(epoch):
    """Settle when the next step is, the first one after the oldest sample; whether it is known."""
    if epoch.stepping:
        return True
    oldest, found = 0, False
    for i in range(OWN_INPUTS):
        queue = epoch.queues[i]
        if queue.count:
            stamp = queue.samples[queue.first].stamp
            oldest = min(oldest, stamp) if found else stamp
            found = True
    if found:
        epoch.next_step = max(-(-oldest // STEP_NS) * STEP_NS, epoch.not_before)
    return found


@inner
def _make_step(sampler, stamp, without_acceleration, inputs):
    """Make the step at `stamp` (ns) of what was sampled until then, into `inputs`."""
    epoch = sampler.epoch
    inputs.restart = sampler.restart
    inputs.restart_values[0], inputs.restart_values[1] = (
        sampler.restart_values[0],
        sampler.restart_values[1],
    )
    sampler.restart = Restart.NONE
    _take_due_samples(sampler, stamp, inputs)
    sampler.step += 1
    inputs.step, inputs.stamp = sampler.step, stamp
    inputs.without_acceleration = without_acceleration
    inputs.has_target, inputs.track_id = epoch.has_target, epoch.track_id
    inputs.sensor_flags, inputs.text = epoch.sensor_flags, epoch.text
    _read_signal(epoch.clearance, stamp, inputs.clearance)
    _read_signal(epoch.relative_velocity, stamp, inputs.relative_velocity)
    _read_signal(epoch.acceleration, stamp, inputs.acceleration)
    _read_signal(epoch.host_speed, stamp, inputs.host_speed)
    _read_signal(epoch.lead_acceleration, stamp, inputs.lead_acceleration)
    # Between scans the clearance is carried forward with the relative velocity.
    clearance, velocity = inputs.clearance, inputs.relative_velocity
    inputs.clearance_now = clearance.measured + velocity.measured * clearance.age
    inputs.late_samples, inputs.refused_samples = sampler.late, sampler.refused
    inputs.bad_samples = sampler.bad


@inner
def _take_due_samples(sampler, stamp, inputs):
    """Take what waits and is no later than the step at `stamp`; a scan may restart the step."""
    epoch = sampler.epoch
    for i in range(ALL_INPUTS):
        queue = epoch.queues[i]
        while queue.count and queue.samples[queue.first].stamp <= stamp:
            sample = queue.samples[queue.first]
            queue.first = (queue.first + 1) % WAITING
            queue.count -= 1
            if i == Input.RADAR:
                _take_scan(sampler, sample, inputs)
            elif not isfinite(sample.value):
                sampler.bad += 1
            elif i == Input.ACCELERATION:
                _note_signal(epoch.acceleration, sample.stamp, sample.value)
            elif i == Input.HOST_SPEED:
                _note_signal(epoch.host_speed, sample.stamp, sample.value)
            else:
                _note_signal(epoch.lead_acceleration, sample.stamp, sample.value)


@inner
def _take_scan(sampler, sample, inputs):
    """Take one scan; a new lead restarts the step."""
    epoch = sampler.epoch
    epoch.has_target, epoch.track_id = sample.has_target, sample.track_id
    epoch.sensor_flags, epoch.text = sample.sensor_flags, sample.text
    if sample.track_id != UNKNOWN_TRACK and sample.has_target:
        if epoch.known_track != UNKNOWN_TRACK and epoch.known_track != sample.track_id:
            inputs.restart = Restart.NEW_LEAD
            inputs.restart_tracks[0] = epoch.known_track
            inputs.restart_tracks[1] = sample.track_id
            _forget_signal(epoch.clearance)
            _forget_signal(epoch.relative_velocity)
        epoch.known_track = sample.track_id
    if not sample.has_target:
        _note_signal(epoch.clearance, sample.stamp, np.nan)
        _note_signal(epoch.relative_velocity, sample.stamp, np.nan)
        return
    if isfinite(sample.value):
        _note_signal(epoch.clearance, sample.stamp, sample.value)
    else:
        sampler.bad += 1
    if isfinite(sample.relative_velocity):
        _note_signal(epoch.relative_velocity, sample.stamp, sample.relative_velocity)
    else:
        sampler.bad += 1


@entry
def next_inputs(samplers, inputs):
    """`next_step` for callers from outside."""
    return next_step(samplers[0], inputs[0])


def restart_reason(inputs: np.void) -> str:
    """Why a step (a record of `STEP_INPUTS`) restarts, in words; empty where it does not."""
    if not inputs["restart"]:
        return ""
    first, second = inputs["restart_values"]
    before, after = inputs["restart_tracks"]
    return {
        Restart.START: "start",
        Restart.TIME_WENT_BACK: f"time went back by {first:.3f} s",
        Restart.GAP: f"no input for {first:.3f} s (limit {second:.3f} s)",
        Restart.NEW_LEAD: f"new lead: track {before} became {after}",
    }[int(inputs["restart"])]


@dataclass(frozen=True)
class Reading:
    """A signal at a step: newest sample `measured`, its `age` in s (both NaN = none), `stale`."""

    measured: float
    age: float
    stale: bool


@dataclass(frozen=True)
class StepInputs:
    """What one step has to work with; `stamp` in ns, `clearance_now` in m carried to the step."""

    step: int
    stamp: int
    restart_reason: str
    without_acceleration: bool
    has_target: bool
    track_id: int
    sensor_flags: int
    sensor_text: str
    clearance: Reading
    relative_velocity: Reading
    acceleration: Reading
    host_speed: Reading
    lead_acceleration: Reading
    clearance_now: float
    late_samples: int
    refused_samples: int
    bad_samples: int


class Sampler:
    """Turns samples, in the order they arrive, into steps."""

    def __init__(self) -> None:
        self.texts = SensorTexts()
        self.state = make_state(SAMPLER)
        start_sampler(self.state)
        self._sample = make_state(SAMPLE)
        self._inputs = make_state(STEP_INPUTS)

    def take(self, sample: Sample) -> bool:
        """Take one sample; whether `next_step` may have steps to give for it."""
        return take_sample(self.state, self._sample, *sample_fields(sample, self.texts))

    def push(self, sample: Sample) -> list[StepInputs]:
        """Take one sample and return the steps that it releases, oldest first."""
        self.take(sample)
        return self._steps()

    def clock(self, stamp: int) -> list[StepInputs]:
        """The clock has reached `stamp` (ns): returns the steps that this releases."""
        take_clock(self.state, stamp)
        return self._steps()

    def _steps(self) -> list[StepInputs]:
        steps = []
        while next_inputs(self.state, self._inputs):
            values = dict(zip(STEP_INPUTS.names or (), self._inputs[0].item(), strict=True))
            values["restart_reason"] = restart_reason(self._inputs[0])
            values["sensor_text"] = self.texts.text(values["text"])
            for name in ("restart", "restart_values", "restart_tracks", "text"):
                del values[name]
            for name in (*INPUTS[1:], "clearance", "relative_velocity", LEAD_ACCELERATION):
                values[name] = Reading(*values[name])
            steps.append(StepInputs(**values))
        return steps
