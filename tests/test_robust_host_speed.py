"""The robust profile without ROS: the host's speed, and what tells where there is none."""

from math import exp, isnan, pi, sin
from random import Random

import numpy as np
import pytest
from robust_car import Car

from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind, State


@pytest.mark.parametrize(
    ("accelerometer", "seconds", "faults"),
    [(name, *last) for name in ("noisy", "silent", "good") for last in ((0.8, False), (2.5, True))],
)
def test_a_rough_speed_is_the_roads_fault_for_a_while_for_not_every_accelerometer_feels_it(
    accelerometer: str, seconds: float, faults: bool
) -> None:
    car, random = Car(), Random(3)

    def drive(seconds: float, shake: float) -> None:
        for _ in range(round(seconds * 100)):
            noise = 0.4 if accelerometer == "noisy" else 0.0
            swing = random.gauss(0.0, shake)
            car.step(acceleration=random.gauss(0.0, noise), host_speed=swing)

    drive(12.0, 0.0)
    car.accelerometer_silent = accelerometer == "silent"
    drive(0.5, 0.0)
    start = car.number
    drive(seconds, 0.15)
    assert car.faults_since(start) == ({"host_speed"} if faults else set())
    drive(4.0, 0.0)
    assert car.outcomes[-1].report.host_speed.state == State.OK


@pytest.mark.parametrize(
    ("shaken", "steps", "faults"),
    [(True, 6, set()), (True, 30, {"host_speed"}), (False, 6, {"host_speed"})],
)
@pytest.mark.parametrize("jump", [-0.9, 0.9, 1.5])
def test_a_wheel_that_is_shaken_may_jump_for_a_moment(
    car: Car, jump: float, shaken: bool, steps: int, faults: set
) -> None:
    """Over a bump it swings to one side for some samples; a speed that jumped stays there."""
    start = car.number
    for swing in (0.25, -0.25, 0.0) if shaken else (0.0,):
        car.step(host_speed=swing)
    jumped = car.number
    car.drive(0.01 * steps, host_speed=jump)
    assert ("host_speed" in car.faults_since(start)) == bool(faults)
    if faults:
        assert car.delay("host_speed", jumped) <= (0.12 if shaken else 0.02)
    car.drive(0.5)
    assert car.faults_since(start) == faults


