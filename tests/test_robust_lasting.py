"""A fault of the accelerometer that lasts is not believed, and its size is that of now."""

from math import sin

import numpy as np
import pytest
from robust_car import Car

from lfd_diagnosis.verdict import SignalVerdict, State


def felt(car: Car) -> SignalVerdict:
    return car.outcomes[-1].report.acceleration


@pytest.mark.parametrize("off", [1.6, -2.4])
def test_a_fault_that_host_speed_told_outlasts_its_silence(car: Car, off: float) -> None:
    """The observers alone would not have told of one so small."""
    car.drive(3.0, acceleration=off)
    assert felt(car).state == State.FAULT
    car.host_speed = False
    start = car.number
    car.drive(6.0, acceleration=off)
    car.host_speed = True
    car.drive(4.0, acceleration=off)
    assert all(o.report.acceleration.state == State.FAULT for o in car.outcomes[start:])
    assert felt(car).size == pytest.approx(off, abs=0.3)
    car.drive(1.0)
    assert felt(car).state == State.OK
    number = car.number
    car.drive(3.0)
    assert not car.faults_since(number)


@pytest.mark.parametrize("fading", [0, 200])
def test_a_fault_that_ends_while_nothing_better_tells_is_over_later(car: Car, fading: int) -> None:
    """Soon where the samples leap back, else when observers have agreed for long."""
    car.drive(3.0, acceleration=2.0)
    car.host_speed = False
    car.drive(1.0, acceleration=2.0)
    for k in range(fading):
        car.step(acceleration=2.0 * (1.0 - k / fading))
    car.drive(1.5)
    assert felt(car).state == (State.FAULT if fading else State.OK)
    car.drive(2.0)
    assert felt(car).state == (State.FAULT if fading else State.OK)
    car.drive(3.0)
    assert felt(car).state == State.OK


def test_the_slope_after_a_fault_that_ended_without_a_speed_is_felt_anew(car: Car) -> None:
    """What it was off before the speed was lost tells nothing of its slope afterwards."""
    car.drive(3.0, acceleration=2.0)
    car.host_speed = False
    car.drive(0.5, acceleration=2.0)
    for k in range(100):
        car.step(acceleration=2.0 * (1.0 - k / 100))
    car.drive(1.5)
    car.host_speed = True
    start = car.number
    car.drive(3.0)
    states = [outcome.report.acceleration.state for outcome in car.outcomes[start:]]
    assert set(states[states.index(State.OK) :]) == {State.OK}


def test_a_fault_that_the_leads_word_told_outlasts_its_silence() -> None:
    car = Car(host_speed=False, lead=True)
    car.drive(12.0)
    start = car.number
    car.drive(3.0, acceleration=2.0)
    assert felt(car).state == State.FAULT
    assert felt(car).reason.startswith("offset by lead's word: off by")
    assert "; now off by" in felt(car).reason
    car.lead = False
    car.drive(1.5, acceleration=2.0)
    car.lead = True
    car.drive(8.0, acceleration=2.0)
    assert felt(car).state == State.FAULT
    assert car.faults_since(start) == {"acceleration"}
    car.drive(10.0)
    assert felt(car).state == State.OK


@pytest.mark.parametrize(("silence", "off"), [(1.0, -2.0), (2.0, 1.8)])
def test_an_accelerometer_that_comes_back_with_an_offset_is_not_believed(
    car: Car, silence: float, off: float
) -> None:
    """Nothing of its jump is among the differences since: that makes it no road."""
    car.accelerometer_silent = True
    car.drive(silence)
    car.accelerometer_silent = False
    car.drive(1.0, acceleration=off)
    start = car.number
    car.drive(8.0, acceleration=off)
    assert all(o.report.acceleration.state == State.FAULT for o in car.outcomes[start:])
    car.drive(1.0)
    assert felt(car).state == State.OK


def test_an_offset_that_began_while_the_speed_was_lost_is_not_believed(car: Car) -> None:
    car.host_speed = False
    car.drive(0.5)
    car.drive(0.5, acceleration=1.8)
    car.host_speed = True
    car.drive(1.5, acceleration=1.8)
    start = car.number
    car.drive(7.0, acceleration=1.8)
    assert all(o.report.acceleration.state == State.FAULT for o in car.outcomes[start:])


@pytest.mark.parametrize(("late", "seldom", "off"), [(10, 5, -2.0), (5, 2, -2.2)])
def test_an_offset_that_jumps_in_as_the_car_brakes_is_no_road(
    late: int, seldom: int, off: float
) -> None:
    """A late speed smears the jump over the manoeuvre."""
    car, random = Car(), np.random.default_rng(1)
    said: list[float] = []

    def step(acceleration: float, off: float = 0.0) -> None:
        car.speed += 0.01 * acceleration
        said.append(car.speed + 0.01 * random.normal())
        at = max(car.number - car.number % seldom - late, 0)
        car.step(acceleration=acceleration + off, host_speed_is=said[at])

    def change(start: float, to: float, off: float = 0.0) -> None:
        steps = round(abs(to - start) / 0.08)
        for k in range(steps):
            step(start + (to - start) * (k + 1) / steps, off)

    car.drive(8.0)
    said += [car.speed] * car.number
    for k in range(600):
        step(1.5 * sin(k / 60))
    change(1.5 * sin(599 / 60), 0.0)
    for _ in range(100):
        step(0.0)
    change(0.0, -2.4)
    change(-2.4, -5.0, off)
    for _ in range(60):
        step(-5.0, off)
    change(-5.0, 0.0, off)
    start = car.number
    for _ in range(800):
        step(0.0, off)
    assert all(o.report.acceleration.state == State.FAULT for o in car.outcomes[start:])
    for _ in range(200):
        step(0.0)
    assert felt(car).state == State.OK


def test_the_size_is_that_of_now_where_a_fault_jumps_to_another_level(car: Car) -> None:
    for off in (2.0, 4.0, 2.0):
        car.drive(3.0, acceleration=off)
        assert felt(car).size == pytest.approx(off, abs=0.3)
