"""The robust profile's accelerometer without ROS: jumps, slopes, bumps and brakes."""

from math import hypot, inf, isnan, pi, sin
from random import Random

import numpy as np
import pytest
from robust_car import SCAN, Car

from lfd_diagnosis.verdict import Kind, State


@pytest.mark.parametrize("highest", [7.0, 9.0, 9.9])
def test_a_shaken_sensor_that_swings_back_by_more_than_it_swung_out_is_no_outlier(
    car: Car, highest: float
) -> None:
    """What it swung out to is not what it says until it has been back for a moment."""
    start = car.number
    for _ in range(4):
        for felt in (2.5, highest, 0.0, 0.0, 0.0):
            car.step(acceleration=felt)
        assert car.outcomes[-1].report.acceleration.state == State.OK
        car.drive(1.0)
    assert not car.faults_since(start)
    assert "outliers" not in car.outcomes[-1].report.acceleration.reason


@pytest.mark.parametrize("seconds", [0.1, 0.5, 0.7])
@pytest.mark.parametrize("off", [60.0, 12.0, -20.0])
def test_a_signal_that_begins_with_what_no_car_does_is_right_from_then_on(
    off: float, seconds: float
) -> None:
    """One that was made of a speed and smoothed: at its edges there was no speed."""
    car = Car()
    car.drive(seconds, acceleration=off)
    begun = car.number
    assert car.drive(20.0).report.acceleration.state == State.OK
    late = [o for o in car.outcomes[begun + 120 :] if o.report.acceleration.state == State.FAULT]
    assert not late
    start = car.number
    car.drive(1.0, acceleration=2.0)
    assert car.faults_since(start) == {"acceleration"}


@pytest.mark.parametrize("healthy", [0.7, 1.0, 2.0])
def test_a_fault_soon_after_the_beginning_is_no_beginning(healthy: float) -> None:
    """What is farther from level ground than what came before is a fault."""
    car = Car()
    car.drive(healthy)
    assert car.drive(1.0, acceleration=6.0).report.acceleration.state == State.FAULT


SWINGS = [
    # By host speed, a wheel being shaken: a swing is over before it counts.
    (True, 0.5, 0.2, -3.5, 0.2, set()),
    (True, 0.5, 0.2, -3.5, 0.5, {"acceleration"}),
    (True, 0.1, 0.2, -3.5, 0.2, {"acceleration"}),
    # So it is where no wheel tells of it, but for what is more than a bump may be.
    (True, 0.5, 0.0, -2.6, 0.18, set()),
    (True, 0.5, 0.0, -2.6, 0.5, {"acceleration"}),
    (True, 0.1, 0.0, -2.6, 0.18, {"acceleration"}),
    (True, 0.5, 0.0, -4.5, 0.2, {"acceleration"}),
    # Without it: what swings is judged half a second later.
    (False, 0.5, 0.0, -3.5, 0.25, set()),
    (False, 0.5, 0.0, -3.5, 1.2, {"acceleration"}),
    (False, 0.1, 0.0, -3.5, 0.25, {"acceleration"}),
]


@pytest.mark.parametrize("seed", [3, 4, 5, 6])
@pytest.mark.parametrize(("host_speed", "noise", "shaken", "off", "seconds", "faults"), SWINGS)
def test_a_bump_swings_a_loosely_mounted_sensor_for_a_moment(
    host_speed: bool,
    noise: float,
    shaken: float,
    off: float,
    seconds: float,
    faults: set,
    seed: int,
) -> None:
    """As a phone on a windscreen, which the noise of all of its samples tells from one that is
    bolted down: there it is a fault that ends soon."""
    car, random = Car(host_speed), Random(seed)

    def drive(seconds: float, off: float) -> None:
        for k in range(round(seconds * 100)):
            shake = shaken * (-1) ** k if off and k < 4 else 0.0
            car.step(acceleration=off + random.gauss(0.0, noise), host_speed=shake)

    drive(12.0, 0.0)
    start = car.number
    drive(seconds, off)
    drive(2.0, 0.0)
    assert car.faults_since(start) == faults


@pytest.mark.parametrize("seed", [3, 4, 5, 6])
def test_a_bump_that_a_phone_feels_is_no_motion_that_the_lead_should_answer(seed: int) -> None:
    """Without host speed a sample of 8 m/s^2 that lasts would move the relative velocity."""
    car, random = Car(host_speed=False), Random(seed)

    def drive(seconds: float, off: float) -> None:
        for k in range(round(seconds * 100)):
            car.radar_silent = k % 10 >= SCAN
            car.step(acceleration=off + random.gauss(0.0, 0.5))

    drive(12.0, 0.0)
    start = car.number
    for _ in range(3):
        drive(0.1, 7.9)
        drive(1.5, 0.0)
    assert not car.faults_since(start)
    indices = [outcome.report.relative_velocity.index for outcome in car.outcomes[start:]]
    assert max(indices) < 0.3


def test_a_slope_is_no_fault(car: Car) -> None:
    start = car.number
    for k in range(800):
        car.step(acceleration=0.6 * min(k / 500, 1.0))
    assert not car.faults_since(start)


def bend(car: Car, slope: float, seconds: float) -> None:
    """The road goes over to another slope, as the accelerometer feels it."""
    steps = round(seconds * 100)
    for k in range(steps):
        car.step(acceleration=slope * (k + 1) / steps)
    car.drive(2.0, acceleration=slope)


@pytest.mark.parametrize(("slope", "seconds"), [(1.4, 0.8), (-1.6, 1.0), (2.3, 1.5)])
def test_a_road_that_bends_is_no_fault(slope: float, seconds: float) -> None:
    """As a town's streets do at a crossing."""
    car = Car()
    car.speed = 14.5
    car.drive(8.0)
    start = car.number
    bend(car, slope, seconds)
    assert not car.faults_since(start)
    assert car.outcomes[-1].reconstruction.acceleration == pytest.approx(slope, abs=0.3)
    jump = car.number
    car.drive(0.4, acceleration=slope + 1.5)
    assert car.faults_since(start) == {"acceleration"}
    assert car.delay("acceleration", jump) <= 0.3


