"""The robust profile without ROS: what is named, how large and until when; silences and resets."""

from math import isnan, nan
from random import Random

import numpy as np
import pytest
from pydantic import ValidationError
from robust_car import SCAN, Car
from test_observer import make_horizon

from lfd_diagnosis.diagnosis import RobustDiagnosis
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.verdict import Kind, State


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


def test_radar_and_acceleration_at_once_are_all_named(car: Car) -> None:
    start = car.number
    car.drive(6.0, clearance=4.0, relative_velocity=-10.0, acceleration=4.0)
    assert car.faults_since(start) == {"clearance", "relative_velocity", "radar", "acceleration"}
    end = car.number
    report = car.drive(1.5).report
    assert {report.radar.state, report.acceleration.state} == {State.OK}
    assert not car.faults_since(end)


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


@pytest.mark.parametrize(
    ("signal", "evidence"), [("clearance", "prediction residual"), ("acceleration", "host speed")]
)
def test_a_reason_names_its_evidence_once(car: Car, signal: str, evidence: str) -> None:
    start = car.number
    car.drive(1.0, **{signal: 4.0})
    verdicts = [getattr(outcome.report, signal) for outcome in car.outcomes[start:]]
    reasons = [verdict.reason for verdict in verdicts if verdict.state == State.FAULT]
    assert all(reason.startswith(f"offset by {evidence}: ") for reason in reasons)
    assert all(reason.count(evidence) == 1 for reason in reasons)
    # What convicted it is said to the end, and what is so by now only where it is something else.
    assert "; now" not in reasons[0] and "; now" in reasons[-1]
    assert reasons[-1].split("; now")[0] == reasons[0]


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


def test_an_offset_in_the_midst_of_noise_is_named_offset(car: Car) -> None:
    """The jump adds to the roughness; what is rough is believed again as soon as it is smooth."""
    for k in range(4):
        car.drive(0.01 * SCAN, clearance=0.35 * (-1.0) ** k)
    start = car.number
    verdict = car.drive(4.0, clearance=-4.0).report.clearance
    assert verdict.state == State.FAULT and "offset by prediction" in verdict.reason
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


@pytest.mark.parametrize(("name", "every"), [("acceleration", 4), ("host_speed", 10)])
def test_what_was_rough_before_a_restart_is_healthy_after_it(name: str, every: int) -> None:
    """A slow sensor's last samples reach far back."""
    car, random = Car(), np.random.default_rng(4)

    def drive(seconds: float, noise: float) -> None:
        for _ in range(round(100 * seconds / every)):
            said = {"acceleration": 0.0, "host_speed": car.speed}[name] + noise * random.normal()
            for _ in range(every):
                car.step(**{f"{name}_is": float(said)})

    drive(12.0, 0.02)
    start = len(car.outcomes)
    drive(5.0, 2.0)
    assert name in car.faults_since(start)
    car.go_unheard(10.0)
    start = len(car.outcomes)
    drive(5.0, 0.02)
    assert not car.faults_since(start)


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
    said = car.drive(0.05, acceleration=1.0).report.clearance
    assert said.state == State.NOT_READY and "after: horizons were lost on the way" in said.reason
    report = car.drive(1.0, acceleration=1.0).report
    assert {report.clearance.state, report.relative_velocity.state} == {State.OK}
    car.drive(5.0, acceleration=1.0)
    assert not car.faults_since(start)


def test_an_offset_that_can_no_longer_be_told_says_so_and_stays(car: Car) -> None:
    verdict = car.drive(15.0, clearance=2.0, relative_velocity=-4.0).report.clearance
    assert verdict.state == State.FAULT
    assert "can no longer be told" in verdict.reason
    assert verdict.confidence >= verdict.confidence_threshold
    end = car.number
    assert car.drive(2.0).report.clearance.state == State.OK, "the jump back ends it"
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


def test_silence_says_no_data_for_all(car: Car) -> None:
    spoke = car.outcomes[-1].report
    report, events = car.diagnosis.silence(10**10)
    for name in ("clearance", "relative_velocity", "radar", "acceleration", "host_speed"):
        threshold = getattr(spoke, name).confidence_threshold
        assert getattr(report, name).confidence_threshold == threshold, name
    assert {report.radar.state, report.acceleration.state, report.host_speed.state} == {
        State.NO_DATA
    }
    assert report.step == 0 and len(events) >= 4
    # What was there has fallen silent; a lead that never said anything has not.
    assert {report.clearance.kind, report.acceleration.kind, report.host_speed.kind} == {
        Kind.DROPOUT
    }
    assert report.lead_acceleration.kind == Kind.UNKNOWN
    assert car.diagnosis.silence(2 * 10**10)[0].clearance.kind == Kind.DROPOUT
    assert Car().diagnosis.silence(10**10)[0].clearance.kind == Kind.UNKNOWN


@pytest.mark.parametrize("signal", ["clearance", "relative_velocity"])
def test_a_sensor_that_is_said_to_have_no_noise_is_judged(signal: str) -> None:
    car = Car(**{f"{signal}_std": 0.0})
    car.drive(2.0)
    car.track_id = 2
    outcome = car.drive(6.0)
    assert getattr(outcome.report, signal).state == State.OK
    start = car.number
    car.drive(1.0, **{signal: 4.0})
    assert signal in car.faults_since(start)


def test_reconstruction_says_which_values_are_missing_and_why(car: Car) -> None:
    assert car.outcomes[-1].reconstruction.reason == ""
    made = car.drive(1.0, clearance=4.0).reconstruction
    assert made.clearance_valid and not made.relative_acceleration_valid
    assert "relative acceleration" in made.reason


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
    with pytest.raises(ValidationError, match="must not be below acceleration_steps"):
        DiagnosisSettings(acceleration_steps=21)
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


def test_what_is_suspected_has_less_confidence_than_a_fault(car: Car) -> None:
    start = car.number
    for k in range(400):
        car.step(clearance=2.0 * 0.01 * k)
    suspected = [
        verdict
        for outcome in car.outcomes[start:]
        for verdict in (outcome.report.clearance, outcome.report.radar)
        if verdict.state == State.SUSPECT
    ]
    assert suspected
    assert all(verdict.confidence < verdict.confidence_threshold for verdict in suspected)


def test_why_everything_is_judged_anew_is_said_until_it_has_been(car: Car) -> None:
    car.diagnosis.reset()
    assert "after: reset" in car.step().report.clearance.reason
    car.drive(5.0)
    car.track_id, car.clearance = 2, 60.0
    reasons = {car.step().report.clearance.reason for _ in range(SCAN)}
    assert any("of this target" in reason for reason in reasons)
    assert not any("after" in reason for reason in reasons)


@pytest.mark.parametrize(
    "settings",
    [
        {"requalify_time": 0.4},
        {"drift_window": 1.9},
        {"host_speed_filter_time": 0.51},
    ],
)
def test_settings_that_would_make_it_deaf_are_refused(settings: dict) -> None:
    with pytest.raises(ValidationError):
        DiagnosisSettings(**settings)
    DiagnosisSettings(requalify_time=0.5, drift_window=2.0, host_speed_filter_time=0.5)
