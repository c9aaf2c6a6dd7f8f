"""The player node: a drive's samples become messages, at a rate or step by step."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from rclpy.context import Context
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger

from lfd_mpc.errors import UserError
from lfd_mpc.messages import set_time
from lfd_mpc.node_support import PIPELINE_QOS, AwaitedNodes
from lfd_mpc.samples import Sample
from lfd_mpc.settings import STEP_NS
from lfd_replay.drive import Drive, playing_times
from lfd_replay.faults import Fault, FaultInjector
from lfd_replay.lockstep import ANSWERS, Lockstep
from lfd_replay.sample_publishers import SamplePublishers

GRAPH_NODES = ("mpc_node", "observer_node", "diagnosis_node")

SETTLE = 0.5
"""Seconds after which other graphs in the same domain have been discovered."""

HEARTBEAT = 0.1
"""Seconds between repeated /clock messages while nothing moves: a pause is no silence."""


@dataclass(frozen=True)
class PlayOptions:
    """`rate` x real time, 0 = lockstep; `start` and `duration` in s of drive time."""

    rate: float = 1.0
    start: float = 0.0
    duration: float = inf
    loop: bool = False
    seed: int = 0

    def check(self, drive: Drive) -> None:
        """Raises UserError for options that cannot be played."""
        if not 0.0 <= self.rate < inf:
            raise UserError(
                f"--rate {self.rate:g}: a number of 0 or more is expected; 0 = lockstep"
            )
        if not 0.0 <= self.start <= drive.duration:
            raise UserError(
                f"--start {self.start:g}: the drive goes from 0 to {drive.duration:.1f} s"
            )
        if not self.duration > 0.0:
            raise UserError(f"--duration {self.duration:g}: a positive number of s is expected")

    def stretch(self, drive: Drive) -> str:
        """What is played of a drive, in words."""
        end = min(self.start + self.duration, drive.duration)
        whole = f"{drive.duration:.1f} s"
        is_part = self.start > 0.0 or end < drive.duration
        return f"{self.start:.1f} to {end:.1f} s of {whole}" if is_part else whole


def samples_to_play(drive: Drive, faults: list[Fault], options: PlayOptions) -> list[Sample]:
    """The drive's samples with faults applied, cut to the stretch that is played."""
    zero = drive.zero
    begin = zero + round(options.start * 1e9)
    # Beyond the drive any duration is as good as another.
    end = begin + round(min(options.duration, drive.duration + 1.0) * 1e9)
    faulty = FaultInjector(faults, zero, options.seed).apply(drive.samples)
    return [sample for sample in faulty if begin <= sample.stamp < end]


def played(faults: list[Fault], options: PlayOptions) -> list[Fault]:
    """Faults of which something lies in the stretch that is played."""
    end = options.start + options.duration
    return [f for f in faults if f.start < end * 1e9 and f.end > options.start * 1e9]


def refuse_others(node: Node, own: int = 0) -> None:
    """Two graphs in one domain would mix. Raises UserError where another one is there.

    `own`: how many publishers each topic has of this graph.
    """
    for topic in ("radar/target", "vehicle/imu", "mpc/horizon"):
        if node.count_publishers(node.resolve_topic_name(topic)) > own:
            raise UserError(
                f"something else publishes {topic} here: another replay, graph or car? "
                "end it, or set another ROS_DOMAIN_ID"
            )


def settle(joined: float) -> None:
    """Wait until all that is there is discovered; `joined` ROS at that `time.monotonic()`."""
    time.sleep(max(joined + SETTLE - time.monotonic(), 0.0))


