"""The decision: which level and action verdicts lead to, below, at and above each limit."""

import time
from dataclasses import replace
from math import isnan, nan

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from test_nodes import Subscriber

from lfd_diagnosis.decision_node import DecisionNode
from lfd_diagnosis.fault_level import DecisionMaker
from lfd_diagnosis.settings import DecisionSettings
from lfd_diagnosis.verdict import Kind, Reconstruction, Report, SignalVerdict, State
from lfd_mpc.decision import Action, Decision, FaultLevel
from lfd_mpc.health import Level
from lfd_mpc.messages import to_message
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_msgs.msg import Decision as DecisionMessage
from lfd_msgs.msg import FaultReport, ReconstructedState
from ros_support import Graph

STEP = 10_000_000
CHOSEN = DecisionSettings()
LEVEL, ACTION = FaultLevel, Action


def verdict(state: State = State.OK, kind: Kind = Kind.UNKNOWN) -> SignalVerdict:
    return SignalVerdict(state, 0.0, 0.5, 0, 4, 0, f"because of {state.name}", kind)


def report(number: int, **states) -> Report:
    """All OK but what is named: a state, or a state and a kind."""
    names = ("clearance", "relative_velocity", "radar", "acceleration", "host_speed")
    made = {name: verdict() for name in (*names, "lead_acceleration")}
    for name, state in states.items():
        made[name] = verdict(*state) if isinstance(state, tuple) else verdict(state)
    return Report(number * STEP, number, **made)


def made(number: int, **values) -> Reconstruction:
    """Everything known: 30 m, no closing, nobody accelerates."""
    known = {
        "clearance": 30.0,
        "relative_velocity": 0.0,
        "relative_acceleration": 0.0,
        "acceleration": 0.0,
        **values,
    }
    full = {name: value for name, value in known.items()}
    full |= {f"{name}_valid": not isnan(value) for name, value in known.items()}
    stds = {f"{n}_std": 0.1 for n in ("clearance", "relative_velocity", "acceleration")}
    return Reconstruction(number * STEP, number, reason="", **full, **stds)


class Drive:
    """Reports one after the other."""

    def __init__(self, settings: DecisionSettings = CHOSEN) -> None:
        self.maker, self.number = DecisionMaker(settings), 0

    def on(self, seconds: float, values: dict | None = None, **states) -> Decision:
        decision = None
        for _ in range(max(round(seconds * 100), 1)):
            self.number += 1
            given = made(self.number, **(values or {}))
            decision = self.maker.step(report(self.number, **states), given)
        assert decision is not None
        return decision


def test_healthy_sensors_change_nothing() -> None:
    drive = Drive()
    for states in (
        {},
        {"clearance": State.SUSPECT},
        {"clearance": State.NO_TARGET, "relative_velocity": State.NO_TARGET},
        {"clearance": State.NOT_READY, "relative_velocity": State.NOT_READY},
        {"host_speed": State.NO_DATA},
        {"lead_acceleration": State.NO_DATA},
    ):
        decision = drive.on(1.0, **states)
        assert (decision.level, decision.action) == (LEVEL.NORMAL, ACTION.FOLLOW), states
        assert decision.reason == ""


@pytest.mark.parametrize("name", ["clearance", "relative_velocity"])
def test_one_radar_signal_lost_degrades_then_calls_then_stops(name: str) -> None:
    drive = Drive()
    drive.on(1.0)
    decision = drive.on(CHOSEN.take_over_after, **{name: State.FAULT})
    assert (decision.level, decision.action) == (LEVEL.DEGRADED, ACTION.FOLLOW_FROM_AFAR)
    assert not getattr(decision, f"{name}_usable") and decision.since == 101 * STEP
    assert name in decision.reason and "because of FAULT" in decision.reason
    assert getattr(decision, name) == (30.0 if name == "clearance" else 0.0)
    decision = drive.on(0.01, **{name: State.FAULT})
    assert (decision.level, decision.action) == (LEVEL.TAKE_OVER, ACTION.WARN)
    decision = drive.on(CHOSEN.stop_after - 0.01, **{name: State.FAULT})
    assert decision.action == ACTION.WARN
    decision = drive.on(0.01, **{name: State.FAULT})
    assert decision.action == ACTION.STOP
    assert decision.deceleration == CHOSEN.stopping_deceleration


