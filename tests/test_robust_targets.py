"""The robust profile without ROS: other cars, other ids, a lead that is not seen for a moment."""

from math import cos, nan

import numpy as np
import pytest
from robust_car import SCAN, Car

from lfd_diagnosis.verdict import Kind, State
from lfd_mpc.samples import UNKNOWN_TRACK


def test_a_new_id_of_the_same_car_restarts_nothing(car: Car) -> None:
    start = car.number
    for track in range(2, 12):
        car.track_id = track
        car.drive(0.3)
    states = {outcome.report.clearance.state for outcome in car.outcomes[start:]}
    assert states <= {State.OK, State.SUSPECT} and not car.faults_since(start)


@pytest.mark.parametrize("first", [12.0, 6.9, -12.0])
def test_a_clearance_is_not_right_because_a_targets_first_scan_was_off(
    car: Car, first: float
) -> None:
    """An offset as large as that scan was off is no way back to the target before."""
    car.track_id, car.clearance = 2, 60.0
    car.drive(0.01 * SCAN, clearance=first)
    car.drive(2.0)
    start = car.number
    car.drive(2.0, clearance=first)
    assert car.delay("clearance", start) <= 0.13
    assert car.outcomes[-1].report.clearance.state == State.FAULT
    start = car.number
    assert car.drive(1.0).report.clearance.state == State.OK
    assert not car.faults_since(start)


def test_a_scan_that_is_said_again_under_another_id_is_of_the_same_car(car: Car) -> None:
    """The lead swings to and fro; which of two ids it has changes with every message."""
    car.scan, start = 2, car.number
    for k in range(500):
        car.lead_acceleration = 1.5 * cos(0.02 * k)
        car.track_id = 1 + k % 2
        car.drive(0.02)
        clearance, velocity = car.seen
        car.track_id = 2 - k % 2
        car.drive(0.02, clearance_is=clearance, relative_velocity_is=velocity)
    assert not car.faults_since(start)


def test_a_new_car_is_judged_from_its_third_scan_on(car: Car) -> None:
    start = car.number
    car.track_id, car.clearance = 2, 18.0
    car.drive(0.5)
    states = [outcome.report.clearance.state for outcome in car.outcomes[start:]]
    assert State.NOT_READY in states and states[-1] == State.OK
    assert states.count(State.NOT_READY) <= 2 * SCAN and not car.faults_since(start)


def test_after_a_lost_reference_a_new_car_must_agree_for_long(car: Car) -> None:
    car.drive(1.0, clearance=4.0)
    car.track_id, car.clearance = 2, 60.0
    verdict = car.drive(1.0).report.clearance
    assert verdict.state == State.FAULT and "reference lost" in verdict.reason
    start = car.number
    car.drive(5.0)
    cleared = [o.report.clearance.state for o in car.outcomes[start:]].index(State.OK)
    assert 3.5 <= cleared * 0.01 <= 5.0
    assert not car.faults_since(start)


def test_what_was_held_tells_nothing_of_another_car(car: Car) -> None:
    car.lead_acceleration = 1.0
    car.drive(2.0)
    car.drive(1.0, clearance_is=car.clearance)
    car.lead_acceleration = 0.0
    held = car.outcomes[-1].report.clearance
    assert held.state == State.FAULT and held.kind == Kind.HOLD
    was, car.track_id, car.clearance, car.velocity = car.seen[0], 2, 60.0, -4.0
    outcome = car.drive(1.0, clearance_is=was)
    verdict = outcome.report.clearance
    assert verdict.state == State.FAULT
    assert "reference lost: a new target must agree for 0.5 s" in verdict.reason
    assert not outcome.reconstruction.clearance_valid
    # It would show that it is held: soon after it no longer does, it is believed.
    start = car.number
    car.drive(0.4)
    assert car.outcomes[-1].report.clearance.state == State.FAULT
    outcome = car.drive(0.4)
    assert outcome.report.clearance.state == State.OK
    assert outcome.reconstruction.clearance == pytest.approx(car.clearance, abs=0.3)
    car.drive(3.0)
    assert not car.faults_since(start)


def test_a_drift_of_the_clearance_that_goes_on_with_another_car_ends(car: Car) -> None:
    for k in range(800):
        if k == 500:
            car.track_id, car.clearance, car.velocity = 2, 60.0, -4.0
            car.lead_acceleration = 0.5
        outcome = car.step(clearance=0.005 * k)
    assert outcome.report.clearance.kind == Kind.RAMP
    assert "reference lost" in outcome.report.clearance.reason
    # Its jump back is no longer seen as one: its agreement with itself must do.
    car.drive(4.5)
    assert car.outcomes[-1].report.clearance.state == State.FAULT
    start = car.number
    outcome = car.drive(1.0)
    assert outcome.report.clearance.state == State.OK
    assert outcome.reconstruction.clearance == pytest.approx(car.clearance, abs=0.3)
    car.drive(3.0)
    assert not car.faults_since(start)