@pytest.mark.parametrize("rates", [(1.2, 0.6, 2.4), (1.6, 0.6, 1.8)])
def test_a_road_that_bends_in_turns_is_no_fault(rates: tuple[float, float, float]) -> None:
    """Down, and up again: faster, slower, and faster again (m/s^3)."""
    car, slope = Car(), 0.0
    car.speed = 13.5
    for k in range(1500):
        slope = -1.5 * min(k / 900, 1.0)
        car.step(acceleration=slope)
    start = car.number
    for rate, seconds in zip((0.0, *rates, 0.0), (3.0, 0.6, 0.3, 0.9, 2.0), strict=True):
        for _ in range(round(seconds * 100)):
            slope += 0.01 * rate
            car.step(acceleration=slope)
    assert not car.faults_since(start)


@pytest.mark.parametrize(
    ("slope", "seconds", "speed", "settings"),
    [
        (1.4, 0.01, 12.0, {}),
        (1.4, 0.8, 15.5, {}),
        (3.8, 1.5, 12.0, {}),
        (1.4, 0.8, 12.0, {"steepest_road": 0.0}),
        (0.5 * 5.0, 5.0, 12.0, {}),
    ],
    ids=["at once", "on a fast road", "too steep", "switched off", "a drift"],
)
def test_what_no_road_does_is_a_fault(
    slope: float, seconds: float, speed: float, settings: dict[str, float]
) -> None:
    car = Car(**settings)
    car.speed = speed
    car.drive(8.0)
    start = car.number
    bend(car, slope, seconds)
    assert car.faults_since(start) == {"acceleration"}


@pytest.mark.parametrize(("braking", "faults"), [(1.0, set()), (4.0, {"host_speed"})])
def test_a_manoeuvre_looks_like_a_bend_and_tells_of_none(braking: float, faults: set) -> None:
    """The road bends by 1.8 m/s^2 as the car begins to brake, by less and more than 2.5 m/s^2: so
    do wheels that slip, which slow down by more than is felt."""
    car = Car()
    car.speed = 14.0
    car.drive(8.0)
    start = car.number
    for k in range(200):
        braked, slope = -braking * min(k / 80, 1.0), 1.8 * min(k / 80, 1.0)
        car.speed += 0.01 * braked
        car.step(acceleration=braked + slope)
    assert car.faults_since(start) == faults


def brake_as_felt_late(car: Car, late: int, hardest: float, rise: int, slope: float = 0.0) -> None:
    """Brake harder and harder for `rise` steps, and so for a while; felt so many steps later."""
    felt = [0.0] * late
    for k in range(rise + 120):
        felt.append(hardest * min(k / rise, 1.0))
        if car.speed + 0.01 * felt[-1] < 1.0:
            return
        car.speed += 0.01 * felt[-1]
        car.step(acceleration=felt.pop(0) + slope)


@pytest.mark.parametrize(("late", "rise"), [(20, 80), (22, 80), (22, 110)])
def test_what_a_late_sensor_was_off_by_in_braking_is_no_slope_afterwards(
    late: int, rise: int
) -> None:
    """A lag that was not learnt differs from what comes after it as a jump would."""
    car = Car(learn_noise=False)
    car.speed = 30.0
    car.drive(8.0)
    start = car.number
    brake_as_felt_late(car, late, -9.0, rise)
    assert not car.faults_since(start)
    jump = car.number
    for _ in range(50):
        car.speed -= 0.09
        car.step(acceleration=-9.0 + 1.5)
    assert car.faults_since(start) == {"acceleration"}
    assert car.delay("acceleration", jump) <= 0.3


def test_a_bend_that_a_manoeuvre_follows_does_not_end_in_it() -> None:
    """What a late sensor is off by while the car brakes harder and harder stays the same, too."""
    car = Car()
    car.speed = 14.9
    car.drive(8.0)
    start = car.number
    for k in range(80):
        car.step(acceleration=-1.4 * (k + 1) / 80)
    car.drive(0.1, acceleration=-1.4)
    brake_as_felt_late(car, 20, -8.0, 100, -1.4)
    assert not car.faults_since(start)


@pytest.mark.parametrize(
    ("change", "faults", "settings"),
    [
        (-1.8, set(), {}),
        (-2.4, {"acceleration"}, {}),
        (1.8, {"acceleration"}, {}),
        (-1.8, {"acceleration"}, {"steepest_road": 0.0}),
    ],
    ids=["down", "farther", "up", "switched off"],
)
def test_a_slope_ends_rather_than_an_accelerometer_drifts(
    change: float, faults: set, settings: dict[str, float]
) -> None:
    """As slowly as it drifts, the road turns down at the top of a hill."""
    car = Car(**settings)
    for k in range(1800):
        car.step(acceleration=0.9 * min(k / 1200, 1.0))
    start = car.number
    for k in range(600):
        car.step(acceleration=0.9 + change * min(k / 360, 1.0))
    assert car.faults_since(start) == faults


@pytest.mark.parametrize(("step", "faults"), [(0.1, set()), (0.25, {"acceleration"})])
def test_a_coarse_host_speed_tells_of_no_bend(step: float, faults: set) -> None:
    car = Car()

    def drive(slope: float) -> None:
        car.speed += 0.01 * 0.8
        car.step(acceleration=0.8 + slope, host_speed_is=step * round(car.speed / step))

    car.speed = 3.0
    for _ in range(800):
        drive(0.0)
    start = car.number
    for k in range(300):
        drive(1.6 * min((k + 1) / 80, 1.0))
    assert car.faults_since(start) == faults


def test_an_acceleration_that_drifts_in_a_standing_car_is_told_by_a_lead_at_rest(standing: Car):
    """A car that drove off with a held speed would near its lead, or have followed it."""
    start = standing.number
    for k in range(400):
        standing.step(acceleration=0.005 * k, host_speed_is=0.0)
    assert standing.faults_since(start) == {"acceleration"}
    assert standing.outcomes[-1].report.acceleration.kind == Kind.RAMP