@pytest.mark.parametrize("name", ["acceleration", "host_speed"])
def test_the_hosts_own_sensors_only_degrade(name: str) -> None:
    drive = Drive()
    decision = drive.on(60.0, **{name: State.FAULT})
    assert (decision.level, decision.action) == (LEVEL.DEGRADED, ACTION.FOLLOW_FROM_AFAR)
    assert not getattr(decision, f"{name}_usable")
    lost = drive.on(1.0, host_speed=(State.NO_DATA, Kind.DROPOUT))
    assert lost.level == LEVEL.DEGRADED


@pytest.mark.parametrize(
    "lost",
    [
        {"clearance": State.FAULT, "relative_velocity": State.FAULT},
        {"clearance": State.NO_DATA, "relative_velocity": State.NO_DATA},
        {"clearance": (State.FAULT, Kind.RAMP)},
        {"relative_velocity": (State.FAULT, Kind.RAMP)},
    ],
)
def test_a_lead_that_is_not_seen_stops_the_car(lost: dict) -> None:
    drive = Drive()
    drive.on(1.0)
    decision = drive.on(CHOSEN.blind_for, **lost)
    assert (decision.level, decision.action) == (LEVEL.TAKE_OVER, ACTION.WARN)
    decision = drive.on(0.01, **lost)
    assert decision.action == ACTION.STOP and "not seen" in decision.reason
    # One signal alone that is believed again was held against a guess.
    assert drive.on(3.0, clearance=State.FAULT).action == ACTION.STOP
    assert drive.on(CHOSEN.recover_after).action == ACTION.STOP
    assert drive.on(0.02).action == ACTION.FOLLOW


def test_no_decision_lasts_since_a_time_to_come() -> None:
    drive = Drive()
    drive.on(1.0)
    drive.number = 0
    assert drive.on(0.01).since <= STEP


@pytest.mark.parametrize(("silent_for", "since"), [(0.48, 0.0), (0.52, 0.0), (0.3, 0.1)])
def test_a_moments_silence_beside_a_fault_that_is_made_up_for_stops_nothing_for_good(
    silent_for: float, since: float
) -> None:
    """As where a node stalls; `since`: for so long both were faulty before."""
    drive, silent = Drive(), dict.fromkeys(("clearance", "relative_velocity"), State.NO_DATA)
    drive.on(1.0)
    drive.on(1.0, clearance=State.FAULT)
    if since:
        drive.on(since, clearance=State.FAULT, relative_velocity=State.FAULT)
    drive.on(silent_for, **silent)
    decision = drive.on(CHOSEN.recover_after + 0.1, clearance=State.FAULT)
    if silent_for < CHOSEN.blind_for and not since:
        assert decision.action == ACTION.FOLLOW_FROM_AFAR
    else:
        assert decision.action == ACTION.STOP and "not seen" in decision.reason
    # A long silence after a short one counts as such.
    assert drive.on(1.0, **silent).action == ACTION.STOP
    assert drive.on(CHOSEN.recover_after + 0.1, clearance=State.FAULT).action == ACTION.STOP


@pytest.mark.parametrize("lost", [("clearance",), ("clearance", "relative_velocity")])
def test_time_that_goes_back_puts_nothing_off(lost: tuple[str, ...]) -> None:
    drive = Drive()
    drive.on(100.0)
    states = dict.fromkeys(lost, State.FAULT)
    drive.on(0.3, **states)
    drive.number = 0
    decision = drive.on(CHOSEN.take_over_after + CHOSEN.stop_after + 0.1, **states)
    assert decision.action == ACTION.STOP


@pytest.mark.parametrize("jump", [180_000, -180_000, 101])
def test_a_jump_of_the_clock_is_no_time(jump: int) -> None:
    drive = Drive()
    drive.on(100.0)
    drive.on(0.3, clearance=State.FAULT)
    drive.number += jump
    decision = drive.on(CHOSEN.take_over_after - 0.31, clearance=State.FAULT)
    assert decision.action == ACTION.FOLLOW_FROM_AFAR
    drive.on(0.05, clearance=State.FAULT)
    drive.number += jump
    assert drive.on(0.02).action == ACTION.WARN, "what raised it was there just now"
    assert drive.on(CHOSEN.recover_after).action == ACTION.FOLLOW


def test_a_lead_that_was_braking_is_expected_to_go_on() -> None:
    both = {"clearance": State.FAULT, "relative_velocity": State.FAULT}
    for braking, action in ((-1.4, ACTION.WARN), (-1.6, ACTION.STOP), (-6.0, ACTION.STOP)):
        drive = Drive()
        drive.on(3.0, {"relative_acceleration": braking})
        decision = drive.on(0.01, {"relative_acceleration": nan}, **both)
        assert decision.action == action, braking
        expected = max(CHOSEN.stopping_deceleration, CHOSEN.blind_margin - braking)
        assert decision.deceleration == pytest.approx(expected, abs=0.01)