def test_an_offset_goes_on_with_another_car_until_it_ends(car: Car) -> None:
    both = {"clearance": 4.0, "relative_velocity": -10.0}
    car.drive(1.0, **both)
    car.track_id, car.clearance, car.velocity = 2, 60.0, 1.0
    start = car.number
    for _ in range(200):
        now = car.step(**both).reconstruction
    report = car.outcomes[-1].report
    assert report.clearance.state == report.relative_velocity.state == State.FAULT
    # No time alone would tell that both ended.
    assert report.clearance.reason.endswith("reference lost: a new target must agree")
    assert not car.faults_since(start)
    assert now.clearance == pytest.approx(car.clearance, abs=0.5)
    assert now.relative_velocity == pytest.approx(car.velocity, abs=0.5)
    end = car.number
    report = car.drive(1.5).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(end)


def test_a_reference_is_lost_for_the_signal_alone_that_was_faulty_then(car: Car) -> None:
    for k in range(1000):
        car.step(relative_velocity=0.004 * k)
    car.track_id, car.clearance = 2, 50.0
    report = car.drive(3.0).report
    assert "reference lost" in report.relative_velocity.reason
    start = car.number
    report = car.drive(1.0, clearance=5.0).report
    assert car.delay("clearance", start) <= 0.15
    assert "reference lost" not in report.clearance.reason
    assert "reference lost" in report.relative_velocity.reason
    # The one agrees with itself for long; the other one's offset goes on all the same.
    report = car.drive(9.0, clearance=5.0).report
    assert report.relative_velocity.state == State.OK
    assert report.clearance.state == State.FAULT
    assert report.clearance.size == pytest.approx(5.0, abs=0.5)
    end = car.number
    assert car.drive(1.0).report.clearance.state == State.OK
    car.drive(3.0)
    assert not car.faults_since(end)


def test_a_fault_that_began_behind_one_that_went_on_outlasts_it(car: Car) -> None:
    car.drive(5.0, relative_velocity=3.0)
    car.track_id, car.clearance = 2, 50.0
    car.drive(1.0)
    start = car.number
    car.drive(8.0, clearance=5.0)
    states = [outcome.report.clearance.state for outcome in car.outcomes[start + 15 :]]
    assert set(states) == {State.FAULT}
    assert car.outcomes[-1].report.relative_velocity.state == State.OK
    end = car.number
    assert car.drive(1.0).report.clearance.state == State.OK
    car.drive(3.0)
    assert not car.faults_since(end)


def test_an_offset_that_ended_before_another_car_came_does_not_go_on(car: Car) -> None:
    car.drive(1.0, relative_velocity=2.0)
    car.drive(0.3)
    assert car.outcomes[-1].report.relative_velocity.state == State.FAULT, "not believed yet"
    car.track_id, car.clearance, car.velocity = 2, 60.0, 1.0
    start = car.number
    assert car.drive(0.5).report.relative_velocity.state == State.OK
    assert not car.faults_since(start)


def test_a_relative_velocity_that_is_off_from_the_first_scan_of_another_car_is_named(car) -> None:
    """What contradicts it is a straight line, as a drift of the clearance is: but no slow one."""
    car.track_id, car.clearance, car.velocity = 2, 60.0, 1.0
    start = car.number
    verdict = car.drive(3.0, relative_velocity=2.0).report.relative_velocity
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    assert verdict.kind == Kind.OFFSET and verdict.size == pytest.approx(2.0, abs=0.3)
    end = car.number
    assert car.drive(1.5).report.relative_velocity.state == State.OK
    assert not car.faults_since(end)


def test_a_drift_that_begins_with_another_car_is_the_clearances(car: Car) -> None:
    car.track_id, car.clearance = 2, 60.0
    start = car.number
    for k in range(500):
        car.step(clearance=0.6 * k * 0.01)
    assert car.faults_since(start) == {"clearance", "radar"}


def test_what_was_off_from_the_first_scan_on_ends_with_the_other_signals_fault(car: Car) -> None:
    """Nobody saw the clearance jump away; its jump back is no fault."""
    car.track_id, car.clearance = 2, 60.0
    start = car.number
    car.drive(3.0, clearance=4.0, relative_velocity=-10.0)
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    end = car.number
    report = car.drive(1.5).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(end)


@pytest.mark.parametrize("missing", ["clearance", "relative_velocity"])
@pytest.mark.parametrize("known", [True, False])
def test_another_car_is_no_fault_of_the_signal_that_is_there(car: Car, missing, known) -> None:
    """Whether its id says that it is another, or a second without either signal before it."""
    off = {f"{missing}_is": nan}
    car.drive(1.0, **off)
    if known:
        car.track_id = 2
    else:
        car.radar_silent = True
        car.drive(1.2)
        car.radar_silent = False
    car.clearance, car.velocity = 50.0, 6.0
    start = car.number
    report = car.drive(1.0, **off).report
    there = report.relative_velocity if missing == "clearance" else report.clearance
    assert there.state == State.NOT_READY and not car.faults_since(start)
    report = car.drive(1.0).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(start)


@pytest.mark.parametrize("missing", ["clearance", "relative_velocity"])
def test_the_same_car_under_another_id_goes_on_with_one_signal(car: Car, missing: str) -> None:
    there = "relative_velocity" if missing == "clearance" else "clearance"
    start = car.number
    car.drive(0.5, **{f"{missing}_is": nan})
    car.track_id = 2
    car.drive(0.5, **{f"{missing}_is": nan})
    states = {getattr(outcome.report, there).state for outcome in car.outcomes[start:]}
    assert states == {State.OK}


