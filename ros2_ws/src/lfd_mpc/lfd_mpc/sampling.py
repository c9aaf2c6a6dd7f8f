"""From samples to steps: when a step happens and which samples it uses.

Everything is decided by stamps and by the order of arrival, never by a clock, so that a replay
gives the same steps as the drive did. Stamps are integer nanoseconds.

Rules, in short: a step lies on every whole multiple of 10 ms. An acceleration sample releases the
steps up to its stamp; where the accelerometer is silent, any other input, or the clock, does so
50 ms later. A step uses the newest sample of each signal at or before it.

`take_sample` and `take_clock` take what arrives, `next_step` then gives the steps that this
releases, one after the other.
"""

from math import isfinite

import numpy as np

from lfd_mpc.arrival import (
    AHEAD_NS,
    ALL_INPUTS,
    NOBODY,
    OWN_INPUTS,
    SAMPLER,
    SILENCE_NS,
    WAITING,
    accept,
    push_sample,
    release,
    start_epoch,
    start_sampler,
    take_next,
)
from lfd_mpc.compiled import borrowing, entry, inner, make_state
from lfd_mpc.newest_value import forget_signal, note_signal, read_signal
from lfd_mpc.samples import SAMPLE, UNKNOWN_TRACK, Input, Sample, SensorTexts, sample_fields
from lfd_mpc.settings import STEP_NS
from lfd_mpc.step_inputs import STEP_INPUTS, Restart, StepInputs, step_inputs


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
        release(samplers[0], min(stamp - SILENCE_NS, epoch.newest), NOBODY)


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
            start_epoch(epoch)
            epoch.not_before = not_before
            accept(sampler, sampler.current)
        elif sampler.held_fits:
            sampler.held_fits = False
            accept(sampler, sampler.current)
        else:
            take_next(sampler, sampler.current)


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
    read_signal(epoch.clearance, stamp, inputs.clearance)
    read_signal(epoch.relative_velocity, stamp, inputs.relative_velocity)
    read_signal(epoch.acceleration, stamp, inputs.acceleration)
    read_signal(epoch.host_speed, stamp, inputs.host_speed)
    read_signal(epoch.lead_acceleration, stamp, inputs.lead_acceleration)
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
                note_signal(epoch.acceleration, sample.stamp, sample.value)
            elif i == Input.HOST_SPEED:
                note_signal(epoch.host_speed, sample.stamp, sample.value)
            else:
                note_signal(epoch.lead_acceleration, sample.stamp, sample.value)


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
            forget_signal(epoch.clearance)
            forget_signal(epoch.relative_velocity)
        epoch.known_track = sample.track_id
    if not sample.has_target:
        note_signal(epoch.clearance, sample.stamp, np.nan)
        note_signal(epoch.relative_velocity, sample.stamp, np.nan)
        return
    if isfinite(sample.value):
        note_signal(epoch.clearance, sample.stamp, sample.value)
    else:
        sampler.bad += 1
    if isfinite(sample.relative_velocity):
        note_signal(epoch.relative_velocity, sample.stamp, sample.relative_velocity)
    else:
        sampler.bad += 1


@entry
def next_inputs(samplers, inputs):
    """`next_step` for callers from outside."""
    return next_step(samplers[0], inputs[0])


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
            steps.append(step_inputs(self._inputs[0], self.texts))
        return steps
