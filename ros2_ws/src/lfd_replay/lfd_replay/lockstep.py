"""Lockstep: a step's samples are sent when the graph has answered the step before.

The sender knows by a sampler of its own which steps its samples release, and holds every answer
against it: a deadline that passes or a step that rests on other samples is an error.
"""

import struct
import time
from collections import deque
from collections.abc import Callable, Collection, Sequence
from itertools import product
from math import inf, isnan

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import Header

from lfd_mpc.errors import UserError
from lfd_mpc.horizon import Horizon
from lfd_mpc.messages import from_message, from_time
from lfd_mpc.mpc_node import RECEIPTS_QOS, RECEIPTS_TOPIC
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_mpc.samples import LEAD_ACCELERATION, Sample
from lfd_mpc.sampling import Sampler
from lfd_mpc.step_inputs import Reading, StepInputs
from lfd_msgs.msg import FaultReport, ObserverBank, PredictionHorizon, ReconstructedState
from lfd_replay.faults import MEASURED

ANSWERS = {
    "observer/bank": ObserverBank,
    "diagnosis/faults": FaultReport,
    "diagnosis/reconstructed": ReconstructedState,
}
"""What lockstep waits for at each step, beside the horizon itself."""

STEP_DEADLINE = 10.0
"""Seconds of wall time that the graph has to answer a step in lockstep."""

SILENCE = 0.1
"""Seconds of wall time after which what is no answer was said because of a stall."""


class LockstepError(Exception):
    """The graph did not answer a step, or answered another one."""