def test_a_radar_may_get_the_first_scan_of_another_car_wrong(car: Car) -> None:
    start = car.number
    car.track_id, car.clearance = 2, 60.0
    car.drive(0.01 * SCAN, relative_velocity=-1.5)
    report = car.drive(1.0).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(start)


def test_another_id_of_the_same_car_lies_where_it_is_seen(car: Car) -> None:
    start = car.number
    car.track_id = 2
    car.drive(0.01 * SCAN, clearance=1.2)
    assert car.drive(1.0, clearance=1.5).report.clearance.state == State.OK
    assert not car.faults_since(start)


def see(car: Car, track_id: int, clearance: float, velocity: float, scans: int, **exactly: float):
    """Some scans of a target; `exactly`: what is said of it without noise."""
    car.track_id, car.clearance, car.velocity = track_id, clearance, velocity
    for _ in range(scans):
        car.drive(0.01 * SCAN, **exactly)


@pytest.mark.parametrize("velocity", [-0.5, 0.0])
def test_two_cars_of_the_same_speed_hold_no_relative_velocity(car: Car, velocity: float) -> None:
    start, said = car.number, {"relative_velocity_is": velocity}
    see(car, 1, 30.0, velocity, 3, **said)
    see(car, 2, 60.0, velocity, 2, **said)
    see(car, 1, 30.0 + 0.25 * velocity, velocity, 8, **said)
    assert not car.faults_since(start)


@pytest.mark.parametrize("scans", [1, 2, 4])
@pytest.mark.parametrize(("clearance", "velocity"), [(95.0, 6.0), (60.0, 6.0), (52.0, 6.0)])
def test_an_id_that_is_another_cars_by_now_is_no_fault(
    car: Car, scans: int, clearance: float, velocity: float
) -> None:
    see(car, 2, 60.0, 6.0, 20)
    start = car.number
    see(car, 1, 30.0, 0.0, scans)
    see(car, 2, clearance, velocity, 20)
    assert car.outcomes[-1].report.clearance.state == State.OK
    assert not car.faults_since(start)


def test_a_car_that_was_hardly_seen_is_not_remembered(car: Car) -> None:
    """Its first two scans say little of its acceleration."""
    start = car.number
    see(car, 2, 60.0, 5.0, 1)
    see(car, 2, 60.3, 5.7, 1)
    see(car, 1, 30.0, 0.0, 4)
    see(car, 2, 61.7, 5.2, 20)
    assert car.outcomes[-1].report.relative_velocity.state == State.OK
    assert not car.faults_since(start)


def test_an_id_that_comes_back_soon_is_still_the_same_car(car: Car) -> None:
    """What is off then is a fault."""
    see(car, 2, 60.0, 0.0, 20)
    start = car.number
    see(car, 1, 30.0, 0.0, 2)
    see(car, 2, 64.0, 0.0, 3)
    assert car.faults_since(start) == {"clearance", "radar"}


def lose_the_lead(car: Car, seconds: float) -> None:
    """For so long a radar that does not see it goes on from what it knew."""
    clearance, velocity = car.clearance, car.velocity
    for step in range(round(seconds * 100)):
        car.step(clearance_is=clearance + 0.01 * step * velocity, relative_velocity_is=velocity)


@pytest.mark.parametrize("acceleration", [2.0, -2.0])
def test_a_lead_that_is_not_seen_while_it_changes_its_speed_is_no_held_radar(
    car: Car, acceleration: float
) -> None:
    """The clearance goes on as the relative velocity says, as no measured one does."""
    car.lead_acceleration = acceleration
    car.drive(1.0)
    start = car.number
    lose_the_lead(car, 0.48)
    car.drive(1.0)
    assert not car.faults_since(start)
    # A measured one does not go so.
    start = car.number
    car.drive(0.48, relative_velocity_is=car.seen[1])
    assert car.faults_since(start) == {"relative_velocity", "radar"}


def test_without_a_clearance_nothing_says_that_the_lead_is_not_seen(car: Car) -> None:
    car.lead_acceleration = 2.0
    car.drive(1.0)
    start = car.number
    car.drive(0.48, relative_velocity_is=car.seen[1], clearance_is=nan)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


@pytest.mark.parametrize(
    ("braking", "seconds", "faulty"),
    [
        (-3.0, 0.4, set()),
        (-4.0, 0.3, set()),
        (-5.0, 0.4, {"relative_velocity", "radar"}),
        (-2.0, 0.6, {"relative_velocity", "radar"}),
    ],
)
def test_a_radar_that_lost_its_lead_for_a_moment_catches_up(
    car: Car, braking: float, seconds: float, faulty: set[str]
) -> None:
    """What it says then is the lead's, as far as one may have begun to brake meanwhile."""
    start, car.lead_acceleration = car.number, braking
    lose_the_lead(car, seconds)
    car.lead_acceleration = 0.0
    assert abs(car.velocity) > 1.0, "more than its limit"
    car.drive(3.0)
    assert car.faults_since(start) == faulty


def coarse(scan: int) -> Car:
    """One whose radar says so often the same by chance that four equal scans tell little."""
    car = Car()
    car.scan, car.rounded = scan, {"relative_velocity": 0.05}
    car.drive(20.0)
    return car