def test_nothing_that_makes_up_for_a_signal_stops_at_once() -> None:
    decision = Drive().on(0.01, {"clearance": nan}, clearance=State.FAULT)
    assert (decision.level, decision.action) == (LEVEL.TAKE_OVER, ACTION.STOP)
    assert isnan(decision.clearance) and "nothing makes up for clearance" in decision.reason


@pytest.mark.parametrize(("velocity", "emergency"), [(-14.9, False), (-15.1, True)])
def test_a_degraded_car_that_must_brake_hard_brakes_fully(velocity, emergency) -> None:
    """15^2 / (2 * (30 - 2)) = 4.02 m/s^2."""
    values = {"relative_velocity": velocity}
    decision = Drive().on(0.01, values, relative_velocity=State.FAULT)
    assert (decision.level == LEVEL.EMERGENCY) == emergency
    assert Drive().on(0.01, values).level == LEVEL.NORMAL, "a healthy car has its controller"
    if emergency:
        assert decision.action == ACTION.BRAKE
        assert decision.deceleration == CHOSEN.emergency_braking
        assert "m/s^2 are needed" in decision.reason


def test_a_level_falls_only_when_what_raised_it_is_gone_for_long_enough() -> None:
    drive = Drive()
    drive.on(1.0, clearance=State.FAULT)
    assert drive.on(CHOSEN.recover_after).level == LEVEL.DEGRADED
    drive.on(0.01, clearance=State.FAULT)
    assert drive.on(CHOSEN.recover_after).level == LEVEL.DEGRADED
    decision = drive.on(0.01)
    assert decision.level == LEVEL.NORMAL and decision.since == drive.number * STEP


def test_a_doubted_value_is_not_driven_by_where_there_is_a_better_one() -> None:
    drive = Drive()
    drive.on(1.0)
    decision = drive.on(0.01, clearance=State.SUSPECT)
    assert not decision.clearance_usable and decision.level == LEVEL.NORMAL
    assert drive.on(0.01, {"clearance": nan}, clearance=State.SUSPECT).clearance_usable


def test_the_node_answers_each_report_once_and_latches_changes() -> None:
    with Graph() as graph:
        graph.add(DecisionNode(context=graph.context))
        node = graph.add(rclpy.create_node("rig", context=graph.context))
        reports = node.create_publisher(FaultReport, "diagnosis/faults", PIPELINE_QOS)
        others = node.create_publisher(ReconstructedState, "diagnosis/reconstructed", PIPELINE_QOS)
        decisions = Subscriber(node, DecisionMessage, "diagnosis/decision")
        graph.spin_until(
            lambda: (
                reports.get_subscription_count()
                and others.get_subscription_count()
                and node.count_publishers("diagnosis/decision")
            ),
            "it listens",
        )
        graph.spin_for(0.3)
        faulty = {"clearance": State.FAULT}
        for number in range(1, 41):
            states = faulty if number > 20 else {}
            # In either order; every tenth reconstruction is lost.
            pair = [(reports, to_message(report(number, **states), FaultReport()))]
            if number % 10:
                pair.append((others, to_message(made(number), ReconstructedState())))
            for publisher, message in pair if number % 2 else reversed(pair):
                publisher.publish(message)
        graph.spin_until(lambda: len(decisions.messages) == 36, "every pair is answered")
        assert [m.step for m in decisions.messages] == [n for n in range(1, 41) if n % 10]
        last = decisions.messages[-1]
        assert (last.level, last.action) == (DecisionMessage.DEGRADED, 1)
        assert last.clearance == 30.0 and not last.clearance_usable and last.acceleration_usable
        assert last.since.nanosec == 21 * STEP and "clearance FAULT" in last.reason
        # Counted anew: no half of the step that was lost.
        others.publish(to_message(replace(made(10), stamp=10**12), ReconstructedState()))
        # No step: the sensors are silent, and so is what could make up for them.
        none = report(41, clearance=State.NO_DATA, relative_velocity=State.NO_DATA)
        reports.publish(to_message(replace(none, step=0), FaultReport()))
        graph.spin_until(lambda: len(decisions.messages) == 37, "silence is answered")
        assert decisions.messages[-1].action == DecisionMessage.STOP
        from lfd_diagnosis.diagnosis_node import EVENT_QOS

        assert decisions.messages[0].since.nanosec == STEP, "the first one began something, too"
        statuses = Subscriber(node, DiagnosticArray, "/diagnostics")
        graph.spin_until(
            lambda: statuses.messages and statuses.messages[-1].status[0].level == b"\x03",
            "a decision that does not come is told",
        )
        assert "no decision for" in statuses.messages[-1].status[0].message
        late = graph.add(rclpy.create_node("late", context=graph.context))
        changes = Subscriber(late, DecisionMessage, "diagnosis/decision_changes", EVENT_QOS)
        graph.spin_until(lambda: len(changes.messages) == 3, "changes are latched")
        assert [m.action for m in changes.messages] == [0, 1, 3]


