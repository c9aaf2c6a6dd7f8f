"""The robust profile without ROS: what it says to each input, at, below and above its limits."""

from copy import copy, deepcopy
from math import exp, hypot, inf, isnan, nan, pi, sin
from random import Random

import numpy as np
import pytest
from pydantic import ValidationError
from test_observer import make_horizon

from lfd_diagnosis.diagnosis import RobustDiagnosis
from lfd_diagnosis.healthy_signal import (
    LEARNT_NOISE,
    REPETITION,
    ROUGHNESS,
    deviation,
    is_frozen,
    is_rough,
    learn_noise,
    note_change,
    start_noise,
    start_repetition,
    start_roughness,
    take_repetition,
    take_roughness,
)
from lfd_diagnosis.lead_track import (
    LEAD_TRACK,
    correct_clearance,
    correct_velocity,
    predict_track,
    start_track,
)
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind, Outcome, State
from lfd_mpc.compiled import make_state
from lfd_observer.bank import ObserverBank
from lfd_observer.settings import BankSettings

SCAN = 5
"""Steps between two scans."""


class Car:
    """A car behind a lead: radar at 20 Hz, everything else at 100 Hz, a little noise on all."""

    def __init__(self, host_speed: bool = True, lead: bool = False, **settings) -> None:
        self.diagnosis = RobustDiagnosis(DiagnosisSettings(**settings))
        self.bank = ObserverBank(BankSettings())
        self.random = np.random.default_rng(1)
        self.number = 0
        self.host_speed, self.lead = host_speed, lead
        self.accelerometer_silent = self.radar_silent = False
        self.clearance, self.velocity, self.speed = 30.0, 0.0, 15.0
        self.lead_acceleration = 0.0
        self.track_id = 1
        self.seen: tuple[float, float] = 30.0, 0.0
        self.scanned = -1
        self.outcomes: list[Outcome] = []

    def step(self, **faults: float) -> Outcome:
        """One step; `faults`: added to a signal, or `NAME_is` to put in its place."""
        self.number += 1
        self.velocity += 0.01 * self.lead_acceleration
        self.clearance += 0.01 * self.velocity
        noise = self.random.normal(size=5).tolist()
        now = {
            "clearance": self.clearance + 0.05 * noise[0],
            "relative_velocity": self.velocity + 0.03 * noise[1],
            "acceleration": 0.08 * noise[2],
            "host_speed": self.speed + 0.01 * noise[3],
            "lead_acceleration": self.lead_acceleration + 0.1 * noise[4],
        }
        for name in now:
            now[name] = faults.get(f"{name}_is", now[name] + faults.get(name, 0.0))
        if self.number % SCAN == 1 and not self.radar_silent:
            self.seen, self.scanned = (now["clearance"], now["relative_velocity"]), self.number
        age = 0.01 * (self.number - self.scanned)
        clearance, velocity = self.seen
        measured = {"measured_clearance": clearance, "measured_relative_velocity": velocity}
        clearance = self.clearance if isnan(clearance) else clearance
        velocity = self.velocity if isnan(velocity) else velocity
        fields = {
            **measured,
            "clearance": clearance + velocity * age,
            "velocity": velocity,
            "clearance_age": age,
            "relative_velocity_age": age,
            "track_id": self.track_id,
            "acceleration": now["acceleration"],
            "measured_acceleration": now["acceleration"],
            "acceleration_stale": self.accelerometer_silent,
            "measured_host_speed": now["host_speed"] if self.host_speed else nan,
            "host_speed_age": 0.0 if self.host_speed else nan,
            "host_speed_stale": not self.host_speed,
        }
        if self.lead:
            fields |= {
                "measured_lead_acceleration": now["lead_acceleration"],
                "lead_acceleration_age": 0.05,
                "lead_acceleration_stale": False,
            }
        horizon = make_horizon(self.number, **fields)
        self.outcomes.append(self.diagnosis.step(horizon, self.bank.step(horizon)))
        return self.outcomes[-1]

    def drive(self, seconds: float, **faults: float) -> Outcome:
        """Many steps alike; returns the last outcome."""
        for _ in range(round(seconds * 100)):
            outcome = self.step(**faults)
        return outcome

    def go_unheard(self, seconds: float) -> None:
        """Drive on while no input arrives at all, so that there are no steps."""
        self.number += round(seconds * 100)
        self.clearance += seconds * self.velocity

    def drive_off(self, seconds: float) -> None:
        """From rest, accelerating by up to 1.5 m/s^2."""
        for k in range(round(seconds * 100)):
            acceleration = min(0.02 * (k + 1), 1.5)
            self.speed += 0.01 * acceleration
            self.step(acceleration=acceleration)

    def faults_since(self, number: int) -> set[str]:
        """Names of everything that was called faulty after that many steps."""
        return {
            event.signal
            for outcome in self.outcomes[number:]
            for event in outcome.events
            if event.fault.state == State.FAULT
        }

    def delay(self, name: str, since: int) -> float:
        """Seconds from a step to the first verdict of FAULT."""
        for k, outcome in enumerate(self.outcomes[since:]):
            if getattr(outcome.report, name).state == State.FAULT:
                return 0.01 * k
        raise AssertionError(f"{name} was never faulty")


@pytest.fixture(scope="module")
def ready_car() -> Car:
    made = Car()
    report = made.drive(12.0).report
    assert {report.clearance.state, report.radar.state, report.acceleration.state} == {State.OK}
    assert report.host_speed.state == State.OK
    assert not made.faults_since(0)
    return made


@pytest.fixture
def car(ready_car: Car) -> Car:
    """A car of each test's own that has driven for 12 s."""
    made = copy(ready_car)
    made.outcomes = list(made.outcomes)
    made.diagnosis, made.bank, made.random = deepcopy((made.diagnosis, made.bank, made.random))
    return made


@pytest.mark.parametrize(
    ("fault", "name", "size"),
    [
        ({"clearance": 2.0}, "clearance", 2.0),
        ({"clearance": -4.0}, "clearance", -4.0),
        ({"relative_velocity": 2.0}, "relative_velocity", 2.0),
        ({"relative_velocity": -10.0}, "relative_velocity", -10.0),
        ({"acceleration": 1.5}, "acceleration", 1.5),
        ({"acceleration": -4.0}, "acceleration", -4.0),
    ],
)
def test_an_offset_of_one_signal_is_named_sized_and_over_with_it(car, fault, name, size) -> None:
    start = car.number
    verdict = getattr(car.drive(4.0, **fault).report, name)
    assert car.faults_since(start) - {"radar"} == {name}
    assert car.delay(name, start) <= (0.3 if name == "acceleration" else 0.13)
    assert verdict.state == State.FAULT and verdict.kind == Kind.OFFSET
    assert verdict.size == pytest.approx(size, rel=0.2)
    assert "limit" in verdict.reason and "offset by" in verdict.reason
    end = car.number
    assert getattr(car.drive(1.5).report, name).state == State.OK
    assert not car.faults_since(end)


def test_a_reference_that_wanders_to_a_faulty_relative_velocity_does_not_end_its_fault(car) -> None:
    """Coasted out of a clearance that wanders by 0.8 m, it meets what the signal says: no jump."""
    off = {"relative_velocity": 1.0}
    car.drive(1.0, **off)
    start, reasons = car.number, set()
    for wandered in (*range(80), *range(80, 0, -1)):
        verdict = car.step(clearance=0.01 * wandered, **off).report.relative_velocity
        assert verdict.state == State.FAULT
        reasons.add(verdict.reason.rpartition("; ")[2])
    assert "did not jump back: it must agree for 2 s" in reasons
    assert car.drive(1.5).report.relative_velocity.state == State.OK, "the jump back was seen"
    assert not car.faults_since(start)


def test_a_reference_that_jumps_is_no_jump_back_of_the_signal() -> None:
    car = Car(relative_velocity_floor=0.2)
    car.drive(12.0)
    car.drive(1.0, relative_velocity=0.5)
    start = car.number
    for _ in range(300):
        verdict = car.step(relative_velocity=0.5, clearance=0.8).report.relative_velocity
        assert verdict.state == State.FAULT
    assert car.drive(1.5, clearance=0.8).report.relative_velocity.state == State.OK
    assert not car.faults_since(start)


def test_a_relative_velocity_that_fades_back_is_believed_though_nothing_jumped(car: Car) -> None:
    car.drive(2.0, relative_velocity=1.5)
    for left in range(100):
        car.step(relative_velocity=0.015 * (100 - left))
    end = car.number
    assert car.drive(2.5).report.relative_velocity.state == State.OK
    assert not car.faults_since(end)