@pytest.mark.parametrize("seconds", [0.3, 0.4])
@pytest.mark.parametrize("braking", [-3.5, 3.5])
def test_the_clearance_says_that_a_slow_radar_had_lost_its_lead(
    seconds: float, braking: float
) -> None:
    """Where it may have said the same by chance."""
    car = coarse(10)
    start, car.lead_acceleration = car.number, braking
    lose_the_lead(car, seconds)
    car.lead_acceleration = 0.0
    assert abs(car.velocity) > 1.0, "more than its limit"
    car.drive(3.0)
    assert not car.faults_since(start)


@pytest.mark.parametrize("offset", [-1.3, 1.3])
def test_the_clearance_says_that_a_radar_had_not_lost_its_lead(offset: float) -> None:
    """Where it said the same for longer than chance would have it."""
    car = coarse(5)
    car.drive(0.4, relative_velocity_is=0.0)
    start = car.number
    car.drive(1.0, relative_velocity=offset)
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    assert car.delay("relative_velocity", start) < 0.4


@pytest.mark.parametrize("seconds", [1.0, 1.6, 2.4])
def test_a_clearance_far_smoother_than_measured_is_made_of_what_the_radar_knew(
    car: Car, seconds: float
) -> None:
    """It may go on without its lead for two seconds."""
    car.lead_acceleration = -0.5
    car.drive(2.0)
    start, car.lead_acceleration = car.number, 0.6
    lose_the_lead(car, seconds)
    assert not car.faults_since(start)
    car.drive(1.0)
    assert bool(car.faults_since(start)) == (seconds > 2.0)


@pytest.mark.parametrize("acceleration", [-2.0, 2.0])
@pytest.mark.parametrize(("further", "faulty"), [(0.0, set()), (-2.2, {"clearance", "radar"})])
def test_a_clearance_made_of_what_the_radar_knew_catches_up_as_well(
    car: Car, acceleration: float, further: float, faulty: set[str]
) -> None:
    """As far as the relative velocity leads in that time, and not the other way."""
    car.lead_acceleration = 0.4 * acceleration
    car.drive(2.0)
    start, car.lead_acceleration = car.number, acceleration
    lose_the_lead(car, 1.6)
    assert abs(car.clearance - car.seen[0]) > 2.0, "more than its limit"
    car.lead_acceleration = 0.0
    car.drive(3.0, clearance=further * acceleration)
    assert car.faults_since(start) == faulty


def test_a_clearance_as_rough_as_measured_is_not_made_of_what_the_radar_knew(car: Car) -> None:
    car.lead_acceleration = -0.5
    car.drive(2.0)
    start, car.lead_acceleration = car.number, 0.6
    car.drive(1.0, relative_velocity_is=car.velocity)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


@pytest.mark.parametrize("repeats", [0, 1, 2, 3])
def test_an_offset_after_a_few_equal_values_is_no_lead_that_was_not_seen(
    car: Car, repeats: int
) -> None:
    """No radar goes on for less than four scans, and two of them are alike by coincidence."""
    while car.number % SCAN:
        car.step()
    car.drive(0.05 * (repeats + 1), relative_velocity_is=car.velocity)
    start = car.number
    car.drive(0.5, relative_velocity=0.95)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


def test_where_repetition_tells_nothing_no_radar_catches_up() -> None:
    car = Car(check_repetition=False)
    car.drive(12.0)
    start, car.lead_acceleration = car.number, -3.0
    lose_the_lead(car, 0.4)
    car.drive(0.5)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


@pytest.mark.parametrize("jump", [-1.2, 1.5])
def test_a_radar_that_saw_its_lead_all_along_has_nothing_to_catch_up(car: Car, jump: float) -> None:
    start = car.number
    car.drive(1.0, relative_velocity=jump)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


def test_a_lead_that_rests_after_a_moment_unseen_is_no_held_clearance(standing: Car) -> None:
    """How far it went in that moment is a guess as good as how fast it was before."""
    for acceleration in (-1.0, 0.8):
        standing.lead_acceleration = acceleration
        standing.drive(1.0)
    still = {"clearance_is": standing.clearance, "relative_velocity_is": 0.0}
    start, standing.lead_acceleration, standing.velocity = standing.number, 0.0, 0.0
    standing.drive(0.15, **still)
    standing.radar_silent = True
    standing.drive(0.95)
    standing.radar_silent = False
    standing.drive(0.5, **still)
    assert not standing.faults_since(start)


@pytest.mark.parametrize("track_id", [1, -1])
@pytest.mark.parametrize(
    ("clearance", "velocity"), [(50.0, 15.0), (80.0, 1.5), (50.0, 0.3), (24.5, -15.0)]
)
def test_another_car_under_the_same_id_is_no_fault(track_id, clearance, velocity) -> None:
    """Radars give the id of a target that is gone to the next one, from one scan to the next."""
    car = Car()
    car.track_id = track_id
    car.drive(8.0)
    start = car.number
    for car.clearance, car.velocity in ((clearance, velocity), (30.0, 0.0)):
        report = car.drive(1.0).report
        assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(start)
    car.drive(1.0, clearance=2.0)
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize(
    ("velocity", "jump", "faults"),
    [
        (-15.0, 14.0, set()),
        (-15.0, 10.0, {"clearance", "radar"}),
        (-12.0, 14.0, {"clearance", "radar"}),
    ],
)
def test_something_else_that_stands_is_no_fault(car: Car, velocity, jump, faults) -> None:
    """What stands is all equally fast: the relative velocity does not tell one from another."""
    car.track_id, car.clearance, car.velocity = 2, 90.0, velocity
    car.drive(2.0)
    start = car.number
    car.clearance += jump
    car.drive(1.0)
    assert car.faults_since(start) == faults