class PlayerNode(Node):
    """Publishes samples and /clock. Call `pump` again and again; it says when next."""

    def __init__(
        self,
        samples: Sequence[Sample],
        options: PlayOptions,
        wait_for: Sequence[str],
        context: Context | None = None,
        joined: float | None = None,
        zero: int | None = None,
    ) -> None:
        """`wait_for`: names of nodes that must have said that they are ready.

        `joined`: `time.monotonic()` at which the context's first node was made; default now.
        `zero`: the drive's time zero in ns; default the first sample's stamp.
        """
        super().__init__("bag_player", context=context)
        self._samples = samples
        self._times = playing_times(samples)
        self._first = samples[0].stamp - zero if samples and zero is not None else 0
        self._options = options
        self._position = 0
        self._awaited = AwaitedNodes(self, wait_for)
        self._joined = time.monotonic() if joined is None else joined
        self.started: float | None = None
        """`time.monotonic()` at the first sample."""
        self._paused = False
        self._last_clock = -STEP_NS
        self._last_beat = 0.0
        self._clock_wall = 0.0
        # Drive time in ns since the first sample; where there is a gap, later than the last sample.
        self._reached = 0
        self._clock = self.create_publisher(Clock, "/clock", 10)
        self._now = Clock()
        self._outputs = SamplePublishers(self, PIPELINE_QOS)
        self.create_service(Trigger, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/resume", self._on_resume)
        self.create_service(Trigger, "~/step", self._on_step)
        self._lockstep = Lockstep(self, ANSWERS) if self.lockstep else None
        self._wanted = -1

    @property
    def lockstep(self) -> bool:
        """Whether each step waits for the graph's answers."""
        return self._options.rate == 0.0

    @property
    def waiting_for(self) -> list[str]:
        """Nodes that have not said that they are ready."""
        return self._awaited.missing

    @property
    def done(self) -> bool:
        """Whether everything is played (and, in lockstep, answered); a loop never is."""
        return not self._options.loop and self._position >= len(self._samples) and not self._waiting

    @property
    def played(self) -> float:
        """Drive time played since the first sample, in s."""
        return self._times[self._position - 1] * 1e-9 if self._position else 0.0

    @property
    def total(self) -> float:
        """Drive time from the first sample to the last, in s."""
        return self._times[-1] * 1e-9

    @property
    def _waiting(self) -> bool:
        return self._lockstep is not None and self._lockstep.waiting

    def pump(self) -> float:
        """Publish what is due; returns the s of wall time until the next call is due.

        Raises UserError when the nodes do not become ready, LockstepError when a step fails.
        """
        now = time.monotonic()
        if self.waiting_for:
            self._awaited.check()
            return HEARTBEAT
        if self.started is None:
            if now - self._joined < SETTLE:
                return SETTLE - (now - self._joined)
            # By now one publisher of each is this graph's own.
            refuse_others(self, own=1)
            if self._lockstep is not None:
                self._lockstep.check_reliable(self._outputs.topics)
            self.started = now
            self._clock_wall = self._pause_wall = now
        if self._paused:
            self._beat(now)
            if self._lockstep is not None and self._lockstep.released < self._wanted:
                self._pump_lockstep(self._lockstep, now)
            return HEARTBEAT
        if self._lockstep is not None:
            return self._pump_lockstep(self._lockstep, now)
        return self._pump_free(now)

    def _pump_free(self, now: float) -> float:
        return self._play_to(round((now - self._clock_wall) * self._options.rate * 1e9), now)

    def _play_to(self, elapsed: int, now: float) -> float:
        """Publish what is due at so many ns of drive time since the first sample."""
        self._reached = elapsed
        while self._position < len(self._samples):
            sample, due = self._samples[self._position], self._times[self._position]
            if due > elapsed:
                # Between samples the clock follows the wall, in steps of the algorithm.
                clock = sample.stamp - (due - elapsed)
                self._tick(clock)
                self._beat(now)
                until_tick = max(self._last_clock + STEP_NS - clock, 0)
                return min(min(due - elapsed, until_tick) * 1e-9 / self._options.rate, HEARTBEAT)
            self._tick(sample.stamp)
            self._send(sample)
        if self._options.loop:
            self._rewind(now)
        return 0.0

    def _pump_lockstep(self, lockstep: Lockstep, now: float) -> float:
        lockstep.check()
        self._beat(now)
        while self._position < len(self._samples) and lockstep.take_turn(
            sample := self._samples[self._position]
        ):
            self._tick(sample.stamp)
            self._send(sample)
        if self._position >= len(self._samples) and self._options.loop and not self._waiting:
            self._rewind(now)
        return HEARTBEAT

    def _rewind(self, now: float) -> None:
        self._position, self._clock_wall, self._last_clock = 0, now, -STEP_NS
        self._reached = 0

    def _send(self, sample: Sample) -> None:
        self._position += 1
        self._outputs.publish(sample)

    def _tick(self, stamp: int) -> None:
        """Move /clock on, at most once per 10 ms."""
        if stamp - self._last_clock >= STEP_NS or stamp < self._last_clock - STEP_NS:
            self._last_clock = stamp
            self._last_beat = time.monotonic()
            self._publish_clock()

    def _publish_clock(self) -> None:
        set_time(self._now.clock, max(self._last_clock, 0))
        self._clock.publish(self._now)

    def _beat(self, now: float) -> None:
        if now - self._last_beat >= HEARTBEAT and self._last_clock >= 0:
            self._last_beat = now
            self._publish_clock()

    def _on_pause(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = not self._paused
        response.message = "paused" if response.success else "is paused already"
        if response.success:
            self._paused, self._pause_wall = True, time.monotonic()
        return response

    def _on_resume(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._paused
        response.message = "resumed" if response.success else "is not paused"
        if response.success:
            self._paused = False
            paused = time.monotonic() - self._pause_wall
            self._clock_wall += paused
            if self._lockstep is not None:
                self._lockstep.postpone(paused)
        return response

    def _on_step(self, _request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """While paused, one step of the algorithm further."""
        response.success = False
        if not self._paused:
            response.message = "is not paused; call pause first"
        elif self.started is None:
            response.message = "has not begun: the nodes are not ready"
        elif self.done:
            response.message = "is at the end"
        elif self._waiting:
            response.message = "the step before is not answered yet"
        else:
            if self._lockstep is not None:
                # A step may have to wait for what confirms the samples before it.
                self._wanted = self._lockstep.released + 1
                self._pump_lockstep(self._lockstep, time.monotonic())
            else:
                self._step_free()
            at = self._first * 1e-9 + max(self.played, self._reached * 1e-9)
            response.success, response.message = True, f"at {at:.2f} s of drive time"
        return response

    def _step_free(self) -> None:
        """Put the pause at the next whole step of drive time, and play what is due until then."""
        due = (self._reached // STEP_NS + 1) * STEP_NS
        self._clock_wall = self._pause_wall - due * 1e-9 / self._options.rate
        self._play_to(due, self._pause_wall)
