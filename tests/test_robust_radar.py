"""The robust radar signals without ROS: at, below and above their limits; outliers and drifts."""

from math import nan, pi, sin

import numpy as np
import pytest
from robust_car import SCAN, Car

from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind, State
from lfd_replay.evaluation.comparison import SMOOTH_RADAR


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


@pytest.mark.parametrize(
    ("first", "later", "settings", "faulty"),
    [
        (0.5, 0.9, {}, False),
        (0.0, 0.9, {}, True),
        (0.5, 1.2, {}, True),
        (0.5, 0.9, {"learn_noise": False}, True),
    ],
)
def test_a_relative_velocity_that_swung_may_swing_farther(
    first: float, later: float, settings: dict, faulty: bool
) -> None:
    """Than its noise tells, as it was seen to; an offset is told as soon afterwards."""
    car = Car(**settings)
    car.drive(12.0)
    _swing(car, first)
    _swing(car, -first)
    start = car.number
    _swing(car, later)
    assert car.faults_since(start) == ({"radar", "relative_velocity"} if faulty else set())
    start = car.number
    car.drive(0.5, relative_velocity=2.0)
    assert car.faults_since(start) == {"radar", "relative_velocity"}
    assert car.delay("relative_velocity", start) <= 0.1


@pytest.mark.parametrize(("said", "faulty"), [(0.0, True), (0.01, False)])
def test_a_relative_velocity_that_swung_does_not_swing_to_zero(
    car: Car, said: float, faulty: bool
) -> None:
    car.drive(12.0)
    _swing(car, 0.5)
    _swing(car, -0.5)
    car.lead_acceleration = -0.5
    car.drive(2.0)
    car.lead_acceleration = 0.0
    car.drive(1.0)
    start = car.number
    car.drive(0.02 * SCAN, relative_velocity_is=said)
    assert car.faults_since(start) == ({"radar", "relative_velocity"} if faulty else set())


def _swing(car: Car, size: float) -> None:
    """The relative velocity is off to one side for four scans, and to the other one."""
    for k in range(8):
        car.drive(0.01 * SCAN, relative_velocity=size * sin(2.0 * pi * (k + 0.5) / 8))
    car.drive(4.0)


def test_what_the_relative_velocity_did_as_its_fault_began_is_no_swing(car: Car) -> None:
    """A first scan within the limits does not widen them."""
    start = car.number
    for off in (0.6, 3.0, 3.0, 3.0):
        car.drive(0.01 * SCAN, relative_velocity=off)
    assert car.faults_since(start) == {"radar", "relative_velocity"}
    car.drive(6.0)
    assert "(limit 0.80)" in car.outcomes[-1].report.relative_velocity.reason


@pytest.mark.parametrize("held", [False, True])
def test_what_the_track_was_off_after_a_silence_or_a_hold_is_no_swing(car: Car, held: bool) -> None:
    car.lead_acceleration = 2.0
    car.drive(0.5)
    was = {"clearance_is": car.seen[0], "relative_velocity_is": car.seen[1]} if held else {}
    car.radar_silent = not held
    car.drive(4.0, **was)
    car.radar_silent, car.lead_acceleration = False, 0.0
    report = car.drive(5.0).report
    assert report.relative_velocity.state == State.OK
    assert "(limit 0.80)" in report.relative_velocity.reason
    start = car.number
    car.drive(0.3, relative_velocity=1.0)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


def test_a_slow_radar_that_swung_may_swing_as_far_again() -> None:
    """Where scans are rare nothing is known as well as the noise is small."""
    car = Car()
    car.scan = 15
    car.drive(4.0)
    for _ in range(2):
        # For two scans; still within the limits.
        car.drive(0.02 * car.scan, relative_velocity=0.7)
        car.drive(4.0)
    start = car.number
    car.drive(0.02 * car.scan, relative_velocity=0.95)
    car.drive(2.0)
    assert not car.faults_since(start)


@pytest.mark.parametrize("seed", [1, 3])
def test_a_value_between_the_steps_of_a_coarse_radar_makes_it_no_finer(seed: int) -> None:
    """As one that is made of two messages, or of a filter that settles."""
    car = Car()
    car.rounded = {"clearance": 1.0, "relative_velocity": 1.0}
    car.velocity = 0.5
    car.follow_unsteady(10, seed)
    clearance, velocity = car.seen
    car.drive(0.05, clearance_is=clearance + 0.4, relative_velocity_is=velocity + 0.4)
    start = car.number
    car.follow_unsteady(20, seed)
    assert not car.faults_since(start)