def test_cars_that_follow_one_another_under_one_id_are_no_fault(car: Car) -> None:
    """Not even where the first scans of each lie beside those that follow."""
    start = car.number
    for clearance, velocity, scans in ((70.0, -17.0, 1), (25.0, 12.0, 3), (45.0, 8.0, 30)):
        car.clearance, car.velocity = clearance, velocity
        car.drive(0.01 * SCAN, clearance=0.6)
        car.drive(0.01 * SCAN * scans)
    assert not car.faults_since(start)
    assert car.drive(0.5).report.clearance.state == State.OK


@pytest.mark.parametrize(
    ("jump", "slower", "faults"),
    [
        (5.0, 0.0, {"clearance", "radar"}),
        (5.0, 0.2, {"clearance", "radar"}),
        (5.0, 0.6, set()),
        (2.9, 0.6, {"clearance", "radar"}),
        (8.0, 0.0, set()),
    ],
)
def test_another_car_some_missed_scans_later_is_no_fault(car: Car, jump, slower, faults) -> None:
    """It is known as such by its relative velocity, too, where that differs."""
    start = car.number
    car.radar_silent = True
    car.drive(0.15)
    car.radar_silent = False
    car.clearance += jump
    car.velocity -= slower
    car.drive(1.0)
    assert car.faults_since(start) == faults


def test_a_fault_of_both_signals_some_missed_scans_later_is_one(car: Car) -> None:
    start = car.number
    car.radar_silent = True
    car.drive(0.15)
    car.radar_silent = False
    car.drive(0.4, clearance=4.0, relative_velocity=-10.0)
    assert car.faults_since(start) == {"clearance", "relative_velocity", "radar"}


@pytest.mark.parametrize(
    "fault",
    [
        {"clearance": 20.0},
        {"clearance": 20.0, "relative_velocity": -10.0},
        {"clearance": 4.0, "relative_velocity": -10.0},
        {"relative_velocity": -10.0},
        {"clearance_is": 0.0, "relative_velocity_is": 0.0},
    ],
)
def test_a_large_fault_does_not_pass_for_another_car(car: Car, fault) -> None:
    """Its clearance goes on as before, whatever the relative velocity says."""
    car.velocity = 2.0
    car.track_id = 2
    car.drive(2.0)
    start = car.number
    car.drive(2.0, **fault)
    named = {name.removesuffix("_is") for name in fault}
    assert car.faults_since(start) == named | {"radar"}
    assert all(car.delay(name, start) <= 0.2 for name in named)


def test_without_ids_another_car_is_told_by_what_it_says_of_itself() -> None:
    """Where it is so near that it could be a fault as well."""
    car = Car()
    car.track_id = -1
    car.drive(8.0)
    car.clearance, car.velocity = car.clearance + 4.0, 3.0
    verdict = car.drive(1.0).report.radar
    assert verdict.state == State.FAULT, "nobody knows yet"
    car.drive(9.0)
    states = {outcome.report.radar.state for outcome in car.outcomes[-50:]}
    assert states == {State.OK}
    start = car.number
    car.drive(1.0, clearance=4.0)
    assert "clearance" in car.faults_since(start)


def test_without_ids_a_fault_of_both_signals_does_not_pass_for_another_car() -> None:
    car = Car()
    car.track_id = -1
    car.drive(8.0)
    start = car.number
    car.drive(12.0, clearance=4.0, relative_velocity=-10.0)
    states = [outcome.report.clearance.state for outcome in car.outcomes[start + 20 :]]
    assert set(states) == {State.FAULT}


def test_a_reference_that_was_lost_is_known_again_once_nothing_is_faulty(car: Car) -> None:
    for k in range(800):
        if k == 500:
            car.track_id, car.clearance, car.velocity = 2, 60.0, -4.0
            car.lead_acceleration = 0.5
        car.step(clearance=0.005 * k)
    assert "reference lost" in car.outcomes[-1].report.clearance.reason
    car.drive(1.0)
    car.track_id, car.clearance, car.velocity = 3, 30.0, 0.0
    outcome = car.drive(6.0)
    assert outcome.report.clearance.state == State.OK
    assert outcome.reconstruction.clearance_valid
    # Nor is what goes wrong next believed as if nothing was known of that car.
    car.drive(8.0, clearance=4.0)
    assert car.outcomes[-1].report.clearance.state == State.FAULT


def test_a_scan_without_an_id_does_not_forget_the_targets(car: Car) -> None:
    """The next id is another car's, as if nothing had been between."""
    start = car.number
    car.track_id = UNKNOWN_TRACK
    car.drive(0.01 * SCAN)
    car.track_id, car.clearance = 2, car.clearance + 2.5
    assert car.drive(1.0).report.clearance.state == State.OK
    assert not car.faults_since(start)