@pytest.mark.parametrize("left", [1.2, 1.3])
def test_what_a_drift_has_left_is_no_jump(car: Car, left: float) -> None:
    start = car.number
    for k in range(300):
        car.step(acceleration=2.0 * k / 300)
    assert car.outcomes[-1].report.acceleration.kind == Kind.RAMP
    for k in range(100):
        car.step(acceleration=2.0 + (left - 2.0) * k / 100)
    report = car.drive(5.0, acceleration=left).report
    assert report.acceleration.state == State.OK
    states = [outcome.report.acceleration.state for outcome in car.outcomes[start:]]
    ends = sum(a == State.FAULT != b for a, b in zip(states, states[1:], strict=False))
    assert ends == 1, "found once, and cleared once"


@pytest.mark.parametrize("slope", [1.3, -1.3])
def test_while_the_speed_is_missing_the_slope_may_change(car: Car, slope: float) -> None:
    start, car.host_speed = car.number, False
    for k in range(1000):
        car.step(acceleration=slope * k / 1000)
    car.host_speed = True
    report = car.drive(5.0, acceleration=slope).report
    assert not car.faults_since(start)
    assert report.acceleration.state == State.OK
    car.drive(0.3, acceleration=slope + 4.0)
    assert car.faults_since(start) == {"acceleration"}


def test_a_car_that_brakes_to_rest_jerks_back(car: Car) -> None:
    """Its speed is no evidence for a moment then, and the observers are slower than the jerk."""
    start = car.number
    car.brake(0.2, 6.0, to=0.1)
    for k in range(200):
        swing = -3.0 * np.exp(-0.05 * k) * np.cos(0.14 * k)
        car.step(acceleration=swing, host_speed_is=0.0)
    assert not car.faults_since(start)
    assert {o.report.acceleration.state for o in car.outcomes[start:]} <= {State.OK, State.SUSPECT}


@pytest.mark.parametrize(("jump", "faults"), [(4.5, set()), (6.5, {"acceleration"})])
def test_as_a_car_comes_to_rest_what_jumps_by_more_than_it_braked_is_a_fault(
    car: Car, jump: float, faults: set
) -> None:
    """Its limit without the speed, 2.5 m/s^2, is wider by the 3 m/s^2 that it stops from."""
    start = car.number
    car.brake(0.2, 3.0, to=0.1)
    for k in range(40):
        car.step(acceleration=jump if k >= 15 else 0.0, host_speed_is=0.0)
    assert car.faults_since(start) == faults


def test_what_shakes_a_standing_car_is_no_fault(standing: Car) -> None:
    random, start = Random(2), standing.number
    for _ in range(300):
        standing.step(acceleration=random.gauss(0.0, 0.9), host_speed_is=0.0)
    standing.drive_off(4.0)
    assert not standing.faults_since(start)


@pytest.mark.parametrize("jerk", [25.0, 40.0])
def test_hard_braking_is_no_fault_though_a_noisy_speed_is_late(car: Car, jerk: float) -> None:
    """The noise of its derivative must not make it seem early."""
    random, start, wheel = Random(0), car.number, 0.0
    late = [0.0] * 15
    course = [sin(2.0 * pi * k / 300) for k in range(3000)]
    for acceleration in course + [max(-0.01 * jerk * k, -8.0) for k in range(100)]:
        late.append(acceleration)
        car.speed += 0.01 * late.pop(0)
        wheel = 0.8 * wheel + random.gauss(0.0, 0.018)
        car.step(acceleration=acceleration, host_speed=wheel)
    assert not car.faults_since(start)


@pytest.mark.parametrize("seed", [2, 4, 5])
def test_an_accelerometers_slow_noise_is_no_lag_that_shows_in_hard_braking(seed: int) -> None:
    """Noise of 0.25 m/s^2 that lasts for half a second, on a calm drive."""
    car, random, slow = Car(), Random(seed), 0.0
    calm = [0.0] * 400 + [0.15 * sin(2.0 * pi * k / 600) for k in range(4000)]
    for acceleration in calm + [max(-0.4 * k, -8.0) for k in range(100)]:
        slow = 0.98 * slow + random.gauss(0.0, 0.05)
        car.speed += 0.01 * acceleration
        car.step(acceleration=acceleration + slow)
    assert not car.faults_since(0)


@pytest.mark.parametrize(("braking", "swing"), [(-5.0, 0.6), (-5.0, -0.6), (-7.0, 0.6)])
@pytest.mark.parametrize("steps", [10, 13, 16])
def test_a_jolt_while_braking_with_a_late_speed_is_no_fault(
    car: Car, braking: float, swing: float, steps: int
) -> None:
    """A wheel that is shaken leaps as no car does: its speed tells less for a moment."""
    start, late = car.number, [0.0] * 5
    jolt = [sin(2.0 * pi * k / steps) for k in range(steps)]
    for k in range(1000):
        acceleration = sin(2.0 * pi * k / 300) if k < 800 else max(-0.1 * (k - 800), braking)
        late.append(acceleration)
        car.speed += 0.01 * late.pop(0)
        shaken = jolt[k - 830] if 0 <= k - 830 < steps else 0.0
        car.step(acceleration=acceleration + 2.0 * shaken, host_speed=swing * shaken)
    assert not car.faults_since(start)


@pytest.mark.parametrize("late", [0, 6])
def test_an_emergency_stop_to_rest_is_no_fault(car: Car, late: int) -> None:
    """The accelerometer is at rest at once; the speed says so some steps later."""
    start, braking = car.number, 0.0
    speeds = [car.speed] * (late + 1)
    while speeds[0] > 0.0:
        braking = max(braking - 0.2, -9.0) if car.speed > 0.0 else 0.0
        car.speed = max(car.speed + 0.01 * braking, 0.0)
        speeds = [*speeds[1:], car.speed]
        car.step(acceleration=braking, host_speed_is=speeds[0])
    report = car.drive(1.5, host_speed_is=0.0).report
    assert not car.faults_since(start)
    assert report.acceleration.state == State.OK