def test_emergency_braking_goes_on_for_as_long_as_its_level() -> None:
    drive, fault = Drive(), {"relative_velocity": State.FAULT}
    hard = drive.on(0.1, {"relative_velocity": -15.1}, **fault)
    assert hard.action == Action.BRAKE and hard.deceleration == CHOSEN.emergency_braking
    for k in range(round(CHOSEN.recover_after * 100)):
        then = drive.on(0.01, {"relative_velocity": -14.5}, **fault)
        assert (then.action, then.deceleration) == (hard.action, hard.deceleration), k
    after = drive.on(0.02, {"relative_velocity": -14.5}, **fault)
    assert after.action != Action.BRAKE and after.deceleration == CHOSEN.stopping_deceleration


def test_a_level_falls_to_the_one_below_it_first() -> None:
    drive, fault = Drive(), {"relative_velocity": State.FAULT}
    assert drive.on(0.5, {"relative_velocity": -15.1}, **fault).action == Action.BRAKE
    blind = {"clearance": State.FAULT, "relative_velocity": State.FAULT}
    nothing = {"clearance": nan, "relative_velocity": nan}
    drive.on(0.6, **fault)
    assert drive.on(0.3, nothing, **blind).level == LEVEL.EMERGENCY
    levels = [drive.on(0.01).level for _ in range(round(100 * CHOSEN.recover_after) + 1)]
    assert levels == sorted(levels, reverse=True)
    assert levels.count(LEVEL.EMERGENCY) == pytest.approx(10, abs=1)
    assert levels.count(LEVEL.TAKE_OVER) == pytest.approx(90, abs=1)
    assert levels[-1] == LEVEL.NORMAL


def test_a_host_speed_that_is_doubted_is_not_driven_by() -> None:
    assert not Drive().on(0.01, host_speed=State.SUSPECT).host_speed_usable
    assert Drive().on(0.01).host_speed_usable


def odd_report() -> FaultReport:
    """Of another version, or made by hand."""
    message = to_message(report(1), FaultReport())
    message.clearance.state = 9
    return message


def test_a_report_that_no_diagnosis_makes_is_refused_and_the_status_says_it() -> None:
    said = "1 messages refused in the last second: diagnosis/faults: 9 is not a valid State"
    with Graph() as graph:
        node = graph.add(DecisionNode(context=graph.context))
        node._on_report(odd_report())
        (status,) = node._statuses(True)
        assert (status.level, status.message) == (Level.STALE, f"no decision yet; {said}")
        node._on_report(to_message(report(2), FaultReport()))
        node._on_made(to_message(made(2), ReconstructedState()))
        (status,) = node._statuses(False)
        assert (status.level, status.message) == (Level.OK, "NORMAL")
        assert status.values["reports refused"] == "1"
        node._on_report(odd_report())
        for period_ends in (False, True):
            (status,) = node._statuses(period_ends)
            assert (status.level, status.message) == (Level.WARN, f"NORMAL; {said}")
        (status,) = node._statuses(True)
        assert (status.level, status.message) == (Level.OK, "NORMAL")
        both = {"clearance": State.FAULT, "relative_velocity": State.FAULT}
        nothing = {"clearance": nan, "relative_velocity": nan}
        node._on_report(to_message(report(3, **both), FaultReport()))
        node._on_made(to_message(made(3, **nothing), ReconstructedState()))
        node._on_report(odd_report())
        (status,) = node._statuses(True)
        assert status.level == Level.ERROR and status.message.endswith(said)


def test_a_report_that_is_refused_at_every_step_is_told_once_a_second() -> None:
    with Graph() as graph:
        node = graph.add(DecisionNode(context=graph.context))
        told: list[Log] = []
        everything = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(Log, "/rosout", told.append, everything)
        begun = time.monotonic()
        for _ in range(200):
            node._on_report(odd_report())
        graph.spin_until(lambda: any("refused" in log.msg for log in told), "it is told")
        graph.spin_for(0.2)
        count = sum("refused" in log.msg for log in told)
        assert count <= 1 + (time.monotonic() - begun)