def test_a_target_is_known_as_soon_by_a_radar_that_says_everything_twice(car: Car) -> None:
    """What is said again contradicts nothing, so the target does not begin anew with it."""
    ready = {}
    for twice in (False, True):
        car.track_id, car.clearance, car.velocity = car.track_id + 1, 45.0, -1.0
        start = len(car.outcomes)
        for k in range(60):
            again = twice and k // SCAN % 2
            said = {"clearance_is": car.seen[0], "relative_velocity_is": car.seen[1]}
            car.step(**(said if again else {}))
        states = [outcome.report.clearance.state for outcome in car.outcomes[start:]]
        ready[twice] = states.index(State.OK, 1)
        car.drive(5.0)
    assert ready[True] == ready[False]


def test_a_scan_without_a_measurement_says_so_where_its_target_is_known(car: Car) -> None:
    car.has_target = False
    car.drive(0.1)
    car.has_target = True
    verdict = car.drive(0.05, relative_velocity_is=nan).report.relative_velocity
    assert verdict.state == State.NOT_READY
    assert verdict.reason == "nothing new to judge in this scan"


@pytest.mark.parametrize(
    ("fault", "gone"),
    [("clearance_is", 1.0), ("relative_velocity_is", 1.0), ("clearance", 6.0)],
)
def test_what_nobody_saw_is_no_agreement_of_a_new_target(car: Car, fault: str, gone: float) -> None:
    """The fault goes on while the lead is out of sight, and behind the next one."""
    said = {"clearance_is": car.seen[0], "relative_velocity_is": car.seen[1], "clearance": 3.0}
    name = fault.removesuffix("_is")
    random = np.random.default_rng(3)

    def drive(seconds: float, **faults: float) -> list[State]:
        start = car.number
        for _ in range(round(seconds)):
            back = 0.05 * (car.clearance - 30.0) + 0.4 * car.velocity
            car.lead_acceleration = float(np.clip(random.normal() - back, -2.0, 2.0))
            car.drive(1.0, **faults)
        return [getattr(outcome.report, name).state for outcome in car.outcomes[start:]]

    assert drive(3.0, **{fault: said[fault]})[-1] == State.FAULT
    car.has_target = False
    drive(gone, **{fault: said[fault]})
    car.has_target, car.track_id, car.clearance, car.velocity = True, 2, 22.0, 0.5
    assert State.OK not in drive(4.0, **{fault: said[fault]})
    start = car.number
    drive(7.0)
    assert getattr(car.outcomes[-1].report, name).state == State.OK
    assert not car.faults_since(start)


@pytest.mark.parametrize("scans", [1, 2, 3])
@pytest.mark.parametrize("track_id", [1, -1])
@pytest.mark.parametrize(("apart", "faster"), [(12.0, 1.5), (25.0, 4.0)])
def test_two_targets_that_take_turns_without_an_id_of_their_own_are_no_fault(
    scans: int, track_id: int, apart: float, faster: float
) -> None:
    car = Car()
    car.track_id = track_id
    car.drive(12.0)
    start = car.number
    for k in range(150):
        other = k // (5 * scans) % 2
        way = apart + 0.01 * faster * k
        car.step(clearance=other * way, relative_velocity=other * faster)
    car.drive(5.0)
    assert not car.faults_since(start)