@pytest.mark.parametrize("value", [0.0, 1e6, -1e300])
def test_an_accelerometer_that_wakes_up_late_is_healthy_from_then_on(value: float) -> None:
    """What it said before is no slope, and says nothing of how rough it is."""
    car = Car()
    car.drive(5.0, acceleration_is=value)
    car.drive(20.0)
    start = car.number
    assert car.drive(5.0).report.acceleration.state == State.OK
    assert not car.faults_since(start)
    car.drive(1.0, acceleration=2.0)
    assert car.faults_since(start) == {"acceleration"}


@pytest.mark.parametrize("offset", [4.0, -4.0])
def test_after_a_crest_an_acceleration_is_rebuilt_with_the_slope_of_now(car: Car, offset) -> None:
    """Its slow mean still lies half way: what jumped is held against a moment before, and its size
    is known 0.2 s later."""
    slope = 0.8
    for k in range(300):
        car.step(acceleration=slope * k / 300)
    car.drive(1.0, acceleration=slope)
    start = car.number
    car.drive(2.0, acceleration=slope + offset)
    assert car.faults_since(start) == {"acceleration"}
    assert car.outcomes[-1].report.acceleration.kind == Kind.OFFSET
    rebuilt = [o.reconstruction for o in car.outcomes[start + 30 :]]
    assert [r.acceleration for r in rebuilt] == pytest.approx([slope] * len(rebuilt), abs=0.3)
    # What the sensor would have said has its noise of 0.08 m/s^2.
    covered = [
        abs(r.acceleration - slope) <= 1.96 * hypot(r.acceleration_std, 0.08) for r in rebuilt
    ]
    assert np.mean(covered) >= 0.9
    for outcome in car.outcomes[start + 30 :]:
        said = outcome.report.acceleration
        assert abs(said.size - offset) < 1.96 * said.size_std < 0.2
        assert outcome.reconstruction.acceleration_std == said.size_std


@pytest.mark.parametrize("offset", [4.0, -2.0])
def test_a_slope_that_changes_under_a_jump_is_followed(car: Car, offset) -> None:
    car.drive(3.0, acceleration=offset)
    for k in range(1000):
        slope = 0.0012 * k
        now = car.step(acceleration=slope + offset).reconstruction
        assert now.acceleration == pytest.approx(slope, abs=0.5)
    end = car.number
    for _ in range(150):
        outcome = car.step(acceleration=slope)
        if outcome.report.acceleration.state == State.FAULT:
            assert outcome.reconstruction.acceleration == pytest.approx(slope, abs=0.8)
    assert outcome.report.acceleration.state == State.OK
    # What the road has become is known: the same slope is no new fault.
    car.drive(4.0, acceleration=slope)
    assert not car.faults_since(end)


