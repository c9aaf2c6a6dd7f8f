"""From samples to steps: when a step happens and which samples it uses.

Everything is decided by stamps and by the order of arrival, never by a clock, so that a replay
gives the same steps as the drive did. Stamps are integer nanoseconds.

Rules, in short: a step lies on every whole multiple of 10 ms. An acceleration sample releases the
steps up to its stamp; where the accelerometer is silent, any other input, or the clock, does so
50 ms later. A step uses the newest sample of each signal at or before it.
"""

from collections import deque
from dataclasses import dataclass
from math import isfinite, nan
from statistics import median

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

PERIOD_SAMPLES = 20
"""A signal's period is the median over this many samples."""

RADAR, ACCELERATION, HOST_SPEED = "radar", "acceleration", "host_speed"
INPUTS = (RADAR, ACCELERATION, HOST_SPEED)

LEAD_ACCELERATION = "lead_acceleration"
"""What the lead itself says of its acceleration (V2V). Its stamps are another car's: it neither
releases steps nor takes part in deciding what time it is, and a lost one makes no gap."""

UNKNOWN_TRACK = -1


@dataclass(frozen=True)
class RadarSample:
    """One scan: `clearance` in m and `relative_velocity` in m/s, NaN = not measured.

    `sensor_flags` and `sensor_text` are what the sensor says of itself.
    """

    stamp: int
    has_target: bool
    clearance: float
    relative_velocity: float
    track_id: int = UNKNOWN_TRACK
    sensor_flags: int = 0
    sensor_text: str = ""

    @property
    def input(self) -> str:
        return RADAR


@dataclass(frozen=True)
class ScalarSample:
    """One value of `input`: an acceleration in m/s^2, or host speed in m/s."""

    input: str
    stamp: int
    value: float


Sample = RadarSample | ScalarSample


def playing_order(sample: Sample) -> tuple[int, bool]:
    """Sort key: by stamp, and at equal stamps the acceleration last, since it releases the step."""
    return sample.stamp, sample.input == ACCELERATION


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


class _Rhythm:
    """Stamps of the last samples of one signal and the median period between them, in ns."""

    def __init__(self) -> None:
        self._periods: deque[int] = deque(maxlen=PERIOD_SAMPLES - 1)
        self._last: int | None = None

    def note(self, stamp: int) -> None:
        if self._last is not None:
            self._periods.append(stamp - self._last)
        self._last = stamp

    @property
    def period(self) -> float:
        return median(self._periods) if self._periods else 0.0


class _Signal:
    """The newest value of one signal."""

    def __init__(self) -> None:
        self._rhythm = _Rhythm()
        self._value = nan
        self._stamp: int | None = None

    def note(self, stamp: int, value: float) -> None:
        self._rhythm.note(stamp)
        self._stamp, self._value = stamp, value

    def forget(self) -> None:
        self._value, self._stamp = nan, None

    def at(self, stamp: int) -> Reading:
        if self._stamp is None:
            return Reading(nan, nan, True)
        age = stamp - self._stamp
        # The period is asked for only where it matters: a median takes its time.
        stale = age > STALE_NS and age > STALE_PERIODS * self._rhythm.period
        return Reading(self._value, age * 1e-9, stale)


class _Epoch:
    """Everything that a restart in time throws away."""

    def __init__(self) -> None:
        self.signals = {
            name: _Signal()
            for name in (
                "clearance",
                "relative_velocity",
                ACCELERATION,
                HOST_SPEED,
                LEAD_ACCELERATION,
            )
        }
        self.rhythms = {name: _Rhythm() for name in INPUTS}
        self.pending: dict[str, deque[Sample]] = {
            name: deque() for name in (*INPUTS, LEAD_ACCELERATION)
        }
        self.last: dict[str, int] = {}
        self.newest: int | None = None
        self.next_step: int | None = None
        self.has_target = False
        self.track_id = UNKNOWN_TRACK
        self.sensor_flags, self.sensor_text = 0, ""
        self.known_track = UNKNOWN_TRACK

    def max_gap(self) -> float:
        slowest = max(rhythm.period for rhythm in self.rhythms.values())
        return max(MAX_GAP_NS, MAX_GAP_PERIODS * slowest)