@pytest.mark.parametrize(("resolution", "seed"), [(0.5, 3), (1.0, 1), (1.0, 4)])
def test_a_ramp_of_the_relative_velocity_is_told_beside_a_coarse_clearance(
    resolution: float, seed: int
) -> None:
    car = Car()
    car.rounded = {"clearance": resolution}
    car.follow_unsteady(30, seed)
    start = car.number
    for k in range(600):
        # It stands still beside the host, then it does not.
        car.lead_acceleration = 0.0 if k % 200 < 100 else (0.5 if k % 400 < 200 else -0.5)
        car.step(relative_velocity=0.005 * k)
    assert car.faults_since(start) == {"relative_velocity", "radar"}


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
    assert ("1 single outlier rejected" in verdict.reason) is (expected == State.SUSPECT)


@pytest.mark.parametrize(("second", "scans"), [(-4.0, 2), (-2.5, 2), (-1.5, 3), (1.6, 3), (2.5, 2)])
def test_two_scans_that_are_off_by_different_amounts_are_two_outliers(
    car: Car, second: float, scans: int
) -> None:
    """Unless a third one is, too: no one fault makes both."""
    while car.number % SCAN:
        car.step()
    start = car.number
    for scan in range(3):
        car.drive(0.01 * SCAN, clearance=second if scan else -4.0)
        expected = {"radar", "clearance"} if scan + 1 >= scans else set()
        assert car.faults_since(start) == expected


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


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(
    ("went", "back_to", "faulty"),
    [(1.6, 0.1, False), (1.6, -0.1, False), (1.6, -0.8, True), (2.2, 0.0, True)],
)
def test_a_radar_that_jumps_back_to_the_part_it_saw_before_is_not_faulty(
    car: Car, side: float, went: float, back_to: float, faulty: bool
) -> None:
    """Though it went over to the other one little by little; nor is the end of an offset that was
    taken for that. A jump that leads elsewhere is, and one that is far."""
    for level in (0.5 * went, went):
        car.drive(SCAN * 0.01, clearance=side * level)
    car.drive(6.0, clearance=side * went)
    start = car.number
    car.drive(6.0, clearance=side * back_to)
    assert car.faults_since(start) == ({"clearance", "radar"} if faulty else set())


def test_what_another_target_did_tells_nothing_of_a_jump(car: Car) -> None:
    for level in (0.8, 1.6):
        car.drive(SCAN * 0.01, clearance=level)
    car.drive(6.0, clearance=1.6)
    car.track_id, car.clearance = 2, 60.0
    car.drive(6.0)
    start = car.number
    car.drive(1.0, clearance=-1.7)
    assert car.faults_since(start) == {"clearance", "radar"}


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


def test_a_lead_that_brakes_hard_is_nobodys_fault(car: Car) -> None:
    start = car.number
    car.lead_acceleration = -8.0
    car.drive(1.2)
    assert not car.faults_since(start)


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


@pytest.mark.parametrize(("offset", "within"), [(0.35, 2.5), (-0.5, 1.8), (0.7, 1.3)])
def test_a_small_step_of_the_relative_velocity_is_wrong_where_the_clearance_leaves_its_path(
    car: Car, offset: float, within: float
) -> None:
    """Within its limits; as far as they come apart by then no drift would be told."""
    start = car.number
    report = car.drive(3.0, relative_velocity=offset).report
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    assert car.delay("relative_velocity", start) <= within
    assert report.relative_velocity.kind == Kind.OFFSET
    assert report.relative_velocity.size == pytest.approx(offset, rel=0.2)
    assert abs(car.outcomes[-1].reconstruction.relative_velocity - car.velocity) < 0.2


@pytest.mark.parametrize("offset", [0.2, -0.2])
def test_a_step_of_the_relative_velocity_that_a_lead_may_make_tells_nothing(
    car: Car, offset: float
) -> None:
    start = car.number
    car.drive(3.0, relative_velocity=offset)
    assert not car.faults_since(start)