def test_radar_and_acceleration_at_once_are_all_named(car: Car) -> None:
    start = car.number
    car.drive(6.0, clearance=4.0, relative_velocity=-10.0, acceleration=4.0)
    assert car.faults_since(start) == {"clearance", "relative_velocity", "radar", "acceleration"}
    end = car.number
    report = car.drive(1.5).report
    assert {report.radar.state, report.acceleration.state} == {State.OK}
    assert not car.faults_since(end)


@pytest.mark.parametrize(("off", "expected"), [(1.15, State.OK), (1.6, State.SUSPECT)])
def test_a_scan_counts_above_its_limit_only_and_alone_is_an_outlier(car, off, expected) -> None:
    while car.number % SCAN:
        car.step()
    verdict = car.step(clearance=off).report.clearance
    assert verdict.state == expected
    assert (verdict.index > verdict.threshold) is (expected == State.SUSPECT)
    start = car.number
    verdict = car.drive(2.0).report.clearance
    assert verdict.state == State.OK and not car.faults_since(start)
    assert ("1 single outliers" in verdict.reason) is (expected == State.SUSPECT)


@pytest.mark.parametrize("levels", [(0.6, 1.1, 1.6), (1.0, 1.9), (-0.9, -1.8)])
def test_a_radar_that_goes_over_to_another_part_of_the_car_is_not_faulty(car: Car, levels) -> None:
    start = car.number
    for _ in range(2):
        for level in levels:
            car.drive(SCAN * 0.01, clearance=level)
        assert car.drive(4.0, clearance=levels[-1]).report.clearance.state == State.OK
        for level in levels[-2::-1]:
            car.drive(SCAN * 0.01, clearance=level)
        assert car.drive(4.0).report.clearance.state == State.OK
    assert not car.faults_since(start)


@pytest.mark.parametrize("step", [0.7, -0.7])
def test_a_radar_that_goes_over_twice_does_not_drift(step: float) -> None:
    """A straight line fits stairs as well as one shift does, and neither fits well."""
    car = Car()
    car.drive(15.0)
    start = car.number
    car.drive(0.9, clearance=step)
    car.drive(3.9, clearance=2.0 * step)
    assert not car.faults_since(start)


def test_what_no_car_is_long_enough_for_is_a_fault(car: Car) -> None:
    start = car.number
    for level in (1.0, 1.9, 2.7, 3.5):
        car.drive(SCAN * 0.01, clearance=level)
    verdict = car.drive(2.0, clearance=3.5).report.clearance
    assert verdict.state == State.FAULT and verdict.kind == Kind.OFFSET
    assert car.faults_since(start) == {"clearance", "radar"}
    assert car.delay("clearance", start) < 0.6


def test_where_a_radar_never_shifts_a_shift_is_a_fault() -> None:
    car = Car(largest_shift=0.0)
    car.drive(12.0)
    start = car.number
    for level in (0.6, 1.1, 1.6, 1.9):
        car.drive(SCAN * 0.01, clearance=level)
    car.drive(2.0, clearance=1.9)
    assert car.faults_since(start) == {"clearance", "radar"}


def test_a_clearance_that_wanders_takes_the_track_along() -> None:
    """Or a fault towards the other side would seem as much smaller as it had wandered."""
    car = Car()
    for k in range(31):
        car.drive(1.0, clearance=0.45 * (-1.0) ** k)
    start = car.number
    verdict = car.drive(0.5, clearance=0.45 - 2.0).report.clearance
    assert car.delay("clearance", start) <= 0.13
    assert verdict.size == pytest.approx(-2.0, abs=0.25)


@pytest.mark.parametrize(("braking", "faulty"), [(0.0, set()), (-1.0, {"relative_velocity"})])
def test_a_relative_velocity_that_repeats_itself_must_have_had_to_change(
    car: Car, braking: float, faulty: set
) -> None:
    start, car.lead_acceleration = car.number, braking
    if braking:
        car.drive(0.6)
    car.drive(1.2, relative_velocity_is=car.velocity)
    assert car.faults_since(start) - {"radar"} == faulty


class CoarseCar(Car):
    """Its radar says the relative velocity in steps of 0.25 m/s."""

    def step(self, **faults: float) -> Outcome:
        said = 0.25 * round(self.velocity / 0.25)
        return super().step(**{"relative_velocity_is": said, **faults})

    def wave(self, seconds: float) -> None:
        """The lead now speeds up, now slows down, and ends as fast as it began."""
        steps = round(seconds * 100)
        for k in range(steps):
            self.lead_acceleration = 1.5 * sin(2.0 * pi * k * round(seconds / 4.0) / steps)
            self.step()
        self.lead_acceleration = 0.0


@pytest.mark.parametrize("off", [4.0, -6.0])
def test_one_scan_that_is_off_convicts_no_relative_velocity_that_repeats_itself(off: float) -> None:
    car = CoarseCar()
    car.wave(40.0)
    start = car.number
    car.drive(5.0)
    car.drive(0.05, clearance=off)
    assert car.drive(5.0).report.clearance.state == State.OK
    assert car.faults_since(start) == set()


def test_a_clearance_that_stays_refutes_what_was_expected_of_the_lead() -> None:
    """The lead ends its braking as it is just as fast as the host."""
    car = CoarseCar()
    car.wave(40.0)
    start = car.number
    for car.lead_acceleration, seconds in ((1.0, 1.6), (-0.8, 2.0), (0.0, 15.0)):
        car.drive(seconds)
    assert car.faults_since(start) == set()
    # A lead that brakes from then on is missed, however long that was true.
    start, car.lead_acceleration = car.number, -1.0
    car.drive(2.0, relative_velocity_is=0.0)
    assert car.faults_since(start) - {"radar"} == {"relative_velocity"}
    assert car.delay("relative_velocity", start) <= 1.8


def test_short_holds_that_nobody_could_tell_do_not_excuse_a_long_one(car: Car) -> None:
    for scans in (6, 8, 10, 12, 14, 16, 18, 20, 24):
        start, held = car.number, car.velocity
        for k in range(SCAN * scans):
            acceleration = -3.0 * sin(2.0 * pi * k / (SCAN * scans))
            car.speed += 0.01 * acceleration
            car.velocity -= 0.01 * acceleration
            car.step(acceleration=acceleration, relative_velocity_is=held)
        car.drive(3.0)
        assert car.faults_since(start) <= {"relative_velocity", "radar"}
    assert car.delay("relative_velocity", start) <= 0.5


@pytest.mark.parametrize("signal", ["clearance", "relative_velocity"])
@pytest.mark.parametrize("share", [0.5, 0.7, 0.8, 0.9, 1.1, 2.0])
def test_a_scan_that_is_off_alone_is_nobodys_fault_within_its_limit_either(
    car: Car, signal: str, share: float
) -> None:
    """What was taken of it makes the next scans disagree."""
    limit = {"clearance": 1.3, "relative_velocity": 0.8}[signal]
    for k in range(6):
        off = car.drive(0.01 * SCAN, **{signal: (-1) ** k * share * limit})
        state = State.OK if share < 1.0 else State.SUSPECT
        assert getattr(off.report, signal).state == state
        assert getattr(car.drive(1.0).report, signal).state == State.OK
    assert not car.faults_since(0)
    if share > 1.0:
        assert "6 single outliers" in getattr(car.outcomes[-1].report, signal).reason


@pytest.mark.parametrize(
    ("signal", "off", "samples", "faults"),
    [
        ("host_speed", 0.5, 1, False),
        ("host_speed", 1.0, 1, False),
        ("host_speed", 15.0, 1, False),
        ("host_speed", 1.0, 2, True),
        ("acceleration", 7.0, 1, False),
        ("acceleration", 9.0, 1, False),
        ("acceleration", 40.0, 1, False),
        ("acceleration", 9.0, 4, False),
        ("acceleration", 40.0, 4, False),
        ("acceleration", 9.0, 25, True),
    ],
)
def test_samples_that_jump_for_a_moment_are_outliers(
    car: Car, signal: str, off: float, samples: int, faults: bool
) -> None:
    start = car.number
    for k in range(4):
        car.drive(0.01 * samples, **{signal: (-1) ** k * off})
        car.drive(1.0)
    assert car.faults_since(start) == ({signal} if faults else set())
    if not faults and off > {"host_speed": 0.65, "acceleration": 8.0}[signal]:
        assert "4 single outliers" in getattr(car.outcomes[-1].report, signal).reason


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


SWINGS = [
    # By host speed, a wheel being shaken: a swing is over before it counts.
    (True, 0.5, 0.2, 0.2, set()),
    (True, 0.5, 0.2, 0.5, {"acceleration"}),
    (True, 0.1, 0.2, 0.2, {"acceleration"}),
    # Without it: what swings is judged half a second later.
    (False, 0.5, 0.0, 0.25, set()),
    (False, 0.5, 0.0, 1.2, {"acceleration"}),
    (False, 0.1, 0.0, 0.25, {"acceleration"}),
]