class Lockstep:
    """Listens on behalf of a node that sends samples."""

    def __init__(
        self,
        node: Node,
        answers: dict[str, type],
        confirmed: Sequence[str] = (),
        then: Callable[[], None] | None = None,
    ) -> None:
        """`answers`: topics that answer each step beside mpc/horizon, with their types.

        `confirmed`: what mpc_node confirms at each step beside the samples; `then` is called after
        each answer.
        """
        self._node, self._then = node, then
        self.released = -1
        """Stamp (ns) of the newest step that the samples sent release."""
        self._confirmed = confirmed
        self._sampler = Sampler()
        self._expected: deque[StepInputs] = deque()
        self._next_steps: list[StepInputs] | None = None
        self._unconfirmed: list[tuple[int, str]] = []
        self._awaited: dict[str, set[int]] = {topic: set() for topic in answers}
        self._deadline, self._sent_stamp = inf, 0
        self._answered = False
        self._error: LockstepError | None = None
        node.create_subscription(PredictionHorizon, "mpc/horizon", self._on_horizon, PIPELINE_QOS)
        receipts = node.create_subscription(Header, RECEIPTS_TOPIC, self._on_receipt, RECEIPTS_QOS)
        self._receipts_topic = receipts.topic_name
        for topic, kind in answers.items():
            node.create_subscription(
                kind,
                topic,
                lambda raw, topic=topic: self._on_answer(topic, raw),
                PIPELINE_QOS,
                raw=True,
            )

    @property
    def waiting(self) -> bool:
        """Whether anything is owed."""
        return bool(self._expected or self._unconfirmed or any(self._awaited.values()))

    def take_turn(self, sample: Sample) -> bool:
        """Whether it is the next sample's turn; then it must be sent: its answers are expected."""
        if any(self._awaited.values()):
            return False
        if self._next_steps is None:
            self._next_steps = self._sampler.push(sample)
        if self._next_steps and self._unconfirmed:
            return False
        self._expected.extend(self._next_steps)
        if self._next_steps:
            self.released = self._next_steps[-1].stamp
        for awaited in self._awaited.values():
            awaited.update(step.stamp for step in self._next_steps)
        self._unconfirmed += product((step.stamp for step in self._next_steps), self._confirmed)
        self._unconfirmed.append((sample.stamp, sample.input))
        self._next_steps = None
        self._deadline, self._sent_stamp = time.monotonic() + STEP_DEADLINE, sample.stamp
        return True

    def check(self) -> None:
        """Raises LockstepError where an answer was wrong or is overdue."""
        if self._error is not None:
            raise self._error
        if time.monotonic() > self._deadline and self.waiting:
            raise LockstepError(self._overdue())

    def postpone(self, seconds: float) -> None:
        """Nothing is overdue for a pause."""
        self._deadline += seconds

    def check_reliable(self, topics: Collection[str]) -> None:
        """Lockstep must not lose a sample, and know that. Raises UserError where it might."""
        lacking = ""
        for topic in topics:
            for info in self._node.get_subscriptions_info_by_topic(topic):
                if info.node_name != "mpc_node":
                    continue
                if info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                    lacking = f"a reliable subscription to {topic}"
                elif not self._node.count_publishers(self._receipts_topic):
                    lacking = f"receipts on {self._receipts_topic}"
        if lacking:
            raise UserError(
                f"lockstep needs {lacking}: start mpc_node with the parameter file lockstep.yaml "
                "of lfd_bringup"
            )

    def _on_horizon(self, message: PredictionHorizon) -> None:
        if not self._expected:
            self._fail(
                f"a step at {message.header.stamp.sec} s that no sample released: "
                "is another graph running in this ROS_DOMAIN_ID?"
            )
            return
        expected = self._expected.popleft()
        difference = horizon_difference(expected, from_message(Horizon, message))
        if difference:
            self._fail(f"step at {expected.stamp * 1e-9:.2f} s: {difference}")
        self._go_on()

    def _on_receipt(self, message: Header) -> None:
        receipt = from_time(message.stamp), message.frame_id
        # Those of another sender, or of a drive before, are latched, too.
        if receipt in self._unconfirmed:
            self._unconfirmed.remove(receipt)
            self._go_on()

    def _on_answer(self, topic: str, raw: bytes) -> None:
        # The header's stamp follows the four bytes of the CDR encapsulation.
        seconds, nanoseconds = struct.unpack_from("<iI", raw, 4)
        stamp = seconds * 1_000_000_000 + nanoseconds
        if stamp in self._awaited[topic]:
            self._awaited[topic].remove(stamp)
            self._answered = True
        elif self._answered and self.waiting and self._lasts > SILENCE:
            self._fail(
                f"{topic} said at {stamp * 1e-9:.2f} s that nothing is heard, while the graph "
                "stalled: start its nodes with -p use_sim_time:=true"
            )
        self._go_on()

    @property
    def _lasts(self) -> float:
        """For how many s the sample that was sent last has waited."""
        return time.monotonic() - (self._deadline - STEP_DEADLINE)

    def _go_on(self) -> None:
        if self._then is not None and not any(self._awaited.values()):
            self._then()

    def _fail(self, text: str) -> None:
        self._error = self._error or LockstepError(f"lockstep: {text}")

    def _overdue(self) -> str:
        """What the graph still owes."""
        owed = [f"{topic} ({len(stamps)})" for topic, stamps in self._awaited.items() if stamps]
        if self._expected:
            owed.insert(0, f"mpc/horizon ({len(self._expected)})")
        if self._unconfirmed:
            owed.insert(0, f"{RECEIPTS_TOPIC} ({len(self._unconfirmed)})")
        return (
            f"lockstep: after the sample at {self._sent_stamp * 1e-9:.3f} s nothing came for "
            f"{STEP_DEADLINE:.0f} s; still owed: {', '.join(owed)}"
        )


def horizon_difference(expected: StepInputs, horizon: Horizon) -> str:
    """What the controller used other than the samples that it was sent; empty = nothing."""
    if horizon.stamp != expected.stamp:
        return f"the controller answered for {horizon.stamp * 1e-9:.2f} s"
    for name in (*MEASURED, LEAD_ACCELERATION):
        reading: Reading = getattr(expected, name)
        got = getattr(horizon, f"measured_{name}"), getattr(horizon, f"{name}_age")
        for what, want, have in zip(
            ("value", "age"), (reading.measured, reading.age), got, strict=True
        ):
            if want != have and not (isnan(want) and isnan(have)):
                return f"{name} {what} should be {want!r}, the controller used {have!r}"
    return ""
