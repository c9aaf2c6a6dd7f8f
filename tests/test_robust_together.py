"""Faults of two signals at once: each is told by itself, and each is over when it is."""

import pytest
from robust_car import SCAN, Car

from lfd_diagnosis.verdict import State

ROUGH = {"clearance": 2.0, "relative_velocity": 1.5}
"""Deviations of the noise in m and m/s."""


def drive(car: Car, seconds: float, rough: str = "", **faults: float) -> None:
    """Drive on with one signal rough, and others off."""
    for _ in range(round(seconds * 100)):
        if rough and car.number % SCAN == 0:
            faults[rough] = ROUGH[rough] * float(car.random.normal())
        car.step(**faults)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    ("rough", "other", "off"),
    [("clearance", "relative_velocity", -3.0), ("relative_velocity", "clearance", 4.0)],
)
def test_an_offset_is_told_while_the_other_signal_is_rough(
    rough: str, other: str, off: float, seed: int
) -> None:
    """What is rough jumps back all the time: no end of its fault that the other one was part of."""
    car = Car()
    car.follow_unsteady(12, seed)
    drive(car, 1.5, rough)
    start = car.number
    drive(car, 2.0, rough, **{other: off})
    assert car.delay(other, start) <= 0.15


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("later", [-0.5, 0.0])
def test_noise_beside_an_offset_of_the_other_signal_is_over_when_it_is(
    later: float, seed: int
) -> None:
    """The track was coasted far away meanwhile."""
    car = Car()
    car.follow_unsteady(12, seed)
    if later:
        drive(car, -later, relative_velocity=-3.0)
    drive(car, 4.0 + later, "clearance", relative_velocity=-3.0)
    if later:
        drive(car, -later, "clearance")
    drive(car, 4.0)
    report = car.outcomes[-1].report
    assert (report.clearance.state, report.relative_velocity.state) == (State.OK, State.OK)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("before", [0.4, 0.5])
def test_an_offset_is_over_that_ends_as_the_held_signal_is_believed_again(
    before: float, seed: int
) -> None:
    """What was coasted is found to be elsewhere in that very scan."""
    car = Car()
    car.follow_unsteady(12, seed)
    car.lead_acceleration = 0.8
    held = car.seen[1]
    drive(car, before, relative_velocity_is=held)
    drive(car, 4.0 - before, relative_velocity_is=held, clearance=4.0)
    drive(car, before, clearance=4.0)
    car.lead_acceleration = -0.8
    drive(car, 4.0)
    report = car.outcomes[-1].report
    assert (report.clearance.state, report.relative_velocity.state) == (State.OK, State.OK)


@pytest.mark.parametrize("silence", [1.0, 2.0])
def test_a_held_accelerometer_is_held_while_nothing_is_heard_of_the_speed(
    car: Car, silence: float
) -> None:
    """Whatever told of it: nothing had changed when it was called held."""
    held = 0.03
    car.drive(3.0, acceleration_is=held)
    assert car.outcomes[-1].report.acceleration.state == State.FAULT
    start, car.host_speed = car.number, False
    car.drive(silence, acceleration_is=held)
    car.host_speed = True
    car.drive(2.0, acceleration_is=held)
    assert {o.report.acceleration.state for o in car.outcomes[start:]} == {State.FAULT}
    car.drive(2.0)
    assert car.outcomes[-1].report.acceleration.state == State.OK


@pytest.mark.parametrize("off", [2.0, 3.0, -3.0, 4.0])
@pytest.mark.parametrize("seldom", [2, 5, 10])
def test_a_seldom_speed_that_jumps_is_faulty_and_nobody_else(seldom: int, off: float) -> None:
    """At its second sample it is no farther off than at its first: no car brakes like that."""
    car = Car()

    def step(off: float) -> None:
        if car.number % seldom == 0:
            step.said = car.speed + off + 0.01 * float(car.random.normal())
        car.step(host_speed_is=step.said)

    step.said = car.speed
    for _ in range(1200):
        step(0.0)
    start = car.number
    for _ in range(300):
        step(off)
    assert car.faults_since(start) == {"host_speed"}
    assert car.delay("host_speed", start) <= 0.03 + 0.02 * seldom
