"""The robust profile without ROS: signals that repeat themselves, held ones and healthy ones."""

from math import pi, sin
from types import SimpleNamespace

import numpy as np
import pytest
from robust_car import SCAN, Car

from lfd_diagnosis.verdict import Kind, Outcome, State


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


def test_before_a_car_that_stands_a_clearance_of_zero_is_called_so(standing: Car) -> None:
    """It says the same as rightly as before, but it jumped there."""
    start = standing.number
    standing.drive(2.0, host_speed_is=0.0, clearance_is=0.0)
    assert standing.faults_since(start) == {"clearance", "radar"}
    said = [o.report.clearance for o in standing.outcomes[start + 40 :]]
    assert {verdict.kind for verdict in said} == {Kind.ZERO}


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


def test_a_car_that_backs_off_from_a_lead_at_rest_holds_no_clearance() -> None:
    """It said the same while the car stood, which counts no more as it moves a first step."""
    car = Car()
    car.rounded = {"clearance": 0.2, "relative_velocity": 0.25}
    car.follow_unsteady(20, seed=1)
    car.clearance, car.velocity, car.lead_acceleration = 30.0, 0.0, 0.0
    car.brake(2.0, 2.0, to=0.0)
    # So far that it may move by most of a step.
    car.speed, car.clearance = 0.0, 29.91
    car.drive(1.0, host_speed_is=0.0)
    start = car.number
    for acceleration in [0.0] * 2000 + [-1.2] * 100 + [1.2] * 100 + [0.0] * 200:
        car.speed = min(car.speed + 0.01 * acceleration, 0.0)
        car.velocity = -car.speed
        car.step(
            acceleration=acceleration,
            host_speed_is=-car.speed,
            clearance_is=0.2 * round(car.clearance / 0.2),
            relative_velocity_is=0.25 * round(car.velocity / 0.25),
        )
    assert not car.faults_since(start)


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
    ("times", "check", "faults"),
    [
        (2, True, set()),
        (5, True, set()),
        (5, False, {"relative_velocity", "radar"}),
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


@pytest.mark.parametrize(("clearance", "velocity"), [(30.0, -0.34), (0.0, 0.0)])
def test_without_host_speed_a_radar_that_is_held_as_a_whole_is_named_as_a_whole(
    clearance: float, velocity: float
) -> None:
    car = Car(host_speed=False)
    car.drive(12.0)
    start, car.lead_acceleration = car.number, -0.5
    car.drive(4.0, clearance_is=clearance, relative_velocity_is=velocity)
    assert {"clearance", "relative_velocity"} <= car.faults_since(start)


@pytest.mark.parametrize(
    ("settings", "kind"), [({}, Kind.HOLD), ({"check_repetition": False}, Kind.OFFSET)]
)
def test_where_repetition_is_not_looked_for_nothing_is_named_so(settings, kind: Kind) -> None:
    car = Car(**settings)
    car.drive(10.0)
    verdict = car.drive(2.0, relative_velocity_is=10.0).report.relative_velocity
    assert (verdict.state, verdict.kind) == (State.FAULT, kind)


@pytest.mark.parametrize(("least", "faults"), [(1.9, set()), (2.1, {"clearance"})])
def test_a_radars_least_clearance_is_not_held(least: float, faults: set) -> None:
    """In a jam the lead comes nearer than the radar can tell."""
    car = Car()
    car.clearance = 5.0
    car.drive(4.0)
    car.lead_acceleration = -0.7
    while car.clearance > 2.2:
        car.step()
    start, car.lead_acceleration = car.number, 0.0
    while car.clearance > 1.2:
        car.step(clearance_is=max(car.clearance, least))
    assert car.faults_since(start) - {"radar"} == faults


@pytest.mark.parametrize("speed_from", [0.0, 2.0])
def test_an_accelerometer_that_never_says_anything_else_is_found(speed_from: float) -> None:
    car = Car(host_speed=False)
    if speed_from:
        car.drive(speed_from, acceleration_is=0.03)
    car.host_speed = True
    for k in range(1200):
        car.speed += 0.01 * 0.5 * sin(2.0 * pi * k / 400)
        car.step(acceleration_is=0.03)
    assert car.faults_since(0) == {"acceleration"}
    assert car.outcomes[-1].report.acceleration.kind == Kind.HOLD


def test_a_held_signal_is_never_said_to_be_told_from_a_healthy_one_no_longer(car: Car) -> None:
    """It shows itself by moving, however far the track was coasted."""
    start, held, car.lead_acceleration = len(car.outcomes), car.seen[1], -1.0
    car.drive(3.0, relative_velocity_is=held)
    verdicts = [outcome.report.relative_velocity for outcome in car.outcomes[start:]]
    reasons = {verdict.reason for verdict in verdicts if verdict.state == State.FAULT}
    assert reasons and not any("can no longer be told" in reason for reason in reasons)
    car.lead_acceleration = 0.0
    assert car.drive(1.0).report.relative_velocity.state == State.OK


@pytest.mark.parametrize("seed", [0, 2, 3])
def test_a_coarse_clearance_that_was_held_is_believed_as_soon(seed: int) -> None:
    """It repeats itself for a moment when it is right, too."""
    car = Car()
    car.random = np.random.default_rng(seed)
    car.rounded["clearance"] = 0.5
    car.follow_unsteady(15, seed)
    held = car.seen[0]
    for _ in range(6):
        back = 0.05 * (car.clearance - 30.0) + 0.4 * car.velocity
        car.lead_acceleration = float(np.clip(car.random.normal() - back, -2.5, 2.5))
        car.drive(0.7, clearance_is=held)
    assert car.outcomes[-1].report.clearance.state == State.FAULT
    start = car.number
    car.follow_unsteady(3, seed + 50)
    states = [outcome.report.clearance.state for outcome in car.outcomes[start:]]
    assert State.FAULT not in states[60:]


class NoiselessCar(Car):
    """As a simulator says it, in steps of a millimetre; `steady`: behind a lead just as fast."""

    def __init__(self, host_speed: bool = True) -> None:
        super().__init__(host_speed)
        self.random = SimpleNamespace(normal=lambda size: np.zeros(size))
        names = ("clearance", "relative_velocity", "acceleration", "host_speed")
        self.rounded = dict.fromkeys(names, 0.001)
        self.follow_unsteady(30, 1)

    def be_steady(self, seconds: float) -> None:
        while abs(self.velocity) > 0.005:
            self.lead_acceleration = -self.velocity
            self.step()
        self.velocity = self.lead_acceleration = 0.0
        self.drive(seconds)


@pytest.mark.parametrize("host_speed", [True, False])
def test_a_simulators_steady_drive_is_no_held_sensor(host_speed: bool) -> None:
    """Nothing moves, and there is no noise that would."""
    car = NoiselessCar(host_speed)
    start = car.number
    car.be_steady(60.0)
    assert not car.faults_since(start)
    start = car.number
    car.drive(1.0, clearance=2.0)
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize("signals", [("clearance", "relative_velocity"), ("relative_velocity",)])
def test_what_a_simulator_holds_while_the_lead_brakes_is_found(signals: tuple[str, ...]) -> None:
    car = NoiselessCar()
    car.be_steady(20.0)
    start, car.lead_acceleration = car.number, -1.0
    car.drive(0.6)
    car.drive(2.0, **{f"{name}_is": car.seen[name == "relative_velocity"] for name in signals})
    assert car.faults_since(start) - {"radar"} == set(signals)


def test_a_simulators_car_that_brakes_at_once_has_no_held_speed() -> None:
    """So does its lead; its speed said the same for long before."""
    car = NoiselessCar()
    for k in range(2000):
        felt = 0.5 * sin(0.01 * k)
        car.speed += 0.01 * felt
        car.step(acceleration=felt)
    car.be_steady(20.0)
    start, car.lead_acceleration = car.number, -0.5
    for _ in range(200):
        car.speed -= 0.04
        car.step(acceleration=-4.0)
    assert not car.faults_since(start)
    assert car.outcomes[-1].report.host_speed.state == State.OK


@pytest.mark.parametrize(("noise", "faulty"), [(0.04, set()), (0.4, {"acceleration"})])
def test_an_accelerometer_without_noise_is_not_rough_for_having_a_little(
    noise: float, faulty: set[str]
) -> None:
    car, random = NoiselessCar(), np.random.default_rng(1)
    for k in range(3300):
        if k == 3000:
            start = car.number
        felt = 0.5 * sin(0.01 * k)
        car.speed += 0.01 * felt
        car.step(acceleration=felt + (noise * random.normal() if k >= 3000 else 0.0))
    assert car.faults_since(start) == faulty


@pytest.mark.parametrize("rows", [2, 3])
def test_an_outlier_in_a_table_that_repeats_each_scan_is_one_outlier(rows: int) -> None:
    car = Car()
    car.scan = 2
    start = car.number

    def scan(**faults: float) -> None:
        for k in range(car.scan * rows):
            repeats = {"clearance_is": car.seen[0], "relative_velocity_is": car.seen[1]}
            car.step(**(faults if k < car.scan else repeats))

    for number in range(100):
        scan(**({"clearance": 4.0} if number == 60 else {}))
    assert not car.faults_since(start)
    start = car.number
    for _ in range(5):
        scan(clearance=4.0)
    assert car.faults_since(start) == {"clearance", "radar"}


@pytest.mark.parametrize(("scans_a_second", "decimals"), [(10, 2), (10, 3), (10, 12), (20, 12)])
def test_a_line_from_one_car_to_another_is_no_fault(scans_a_second: int, decimals: int) -> None:
    """A table of 50 rows a second that is interpolated between fewer scans."""
    car = Car()
    car.scan = 2
    random = np.random.default_rng(4)
    scans = np.arange(20 * scans_a_second) / scans_a_second
    velocity = 0.8 * np.sin(0.7 * scans) + random.normal(0.0, 0.02, len(scans))
    clearance = 30.0 - 0.8 / 0.7 * np.cos(0.7 * scans) + random.normal(0.0, 0.05, len(scans))
    others = (scans > 8.0) & (scans < 14.0)
    clearance[others] += 12.0 + 0.4 * (scans[others] - 8.0)
    velocity[others] += 0.4

    def drive(seconds: float, off: float = 0.0) -> None:
        for _ in range(round(100 * seconds)):
            now = 0.01 * (car.number + 1)
            car.track_id = 1 + int(others[int(scans_a_second * now + 1e-9)])
            car.step(
                clearance_is=round(float(np.interp(now, scans, clearance)), decimals) + off,
                relative_velocity_is=round(float(np.interp(now, scans, velocity)), decimals),
            )

    drive(17.0)
    assert not car.faults_since(0)
    start = car.number
    drive(0.2, off=2.0)
    assert car.faults_since(start) == {"clearance", "radar"}


def test_what_repeats_itself_beside_a_held_clearance_is_less_sure_the_longer_it_does() -> None:
    """Coarse steps may say the same for seconds by chance, or because the whole radar is held."""
    found = 0
    for seed in range(6):
        car = Car()
        car.random = np.random.default_rng(seed)
        car.rounded |= {"clearance": 0.2, "relative_velocity": 0.25}
        car.follow_unsteady(25, seed)
        held = {"clearance_is": car.seen[0], "relative_velocity_is": car.seen[1]}
        car.lead_acceleration = 1.0
        for _ in range(400):
            outcome = car.step(**held)
            made = outcome.reconstruction
            if outcome.report.clearance.state == State.FAULT and made.relative_velocity_valid:
                off = abs(made.relative_velocity - car.velocity)
                assert off < 4.0 * made.relative_velocity_std
        found += outcome.report.clearance.state == State.FAULT
    assert found >= 4, "a lead that is as fast, and stays so by both, tells nothing"


def test_without_host_speed_a_clearance_that_settles_holds_no_relative_velocity_at_rest() -> None:
    car = Car(host_speed=False)
    car.drive(12.0)
    car.speed, start = 0.0, car.number
    for k in range(3000):
        settled = 0.4 * min(k / 1000.0, 1.0)
        car.step(clearance=settled, relative_velocity_is=0.0)
    assert not car.faults_since(start)