@pytest.mark.parametrize("ages", [(0,), (0, 5)])
@pytest.mark.parametrize(("noise", "faults"), [(0.0, set()), (0.2, {"host_speed"})])
def test_a_seldom_speed_is_not_rough_because_the_car_brakes_hard(
    ages: tuple[int, ...], noise: float, faults: set
) -> None:
    """At 10 Hz, or in a table at 10 Hz of which every other value is half a sample old."""
    car = Car()
    speeds, said = [30.0] * 6, 30.0
    braking = [0.0] * 6000
    for jerk in (-8.0, 0.0, 8.0):
        braking += [braking[-1] + 0.01 * jerk * k for k in range(1, 111)]
    for acceleration in braking + [0.0] * 300:
        speeds.append(speeds[-1] + 0.01 * acceleration)
        if car.number % 10 == 0:
            age = ages[car.number // 10 % len(ages)]
            said = speeds[-1 - age] + 0.003 * car.random.normal()
            if len(speeds) > len(braking):
                said += noise * car.random.normal()
        car.speed = speeds[-1]
        car.step(acceleration=acceleration, host_speed_is=said)
    assert car.faults_since(0) == faults


def test_a_faulty_host_speed_is_named_and_not_used(car: Car) -> None:
    start = car.number
    report = car.drive(1.0, host_speed=5.0).report
    said = report.host_speed
    assert said.state == State.FAULT and said.kind == Kind.OFFSET and "jump" in said.reason
    assert 0.0 < said.size_std < 0.2 and abs(said.size - 5.0) < 3.0 * said.size_std
    assert "host speed is not used" in report.acceleration.reason
    assert car.faults_since(start) == {"host_speed"}
    start = car.number
    car.drive(0.5, host_speed=5.0, acceleration=4.0)
    assert "acceleration" in car.faults_since(start), "the observers still tell"


@pytest.mark.parametrize("then", [-5.0, 2.5, 10.0])
def test_a_host_speed_whose_offset_changes_is_off_by_what_it_is_by_then(
    car: Car, then: float
) -> None:
    car.drive(1.0, host_speed=5.0)
    said = car.drive(1.0, host_speed=then).report.host_speed
    assert said.state == State.FAULT
    assert abs(said.size - then) < 6.0 * said.size_std
    said = car.drive(0.3).report.host_speed
    assert said.state == State.FAULT
    assert car.drive(0.5).report.host_speed.state == State.OK


@pytest.mark.parametrize("rate", [-3.0, -1.5, 1.5, 3.0])
def test_a_speed_that_drifts_is_named_as_the_lead_tells_and_blames_no_accelerometer(
    rate: float,
) -> None:
    """As that of wheels that slip; they grip again, and it is right at once. So fast no road bends
    like that."""
    car = Car()
    car.speed = 25.0
    car.drive(20.0)
    for k in range(400):
        outcome = car.step(host_speed=0.01 * rate * (k + 1))
    said = outcome.report.host_speed
    assert (said.state, said.kind) == (State.FAULT, Kind.RAMP)
    assert abs(said.size - 4.0 * rate) < 2.0 * said.size_std < 4.0 * abs(rate)
    assert "ramp by its derivative left what the accelerometer feels" in said.reason
    assert "host speed is not used" in outcome.report.acceleration.reason
    assert car.delay("host_speed", 2000) < 0.7
    ended = car.number
    outcome = car.drive(1.5)
    assert outcome.report.host_speed.state == outcome.report.acceleration.state == State.OK
    assert car.faults_since(0) == {"host_speed"}
    assert car.faults_since(ended + 60) == set()


@pytest.mark.parametrize("bend", [-1.8, 1.8])
@pytest.mark.parametrize("leads", [True, False], ids=["behind a lead", "alone"])
def test_a_car_that_is_driven_on_as_before_where_the_road_bends_has_no_faulty_sensor(
    bend: float, leads: bool
) -> None:
    """Its accelerometer feels the drive, not gravity: the speed alone changes, and the lead says
    the same."""
    car = Car()
    car.has_target, car.speed = leads, 25.0
    car.drive(20.0)
    for k in range(400):
        slope = bend * min(k / 30.0, 1.0)
        car.speed += 0.01 * slope
        car.velocity -= 0.01 * slope
        car.step()
    assert car.faults_since(0) == set()
    # It was learnt: what the accelerometer jumps by is still seen.
    start = car.number
    for _ in range(100):
        car.speed += 0.01 * bend
        car.velocity -= 0.01 * bend
        outcome = car.step(acceleration=3.0)
    assert car.faults_since(start) == {"acceleration"}
    assert abs(outcome.report.acceleration.size - 3.0) < 0.3


def test_an_accelerometer_that_jumps_as_the_car_brakes_as_hard_is_the_faulty_one() -> None:
    """What is felt hardly changes, but it leapt."""
    car = Car()
    car.drive(20.0)
    start = car.number
    for k in range(200):
        brakes = 2.0 * min(k / 30.0, 1.0)
        car.speed -= 0.01 * brakes
        car.velocity += 0.01 * brakes
        car.step(acceleration=2.0 - brakes)
    assert car.faults_since(start) == {"acceleration"}


def test_a_host_speed_that_is_held_as_the_car_drives_off_blames_no_accelerometer(car: Car) -> None:
    while car.speed > 0.03:
        car.speed -= 0.02
        car.step(acceleration=-2.0)
    car.speed = 0.0
    car.drive(8.0, host_speed_is=0.0)
    assert not car.faults_since(0)
    start = car.number
    # The lead drives off before the car does.
    car.lead_acceleration = 1.0
    car.drive(1.0, host_speed_is=0.0)
    car.lead_acceleration = 0.0
    for k in range(250):
        acceleration = min(0.02 * (k + 1), 1.7)
        car.speed += 0.01 * acceleration
        car.step(acceleration=acceleration, host_speed_is=0.0)
    assert not car.faults_since(start)
    # It jumps to where it should have been.
    for _ in range(200):
        car.speed += 0.01 * 1.7
        outcome = car.step(acceleration=1.7)
    assert car.faults_since(start) == {"host_speed"}
    assert outcome.report.host_speed.state == outcome.report.acceleration.state == State.OK


def test_a_coarse_host_speed_that_is_held_as_the_car_brakes_blames_no_accelerometer() -> None:
    """Steps of 1 km/h take their time, but the lead goes on steadily, if the accelerometer is
    right; then the speed leaps to where it should be."""
    car = Car()
    speeds = [car.speed] * 7

    def accelerate(by: float) -> float:
        """What the speed says afterwards, a moment late."""
        car.speed += 0.01 * by
        car.velocity -= 0.01 * by
        speeds.append(car.speed)
        return round(3.6 * speeds[-7]) / 3.6

    for k in range(4000):
        acceleration = 0.8 * sin(2.0 * pi * k / 800)
        car.step(acceleration=acceleration, host_speed_is=accelerate(acceleration))
    start, held = car.number, accelerate(0.0)
    for k in range(150):
        acceleration = -0.02 * k
        accelerate(acceleration)
        car.step(acceleration=acceleration, host_speed_is=held)
    for _ in range(50):
        car.step(acceleration=-3.0, host_speed_is=accelerate(-3.0))
    assert "acceleration" not in car.faults_since(start)


def test_a_held_host_speed_is_believed_soon_after_it_moves_again(car: Car) -> None:
    start, held = car.number, car.speed
    for _ in range(300):
        car.speed += 0.01 * 1.2
        outcome = car.step(acceleration=1.2, host_speed_is=held)
    assert outcome.report.host_speed.kind == Kind.HOLD
    assert car.faults_since(start) == {"host_speed"}
    for k in range(400):
        car.speed += 0.01 * 1.2
        outcome = car.step(acceleration=1.2)
        if k == 40:
            assert outcome.report.host_speed.state == State.FAULT
        if k >= 130:
            assert outcome.report.host_speed.state == State.OK
    assert car.faults_since(start) == {"host_speed"}


@pytest.mark.parametrize("braking", [3.5, 6.0, 9.0])
@pytest.mark.parametrize("kind", ["held", "offset"])
def test_a_car_that_has_braked_to_rest_stands_whatever_its_accelerometer_says(
    kind: str, braking: float
) -> None:
    car = Car()
    car.drive(12.0)
    braked = 0.0
    while car.speed > 0.0:
        braked = min(braked + 0.12, braking)
        car.speed = max(car.speed - 0.01 * braked, 0.0)
        car.velocity = 0.0
        fault = {"acceleration": 3.0 - braked}
        if kind == "held":
            fault = (
                {"acceleration_is": -braking} if braked == braking else {"acceleration": -braked}
            )
        car.step(**fault)
    rested = car.number
    for _ in range(400):
        car.step(**({"acceleration_is": -braking} if kind == "held" else {"acceleration": 3.0}))
    assert "acceleration" in car.faults_since(1200)
    since = car.outcomes[rested + 100 :]
    assert all(outcome.report.host_speed.state == State.OK for outcome in since)
    made = [outcome.reconstruction for outcome in car.outcomes[rested + 30 :]]
    assert all(abs(m.acceleration) < 1.5 for m in made if m.acceleration_valid)


def test_a_host_speed_that_fell_to_zero_is_faulty_until_it_moves_again(car: Car) -> None:
    outcome = car.drive(9.0, host_speed_is=0.0)
    assert outcome.report.host_speed.state == State.FAULT
    assert outcome.report.host_speed.kind == Kind.ZERO
    assert isnan(outcome.report.host_speed.size), "as of any signal that is zero"
    assert car.drive(1.5).report.host_speed.state == State.OK
    assert car.faults_since(0) == {"host_speed"}


def test_without_host_speed_a_jump_of_the_acceleration_is_found() -> None:
    car = Car(host_speed=False)
    car.drive(8.0)
    start = car.number
    verdict = car.drive(2.0, acceleration=4.0).report.acceleration
    assert car.delay("acceleration", start) <= 0.2
    assert verdict.kind == Kind.OFFSET and "observers" in verdict.reason
    assert car.faults_since(start) == {"acceleration"}


def test_without_host_speed_a_cars_own_braking_is_no_fault() -> None:
    car = Car(host_speed=False)
    car.drive(8.0)
    start = car.number
    for k in range(100):
        # The host brakes hard within 0.4 s: the relative velocity grows as it does.
        braking = -5.0 * min(k / 40, 1.0)
        car.velocity -= 0.01 * braking
        car.step(acceleration=braking)
    assert not car.faults_since(start)


@pytest.mark.parametrize("late", [0, 15])
@pytest.mark.parametrize("lead_brakes", [0.0, -3.0])
def test_without_host_speed_brakes_that_come_on_at_once_are_no_fault(late, lead_brakes) -> None:
    """The radar sees it later, and the lead may brake meanwhile."""
    car = Car(host_speed=False)
    car.drive(8.0)
    start, seen = car.number, [0.0] * (late + 1)
    for k in range(150):
        braking = -9.0 * (1.0 - exp(-0.01 * k / 0.15))
        seen.append(lead_brakes * min(k / 40, 1.0) - braking)
        car.velocity += 0.01 * seen[-1 - late]
        car.step(acceleration=braking)
    assert not car.faults_since(start)


def test_without_host_speed_what_comes_on_like_brakes_and_is_not_answered_is_found() -> None:
    car = Car(host_speed=False)
    car.drive(8.0)
    start = car.number
    for k in range(100):
        car.step(acceleration=-9.0 * (1.0 - exp(-0.01 * k / 0.15)))
    assert 0.5 < car.delay("acceleration", start) < 0.9
    assert car.faults_since(start) == {"acceleration"}


@pytest.mark.parametrize(("slope", "faults"), [(0.0, set()), (1.6, set()), (2.0, {"acceleration"})])
def test_without_host_speed_a_car_that_stops_on_a_slope_feels_the_slope(
    slope: float, faults: set
) -> None:
    """Behind a lead at rest, which the radar tells 0.15 s late; roads are hardly steeper."""
    car = Car(host_speed=False)
    car.velocity, car.clearance = -8.0, 120.0
    car.drive(8.0, acceleration=slope)
    start, late = car.number, [-8.0] * 15
    for k in range(400):
        stands = k >= 200
        late.append(0.0 if stands else -8.0 + 0.04 * k)
        car.velocity = late[-15]
        car.step(acceleration=slope - (0.0 if stands else 4.0 * min(k / 20, 1.0)))
    assert car.faults_since(start) == faults


def test_the_leads_word_finds_what_nothing_else_does() -> None:
    found = {}
    for lead in (True, False):
        car = Car(host_speed=False, lead=lead)
        report = car.drive(8.0).report
        assert report.lead_acceleration.state == (State.OK if lead else State.NO_DATA)
        start = car.number
        car.drive(1.0, acceleration=2.0)
        found[lead] = car.faults_since(start)
    assert found == {True: {"acceleration"}, False: set()}


@pytest.mark.parametrize("braking", [4.0, 6.0])
def test_the_leads_word_blames_no_car_that_brakes_as_its_lead_does(braking: float) -> None:
    """Which a radar sees 0.17 s later than the accelerometer feels it."""
    car = Car(host_speed=False, lead=True)
    car.drive(8.0)
    start, seen, said = car.number, [0.0] * 17, [0.0] * 10
    for k in range(250):
        car.lead_acceleration = -braking * min(k / 30, 1.0)
        felt = -braking * min(max(k - 50, 0) / 30, 1.0)
        seen.append(car.velocity)
        said.append(car.lead_acceleration)
        car.velocity -= 0.01 * felt
        velocity = seen[-17] + 0.03 * car.random.normal()
        word = said[-11] + 0.1 * car.random.normal()
        car.step(acceleration=felt, relative_velocity_is=velocity, lead_acceleration_is=word)
    assert "acceleration" not in car.faults_since(start)


@pytest.mark.parametrize("host_speed", [True, False])
def test_a_lie_of_the_lead_is_found_out_and_blames_no_one(host_speed: bool) -> None:
    car = Car(host_speed=host_speed, lead=True)
    car.drive(8.0)
    start = car.number
    report = car.drive(3.0, lead_acceleration=4.0).report
    assert report.lead_acceleration.state == State.FAULT
    assert car.faults_since(start) == {"lead_acceleration"}
    assert report.acceleration.state == State.OK


def test_a_lead_that_lied_is_believed_again_once_it_has_told_the_truth_for_long() -> None:
    car = Car(lead=True)
    car.drive(8.0)
    assert car.drive(3.0, lead_acceleration=4.0).report.lead_acceleration.state == State.FAULT
    start = car.number
    needed = DiagnosisSettings().requalify_time
    car.drive(needed + 1.0)
    states = [outcome.report.lead_acceleration.state for outcome in car.outcomes[start:]]
    assert needed <= 0.01 * states.index(State.OK) < needed + 1.0
    assert states[-1] == State.OK


def test_what_the_lead_said_longer_ago_tells_less() -> None:
    known = []
    for delay in (0.0, 0.1, 1.0):
        car = Car(lead=True, lead_report_delay=delay)
        car.drive(8.0)
        made = car.drive(4.0, clearance=4.0, relative_velocity=-10.0).reconstruction
        known.append(made.relative_velocity_std)
    assert known[0] < known[1] < known[2]


def test_the_lead_that_falls_silent_is_said_so() -> None:
    car = Car(lead=True)
    car.drive(8.0)
    car.lead = False
    verdict = car.step().report.lead_acceleration
    assert verdict.state == State.NO_DATA and verdict.kind == Kind.DROPOUT


def test_a_wheel_is_as_rough_after_a_long_rest_as_it_was_before(standing: Car) -> None:
    start = standing.number
    standing.drive(120.0, host_speed_is=0.0)
    standing.drive_off(4.0)
    assert not standing.faults_since(start)


def test_a_wheel_that_swings_while_braking_hard_is_no_fault(car: Car) -> None:
    """The derivative of its speed swings to and fro; where it turns back it has no jerk."""
    start, braking = car.number, 0.0
    for k in range(150):
        braking = max(braking - 0.2, -8.0)
        car.speed += 0.01 * braking
        swing = 1.2 * np.sin(np.pi * (k - 30) / 8) if 30 <= k < 46 else 0.0
        car.step(acceleration=braking, host_speed=swing)
    assert not car.faults_since(start)


def test_a_speed_that_was_silent_is_judged_again_within_half_a_second(car: Car) -> None:
    car.host_speed = False
    car.drive(2.0)
    car.host_speed = True
    start = car.number
    car.drive(1.0)
    states = [outcome.report.host_speed.state for outcome in car.outcomes[start:]]
    assert 0.01 * states.index(State.OK) <= 0.45
    assert not car.faults_since(start)


@pytest.mark.parametrize("held", ["clearance", "acceleration"])
def test_a_faulty_host_speed_does_not_say_that_the_car_stands(car: Car, held: str) -> None:
    """What repeats itself in a car that stands is no fault."""
    assert car.drive(2.0, host_speed_is=0.0).report.host_speed.state == State.FAULT
    car.lead_acceleration = -0.5
    car.drive(2.0, host_speed_is=0.0)
    start, value = car.number, {"clearance": car.seen[0], "acceleration": 0.0}[held]
    car.lead_acceleration = 0.0
    car.drive(3.0, host_speed_is=0.0, **{f"{held}_is": value})
    assert held in car.faults_since(start)


def test_a_host_speed_that_ends_while_nothing_arrives_was_there_before(car: Car) -> None:
    car.host_speed = False
    verdict = car.drive(1.0).report.host_speed
    assert (verdict.state, verdict.kind) == (State.NO_DATA, Kind.DROPOUT)
    never = Car(host_speed=False)
    assert never.drive(1.0).report.host_speed.kind == Kind.UNKNOWN
    never.go_unheard(8.0)
    assert never.drive(1.0).report.host_speed.kind == Kind.UNKNOWN
    car.diagnosis.reset()
    assert car.drive(1.0).report.host_speed.kind == Kind.UNKNOWN


def test_what_the_lead_says_while_no_radar_hears_it_is_no_lie() -> None:
    car = Car(lead=True)
    car.drive(12.0)
    start, car.radar_silent = car.number, True
    car.drive(1.0)
    for k in range(50):
        car.lead_acceleration = -0.06 * k
        car.step()
    car.drive(2.0)
    assert "lead_acceleration" not in car.faults_since(start)


@pytest.mark.parametrize("clearance", [0.0, 4.0])
def test_what_the_lead_says_again_and_again_makes_nothing_worse(clearance: float) -> None:
    """It goes on to say that it brakes, though it does not any more, while the radar is faulty."""
    car = Car(lead=True)
    car.drive(12.0)
    car.lead_acceleration = -1.0
    car.drive(1.0)
    faults = {"relative_velocity": -10.0, "clearance": clearance, "lead_acceleration_is": -1.0}
    car.drive(0.4, **faults)
    car.lead_acceleration = 0.0
    valid = 0
    for _ in range(400):
        made = car.step(**faults).reconstruction
        if made.relative_velocity_valid:
            valid += 1
            assert abs(made.relative_velocity - car.velocity) < 2.5 * made.relative_velocity_std
    assert valid >= 200