@pytest.mark.parametrize("seed", [3, 4, 5, 6])
@pytest.mark.parametrize(("host_speed", "noise", "shaken", "seconds", "faults"), SWINGS)
def test_a_bump_swings_a_loosely_mounted_sensor_for_a_moment(
    host_speed: bool, noise: float, shaken: float, seconds: float, faults: set, seed: int
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
    drive(seconds, -3.5)
    drive(2.0, 0.0)
    assert car.faults_since(start) == faults


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


def test_a_clearance_of_which_scans_are_missing_is_not_rough_for_that(car: Car) -> None:
    """A lead that is neared by 15 m/s is somewhere else after a scan that is missing."""
    car.clearance, car.velocity, car.track_id = 200.0, -15.0, 2
    start = car.number
    for k in range(240):
        car.radar_silent = k % 3 == 1
        car.drive(0.01 * SCAN)
        if k == 80:
            car.clearance, car.track_id = 200.0, 3
    assert not car.faults_since(start)


@pytest.mark.parametrize("braking", [1.0, 4.0])
@pytest.mark.parametrize("steps", [8, 20, 40])
def test_a_lead_at_rest_that_is_neared_at_a_steady_speed_is_no_held_radar(
    braking: float, steps: int
) -> None:
    """What the relative velocity repeats is true, and a lead at rest brakes no further.

    `steps`: those of the relative velocity in 1 m/s.
    """
    car = Car()
    car.clearance, car.speed = 40.0, 3.5
    while car.clearance > 5.0:
        if car.number < 1500:
            car.lead_acceleration = 0.4 * sin(2.0 * pi * car.number / 300)
        else:
            car.lead_acceleration = -min(braking, 100.0 * (car.speed + car.velocity))
        car.step(relative_velocity_is=round(steps * car.velocity) / steps)
    assert not car.faults_since(0)


def test_a_lead_that_brakes_hard_is_nobodys_fault(car: Car) -> None:
    start = car.number
    car.lead_acceleration = -8.0
    car.drive(1.2)
    assert not car.faults_since(start)


@pytest.mark.parametrize(
    ("signal", "kind"),
    [("clearance", Kind.HOLD), ("relative_velocity", Kind.HOLD), ("acceleration", Kind.ZERO)],
)
def test_a_signal_that_repeats_itself_is_named(car: Car, signal: str, kind: Kind) -> None:
    car.lead_acceleration = 1.0
    car.drive(1.0)
    car.lead_acceleration = 0.0
    car.drive(1.0)
    start = car.number
    value = 0.0 if kind == Kind.ZERO else {"clearance": car.clearance, "relative_velocity": 1.0}
    held = value if isinstance(value, float) else value[signal]
    report = car.drive(2.0, **{f"{signal}_is": held}).report
    assert car.faults_since(start) - {"radar"} == {signal}
    assert getattr(report, signal).kind == kind


@pytest.mark.parametrize(("seconds", "faulty"), [(0.9, set()), (1.2, {"clearance", "radar"})])
def test_a_clearance_that_does_not_even_waver_is_held(
    car: Car, seconds: float, faulty: set[str]
) -> None:
    """Nothing moves: it is told by its own noise, but not before a second has passed."""
    start, (held, _) = car.number, car.seen
    report = car.drive(seconds, clearance_is=held).report
    assert car.faults_since(start) == faulty
    assert not faulty or report.clearance.kind == Kind.HOLD


def test_a_held_clearance_is_told_the_sooner_the_longer_it_is_no_coincidence(car: Car) -> None:
    """It should have gone 0.3 m by then, not the 0.45 m of a run that may be one."""
    car.lead_acceleration = 0.4
    car.drive(1.0)
    car.lead_acceleration = 0.0
    car.drive(1.0)
    start, (held, _) = car.number, car.seen
    car.drive(0.9, clearance_is=held)
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize("velocity", [1.0, -1.0, 0.6])
def test_a_held_clearance_is_told_where_a_radar_has_narrow_limits_too(velocity: float) -> None:
    """It leaves them gradually, as a drift does; the path would take a second longer to tell."""
    car = Car(clearance_floor=0.3, largest_shift=0.0)
    car.drive(12.0)
    car.lead_acceleration = velocity
    car.drive(1.0)
    car.lead_acceleration = 0.0
    car.drive(1.0)
    start, held = car.number, car.clearance
    verdict = car.drive(1.5, clearance_is=held).report.clearance
    assert car.faults_since(start) - {"radar"} == {"clearance"} and verdict.kind == Kind.HOLD
    assert car.delay("clearance", start) <= 0.5 / abs(velocity) + 0.05


@pytest.mark.parametrize(
    ("floor", "peak", "slope"), [(1.3, 2.0, 2.0), (1.3, 2.0, 4.0), (0.3, 0.6, 1.0)]
)
def test_what_leaves_its_limits_gradually_and_comes_back_at_once_is_no_offset(
    floor: float, peak: float, slope: float
) -> None:
    car = Car(clearance_floor=floor)
    car.drive(12.0)
    start = car.number
    for k in range(round(100 * peak / slope)):
        car.step(clearance=0.01 * slope * (k - k % SCAN))
    assert car.outcomes[-1].report.clearance.state == State.SUSPECT
    assert car.drive(2.0).report.clearance.state == State.OK
    assert not car.faults_since(start)


def test_noise_of_one_sensor_is_a_fault_and_a_bad_road_is_none(car: Car) -> None:
    random = Random(2)
    start = car.number
    for _ in range(150):
        car.step(acceleration=random.gauss(0.0, 0.9), host_speed=random.gauss(0.0, 0.1))
    assert not car.faults_since(start)
    car.drive(3.0)
    start = car.number
    for _ in range(150):
        car.step(acceleration=random.gauss(0.0, 0.9))
    verdict = car.outcomes[-1].report.acceleration
    assert verdict.state == State.FAULT and verdict.kind == Kind.NOISE


@pytest.mark.parametrize("name", ["clearance", "relative_velocity"])
def test_a_drift_is_blamed_on_the_signal_that_drifts(car: Car, name: str) -> None:
    car.drive(5.0)
    start = car.number
    for k in range(400):
        car.step(**{name: 0.5 * k * 0.01})
    assert car.faults_since(start) - {"radar"} == {name}
    assert getattr(car.outcomes[-1].report, name).kind == Kind.RAMP
    assert car.delay(name, start) < 4.0


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


@pytest.mark.parametrize(("braking", "faults"), [(1.0, set()), (4.0, {"acceleration"})])
def test_a_manoeuvre_looks_like_a_bend_and_tells_of_none(braking: float, faults: set) -> None:
    """The road bends by 1.8 m/s^2 as the car begins to brake, by less and more than 2.5 m/s^2."""
    car = Car()
    car.speed = 14.0
    car.drive(8.0)
    start = car.number
    for k in range(200):
        braked, slope = -braking * min(k / 80, 1.0), 1.8 * min(k / 80, 1.0)
        car.speed += 0.01 * braked
        car.step(acceleration=braked + slope)
    assert car.faults_since(start) == faults


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


def test_a_faulty_host_speed_is_named_and_not_used(car: Car) -> None:
    start = car.number
    report = car.drive(1.0, host_speed=5.0).report
    assert report.host_speed.state == State.FAULT and "jump" in report.host_speed.reason
    assert "host speed is not used" in report.acceleration.reason
    assert car.faults_since(start) == {"host_speed"}
    start = car.number
    car.drive(0.5, host_speed=5.0, acceleration=4.0)
    assert "acceleration" in car.faults_since(start), "the observers still tell"


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


def test_an_acceleration_that_drifts_in_a_standing_car_is_told_by_a_lead_at_rest(standing: Car):
    """A car that drove off with a held speed would near its lead, or have followed it."""
    start = standing.number
    for k in range(400):
        standing.step(acceleration=0.005 * k, host_speed_is=0.0)
    assert standing.faults_since(start) == {"acceleration"}
    assert standing.outcomes[-1].report.acceleration.kind == Kind.RAMP


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


def test_a_host_speed_that_fell_to_zero_is_faulty_until_it_moves_again(car: Car) -> None:
    outcome = car.drive(9.0, host_speed_is=0.0)
    assert outcome.report.host_speed.state == State.FAULT
    assert outcome.report.host_speed.kind == Kind.ZERO
    assert car.drive(1.5).report.host_speed.state == State.OK
    assert car.faults_since(0) == {"host_speed"}


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


@pytest.mark.parametrize("host_speed", [True, False])
def test_a_lie_of_the_lead_is_found_out_and_blames_no_one(host_speed: bool) -> None:
    car = Car(host_speed=host_speed, lead=True)
    car.drive(8.0)
    start = car.number
    report = car.drive(3.0, lead_acceleration=4.0).report
    assert report.lead_acceleration.state == State.FAULT
    assert car.faults_since(start) == {"lead_acceleration"}
    assert report.acceleration.state == State.OK


def test_the_lead_that_falls_silent_is_said_so() -> None:
    car = Car(lead=True)
    car.drive(8.0)
    car.lead = False
    verdict = car.step().report.lead_acceleration
    assert verdict.state == State.NO_DATA and verdict.kind == Kind.DROPOUT


def test_a_new_id_of_the_same_car_restarts_nothing(car: Car) -> None:
    start = car.number
    for track in range(2, 12):
        car.track_id = track
        car.drive(0.3)
    states = {outcome.report.clearance.state for outcome in car.outcomes[start:]}
    assert states <= {State.OK, State.SUSPECT} and not car.faults_since(start)


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


@pytest.mark.parametrize("moved", [-2.5, 5.0])
def test_a_clearance_that_was_held_may_see_another_part_of_the_car_since(
    car: Car, moved: float
) -> None:
    car.velocity = -1.0
    car.drive(2.0)
    car.drive(3.0, clearance_is=car.clearance)
    assert car.outcomes[-1].report.clearance.kind == Kind.HOLD
    car.clearance += moved
    start = car.number
    car.drive(1.5)
    assert car.outcomes[-1].report.clearance.state == State.OK
    car.drive(3.0)
    assert not car.faults_since(start)


def test_a_hold_that_nothing_told_does_not_excuse_the_next_one(car: Car) -> None:
    def coarse(seconds: float) -> None:
        for _ in range(round(seconds * 100)):
            value = car.velocity + 0.03 * float(car.random.normal())
            car.step(relative_velocity_is=0.05 * round(value / 0.05))

    coarse(20.0)
    # Nothing changes meanwhile: nobody can tell.
    car.drive(3.0, relative_velocity_is=0.0)
    coarse(5.0)
    assert not car.faults_since(0)
    car.lead_acceleration = -0.5
    start, held = car.number, car.seen[1]
    car.drive(2.5, relative_velocity_is=held)
    assert car.faults_since(start) == {"radar", "relative_velocity"}
    assert car.outcomes[-1].report.relative_velocity.kind == Kind.HOLD


def test_a_clearance_that_goes_over_to_another_part_while_the_relative_velocity_is_held(
    car: Car,
) -> None:
    car.lead_acceleration = 0.5
    car.drive(2.0)
    start, held = car.number, car.velocity
    for _ in range(200):
        # Within its limits from scan to scan, as a radar that sees the car's front by and by.
        car.clearance -= 0.07 * (car.number - start < 30)
        car.step(relative_velocity_is=held)
    assert car.faults_since(start) == {"radar", "relative_velocity"}


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


def test_a_slow_drift_of_the_clearance_is_seen_over_two_windows(car: Car) -> None:
    start = car.number
    for k in range(700):
        car.step(clearance=0.0035 * k)
    assert car.faults_since(start) == {"clearance", "radar"}
    assert car.outcomes[-1].report.clearance.kind == Kind.RAMP
    assert 0.35 * car.delay("clearance", start) < 2.1


def test_a_clearance_that_comes_back_to_the_path_from_a_drift_too_slow_to_tell(car: Car) -> None:
    car.drive(5.0)
    start = car.number
    for k in range(900):
        car.step(clearance=0.0017 * k)
    assert not car.faults_since(start)
    car.drive(3.0)
    assert not car.faults_since(start)
    # As far from where it never was: a fault.
    car.drive(1.0, clearance=1.53)
    assert "clearance" in car.faults_since(start)


def test_a_relative_velocity_that_comes_back_ends_the_drift_it_made(car: Car) -> None:
    car.track_id, car.clearance, car.velocity = 2, 60.0, -2.0
    # Off by less than its limits from its first scan on: that is a drift of the clearance to see.
    car.drive(4.0, relative_velocity=0.6)
    assert car.outcomes[-1].report.clearance.kind == Kind.RAMP
    for k in range(280):
        car.step(relative_velocity=0.6 + 0.005 * k)
    car.drive(1.5, relative_velocity=2.0)
    start = car.number
    report = car.drive(0.5).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    car.drive(3.0)
    assert not car.faults_since(start)


@pytest.mark.parametrize(("wander", "period"), [(0.4, 4.0), (0.6, 5.0), (0.8, 8.0)])
def test_a_lead_that_brakes_behind_a_held_relative_velocity_is_no_fault_of_the_clearance(
    car: Car, wander: float, period: float
) -> None:
    def drive(seconds: float, **held: float) -> None:
        for _ in range(round(seconds * 100)):
            off = wander * sin(2.0 * pi * 0.01 * car.number / period)
            car.step(clearance=off, **held)

    drive(30.0)
    car.lead_acceleration = 0.5
    drive(3.0)
    start, held = car.number, car.velocity
    drive(1.0, relative_velocity_is=held)
    car.lead_acceleration = -8.0
    drive(2.0, relative_velocity_is=held)
    for _ in range(20):
        drive(0.1, relative_velocity_is=held)
        now = car.outcomes[-1].reconstruction
        off = abs(now.relative_velocity - car.velocity)
        assert off < 2.5 or not now.relative_velocity_valid
    assert car.faults_since(start) == {"radar", "relative_velocity"}


def test_an_offset_goes_on_with_another_car_until_it_ends(car: Car) -> None:
    both = {"clearance": 4.0, "relative_velocity": -10.0}
    car.drive(1.0, **both)
    car.track_id, car.clearance, car.velocity = 2, 60.0, 1.0
    start = car.number
    for _ in range(200):
        now = car.step(**both).reconstruction
    report = car.outcomes[-1].report
    assert report.clearance.state == report.relative_velocity.state == State.FAULT
    assert "reference lost: a new target must agree for 5 s" in report.clearance.reason
    assert not car.faults_since(start)
    assert now.clearance == pytest.approx(car.clearance, abs=0.5)
    assert now.relative_velocity == pytest.approx(car.velocity, abs=0.5)
    end = car.number
    report = car.drive(1.5).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
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


def test_a_clearance_that_jumps_while_the_relative_velocity_stays_faulty_is_faulty(car) -> None:
    car.drive(1.0, relative_velocity=2.0)
    start = car.number
    car.drive(1.0, relative_velocity=2.0, clearance=4.0)
    assert "clearance" in car.faults_since(start) and car.delay("clearance", start) <= 0.13


def test_a_lead_that_braked_all_along_ends_no_fault_later(car: Car) -> None:
    """What it did while nothing told of it is in what the relative velocity said."""
    both = {"clearance": 4.0, "relative_velocity": -10.0}
    car.velocity = 5.0
    car.drive(5.0)
    car.drive(1.0, **both)
    car.lead_acceleration = -3.0
    car.drive(2.0, **both)
    end = car.number
    report = car.drive(1.0).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(end)


@pytest.mark.parametrize("silence", [0.0, 0.6])
def test_another_part_of_the_car_behind_a_faulty_relative_velocity_is_no_fault(
    car: Car, silence: float
) -> None:
    off = {"relative_velocity": 2.0}
    car.drive(0.5, **off)
    start = car.number
    if silence:
        car.radar_silent = True
        car.drive(silence, **off)
        car.radar_silent = False
    else:
        for level in (0.5, 1.2, 1.9):
            car.drive(0.01 * SCAN, clearance=level, **off)
    verdict = car.drive(2.0, clearance=2.4, **off).report.relative_velocity
    assert verdict.state == State.FAULT and not car.faults_since(start) - {"relative_velocity"}
    assert car.drive(1.5, clearance=2.4).report.relative_velocity.state == State.OK


def test_a_clearance_that_came_back_may_go_over_to_another_part_of_the_car(car: Car) -> None:
    car.drive(2.0, clearance=2.0)
    end = car.number
    car.drive(0.22)
    for level in (-0.6, -1.1):
        car.drive(0.01 * SCAN, clearance=level)
    assert car.drive(1.0, clearance=-1.4).report.clearance.state == State.OK
    assert not car.faults_since(end)


@pytest.mark.parametrize("at", range(15, 55, SCAN))
def test_an_outlier_after_a_jump_back_is_not_where_the_car_is(car: Car, at: int) -> None:
    car.drive(2.0, clearance=4.0)
    end = car.number
    for k in range(150):
        verdict = car.step(clearance=-1.5 * (at <= k < at + SCAN)).report.clearance
    assert verdict.state == State.OK and not car.faults_since(end)


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


def test_a_clearance_that_was_missing_may_see_another_part_of_the_car(car: Car) -> None:
    car.drive(1.0, clearance_is=nan)
    start = car.number
    assert car.drive(2.0, clearance=2.0).report.clearance.state == State.OK
    assert not car.faults_since(start)
    car.drive(1.0, clearance=2.0, clearance_is=nan)
    car.drive(1.0, clearance=6.0)
    assert "clearance" in car.faults_since(start)


def test_a_gap_in_the_path_is_no_agreement(car: Car) -> None:
    """Three seconds after the gap its window begins where no scan is."""
    both = {"clearance": 4.0, "relative_velocity": -10.0}
    car.drive(0.5, **both)
    car.radar_silent = True
    car.drive(0.35, **both)
    car.radar_silent = False
    report = car.drive(4.0, **both).report
    assert report.clearance.state == report.relative_velocity.state == State.FAULT
    assert not any("lost" in o.report.clearance.reason for o in car.outcomes)
    end = car.number
    report = car.drive(1.5).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(end)


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


def test_an_id_that_is_another_cars_by_now_is_no_fault(car: Car) -> None:
    see(car, 2, 60.0, 6.0, 20)
    start = car.number
    see(car, 1, 30.0, 0.0, 4)
    see(car, 2, 95.0, 6.0, 20)
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


def test_a_relative_velocity_that_makes_the_path_is_believed_behind_a_braking_lead(car: Car):
    """What the clearance makes of it is vague while the lead's acceleration changes."""
    car.clearance, car.track_id = 60.0, 2
    car.drive(5.0)
    car.drive(2.0, relative_velocity=-2.0)
    car.lead_acceleration = -8.0
    car.drive(1.0, relative_velocity=-2.0)
    end = car.number
    for acceleration in (-4.0, 2.0, 4.0, 3.0):
        car.lead_acceleration = acceleration
        car.drive(0.5)
    believed = [o.report.relative_velocity.state for o in car.outcomes[end:]].index(State.OK)
    assert believed * 0.01 <= 0.7
    assert not car.faults_since(end)


def test_a_quiet_radar_that_gets_as_noisy_as_others_is_not_faulty() -> None:
    car = Car()
    car.velocity = 1.0
    for _ in range(2000):
        car.step(clearance_is=round(car.clearance, 2), relative_velocity_is=car.velocity)
    start = car.number
    car.drive(5.0)
    assert not car.faults_since(start)


def test_an_offset_in_the_midst_of_noise_is_named_offset(car: Car) -> None:
    """The jump adds to the roughness; what is rough is believed again as soon as it is smooth."""
    for k in range(4):
        car.drive(0.01 * SCAN, clearance=0.35 * (-1.0) ** k)
    start = car.number
    verdict = car.drive(4.0, clearance=-4.0).report.clearance
    assert verdict.state == State.FAULT and "offset by prediction" in verdict.reason
    assert car.faults_since(start) == {"clearance", "radar"}


def test_a_car_that_brakes_to_rest_jerks_back(car: Car) -> None:
    """Its speed is no evidence for a moment then, and the observers are slower than the jerk."""
    start, braking = car.number, 0.0
    while car.speed > 0.1:
        braking = max(braking - 0.2, -6.0)
        car.speed += 0.01 * braking
        car.step(acceleration=braking)
    for k in range(200):
        swing = -3.0 * np.exp(-0.05 * k) * np.cos(0.14 * k)
        car.step(acceleration=swing, host_speed_is=0.0)
    assert not car.faults_since(start)


@pytest.fixture
def standing(car: Car) -> Car:
    """The car has come to rest, and its wheels say so."""
    start, braking = car.number, 0.0
    while car.speed > 0.02:
        braking = max(braking - 0.02, -2.0)
        car.speed += 0.01 * braking
        car.step(acceleration=braking)
    car.speed = 0.0
    car.drive(3.0, host_speed_is=0.0)
    assert not car.faults_since(start)
    return car


def test_a_wheel_is_as_rough_after_a_long_rest_as_it_was_before(standing: Car) -> None:
    start = standing.number
    standing.drive(120.0, host_speed_is=0.0)
    standing.drive_off(4.0)
    assert not standing.faults_since(start)


def test_what_shakes_a_standing_car_is_no_fault(standing: Car) -> None:
    random, start = Random(2), standing.number
    for _ in range(300):
        standing.step(acceleration=random.gauss(0.0, 0.9), host_speed_is=0.0)
    standing.drive_off(4.0)
    assert not standing.faults_since(start)


def test_before_a_car_that_stands_a_held_relative_velocity_makes_no_held_clearance(
    standing: Car,
) -> None:
    """It says that the clearance shrinks, which is the same for long, as it should be."""
    start, clearance = standing.number, standing.clearance
    standing.drive(5.0, host_speed_is=0.0, relative_velocity_is=-0.15, clearance_is=clearance)
    assert "clearance" not in standing.faults_since(start)


def test_before_a_car_that_stands_a_clearance_is_held_as_the_lead_drives_off(
    standing: Car,
) -> None:
    start, clearance, standing.lead_acceleration = standing.number, standing.clearance, 1.0
    standing.drive(2.0, host_speed_is=0.0, clearance_is=clearance)
    assert standing.faults_since(start) == {"clearance", "radar"}
    assert standing.outcomes[-1].report.clearance.kind == Kind.HOLD


@pytest.mark.parametrize("drift", [0.5, -0.5, -1.0])
def test_before_a_car_that_stands_a_relative_velocity_drifts_beside_a_clearance_that_stays(
    standing: Car, drift: float
) -> None:
    """No lead comes driving backward, and one that drives off does so faster."""
    start, clearance = standing.number, standing.clearance
    for k in range(400):
        drifted = 0.01 * k * drift
        standing.step(host_speed_is=0.0, relative_velocity_is=drifted, clearance_is=clearance)
    assert standing.faults_since(start) == {"relative_velocity", "radar"}
    assert standing.outcomes[-1].report.relative_velocity.kind == Kind.RAMP


def test_before_a_car_that_stands_a_relative_velocity_is_held_as_the_lead_drives_off(
    standing: Car,
) -> None:
    standing.lead_acceleration = 1.5
    standing.drive(1.2, host_speed_is=0.0)
    start, held = standing.number, standing.seen[1]
    standing.drive(2.0, host_speed_is=0.0, relative_velocity_is=held)
    assert standing.faults_since(start) == {"relative_velocity", "radar"}
    assert standing.delay("relative_velocity", start) <= 0.7
    assert standing.outcomes[-1].report.relative_velocity.kind == Kind.HOLD


def test_before_a_car_that_stands_a_lead_that_creeps_says_the_same(standing: Car) -> None:
    """Slower than 0.5 m/s it may stand as well."""
    standing.velocity, start = 0.4, standing.number
    standing.drive(8.0, host_speed_is=0.0, relative_velocity_is=0.4)
    assert not standing.faults_since(start)


class WanderingCar(Car):
    """Its radar sees now this, now that part of the lead."""

    def step(self, **faults: float) -> Outcome:
        beside = 0.2 * sin(2.0 * pi * 0.01 * self.number / 4.0)
        return super().step(**{"clearance": beside, **faults})


def test_a_held_relative_velocity_is_told_by_a_clearance_that_wanders() -> None:
    """Its wandering counts once, and the less the longer the relative velocity says the same."""
    car = WanderingCar()
    car.drive(30.0)
    assert not car.faults_since(0)
    start, held, car.lead_acceleration = car.number, car.seen[1], -1.0
    car.drive(2.5, relative_velocity_is=held)
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    assert car.delay("relative_velocity", start) <= 0.6


def test_a_lead_whose_relative_velocity_was_faulty_tells_of_no_held_one(car: Car) -> None:
    """It ends its braking while that is off; nobody saw it."""
    car.lead_acceleration = -1.5
    car.drive(1.5)
    start = car.number
    car.drive(1.0, relative_velocity=-10.0)
    car.lead_acceleration = 0.0
    car.drive(1.0, relative_velocity=-10.0)
    car.drive(0.7)
    held = car.seen[1]
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    start = car.number
    car.drive(1.0, relative_velocity_is=held)
    assert not car.faults_since(start)


def test_a_clearance_that_was_off_as_it_began_tells_of_no_held_relative_velocity(car: Car) -> None:
    """It comes back to another part of the lead."""
    car.velocity = 1.0
    car.drive(2.0)
    start = car.number
    car.drive(3.0, clearance=4.0)
    car.drive(0.3, clearance=4.0, relative_velocity_is=1.0)
    car.drive(0.9, clearance=0.5, relative_velocity_is=1.0)
    assert car.faults_since(start) == {"clearance", "radar"}


def test_a_radar_that_was_faulty_before_time_went_back_is_judged_as_any_other(car: Car) -> None:
    car.drive(3.0, clearance=4.0)
    car.drive(3.0)
    car.number = 0
    car.scanned = -1
    car.drive(12.0)
    start, held, car.lead_acceleration = len(car.outcomes), car.seen[1], -1.0
    car.drive(2.5, relative_velocity_is=held)
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    assert car.delay("relative_velocity", start) <= 0.65


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


@pytest.mark.parametrize("off", [0.9, 3.7])
def test_without_host_speed_one_scan_convicts_no_relative_velocity_that_rests(off: float) -> None:
    """Behind a standing lead it says zero for long."""
    car = Car(host_speed=False)
    car.drive(12.0)
    start, still = car.number, {"relative_velocity_is": 0.0}
    car.drive(4.0, **still)
    car.drive(0.05, clearance=off, **still)
    car.drive(2.0, **still)
    assert not car.faults_since(start)
    # What goes on being off is not the relative velocity's rest.
    for _ in range(200):
        car.velocity = 2.0
        car.step(**still)
    assert "relative_velocity" in car.faults_since(start)


@pytest.mark.parametrize(
    ("shift", "relative_velocity", "faulty"),
    [
        (1.9, 0.0, set()),
        (-1.9, 0.0, set()),
        (3.6, 0.0, {"clearance"}),
        (1.9, 5.0, {"clearance", "relative_velocity"}),
    ],
)
def test_a_radar_may_see_another_part_of_the_car_after_a_moment_without_it(
    car: Car, shift: float, relative_velocity: float, faulty: set
) -> None:
    start = car.number
    car.radar_silent = True
    car.drive(0.65)
    car.radar_silent = False
    car.drive(1.0, clearance=shift, relative_velocity=relative_velocity)
    assert car.faults_since(start) - {"radar"} == faulty


def test_a_wheel_that_swings_while_braking_hard_is_no_fault(car: Car) -> None:
    """The derivative of its speed swings to and fro; where it turns back it has no jerk."""
    start, braking = car.number, 0.0
    for k in range(150):
        braking = max(braking - 0.2, -8.0)
        car.speed += 0.01 * braking
        swing = 1.2 * np.sin(np.pi * (k - 30) / 8) if 30 <= k < 46 else 0.0
        car.step(acceleration=braking, host_speed=swing)
    assert not car.faults_since(start)


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


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_radar_that_goes_over_to_another_part_does_not_end_a_fault(car: Car, sign: float) -> None:
    """Off by as much the other way, the clearance agrees; the fault is over when it jumps back."""
    start = car.number
    car.drive(1.0, clearance=2.0 * sign)
    for wandered in (0.6, 1.2):
        car.drive(0.01 * SCAN, clearance=(2.0 - wandered) * sign)
    report = car.drive(3.0, clearance=0.2 * sign).report
    assert report.clearance.state == State.FAULT
    assert "did not jump back: it must agree for 5 s" in report.clearance.reason
    assert report.relative_velocity.state == State.OK
    end = car.number
    report = car.drive(1.5, clearance=-1.8 * sign).report
    assert report.clearance.state == report.relative_velocity.state == State.OK
    assert not car.faults_since(end)
    assert car.faults_since(start) == {"clearance", "radar"}


def test_a_fault_that_fades_is_over_when_it_has_agreed_for_long(car: Car) -> None:
    car.drive(1.0, clearance=2.0)
    for off in (1.4, 0.8, 0.2):
        car.drive(0.01 * SCAN, clearance=off)
    end = car.number
    requalify_time = DiagnosisSettings().requalify_time
    assert car.drive(requalify_time - 0.3).report.clearance.state == State.FAULT
    assert car.drive(0.6).report.clearance.state == State.OK
    assert not car.faults_since(end)


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


@pytest.mark.parametrize("host_speed", [True, False])
@pytest.mark.parametrize(
    ("radar_late", "host_late", "phase"), [(0, 12, 0), (0, 16, 8), (20, 0, 3), (20, 0, 5)]
)
def test_an_emergency_stop_behind_a_car_at_rest_is_no_fault_of_a_slow_radar(
    host_speed: bool, radar_late: int, host_late: int, phase: int
) -> None:
    """Braking ends at once; radar and host tell of it at different times."""
    car = Car(host_speed=host_speed)
    car.clearance, car.velocity = 300.0, -15.0
    seen = [(car.clearance, car.velocity)] * (radar_late + 1)
    felt = [(0.0, car.speed)] * (host_late + 1)

    def drive(steps: int, braking: float, off: float = 0.0) -> None:
        for _ in range(steps):
            change = max(0.01 * braking, -car.speed)
            car.speed += change
            car.velocity -= change
            seen.append((car.clearance, car.velocity))
            felt.append((100.0 * change, car.speed))
            (clearance, velocity), (acceleration, speed) = seen.pop(0), felt.pop(0)
            # At 10 Hz.
            car.radar_silent = car.number % (2 * SCAN) >= SCAN
            noise = car.random.normal(size=2).tolist()
            car.step(
                acceleration=acceleration,
                host_speed_is=speed,
                clearance_is=clearance + 0.05 * noise[0],
                relative_velocity_is=velocity + 0.03 * noise[1] + off,
            )

    drive(1500 + phase, 0.0)
    start = car.number
    for braking in np.linspace(0.0, -9.5, 45).tolist():
        drive(1, braking)
    drive(250, -9.5)
    assert car.faults_since(start) == set()
    # A fault is seen as soon as ever.
    start = car.number
    drive(50, 0.0, off=2.0)
    assert car.delay("relative_velocity", start) <= 0.2


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


def test_after_a_restart_the_road_may_have_another_slope(car: Car) -> None:
    car.drive(10.0, acceleration=0.8)
    car.drive(20.0, acceleration=1.6)
    car.go_unheard(10.0)
    start = len(car.outcomes)
    report = car.drive(5.0, acceleration=-1.4).report
    assert report.acceleration.state == State.OK
    assert not car.faults_since(start)


@pytest.mark.parametrize("gap", [0.35, 1.5, 5.5])
@pytest.mark.parametrize(
    ("fault", "names"),
    [
        ({"acceleration": 4.0}, {"acceleration"}),
        ({"clearance": 4.0, "relative_velocity": -10.0}, {"clearance", "relative_velocity"}),
    ],
)
def test_a_fault_goes_on_through_a_gap_of_all_inputs_and_its_end_is_no_other_one(
    car: Car, gap: float, fault: dict, names: set
) -> None:
    start = len(car.outcomes)
    car.drive(3.0, **fault)
    car.go_unheard(gap)
    car.drive(1.0, **fault)
    report = car.outcomes[-1].report
    assert {
        n
        for n in ("clearance", "relative_velocity", "acceleration", "host_speed")
        if getattr(report, n).state == State.FAULT
    } == names
    report = car.drive(4.0).report
    for name in names:
        assert getattr(report, name).state == State.OK
    events = [e for o in car.outcomes[start:] for e in o.events if e.fault.state == State.FAULT]
    assert sorted(e.signal for e in events if e.signal != "radar") == sorted(names)


@pytest.mark.parametrize("gap", [0.35, 2.0, 5.5])
def test_what_ended_in_a_gap_of_all_inputs_is_over(car: Car, gap: float) -> None:
    car.drive(3.0, acceleration=4.0)
    car.go_unheard(gap)
    start = len(car.outcomes)
    report = car.drive(2.0).report
    assert report.acceleration.state == report.clearance.state == State.OK
    car.drive(5.0)
    later = [o.report.acceleration.state for o in car.outcomes[start + 200 :]]
    assert set(later) == {State.OK}


@pytest.mark.parametrize("elsewhere", [0.0, 1.6, -3.0, 30.0])
@pytest.mark.parametrize("gap", [0.35, 2.0])
def test_another_lead_and_another_slope_after_a_gap_of_all_inputs_are_no_fault(
    car: Car, gap: float, elsewhere: float
) -> None:
    """Nor is a clock that was set, as which the gap may be none."""
    start = len(car.outcomes)
    car.go_unheard(gap)
    car.clearance += elsewhere
    assert not car.outcomes[-1].events
    report = car.drive(1.0, acceleration=1.0).report
    assert {report.clearance.state, report.relative_velocity.state} == {State.OK}
    car.drive(5.0, acceleration=1.0)
    assert not car.faults_since(start)


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


@pytest.mark.parametrize(
    ("times", "check", "faults"),
    [
        (2, True, set()),
        (5, True, set()),
        (5, False, {"clearance", "radar"}),
        (12, True, {"clearance", "relative_velocity", "radar"}),
    ],
)
def test_a_message_that_is_sent_again_for_a_moment_tells_nothing(times, check, faults) -> None:
    """Nor does the lead's braking end with it; what is sent for longer is held."""
    car = Car(check_repetition=check)
    car.clearance, car.velocity = 150.0, -14.0
    car.drive(4.0)
    car.lead_acceleration = -5.0
    car.drive(0.5)
    start = car.number
    while car.number % SCAN:
        car.step()
    said = {"clearance_is": car.clearance, "relative_velocity_is": car.velocity}
    car.drive(0.05 * times, **said)
    car.drive(1.0)
    assert car.faults_since(start) == faults


def test_a_calm_target_is_not_held_because_another_one_moved(car: Car) -> None:
    """A radar of coarse steps, whose relative velocity is the same from a target's first scan."""
    car.track_id, car.clearance, car.velocity = 2, 80.0, -8.0
    for _ in range(600):
        car.step(relative_velocity_is=-8.0 + 0.05 * round(0.8 * car.random.normal()))
    start = car.number
    car.track_id, car.clearance, car.velocity = 3, 60.0, -1.0
    report = car.drive(1.2, relative_velocity_is=-1.0).report
    assert report.relative_velocity.state == State.OK
    assert not car.faults_since(start)


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


def test_an_offset_that_can_no_longer_be_told_says_so_and_stays(car: Car) -> None:
    verdict = car.drive(15.0, clearance=2.0, relative_velocity=-4.0).report.clearance
    assert verdict.state == State.FAULT
    assert "can no longer be told" in verdict.reason
    assert verdict.confidence >= verdict.confidence_threshold
    end = car.number
    assert car.drive(2.0).report.clearance.state == State.OK, "the jump back ends it"
    assert not car.faults_since(end)


@pytest.mark.parametrize("outlier", [None, "before", "after", "third"])
def test_a_long_fault_ends_with_its_jump_back_whatever_became_of_the_reference(
    car: Car, outlier: str | None
) -> None:
    """The lead brakes while both signals are faulty, so that the coasted track is far off."""
    fault = {"clearance": -4.0, "relative_velocity": 5.0}
    car.track_id, car.clearance = 2, 60.0  # room to brake for as long
    car.drive(8.0)
    car.lead_acceleration = -0.4
    car.drive(12.0, **fault)
    while car.number % SCAN:
        car.step(**fault)
    spike = {"clearance": fault["clearance"] - 3.0, "relative_velocity": 5.0}
    for _ in range(SCAN):
        car.step(**(spike if outlier == "before" else fault))
    for scan in ("after", "second", "third"):
        car.drive(0.01 * SCAN, clearance=-3.0 if outlier == scan else 0.0)
    report = car.drive(1.5).report
    assert {report.clearance.state, report.relative_velocity.state} == {State.OK}
    assert car.outcomes[-1].reconstruction.clearance == pytest.approx(car.clearance, abs=0.3)


def test_a_fault_is_not_over_because_the_coasted_track_comes_near_to_it(car: Car) -> None:
    """The lead stops braking and accelerates while nothing sees it: what is expected of the
    relative velocity goes to where the fault is, but the clearance does not follow that."""
    car.lead_acceleration = -1.6
    car.drive(1.0)
    fault = {"clearance": 4.0, "relative_velocity": -10.0}
    car.drive(0.2, **fault)
    start = car.number
    for k in range(800):
        car.lead_acceleration = min(-1.6 + 0.012 * k, 1.5)
        car.step(**fault)
    states = {
        (o.report.clearance.state, o.report.relative_velocity.state) for o in car.outcomes[start:]
    }
    assert states == {(State.FAULT, State.FAULT)}
    end = car.number
    report = car.drive(1.5).report
    assert {report.clearance.state, report.relative_velocity.state} == {State.OK}
    car.drive(5.0)
    assert not car.faults_since(end)


def test_a_radar_that_says_the_same_again_and_again_is_told_and_believed_again(car: Car) -> None:
    """Both signals are held while the lead brakes: what they taught the track is taken back."""
    car.lead_acceleration = -1.0
    car.drive(1.0)
    start = car.number
    clearance, velocity = car.seen
    judged = 0
    for _ in range(300):
        outcome = car.step(clearance_is=clearance, relative_velocity_is=velocity)
        now = outcome.reconstruction
        valid = now.clearance_valid and now.relative_velocity_valid
        if valid and outcome.report.clearance.state == State.FAULT:
            judged += 1
            assert abs(now.clearance - car.clearance) < 2.0 * now.clearance_std
            assert abs(now.relative_velocity - car.velocity) < 2.0 * now.relative_velocity_std
    assert judged > 100
    assert car.faults_since(start) == {"clearance", "relative_velocity", "radar"}
    last = car.outcomes[-1]
    assert {last.report.clearance.kind, last.report.relative_velocity.kind} == {Kind.HOLD}
    end = car.number
    report = car.drive(1.5).report
    assert {report.clearance.state, report.relative_velocity.state} == {State.OK}
    assert not car.faults_since(end)


def test_a_lead_behind_the_own_bumper_is_no_reconstruction(car: Car) -> None:
    car.lead_acceleration = -2.0
    below = above = 0
    for _ in range(600):
        now = car.step(clearance=4.0).reconstruction
        if car.clearance > 0.5:
            above += now.clearance_valid
        elif car.clearance < -0.5:
            below += 1
            assert not now.clearance_valid and isnan(now.clearance)
    assert above > 300 and below > 10


def test_without_latch_agreement_alone_clears(car: Car) -> None:
    car.diagnosis = RobustDiagnosis(DiagnosisSettings(latch=False))
    car.drive(8.0)
    car.drive(15.0, clearance=2.0, relative_velocity=-4.0)
    states = {o.report.clearance.state for o in car.outcomes[-500:]}
    assert State.OK in states


def test_reset_forgets_faults(car: Car) -> None:
    car.drive(1.0, clearance=4.0)
    car.diagnosis.reset()
    verdict = car.step(clearance=4.0).report.clearance
    assert verdict.state == State.NOT_READY and "reset" in verdict.reason


def test_reconstruction_stands_in_for_faulty_signals(car: Car) -> None:
    start = car.number
    car.drive(1.0, clearance=4.0, relative_velocity=-10.0, acceleration=4.0)
    for outcome in car.outcomes[start + 15 :]:
        now = outcome.reconstruction
        assert now.clearance_valid and now.clearance == pytest.approx(car.clearance, abs=0.5)
        assert now.relative_velocity == pytest.approx(0.0, abs=0.5)
        assert now.acceleration == pytest.approx(0.0, abs=0.6)
    now = car.drive(20.0, clearance=4.0, relative_velocity=-10.0).reconstruction
    assert not now.clearance_valid and isnan(now.clearance) and "not known better" in now.reason


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


@pytest.mark.parametrize("offset", [2.0, -4.0])
def test_a_steady_lead_behind_a_faulty_clearance_is_no_held_radar(offset) -> None:
    """A relative velocity in coarse steps says the same again and again where nothing changes."""
    car = Car()
    for _ in range(2500):
        seen = 0.1 * round(car.random.normal(0.0, 0.05) / 0.1)
        car.step(relative_velocity_is=seen)
    start = car.number
    car.drive(1.5, clearance=offset, relative_velocity_is=0.1)
    assert car.faults_since(start) - {"radar"} == {"clearance"}


def test_one_step_of_a_coarse_relative_velocity_is_no_leap_to_zero() -> None:
    """Such a sensor says zero for seconds."""
    car = Car()
    for k in range(500):
        car.drive(0.05, relative_velocity_is=-0.25 if k % 8 == 0 else 0.0)
    start = car.number
    car.drive(0.25, relative_velocity_is=-0.25)
    car.drive(2.5, relative_velocity_is=0.0)
    assert not car.faults_since(start)


@pytest.mark.parametrize("offset", [2.0, -2.0])
def test_a_fault_soon_after_the_start_is_seen_and_hides_no_other(offset) -> None:
    car = Car()
    car.drive(1.5)
    for _ in range(3):
        start = car.number
        car.drive(4.0, clearance=offset)
        assert car.faults_since(start) - {"radar"} == {"clearance"}
        assert car.delay("clearance", start) <= 0.13
        assert car.drive(4.0).report.clearance.state == State.OK


def test_what_stays_on_one_side_is_no_noise(car: Car) -> None:
    """A shift below the limit must not widen it."""
    for k in range(21):
        car.drive(1.0, clearance=1.2 * (k % 2))
    start = car.number
    car.drive(1.0, clearance=2.0)
    assert "clearance" in car.faults_since(start) and car.delay("clearance", start) <= 0.13


def test_a_clearance_that_wanders_tells_less_of_a_relative_velocity(car: Car) -> None:
    """A real radar sees now this, now that part of a car, for some scans each."""
    wanders = np.cumsum(car.random.normal(0.0, 0.04, 6000))
    wanders -= np.convolve(wanders, np.ones(300) / 300, "same")
    for k in range(4000):
        car.step(clearance=wanders[k])
    start = car.number
    for k in range(4000, 4400):
        now = car.step(clearance=wanders[k], relative_velocity=2.0).reconstruction
        if k > 4020:
            assert now.relative_velocity == pytest.approx(0.0, abs=0.7)
            assert abs(now.relative_velocity) < 3.0 * now.relative_velocity_std
    assert car.faults_since(start) - {"radar"} == {"relative_velocity"}


def test_a_coasted_clearance_is_known_worse_as_the_radars_wander_goes_on(car: Car) -> None:
    """The relative velocity carries it; what a healthy clearance would wander to is not seen."""
    wanders = np.cumsum(car.random.normal(0.0, 0.04, 6000))
    wanders -= np.convolve(wanders, np.ones(300) / 300, "same")
    for k in range(4000):
        car.step(clearance=wanders[k])
    stds = [
        car.step(clearance=wanders[k] + 4.0).reconstruction.clearance_std for k in range(4000, 4400)
    ]
    assert stds[-1] > 1.15 * stds[30]
    calm = Car()
    calm.drive(40.0)
    stds = [calm.step(clearance=4.0).reconstruction.clearance_std for _ in range(400)]
    assert stds[-1] < 1.5 * stds[30]


@pytest.mark.parametrize("offset", [2.0, -1.5])
def test_an_offset_of_a_steady_relative_velocity_stays_an_offset(offset) -> None:
    """Equal samples that began after the fault make no hold of it."""
    car = Car()
    for k in range(2900):
        if k < 2500:
            seen = 0.5 * round(car.random.normal(0.0, 0.2) / 0.5)
        else:
            seen = offset + 0.5 * (2510 <= k < 2530)
        car.step(relative_velocity_is=seen)
    verdict = car.outcomes[-1].report.relative_velocity
    assert verdict.state == State.FAULT and verdict.kind == Kind.OFFSET
    assert verdict.size == pytest.approx(offset, abs=0.6)


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


def test_silence_says_no_data_for_all(car: Car) -> None:
    report, events = car.diagnosis.silence(10**10)
    assert {report.radar.state, report.acceleration.state, report.host_speed.state} == {
        State.NO_DATA
    }
    assert report.step == 0 and len(events) >= 4


def test_each_mechanism_can_be_switched_off() -> None:
    quiet = Car(check_repetition=False)
    quiet.drive(8.0)
    start = quiet.number
    quiet.drive(1.0, acceleration_is=0.01)
    assert not quiet.faults_since(start)
    deaf = Car(use_host_speed=False, use_observers=False, use_lead_report=False)
    deaf.drive(8.0)
    start = deaf.number
    report = deaf.drive(2.0, acceleration=4.0).report
    assert "acceleration" not in deaf.faults_since(start)
    assert report.host_speed.state == State.NOT_READY
    with pytest.raises(ValidationError, match="scan_confidence_max"):
        DiagnosisSettings(scan_confidence_max=2)


def test_non_finite_inputs_never_count_as_agreement() -> None:
    diagnosis = RobustDiagnosis(DiagnosisSettings())
    for step in range(1, 200):
        horizon = make_horizon(
            step,
            measured_clearance=nan,
            measured_relative_velocity=nan,
            clearance_age=nan,
            relative_velocity_age=nan,
            clearance_stale=True,
            relative_velocity_stale=True,
            acceleration_stale=True,
            measured_acceleration=nan,
            acceleration_age=nan,
            host_speed_stale=True,
            measured_host_speed=nan,
            host_speed_age=nan,
        )
        report = diagnosis.step(horizon, None).report
    assert report.radar.state == report.acceleration.state == State.NO_DATA
    assert report.host_speed.state == State.NO_DATA


def test_a_vague_prediction_tells_nothing_of_the_noise() -> None:
    noise = make_state(LEARNT_NOISE)[0]
    start_noise(noise, 0.1, 0.01, 1.0, True, 400)
    learn_noise(noise, 20.0, 31.0 * 0.1**2)
    assert deviation(noise) == pytest.approx(0.1)
    learn_noise(noise, 20.0, 29.0 * 0.1**2)
    assert deviation(noise) > 0.2


def test_noise_is_learnt_from_a_first_value_within_limits() -> None:
    noise, fixed = make_state(LEARNT_NOISE)[0], make_state(LEARNT_NOISE)[0]
    start_noise(noise, 0.15, 0.03, 1.5, True, 400)
    start_noise(fixed, 0.15, 0.03, 1.5, False, 400)
    random = Random(3)
    for value in [random.gauss(0.0, 0.05) for _ in range(3000)]:
        learn_noise(noise, value, 0.0)
    assert deviation(noise) == pytest.approx(0.05, rel=0.1)
    for _ in range(3000):
        learn_noise(noise, 0.0, 0.0)
    assert deviation(noise) == pytest.approx(0.03)
    learn_noise(fixed, 9.0, 0.0)
    assert deviation(fixed) == pytest.approx(0.15)


def test_roughness_is_blind_to_smooth_motion_and_to_one_outlier() -> None:
    roughness = make_state(ROUGHNESS)[0]
    start_roughness(roughness, 16)
    random = Random(4)
    for k in range(200):
        value = 0.001 * k**2 + random.gauss(0.0, 0.05) + (k == 150)
        take_roughness(roughness, 0.05 * k, value, True, 0.0)
        assert not is_rough(roughness)
    for k in range(200, 216):
        take_roughness(roughness, 0.05 * k, random.gauss(0.0, 1.0), False, 0.0)
    assert is_rough(roughness)


def test_repetition_is_told_from_what_the_signal_used_to_do() -> None:
    lively, lazy = make_state(REPETITION)[0], make_state(REPETITION)[0]
    start_repetition(lively, 8)
    start_repetition(lazy, 8)
    random = Random(5)
    for _ in range(2000):
        take_repetition(lively, random.gauss(0.0, 1.0), True)
        take_repetition(lazy, float(random.randrange(2)), True)
    take_repetition(lively, 1.0, True)
    take_repetition(lazy, 5.0, True)
    for _ in range(8):
        assert not is_frozen(lively, True)
        take_repetition(lively, 1.0, True)
        take_repetition(lazy, 5.0, True)
        note_change(lively, True)
        note_change(lazy, True)
    assert is_frozen(lively, True)
    for _ in range(7):
        assert not is_frozen(lazy, True)
        take_repetition(lazy, 5.0, True)
        note_change(lazy, True)


def test_a_run_that_nothing_told_does_not_hide_the_next_hold_for_ever() -> None:
    signal = make_state(REPETITION)[0]
    start_repetition(signal, 8)
    random = Random(6)

    def lively(count: int) -> None:
        for _ in range(count):
            take_repetition(signal, float(random.randrange(3)), True)

    lively(1000)
    for _ in range(100):
        take_repetition(signal, 5.0, True)
        note_change(signal, False)
    lively(500)
    # Chance makes eleven of them, or thirteen; twice as many are none, however long the run before.
    take_repetition(signal, 5.0, True)
    for k in range(40):
        take_repetition(signal, 5.0, True)
        note_change(signal, True)
        assert k < 30 or is_frozen(signal, True)
        assert k > 20 or not is_frozen(signal, True)


def test_a_value_that_should_have_changed_only_now_is_not_held_yet() -> None:
    signal = make_state(REPETITION)[0]
    start_repetition(signal, 8)
    random = Random(6)
    for _ in range(500):
        take_repetition(signal, random.gauss(0.0, 1.0), True)
    for _ in range(12):
        take_repetition(signal, 5.0, True)
        note_change(signal, False)
    note_change(signal, True)
    assert not is_frozen(signal, True)
    take_repetition(signal, 5.0, True)
    note_change(signal, True)
    assert is_frozen(signal, True)


def test_the_track_follows_and_coasts_as_it_is_driven() -> None:
    track = make_state(LEAD_TRACK)[0]
    start_track(track, 30.0, 0.0, 0.0, 0.1**2, 0.05**2)
    clearance, velocity = 30.0, 0.0
    for k in range(300):
        velocity += 0.01 * (1.0 - 0.5)
        clearance += 0.01 * velocity
        predict_track(track, 0.01, 0.5, 1.0, 0.0, 3.0)
        if k % 5 == 0:
            correct_clearance(track, clearance - track["clearance"], 0.1**2)
            correct_velocity(track, velocity - track["velocity"], 0.05**2)
    assert track["acceleration"] == pytest.approx(1.0, abs=0.05)
    assert track["velocity"] == pytest.approx(velocity, abs=0.02)
    before = float(track["vv"])
    predict_track(track, 0.01, 0.5, 1.0, 0.0, 3.0)
    assert track["vv"] > before