class Sampler:
    """Turns samples, in the order they arrive, into steps."""

    def __init__(self) -> None:
        self._epoch = _Epoch()
        self._step = 0
        self._restart_reason = "start"
        self._late = 0
        self._refused = 0
        self._bad = 0
        # A sample whose stamp does not fit waits here for a second one that confirms it.
        self._odd: Sample | None = None

    def push(self, sample: Sample) -> list[StepInputs]:
        """Take one sample and return the steps that it releases, oldest first.

        Samples that do not fit are counted, never raised. Two that agree on a jump of time make
        a restart; a single one is taken for a wrong stamp.
        """
        epoch = self._epoch
        if sample.input == LEAD_ACCELERATION:
            self._overhear(sample)
            return []
        if epoch.newest is None:
            return self._accept(sample)
        previous = epoch.last.get(sample.input)
        if previous is None:
            backward, useless = False, sample.stamp < epoch.newest - AHEAD_NS
        else:
            backward, useless = sample.stamp < previous, sample.stamp == previous
        if useless:
            self._refused += 1
            return []
        if backward or sample.stamp > epoch.newest + AHEAD_NS:
            return self._jump(sample, epoch.newest)
        odd = self._odd
        if odd is not None and (odd.stamp > epoch.newest or odd.input == sample.input):
            self._drop_odd()
        return self._continue(sample, epoch.newest)

    def _overhear(self, sample: Sample) -> None:
        """Take what the lead says, where it fits in with what is measured here."""
        epoch = self._epoch
        newest, previous = epoch.newest, epoch.last.get(LEAD_ACCELERATION)
        if (
            newest is None
            or abs(sample.stamp - newest) > AHEAD_NS
            or (previous is not None and sample.stamp <= previous)
        ):
            self._refused += 1
            return
        epoch.last[LEAD_ACCELERATION] = sample.stamp
        epoch.pending[LEAD_ACCELERATION].append(sample)

    def clock(self, stamp: int) -> list[StepInputs]:
        """The clock has reached `stamp`: release what a silent accelerometer holds back.

        Steps after the newest input wait for the next one, since nobody can tell yet whether the
        gap that they lie in is too long for steps.
        """
        newest = self._epoch.newest
        if newest is None or stamp > newest + AHEAD_NS:
            return []
        return self._release(min(stamp - SILENCE_NS, newest), None)

    def _jump(self, sample: Sample, newest: int) -> list[StepInputs]:
        """A stamp that went backwards, or far ahead: believed if a second sample agrees."""
        odd = self._odd
        ahead = sample.stamp > newest
        if odd is None or (odd.stamp > newest) != ahead:
            self._drop_odd(sample)
            return []
        close = abs(sample.stamp - odd.stamp) <= AHEAD_NS
        if odd.input != sample.input:
            confirmed = close
        elif ahead:
            # A lone input may have skipped: it is believed once nothing contradicts it for long.
            if close and sample.stamp > odd.stamp:
                self._refused += 1
                return []
            confirmed = AHEAD_NS < sample.stamp - odd.stamp <= 2 * AHEAD_NS
        else:
            confirmed = close and sample.stamp > odd.stamp
        if not confirmed:
            self._drop_odd(sample)
            return []
        self._odd = None
        if ahead:
            steps = self._continue(odd, newest)
            # With one input alone its second sample is ahead of the first by a second.
            return steps + self._continue(sample, odd.stamp)
        reason = f"time went back by {(newest - odd.stamp) * 1e-9:.3f} s"
        return self._restart(odd, reason) + self._accept(sample)

    def _drop_odd(self, successor: Sample | None = None) -> None:
        """Refuse the sample that nothing confirmed."""
        self._refused += self._odd is not None
        self._odd = successor

    def _continue(self, sample: Sample, newest: int) -> list[StepInputs]:
        """Take a sample that fits; across a gap of all inputs that means to start anew."""
        if sample.stamp <= newest + MAX_GAP_NS:
            return self._accept(sample)
        max_gap = self._epoch.max_gap()
        if sample.stamp <= newest + max_gap:
            return self._accept(sample)
        steps = self._release(newest, None)
        gap, limit = (sample.stamp - newest) * 1e-9, max_gap * 1e-9
        return steps + self._restart(sample, f"no input for {gap:.3f} s (limit {limit:.3f} s)")

    def _restart(self, sample: Sample, reason: str) -> list[StepInputs]:
        self._epoch = _Epoch()
        self._restart_reason = reason
        return self._accept(sample)

    def _accept(self, sample: Sample) -> list[StepInputs]:
        epoch = self._epoch
        epoch.last[sample.input] = sample.stamp
        epoch.rhythms[sample.input].note(sample.stamp)
        epoch.newest = sample.stamp if epoch.newest is None else max(epoch.newest, sample.stamp)
        epoch.pending[sample.input].append(sample)
        if epoch.next_step is not None and sample.stamp <= epoch.next_step - STEP_NS:
            self._late += 1
        if sample.input == ACCELERATION:
            return self._release(sample.stamp, sample.stamp)
        return self._release(sample.stamp - SILENCE_NS, None)

    def _release(self, limit: int, acceleration_stamp: int | None) -> list[StepInputs]:
        """Steps up to `limit`, released by an acceleration sample or (None) for want of one."""
        epoch = self._epoch
        stamp = epoch.next_step
        if stamp is None:
            oldest = min(
                (queue[0].stamp for name in INPUTS if (queue := epoch.pending[name])), default=None
            )
            if oldest is None:
                return []
            stamp = -(-oldest // STEP_NS) * STEP_NS
        steps = []
        while stamp <= limit:
            in_time = acceleration_stamp is not None and acceleration_stamp < stamp + SILENCE_NS
            steps.append(self._make_step(stamp, not in_time))
            stamp += STEP_NS
            epoch.next_step = stamp
        return steps

    def _make_step(self, stamp: int, without_acceleration: bool) -> StepInputs:
        epoch = self._epoch
        reason, self._restart_reason = self._restart_reason, ""
        for queue in epoch.pending.values():
            while queue and queue[0].stamp <= stamp:
                sample = queue.popleft()
                if isinstance(sample, RadarSample):
                    reason = self._take_radar(sample) or reason
                elif isfinite(sample.value):
                    epoch.signals[sample.input].note(sample.stamp, sample.value)
                else:
                    self._bad += 1
        self._step += 1
        clearance = epoch.signals["clearance"].at(stamp)
        velocity = epoch.signals["relative_velocity"].at(stamp)
        return StepInputs(
            step=self._step,
            stamp=stamp,
            restart_reason=reason,
            without_acceleration=without_acceleration,
            has_target=epoch.has_target,
            track_id=epoch.track_id,
            sensor_flags=epoch.sensor_flags,
            sensor_text=epoch.sensor_text,
            clearance=clearance,
            relative_velocity=velocity,
            acceleration=epoch.signals[ACCELERATION].at(stamp),
            host_speed=epoch.signals[HOST_SPEED].at(stamp),
            lead_acceleration=epoch.signals[LEAD_ACCELERATION].at(stamp),
            # Between scans the clearance is carried forward with the relative velocity.
            clearance_now=clearance.measured + velocity.measured * clearance.age,
            late_samples=self._late,
            refused_samples=self._refused,
            bad_samples=self._bad,
        )

    def _take_radar(self, sample: RadarSample) -> str:
        """Take one scan; returns the reason of a restart, or nothing."""
        epoch = self._epoch
        clearance, velocity = epoch.signals["clearance"], epoch.signals["relative_velocity"]
        epoch.has_target = sample.has_target
        epoch.track_id = sample.track_id
        epoch.sensor_flags, epoch.sensor_text = sample.sensor_flags, sample.sensor_text
        reason = ""
        if sample.track_id != UNKNOWN_TRACK and sample.has_target:
            if epoch.known_track not in (UNKNOWN_TRACK, sample.track_id):
                reason = f"new lead: track {epoch.known_track} became {sample.track_id}"
                clearance.forget()
                velocity.forget()
            epoch.known_track = sample.track_id
        for signal, value in ((clearance, sample.clearance), (velocity, sample.relative_velocity)):
            if not sample.has_target:
                signal.note(sample.stamp, nan)
            elif isfinite(value):
                signal.note(sample.stamp, value)
            else:
                self._bad += 1
        return reason