@pytest.mark.parametrize("ids", [2, 1000])
@pytest.mark.parametrize(
    ("signal", "rate", "most", "scans"),
    [
        *(("clearance", rate, 4.5, scans) for rate in (1.0, -1.0) for scans in (10, 40)),
        *(("relative_velocity", 0.6, 3.0, scans) for scans in (2, 3, 10, 40)),
    ],
)
def test_a_drift_goes_on_through_the_ids_of_one_car(
    car: Car, ids: int, signal: str, rate: float, most: float, scans: int
) -> None:
    """An id changes nothing of what its sensor drifts by, be it new or known; the step that it
    makes is no drift."""
    car.drive(3.0)
    start = car.number
    for k in range(600):
        if k % (scans * SCAN) == 0:
            car.track_id = 10 + (k // (scans * SCAN)) % ids
        part = 0.4 * (car.track_id % 2)
        drifts = {"clearance": part}
        drifts[signal] = drifts.get(signal, 0.0) + 0.01 * rate * k
        car.step(**drifts)
    assert car.faults_since(start) == {signal, "radar"}
    assert car.delay(signal, start) * abs(rate) <= most


@pytest.mark.parametrize("rate", [2.0, -2.0])
@pytest.mark.parametrize(("beside", "fault"), [(0.0, False), (-2.0, True)])
def test_the_end_of_a_drift_that_was_not_found_is_no_offset(
    rate: float, beside: float, fault: bool
) -> None:
    """It leads back onto the path that was travelled; a fault would lead beside it."""
    car = Car()

    def drive(seconds: float, off: float, drifts: float = 0.0) -> None:
        for k in range(round(100 * seconds)):
            car.track_id = 10 + (car.number // 80) % 2
            car.step(clearance=off + 0.01 * drifts * k)

    drive(14.0, 0.0)
    start = car.number
    drive(1.0, 0.0, rate)
    assert not car.faults_since(start)
    drive(1.0, beside if rate > 0.0 else -beside)
    assert car.faults_since(start) == {"clearance", "radar"}
    verdict = car.outcomes[-1].report.clearance
    assert verdict.state == (State.FAULT if fault else State.OK)


@pytest.mark.parametrize(("seed", "rate"), [(0, -0.5), (8, -0.5), (10, -0.5), (11, 0.5)])
@pytest.mark.parametrize("drifts", [True, False])
def test_where_a_clearance_wanders_the_end_of_a_drift_leads_near_to_the_path(
    seed: int, rate: float, drifts: bool
) -> None:
    """Nearer to the path travelled than to where an offset without a drift would lead."""
    car = Car()
    random = np.random.default_rng(seed)
    wander = 0.0

    def drive(seconds: float, off: float = 0.0, drift: float = 0.0) -> None:
        nonlocal wander
        for k in range(round(100 * seconds)):
            wander += -0.01 / 3.0 * wander + 0.3 * (0.02 / 3.0) ** 0.5 * random.normal()
            car.step(clearance=wander + off + 0.01 * drift * k)

    drive(30.0)
    drive(4.0, drift=rate if drifts else 0.0)
    assert not car.faults_since(0)
    start = car.number
    drive(2.0, off=0.0 if drifts else -4.0 * rate)
    assert car.faults_since(start) == {"clearance", "radar"}
    verdict = car.outcomes[-1].report.clearance
    assert verdict.state == (State.OK if drifts else State.FAULT)


@pytest.mark.parametrize(
    ("rests", "beside", "told"),
    [(0.0, 0.0, Kind.RAMP), (7.0, 0.0, Kind.RAMP), (0.0, -3.0, Kind.OFFSET)],
)
def test_a_drift_that_the_relative_velocity_was_blamed_for_ends(
    car: Car, rests: float, beside: float, told: Kind
) -> None:
    """The clearance drifts as if the relative velocity did; it ends where that led all along."""
    start, off = car.number, 0.0
    for k in range(400):
        off = 0.2 * (0.01 * k) ** 2
        car.step(clearance=off)
    for _ in range(round(100 * rests)):
        off += 0.016
        car.step(clearance=off)
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    report = car.drive(0.3, clearance=beside).report
    assert report.clearance.state == State.FAULT and report.clearance.kind == told
    report = car.drive(2.0, clearance=beside).report
    state = State.OK if told == Kind.RAMP else State.FAULT
    assert report.clearance.state == state
    if told == Kind.RAMP:
        assert report.relative_velocity.state == State.OK


@pytest.mark.parametrize("size", [4.0, -6.0])
def test_an_offset_that_begins_with_another_id_is_told_of_as_it_ends(car: Car, size: float) -> None:
    """It passes for another car that is just as fast, until the clearance jumps back."""
    start = car.number
    car.track_id = 2
    car.drive(4.0, clearance=size)
    assert not car.faults_since(start)
    report = car.drive(0.5).report
    assert report.clearance.state == State.FAULT and report.clearance.kind == Kind.OFFSET
    assert report.clearance.size == pytest.approx(size, abs=0.3)
    assert report.clearance.reason.startswith("offset by jump back: by ")
    assert report.clearance.reason.endswith("it was off until then")
    assert car.drive(1.5).report.clearance.state == State.OK
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize(
    ("beside", "velocity", "jump"),
    [(4.0, 2.0, -4.0), (4.0, 0.0, 4.0), (4.0, 0.0, -2.5), (4.0, 0.0, -6.0), (2.0, 0.0, -2.0)],
)
def test_an_offset_of_another_car_does_not_pass_for_the_end_of_one(
    car: Car, beside: float, velocity: float, jump: float
) -> None:
    """Another car is as fast as itself, and its clearance jumps elsewhere."""
    car.track_id, car.clearance, car.velocity = 2, car.clearance + beside, car.velocity + velocity
    car.drive(4.0)
    report = car.drive(4.0, clearance=jump).report
    assert report.clearance.state == State.FAULT and report.clearance.kind == Kind.OFFSET
    assert report.clearance.size == pytest.approx(jump, abs=0.4)


@pytest.mark.parametrize("off", [2.0, -4.0])
@pytest.mark.parametrize("later", [3.0, 8.0, 20.0])
def test_an_offset_that_is_believed_since_another_car_came_ends_when_it_jumps_back(
    car: Car, off: float, later: float
) -> None:
    """Nobody saw whether it went on with that car; its end is no fault."""
    car.drive(2.0, clearance=off)
    car.track_id, car.clearance, car.velocity = 2, 55.0, 0.3
    car.drive(later, clearance=off)
    start = car.number
    car.drive(4.0)
    assert not car.faults_since(start)
    assert car.outcomes[-1].report.clearance.state == State.OK
    start = car.number
    car.drive(1.0, clearance=off)
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize(("seed", "apart"), [(0, 0.0), (1, 0.0), (0, 0.1)])
def test_the_nearest_of_two_coarse_parts_is_no_drift(seed: int, apart: float) -> None:
    """Chosen is the one that just stepped nearer: whatever it says next lies farther off."""
    car = Car()
    car.random = np.random.default_rng(seed)
    car.rounded["clearance"] = 0.25
    car.drive(10.0)
    start, chosen, car.velocity = car.number, 0, 2.0
    for _ in range(1200):
        if car.number % SCAN == 0:
            noise = 0.2 * car.random.normal(size=2)
            parts = np.round((car.clearance + np.array([0.0, apart]) + noise) / 0.25) * 0.25
            chosen = chosen if parts[chosen] <= parts[1 - chosen] else 1 - chosen
            said, car.track_id = float(parts[chosen]), 5 + chosen
        car.step(clearance_is=said)
    assert not car.faults_since(start)


def test_without_ids_another_car_at_a_light_is_no_fault(standing: Car) -> None:
    """Where both stand the relative velocity tells no car from another."""
    standing.track_id = UNKNOWN_TRACK
    standing.drive(2.0)
    start = standing.number
    standing.clearance += 14.0
    standing.drive(1.0)
    assert not standing.faults_since(start)


@pytest.mark.parametrize("seed", range(4))
def test_without_ids_another_car_is_told_though_its_clearance_wanders(seed: int) -> None:
    """Whether it goes on as it says itself or as the former one did: no sensor is so far off."""
    car = Car()
    car.track_id = UNKNOWN_TRACK
    car.drive(8.0)
    start = car.number
    car.clearance, car.velocity = car.clearance + 40.0, 5.0
    wander, off = np.random.default_rng(seed), 0.0
    for _ in range(14):
        off += 0.5 * wander.normal()
        car.drive(0.01 * SCAN, clearance=off)
    assert not car.faults_since(start)


@pytest.mark.parametrize(
    ("track_id", "jump", "faults"),
    [
        (UNKNOWN_TRACK, 16.0, set()),
        (UNKNOWN_TRACK, -16.0, set()),
        (UNKNOWN_TRACK, 13.0, {"clearance", "radar"}),
        (1, 16.0, {"clearance", "radar"}),
    ],
)
def test_without_ids_another_car_may_be_just_as_fast(track_id: int, jump: float, faults) -> None:
    """The lead leaves, and the next one drives far before it: no fault is as large."""
    car = Car()
    car.track_id = track_id
    car.drive(8.0)
    start = car.number
    car.clearance += jump
    car.drive(1.0)
    assert car.faults_since(start) == faults


@pytest.mark.parametrize(("gain", "clearance"), [(1.3, 30.0), (1.3, 90.0), (0.7, 90.0)])
def test_without_ids_a_gain_of_the_clearance_is_a_fault(gain: float, clearance: float) -> None:
    car = Car()
    car.track_id, car.clearance = UNKNOWN_TRACK, clearance
    car.drive(8.0)
    start = car.number
    for _ in range(100):
        car.step(clearance=(gain - 1.0) * car.clearance)
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize("farther", [-15.0, -8.0, 5.0, 20.0, 45.0])
def test_another_car_that_comes_while_no_clearance_is_heard_is_not_where_the_last_one_was(
    car: Car, farther: float
) -> None:
    car.drive(1.0, clearance_is=nan)
    assert car.outcomes[-1].reconstruction.clearance_valid
    start = car.number
    car.track_id, car.clearance = 2, car.clearance + farther
    for _ in range(200):
        made = car.step(clearance_is=nan).reconstruction
        assert not made.clearance_valid or car.number <= start + 2 * SCAN
    assert made.relative_velocity_valid
    assert car.drive(2.0).report.clearance.state == State.OK
    assert not car.faults_since(start)
    assert abs(car.outcomes[-1].reconstruction.clearance - car.clearance) < 0.5


def test_a_relative_velocity_that_is_not_heard_of_another_id_is_not_known(car: Car) -> None:
    car.drive(0.5, relative_velocity_is=nan)
    car.track_id = 2
    made = car.drive(1.0, relative_velocity_is=nan).reconstruction
    assert made.clearance_valid and not made.relative_velocity_valid
    made = car.drive(1.0).reconstruction
    assert made.clearance_valid and made.relative_velocity_valid and not car.faults_since(0)


@pytest.mark.parametrize("farther", [-15.0, 25.0])
@pytest.mark.parametrize("zero", [False, True])
@pytest.mark.parametrize("unfound", [False, True])
def test_a_clearance_that_repeats_itself_does_not_tell_which_car_another_id_is(
    car: Car, farther: float, zero: bool, unfound: bool
) -> None:
    """The other car is just as fast: nothing else would tell, either."""
    car.lead_acceleration = 1.0
    car.drive(2.0)
    car.lead_acceleration, said = 0.0, 0.0 if zero else car.clearance
    car.drive(0.15 if unfound else 1.0, clearance_is=said)
    assert car.outcomes[-1].reconstruction.clearance_valid
    car.track_id, car.clearance, start = 2, car.clearance + farther, car.number
    for _ in range(200):
        made = car.step(clearance_is=said).reconstruction
        assert not made.clearance_valid or car.number <= start + (8 if unfound else 1) * SCAN
    assert car.outcomes[-1].report.clearance.state == State.FAULT
    start, outcome = car.number, car.drive(0.8)
    assert outcome.report.clearance.state == State.OK
    assert abs(outcome.reconstruction.clearance - car.clearance) < 0.3
    car.drive(5.0)
    assert not car.faults_since(start)


def test_an_offset_beside_a_clearance_that_repeats_itself_outlasts_another_id(car: Car) -> None:
    off = {"clearance_is": 0.0, "relative_velocity": 3.0}
    car.drive(1.0, clearance_is=0.0)
    car.drive(1.0, **off)
    car.track_id = 2
    verdict = car.drive(8.0, **off).report.relative_velocity
    assert (verdict.state, verdict.kind) == (State.FAULT, Kind.OFFSET)