@pytest.mark.parametrize("offset", [4.0, -2.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_what_the_difference_was_as_a_jump_began_is_not_the_slope_after_it(
    offset: float, way: float
) -> None:
    """It passes by under the jump, and comes again before the next one."""
    car = Car()
    car.speed = 30.0
    car.drive(12.0)
    comes = [0.005 * k for k in range(180)]
    for _ in range(5):
        begin = car.number
        for beside in [*comes, *[comes[-1]] * 60]:
            outcome = car.step(acceleration=way * beside)
        assert outcome.report.acceleration.state == State.OK
        assert not car.faults_since(begin)
        for beside in [*comes[::-1], *[0.0] * 500]:
            car.step(acceleration=offset + way * beside)
        assert car.faults_since(begin) == {"acceleration"}
        assert car.drive(1.0).report.acceleration.state == State.OK


@pytest.mark.parametrize("rate", [0.15, -0.2])
def test_a_drift_that_ends_at_once_leaves_no_fault(car: Car, rate: float) -> None:
    """Part of it was taken for the slope before it was found."""
    for k in range(2500):
        car.step(acceleration=rate * 0.01 * k)
    assert car.outcomes[-1].report.acceleration.state == State.FAULT
    assert car.drive(1.0).report.acceleration.state == State.OK
    over = car.number
    car.drive(6.0)
    assert not car.faults_since(over)


def hide(car: Car, offset: float, slope: float) -> None:
    """A fault that a road which bends makes seem over."""
    car.drive(3.0, acceleration=offset)
    for k in range(60):
        car.step(acceleration=offset + slope * k / 60)
    assert car.drive(0.9, acceleration=offset + slope).report.acceleration.state == State.OK


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("later", [0.2, 1.5])
def test_the_end_of_a_fault_that_a_bent_road_hid_is_no_other_fault(
    car: Car, way: float, later: float
) -> None:
    hide(car, -2.0 * way, 1.8 * way)
    car.drive(later, acceleration=-0.2 * way)
    end = car.number
    assert car.drive(6.0, acceleration=1.8 * way).report.acceleration.state == State.OK
    assert not car.faults_since(end)


@pytest.mark.parametrize("then", [2.0, -4.0, 4.0])
def test_another_jump_than_back_is_a_fault_soon_after_one(car: Car, then: float) -> None:
    """To the same side, or by far more than back."""
    car.drive(3.0, acceleration=2.0)
    car.drive(2.0)
    again = car.number
    assert car.drive(1.0, acceleration=then).report.acceleration.state == State.FAULT
    assert car.faults_since(again) == {"acceleration"}


@pytest.mark.parametrize(("steepest", "offset"), [(2.5, 4.0), (2.5, -4.0), (0.0, 2.0)])
def test_what_no_road_hides_is_not_the_end_of_a_fault(steepest: float, offset: float) -> None:
    car = Car(steepest_road=steepest)
    car.drive(12.0)
    car.drive(3.0, acceleration=offset)
    assert car.drive(1.0).report.acceleration.state == State.OK
    assert car.drive(1.0, acceleration=-offset).report.acceleration.state == State.FAULT


@pytest.mark.parametrize("held", [0.0, 0.2])
@pytest.mark.parametrize("offset", [2.0, -2.0])
def test_a_jump_soon_after_a_hold_is_a_fault(car: Car, held: float, offset: float) -> None:
    """It is the end of nothing: what is held is off by no figure."""
    for k in range(400):
        acceleration = min(0.01 * k, 2.0)
        car.speed += 0.01 * acceleration
        car.step(acceleration_is=held)
    assert car.outcomes[-1].report.acceleration.state == State.FAULT
    assert car.drive(1.5).report.acceleration.state == State.OK
    assert car.drive(1.0, acceleration=offset).report.acceleration.state == State.FAULT


def test_a_jump_back_is_a_fault_some_time_after_the_end_of_one(car: Car) -> None:
    car.drive(3.0, acceleration=2.0)
    car.drive(3.8)
    assert car.drive(1.0, acceleration=-2.0).report.acceleration.state == State.FAULT


@pytest.mark.parametrize("slope", [1.35, -1.35])
def test_a_slope_that_nobody_saw_change_under_a_jump_is_no_fault(car: Car, slope: float) -> None:
    car.drive(2.0, acceleration=4.0)
    car.host_speed = False
    for k in range(300):
        car.step(acceleration=4.0 + slope * min(k / 250, 1.0))
    while car.outcomes[-1].report.acceleration.state == State.FAULT:
        car.step(acceleration=slope)
    over, car.host_speed = car.number, True
    car.drive(3.0, acceleration=slope)
    assert not car.faults_since(over)


@pytest.mark.parametrize("then", [8.0, -3.0])
def test_a_jump_that_becomes_another_is_not_taken_for_the_road(car: Car, then) -> None:
    car.drive(4.0, acceleration=4.0)
    changed = car.number
    car.drive(3.0, acceleration=then)
    rebuilt = [o.reconstruction.acceleration for o in car.outcomes[changed:]]
    assert rebuilt == pytest.approx([0.0] * len(rebuilt), abs=0.6)


def test_a_jump_that_falls_silent_is_rebuilt_from_the_speed(car: Car) -> None:
    car.drive(4.0, acceleration=4.0)
    car.accelerometer_silent = True
    for k in range(300):
        acceleration = min(0.01 * k, 1.5)
        car.speed += 0.01 * acceleration
        now = car.step(acceleration=4.0).reconstruction
        assert now.acceleration == pytest.approx(acceleration, abs=0.5)


@pytest.mark.parametrize("silence", [0.8, 3.0])
@pytest.mark.parametrize("host_speed", [True, False])
@pytest.mark.parametrize("lets_go", [True, False])
def test_what_an_accelerometer_said_before_a_silence_is_no_evidence_after_it(
    silence: float, host_speed: bool, lets_go: bool
) -> None:
    """The car brakes meanwhile, on and on or until the silence is nearly over."""
    car = Car(host_speed)
    car.speed, acceleration, braked = 30.0, 0.0, silence - 0.1 if lets_go else inf
    car.drive(12.0)
    for k in range(round(100 * silence) + 150):
        car.accelerometer_silent = k < 100 * silence
        brakes = k < 100 * braked
        acceleration = max(acceleration - 0.08, -6.0) if brakes else min(acceleration + 0.08, 0.0)
        car.speed += 0.01 * acceleration
        car.step(acceleration=acceleration)
    assert not car.faults_since(0)


@pytest.mark.parametrize(("size", "most"), [(1.5, 0.4), (-2.0, 0.3), (4.0, 0.3)])
@pytest.mark.parametrize("silence", [0.4, 1.5, 6.0])
def test_an_offset_that_begins_in_a_silence_is_told_after_it(
    car: Car, silence: float, size: float, most: float
) -> None:
    """Though the road's slope may be another one by then."""
    car.accelerometer_silent = True
    car.drive(silence)
    car.accelerometer_silent = False
    end = car.number
    car.drive(2.0, acceleration=size)
    assert car.faults_since(end) == {"acceleration"}
    assert car.delay("acceleration", end) <= most


def test_a_held_acceleration_is_rebuilt_from_the_speed(car: Car) -> None:
    """At first it looks like a jump that stays."""
    for k in range(500):
        acceleration = min(0.004 * k, 1.0)
        car.speed += 0.01 * acceleration
        now = car.step(acceleration_is=4.0).reconstruction
        if k > 50:
            assert now.acceleration == pytest.approx(acceleration, abs=0.5)


def test_an_acceleration_that_jumps_and_stays_there_is_held_and_no_offset(car: Car) -> None:
    start = car.number
    for k in range(500):
        acceleration = 0.8 * sin(2.0 * pi * k / 400)
        car.speed += 0.01 * acceleration
        held = car.step(acceleration_is=4.0).report.acceleration
    assert held.kind == Kind.HOLD and "same value" in held.reason
    report = car.drive(0.7).report
    assert report.acceleration.state == State.OK
    assert car.faults_since(start) == {"acceleration"}


@pytest.mark.parametrize("offset", [1.5, -2.0, 4.0, -8.0])
def test_a_jump_has_its_size_from_the_first_step_that_tells_of_it(car: Car, offset: float) -> None:
    """Who reads the event that tells of a fault reads no other one: what was filtered until then is
    a half of it."""
    start = car.number
    car.drive(1.0, acceleration=offset)
    said = [o.report.acceleration for o in car.outcomes[start:]]
    faulty = [verdict for verdict in said if verdict.state == State.FAULT]
    assert len(faulty) > 50
    for verdict in faulty:
        assert verdict.size == pytest.approx(offset, rel=0.2)
        assert abs(verdict.size - offset) < 3.0 * verdict.size_std < 0.6


def test_a_jump_has_the_size_it_began_with(car: Car) -> None:
    """Later its reference has been coasted: a lead that brakes is no change of the fault."""
    car.drive(1.0, clearance=4.0, relative_velocity=-10.0)
    car.lead_acceleration = -0.5
    verdict = car.drive(3.0, clearance=4.0, relative_velocity=-10.0).report.relative_velocity
    assert verdict.size == pytest.approx(-10.0, abs=0.5)
    verdict = car.drive(1.0, clearance=4.0, relative_velocity=-18.0).report.relative_velocity
    assert verdict.size == pytest.approx(-18.0, abs=2.5)


def test_a_jump_that_fades_is_over(car: Car) -> None:
    car.drive(4.0, acceleration=4.0)
    for k in range(800):
        car.step(acceleration=4.0 - 0.005 * k)
    assert car.drive(3.0).report.acceleration.state == State.OK


@pytest.mark.parametrize("seed", [2, 5, 9, 12, 13, 18, 19])
def test_a_speed_that_jumps_for_a_moment_does_not_end_a_jump_of_the_accelerometer(seed) -> None:
    """As one does that is noisy, and comes in steps of 0.15 m/s."""
    car, noise, said = Car(), np.random.default_rng(seed), 15.0

    def drive(seconds: float, offset: float) -> list[State]:
        nonlocal said
        begin = len(car.outcomes)
        for _ in range(round(100 * seconds)):
            acceleration = 1.5 * sin(0.01 * car.number)
            car.speed += 0.01 * acceleration
            if car.number % SCAN == 0:
                said = 0.15 * round((car.speed + 0.18 * noise.normal()) / 0.15)
            car.step(acceleration=acceleration + offset, host_speed_is=said)
        return [outcome.report.acceleration.state for outcome in car.outcomes[begin:]]

    drive(25.0, 0.0)
    states = drive(8.0, 2.0)
    assert set(states[states.index(State.FAULT) :]) == {State.FAULT}
    assert State.FAULT not in drive(3.0, 0.0)[150:]


def test_where_no_speed_tells_it_a_healthy_acceleration_is_what_it_says(car: Car) -> None:
    """On a slope, too, and whatever was suspected of it before."""
    for k in range(1000):
        outcome = car.step(acceleration=min(0.002 * k, 1.0))
    car.host_speed = False
    outcome = car.drive(1.0, acceleration=1.0)
    assert outcome.reconstruction.acceleration == pytest.approx(1.0, abs=0.2)
    start = car.number
    states = set()
    for k in range(120):
        car.lead_acceleration = min(0.3 * k, 5.0)
        outcome = car.step(acceleration=1.0 - car.lead_acceleration)
        states.add(outcome.report.acceleration.state)
    assert states <= {State.OK, State.SUSPECT} and not car.faults_since(start)
    car.lead_acceleration = 0.0
    car.drive(2.0, acceleration=1.0)
    for k in range(500):
        outcome = car.step(acceleration=1.0 + min(0.004 * k, 1.0))
    assert outcome.reconstruction.acceleration == pytest.approx(2.0, abs=0.2)
    assert not car.faults_since(start)


@pytest.mark.parametrize(("rate", "seconds"), [(1.2, 4.0), (1.2, 6.0), (2.0, 6.0)])
def test_a_drift_that_is_over_leaves_no_fault_for_good(
    car: Car, rate: float, seconds: float
) -> None:
    """Part of it may have been taken for a road that bends."""
    for k in range(round(100 * seconds)):
        car.step(acceleration=0.01 * k * rate)
    assert car.drive(8.0).report.acceleration.state == State.OK


def test_what_was_there_from_the_first_sample_on_leaves_no_fault_for_good() -> None:
    car = Car()
    car.drive(12.0, acceleration=1.5)
    assert car.drive(8.0).report.acceleration.state == State.OK


def test_a_jump_back_to_the_slope_is_the_end_of_what_was_not_found(car: Car) -> None:
    start = car.number
    for k in range(400):
        car.step(acceleration=min(0.9 + 0.15 * 0.01 * k, 1.35))
    assert not car.faults_since(start)
    car.drive(3.0)
    assert not car.faults_since(start)
    car.drive(1.0, acceleration=-1.5)
    assert car.faults_since(start) == {"acceleration"}


def test_an_accelerometer_that_is_held_stays_faulty_until_it_is_not(car: Car) -> None:
    car.drive(20.0)
    start = car.number
    verdict = car.drive(6.0, acceleration_is=0.05).report.acceleration
    assert (verdict.state, verdict.kind) == (State.FAULT, Kind.HOLD) and isnan(verdict.size)
    states = [outcome.report.acceleration.state for outcome in car.outcomes[start:]]
    assert states.count(State.FAULT) == len(states) - states.index(State.FAULT)
    assert car.drive(2.0).report.acceleration.state == State.OK


def test_without_host_speed_a_held_accelerometer_needs_no_lead_to_be_over() -> None:
    car = Car(host_speed=False)
    car.drive(14.0)
    car.lead_acceleration = -0.3
    assert car.drive(4.0, acceleration_is=0.05).report.acceleration.state == State.FAULT
    car.has_target = False
    car.drive(3.0)
    assert car.outcomes[-1].report.acceleration.state != State.FAULT


def test_what_nobody_tells_of_the_acceleration_is_not_offered_for_long() -> None:
    car = Car(host_speed=False)
    car.drive(5.0)
    car.accelerometer_silent = True
    assert car.drive(0.4).reconstruction.acceleration_valid
    assert not car.drive(0.2).reconstruction.acceleration_valid
    car.accelerometer_silent = False
    assert car.drive(0.5).reconstruction.acceleration_valid


@pytest.mark.parametrize(
    ("settings", "faults", "why"),
    [
        ({}, {"clearance": 4.0}, "the radar is faulty"),
        ({"use_observers": False}, {}, "use_observers"),
        ({"use_host_speed": False}, {"clearance": 4.0}, "use_host_speed"),
    ],
)
def test_why_there_is_nothing_to_hold_it_against_is_said(settings, faults, why: str) -> None:
    car = Car(host_speed=False, **settings)
    car.drive(5.0)
    assert why in car.drive(1.0, **faults).report.acceleration.reason


def test_wheels_that_slip_convict_no_accelerometer(car: Car) -> None:
    """Under brakes that are released and applied again, wheels turn more slowly than the car."""
    start, random = car.number, Random(4)
    for k in range(250):
        braking = -min(0.1 * k, 8.0)
        car.speed += 0.01 * braking
        slipping = random.uniform(0.3, 1.0) * (k > 80 and k // 12 % 2)
        car.step(acceleration=braking, host_speed=-slipping)
        if car.speed < 3.0:
            break
    assert "acceleration" not in car.faults_since(start)


def test_a_street_that_bends_and_stays_so_leaves_no_fault_for_good(car: Car) -> None:
    """At a walking pace a slope comes as slowly as a drift, but then stays where it is."""
    car.speed = 1.5
    car.drive(3.0)
    for k in range(400):
        car.step(acceleration=0.005 * k)
    car.drive(12.0, acceleration=2.0)
    assert car.outcomes[-1].report.acceleration.state == State.OK
    jumped = Car()
    jumped.drive(12.0)
    jumped.drive(15.0, acceleration=2.0)
    assert jumped.outcomes[-1].report.acceleration.state == State.FAULT


def brakes_to_rest(car: Car) -> None:
    """Braking that comes on little by little, behind a lead that brakes alike, and ends at once."""
    for k in range(200):
        car.step(acceleration=max(-4.0, -0.06 * k))


def test_a_jump_that_was_looked_into_as_the_lead_was_lost_makes_nobody_blind() -> None:
    car = Car(host_speed=False)
    car.drive(12.0)
    brakes_to_rest(car)
    car.drive(0.1)
    car.has_target = False
    car.drive(0.6)
    car.has_target = True
    car.drive(5.0)
    assert car.outcomes[-1].report.acceleration.state == State.OK
    assert not car.faults_since(0)
    since = len(car.outcomes)
    car.drive(1.0, acceleration=6.0)
    assert car.faults_since(since) == {"acceleration"}


def test_a_jump_before_the_speed_was_there_is_not_judged_long_after_it() -> None:
    car = Car()
    car.drive(12.0)
    car.host_speed = False
    car.drive(1.2)
    brakes_to_rest(car)
    car.drive(0.3)
    car.host_speed = True
    car.drive(8.0)
    car.host_speed, car.velocity = False, -0.5
    car.drive(2.0)
    assert not car.faults_since(0)


def test_what_the_car_did_before_it_lost_its_lead_is_no_change_of_its_own() -> None:
    """Then it is the lead's word that is wrong: it still tells of the lead before."""
    car = Car(host_speed=False, lead=True)
    car.drive(12.0)
    for k in range(300):
        felt = min(0.01 * k, 1.8)
        car.step(acceleration=felt, lead_acceleration=felt)
    car.has_target = False
    car.drive(10.0, lead_acceleration=1.7)
    car.has_target, car.track_id = True, 2
    since = len(car.outcomes)
    car.drive(2.0, lead_acceleration=1.7)
    assert "acceleration" not in car.faults_since(since)


def drives_like_esp(car: Car, accelerations: np.ndarray, held: range = range(0)) -> None:
    """With sensors such as a stability control's: an accelerometer that is filtered and comes in
    steps of 0.1 m/s^2, and a speed that is late and zero below 0.5 m/s. While it is `held`, the
    accelerometer says what it said at first."""
    random, felt, speeds, said = np.random.default_rng(4), 0.0, [15.0], 0.0
    for k, acceleration in enumerate(accelerations):
        if k % 2 == 0:
            noise = random.normal(0.0, 0.1) if speeds[-1] else 0.0
            felt += 0.18 * (acceleration + noise - felt)
            said = said if k in held else round(10.0 * felt) / 10.0
        speeds.append(max(speeds[-1] + 0.01 * acceleration, 0.0))
        late = speeds[max(k - 25, 0)] + random.normal(0.0, 0.02)
        late = round(20.0 * late) / 20.0 if late >= 0.5 else 0.0
        car.step(acceleration_is=said, host_speed_is=late)


def waves(seconds: float, highest: float) -> np.ndarray:
    """Accelerations (m/s^2) that come and go."""
    return highest * np.sin(np.arange(0.0, seconds, 0.01))


def stops_and_pulls_away(times: int) -> np.ndarray:
    """Accelerations (m/s^2) of a car that rests for some seconds each time."""
    t = np.arange(0.0, 40.0, 0.01)
    brakes = -1.5 * np.clip(t / 0.8, 0.0, 1.0) * (t < 11.0)
    once = brakes + 1.1 * np.clip((t - 16.0) / 0.8, 0.0, 1.0) * (t < 28.0)
    return np.tile(once, times)


def test_a_late_speed_that_comes_to_what_was_felt_before_is_no_reason_to_change() -> None:
    car = Car()
    drives_like_esp(car, np.concatenate([waves(20.0, 0.9), stops_and_pulls_away(4)]))
    assert not car.faults_since(0)


def test_a_coarse_accelerometer_repeats_itself_after_a_hold_as_before() -> None:
    car, begin, end = Car(), 6500, 7000
    drive = [waves(25.1, 0.9), waves(25.1, 0.2), waves(20.0, 0.9), waves(20.0, 0.1)]
    drives_like_esp(car, np.concatenate(drive), range(begin, end))
    states = [outcome.report.acceleration.state for outcome in car.outcomes]
    assert State.FAULT not in states[:begin]
    assert states[end - 1] == State.FAULT, "found"
    assert State.FAULT not in states[end + 150 :], "over"


@pytest.mark.parametrize("value", [1e308, -1e308, 1000.0, -1000.0, 100.0])
def test_what_no_car_does_says_nothing_of_the_host_speed_and_ends_once(
    car: Car, value: float
) -> None:
    car.drive(8.0)
    start = car.number
    car.drive(1.0, acceleration_is=value)
    assert car.delay("acceleration", start) < 0.2
    assert car.outcomes[-1].report.acceleration.state == State.FAULT
    assert car.outcomes[-1].reconstruction.acceleration == pytest.approx(0.0, abs=0.2)
    car.drive(6.0)
    assert car.faults_since(start) == {"acceleration"}
    events = [e for o in car.outcomes[start:] for e in o.events if e.signal == "acceleration"]
    assert sum(event.fault.state == State.FAULT for event in events) == 1
    assert car.outcomes[start + 200].report.acceleration.state == State.OK


@pytest.mark.parametrize("hardest", [0.4, 1.0, 1.5, 2.5])
def test_a_car_that_reverses_by_a_speed_without_a_sign_blames_no_accelerometer(
    standing: Car, hardest: float
) -> None:
    start = standing.number
    ramp = np.clip(np.arange(150) / 40.0, 0.0, 1.0) * np.clip(np.arange(150)[::-1] / 40.0, 0.0, 1.0)
    for acceleration in hardest * np.concatenate([-ramp, np.zeros(400), ramp, np.zeros(300)]):
        standing.speed = min(standing.speed + 0.01 * acceleration, 0.0)
        standing.step(acceleration=acceleration, host_speed=-2.0 * standing.speed)
    assert not standing.faults_since(start)
    reasons = " ".join(outcome.report.acceleration.reason for outcome in standing.outcomes[start:])
    assert ("may reverse" in reasons) == (hardest > 0.5)
    # It drives off forward.
    standing.drive_off(3.0)
    assert not standing.faults_since(start)


def backs_off(
    car: Car, pulls: float, rolls: float, brakes: float, silent: range = range(0)
) -> None:
    """Backward at `pulls` m/s^2 for a second, on for `rolls` s, to rest at `brakes` m/s^2; by a
    speed without a sign."""
    pull = np.minimum(np.arange(125), np.arange(125)[::-1]).clip(0, 25) / 25.0
    accelerations = np.concatenate([-pulls * pull, np.zeros(round(100 * rolls))])
    for number, acceleration in enumerate(accelerations):
        car.speed += 0.01 * acceleration
        car.host_speed = number not in silent
        car.step(acceleration=acceleration, host_speed=-2.0 * car.speed)
    number = 0
    while car.speed < 0.0:
        number += 1
        acceleration = min(brakes * min(number / 20.0, 1.0), -100.0 * car.speed)
        car.speed = min(car.speed + 0.01 * acceleration, 0.0)
        car.step(acceleration=acceleration, host_speed=-2.0 * car.speed)


@pytest.mark.parametrize("silent", [range(0), range(80, 95), range(10, 30)])
@pytest.mark.parametrize("brakes", [1.5, 2.5])
def test_a_car_that_brakes_while_it_reverses_blames_no_accelerometer(
    standing: Car, brakes: float, silent: range
) -> None:
    """By its speed without a sign it seems to brake forward; nor is that a slope."""
    start = standing.number
    for _ in range(3):
        backs_off(standing, 1.0, 2.0, brakes, silent)
        standing.drive(2.0, host_speed_is=0.0)
    assert not standing.faults_since(start)
    assert standing.outcomes[-1].reconstruction.acceleration == pytest.approx(0.0, abs=0.25)


@pytest.mark.parametrize("offset", [3.0, -3.0])
def test_an_offset_while_the_car_reverses_is_found(standing: Car, offset: float) -> None:
    backs_off(standing, 1.0, 2.0, 1.5)
    standing.drive(2.0, host_speed_is=0.0)
    start = standing.number
    for number in range(500):
        acceleration = -1.0 if number < 100 else 0.3 if number < 400 else 0.0
        off = offset if number >= 250 else 0.0
        standing.speed = min(standing.speed + 0.01 * acceleration, 0.0)
        standing.step(acceleration=acceleration + off, host_speed=-2.0 * standing.speed)
        if number == 380:
            told = standing.outcomes[-1].reconstruction.acceleration
            assert told == pytest.approx(0.3, abs=0.3), "its sign is the car's"
    assert not standing.faults_since(start) - {"acceleration"}
    assert standing.delay("acceleration", start + 250) < 0.3


@pytest.mark.parametrize("offset", [2.0, -2.0, 4.0, -4.0])
@pytest.mark.parametrize("after", [-1.0, 0.7, 2.0])
def test_an_offset_while_the_car_drives_off_is_no_reversal(
    standing: Car, offset: float, after: float
) -> None:
    """It is there while the car stands, or it began when the car surely drove forward."""
    start = standing.number
    if after < 0.0:
        standing.drive(-after, acceleration=offset, host_speed_is=0.0)
    standing.drive_off(max(after, 0.01))
    for _ in range(30):
        standing.speed += 0.01
        standing.step(acceleration=1.0 + offset)
    assert State.FAULT in {o.report.acceleration.state for o in standing.outcomes[start:]}


@pytest.mark.parametrize("speed", [8.0, 20.0])
@pytest.mark.parametrize("rate", [0.8, 1.0, -1.0, 2.0])
def test_a_drift_that_a_bend_of_the_road_might_have_begun_is_none_once_it_goes_on(
    car: Car, speed: float, rate: float
) -> None:
    car.speed = speed
    car.drive(8.0)
    start = car.number
    for k in range(600):
        outcome = car.step(acceleration=0.01 * rate * k)
    verdict, made = outcome.report.acceleration, outcome.reconstruction
    assert verdict.state == State.FAULT and verdict.kind == Kind.RAMP
    assert verdict.size == pytest.approx(6.0 * rate, rel=0.2)
    assert abs(made.acceleration) < 0.4 and made.acceleration_std < 0.5
    assert car.faults_since(start) == {"acceleration"}
    end = car.number
    assert car.drive(1.5).report.acceleration.state == State.OK
    car.drive(5.0)
    assert not car.faults_since(end)


@pytest.mark.parametrize("off", [1.3, 1.5])
def test_a_level_road_is_believed_though_a_sensor_that_was_off_had_taught_a_slope(
    car: Car, off: float
) -> None:
    for k in range(300):
        car.step(acceleration=off * k / 300.0)
    car.drive(12.0, acceleration=off)
    for _ in range(2000):
        outcome = car.step()
        made, verdict = outcome.reconstruction, outcome.report.acceleration
        if verdict.state == State.FAULT and outcome.report.stamp - verdict.since > 300_000_000:
            assert abs(made.acceleration) < 3.0 * made.acceleration_std
    assert outcome.report.acceleration.state == State.OK