@pytest.mark.parametrize(("seconds", "drift"), [(0.06, 0.0), (0.5, 0.3), (0.5, -0.3)])
def test_a_lead_that_jerks_beside_a_clearance_that_wanders_is_no_step(
    car: Car, seconds: float, drift: float
) -> None:
    """A step that the clearance follows, or that did not come at once, is the lead's."""
    start = car.number
    car.lead_acceleration = -8.0
    car.drive(seconds)
    car.lead_acceleration = 0.0
    for k in range(250):
        car.step(clearance=drift * 0.01 * k)
    assert not car.faults_since(start)


def test_a_step_of_the_relative_velocity_that_goes_back_tells_nothing(car: Car) -> None:
    start = car.number
    car.drive(0.1, relative_velocity=0.5)
    for k in range(200):
        car.step(clearance=-0.004 * k)
    assert "relative_velocity" not in car.faults_since(start)


@pytest.mark.parametrize("rate", [0.3, 0.5, 0.7])
def test_a_lead_that_brakes_while_the_ids_change_in_every_scan_makes_no_step(
    car: Car, rate: float
) -> None:
    """The time between two ids counts as none: nothing tells how fast its speed changed in it."""
    start = car.number
    for k in range(60):
        car.track_id = 1 + (k // SCAN) % 2
        car.lead_acceleration = -6.0 if 30 <= k < 45 else 0.0
        car.step()
    for k in range(200):
        car.step(clearance=rate * 0.01 * k)
    assert "relative_velocity" not in car.faults_since(start)


def test_a_small_step_is_not_told_where_drifts_are_not_looked_for() -> None:
    car = Car(check_drift=False)
    car.drive(8.0)
    start = car.number
    car.drive(3.0, relative_velocity=0.5)
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


@pytest.mark.parametrize("offset", [4.0, 2.0, -2.0])
def test_a_clearance_that_jumps_while_the_relative_velocity_stays_faulty_is_faulty(
    car: Car, offset: float
) -> None:
    car.drive(1.0, relative_velocity=2.0)
    start = car.number
    car.drive(1.0, relative_velocity=2.0, clearance=offset)
    assert "clearance" in car.faults_since(start) and car.delay("clearance", start) <= 0.13


@pytest.mark.parametrize("acceleration", [-2.0, -1.0, 1.0, 2.0])
def test_a_fault_ends_though_its_reference_has_gone_astray_where_limits_are_narrow(
    acceleration: float,
) -> None:
    """What the lead does meanwhile nobody sees: the track is left behind from scan to scan."""
    car = Car(**SMOOTH_RADAR)
    car.clearance = 60.0
    car.drive(8.0)
    car.lead_acceleration = acceleration
    car.drive(4.0, clearance=4.0, relative_velocity=-10.0)
    report = car.drive(1.0).report
    assert report.clearance.state == report.relative_velocity.state == State.OK


@pytest.mark.parametrize("seed", [1, 10, 12, 23])
def test_the_end_of_a_fault_that_noise_is_not_small_against_is_no_level_between(seed: int) -> None:
    car = Car(**SMOOTH_RADAR)
    car.random = np.random.default_rng(seed)
    car.drive(8.0)
    assert car.drive(4.0 + 0.01 * seed, clearance=-0.5).report.clearance.state == State.FAULT
    assert car.drive(1.5).report.clearance.state == State.OK


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
    faults = car.faults_since(start) - {"radar"}
    assert verdict.state == State.FAULT and not faults - {"relative_velocity"}
    assert car.drive(1.5, clearance=2.4).report.relative_velocity.state == State.OK


@pytest.mark.parametrize("late", [0.2, 0.27])
def test_an_old_scan_that_ends_a_silence_makes_no_fault_of_the_next_one(
    car: Car, late: float
) -> None:
    """A logger that stalled hands over all that waited within a moment."""
    car.clearance, car.velocity, car.track_id = 120.0, -9.5, 2
    car.drive(4.0)
    start, car.radar_silent = car.number, True
    car.drive(0.3)
    car.seen, car.scanned = (car.clearance - late * car.velocity, car.velocity), car.number
    car.step()
    car.radar_silent = False
    car.seen, car.scanned = (car.clearance, car.velocity), car.number
    car.drive(3.0)
    assert not car.faults_since(start) - {"radar"}
    assert car.outcomes[-1].report.clearance.state == State.OK


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


@pytest.mark.parametrize(
    ("unseen", "shift", "relative_velocity", "faulty"),
    [
        (0.15, 1.9, 0.0, {"clearance"}),
        (0.3, 1.9, 0.0, set()),
        (0.65, 1.9, 0.0, set()),
        (0.65, -1.9, 0.0, set()),
        (0.65, 3.6, 0.0, {"clearance"}),
        (0.65, 1.9, 5.0, {"clearance", "relative_velocity"}),
    ],
)
def test_a_radar_may_see_another_part_of_the_car_after_a_moment_without_it(
    car: Car, unseen: float, shift: float, relative_velocity: float, faulty: set
) -> None:
    start = car.number
    car.radar_silent = True
    car.drive(unseen)
    car.radar_silent = False
    car.drive(1.0, clearance=shift, relative_velocity=relative_velocity)
    assert car.faults_since(start) - {"radar"} == faulty


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


@pytest.mark.parametrize(
    ("signal", "rate"),
    [
        ("relative_velocity", 0.5),
        ("relative_velocity", 1.0),
        ("clearance", 0.5),
        ("clearance", 0.8),
    ],
)
@pytest.mark.parametrize("phase", [0.0, 0.25, 0.5, 0.75])
def test_who_drifts_is_told_beside_a_clearance_that_wanders(
    signal: str, rate: float, phase: float
) -> None:
    car = Car()

    def step(off: float) -> None:
        wander = 0.1 * sin(2.0 * pi * (car.number / 300 + phase))
        faults = {"clearance": wander, "relative_velocity": 0.0}
        faults[signal] += off
        car.step(**faults)

    for _ in range(2000):
        step(0.0)
    start = car.number
    for k in range(500):
        step(0.01 * k * rate)
    assert car.faults_since(start) == {"radar", signal}


@pytest.mark.parametrize("seed", range(1, 13))
def test_an_outlier_long_before_is_no_part_of_a_fault(seed: int) -> None:
    """How large the fault is would be told by it: a small one would seem to be over, and the
    healthy clearance would be left to explain the difference."""
    car, random = Car(), np.random.default_rng(seed)

    def drive(seconds: float, off: float = 0.0) -> None:
        for _ in range(round(seconds * 100)):
            noise = random.normal(size=2).tolist()
            car.step(clearance=0.09 * noise[0], relative_velocity=off + 0.04 * noise[1])

    drive(12.0)
    drive(0.01 * SCAN, 6.0)
    drive(10.0)
    since = len(car.outcomes)
    drive(8.0, -0.78)
    begun = since + round(100 * car.delay("relative_velocity", since))
    states = {outcome.report.relative_velocity.state for outcome in car.outcomes[begun:]}
    assert states == {State.FAULT}
    drive(8.0)
    assert car.faults_since(since) == {"relative_velocity", "radar"}
    assert car.outcomes[-1].report.radar.state == State.OK


@pytest.mark.parametrize(
    ("wanders", "period", "noise", "off"), [(0.3, 4.0, 0.35, 1.5), (0.5, 5.0, 0.25, 1.8)]
)
def test_a_jump_back_is_told_beside_a_noise_that_is_overestimated(
    wanders: float, period: float, noise: float, off: float
) -> None:
    """What the clearance wanders and how rough it was makes agreement alone worth nothing."""
    car, random = Car(), np.random.default_rng(2)

    def drive(seconds: float, share: float, fault: float = 0.0) -> None:
        for _ in range(round(100 * seconds)):
            wander = wanders * np.sin(2.0 * np.pi * 0.01 * car.number / period)
            car.step(clearance=fault + wander + share * noise * random.normal())

    drive(8.0, 1.0)
    drive(4.0, 0.3, off)
    assert car.outcomes[-1].report.clearance.state == State.FAULT
    drive(1.0, 0.3)
    assert car.outcomes[-1].report.clearance.state == State.OK


@pytest.mark.parametrize(("wavers", "noise"), [(0.13, False), (0.19, True)])
def test_a_calm_clearance_may_waver_by_a_little(wavers: float, noise: bool) -> None:
    """Recorded radars change between two points of a car that lie a quarter of a metre apart."""
    car = Car()

    def drive(seconds: float, off: float) -> None:
        for _ in range(round(20 * seconds)):
            off = -off
            for _ in range(SCAN):
                car.step(clearance_is=car.clearance + off)

    drive(15.0, 0.002)
    since = len(car.outcomes)
    drive(3.0, wavers)
    assert car.faults_since(since) == ({"clearance", "radar"} if noise else set())
    if noise:
        assert car.outcomes[-1].report.clearance.kind == Kind.NOISE


@pytest.mark.parametrize("velocity", [-2.0, 1.75])
def test_an_offset_that_makes_a_coarse_relative_velocity_zero_for_a_while_is_still_there_after_it(
    velocity: float,
) -> None:
    car = Car()
    car.rounded["relative_velocity"] = 0.25
    car.follow_unsteady(20, 3)
    car.track_id, car.clearance = 2, 60.0
    car.velocity, car.lead_acceleration = velocity, 0.0
    car.drive(3.0)
    start = car.number
    for k in range(400):
        car.lead_acceleration = 0.0 if k < 60 else 0.5
        outcome = car.step(relative_velocity=-velocity)
        faulty = outcome.report.relative_velocity.state == State.FAULT
        assert faulty or k <= 2 * SCAN
    assert outcome.report.relative_velocity.kind == Kind.OFFSET
    assert car.faults_since(start) == {"relative_velocity", "radar"}
    assert car.drive(1.5).report.relative_velocity.state == State.OK


def test_how_late_a_relative_velocity_is_is_learnt() -> None:
    """By 0.3 s, beside a clearance that wanders: as it changes the two come apart."""
    car = Car()
    said: list[float] = []
    for k in range(12000):
        back = 0.03 * (car.clearance - 30.0) + 0.2 * car.velocity
        wanted = (1.0 if k < 3000 else 3.0) * sin(0.01 * k / 2.0) * sin(0.01 * k / 17.0) - back
        car.lead_acceleration += 0.02 * (wanted - car.lead_acceleration)
        said.append(car.velocity)
        late = said[max(k - 30, 0)] + 0.03 * car.random.standard_normal()
        wander = 0.15 * sin(0.01 * k * 2.0 * pi / 3.1)
        car.step(clearance=wander, relative_velocity_is=late)
    assert not car.faults_since(0)


@pytest.mark.parametrize(
    ("first", "right", "second"),
    [(4.0, 0.4, -4.0), (10.0, 0.5, -10.0), (4.0, 0.1, -2.0), (4.0, 0.1, 2.0), (3.0, 0.1, -3.0)],
)
def test_an_offset_that_begins_while_another_one_clears_is_no_jump_back(
    car: Car, first: float, right: float, second: float
) -> None:
    car.drive(3.0, clearance=first)
    car.drive(right)
    car.drive(0.1, clearance=second)
    start = car.number
    for _ in range(400):
        verdict = car.step(clearance=second).report.clearance
        assert verdict.state == State.FAULT
    assert abs(verdict.size - second) < 0.3
    assert car.drive(0.8).report.clearance.state == State.OK
    car.drive(5.0)
    assert not car.faults_since(start)


@pytest.mark.parametrize(
    ("name", "first", "later"),
    [
        ("clearance", 4.0, -4.0),
        ("clearance", 4.0, 8.0),
        ("clearance", 4.0, 2.0),
        ("relative_velocity", 3.0, 6.0),
        ("relative_velocity", 3.0, -1.5),
    ],
)
def test_an_offset_that_jumps_is_as_large_as_it_is_now(
    car: Car, name: str, first: float, later: float
) -> None:
    car.drive(3.0, **{name: first})
    verdict = getattr(car.drive(0.5, **{name: later}).report, name)
    assert abs(verdict.size - later) < 3.0 * verdict.size_std < 0.6
    verdict = getattr(car.drive(2.5, **{name: later}).report, name)
    assert abs(verdict.size - later) < 3.0 * verdict.size_std < 0.6
    start = car.number
    assert getattr(car.drive(0.8).report, name).state == State.OK
    assert not car.faults_since(start)


def test_an_outlier_of_an_offset_makes_no_other_offset_of_it(car: Car) -> None:
    car.drive(3.0, clearance=4.0)
    car.drive(0.05, clearance=24.0)
    verdict = car.drive(1.0, clearance=4.0).report.clearance
    assert abs(verdict.size - 4.0) < 3.0 * verdict.size_std
