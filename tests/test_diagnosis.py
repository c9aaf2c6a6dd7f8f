"""Fault indices, confidence and verdicts without ROS."""

import math

import numpy as np
import pytest
from test_observer import N, make_horizon

from lfd_diagnosis.confidence import confidences
from lfd_diagnosis.diagnosis import PaperDiagnosis
from lfd_diagnosis.fault_index import PredictionLimits
from lfd_diagnosis.pairing import OVERTAKEN, PATIENCE, Pairing
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.silence import CLOCK_LOST, LIMIT, SilenceWatch
from lfd_diagnosis.verdict import State
from lfd_observer.bank import ObserverBank
from lfd_observer.settings import BankSettings

MU, SIGMA, R1, R2 = 0.0728, 0.6698, 0.15, 0.08


STEADY = {
    "predicted_clearance": np.full(N, 30.0),
    "predicted_relative_velocity": np.zeros(N),
}
"""Predictions that do not learn from the measurement."""


class Both:
    """Bank and diagnosis, fed one horizon after the other."""

    def __init__(self) -> None:
        self.bank = ObserverBank(BankSettings())
        self.diagnosis = PaperDiagnosis(DiagnosisSettings())
        self.number = 0

    def step(self, **fields):
        self.number += 1
        horizon = make_horizon(self.number, **fields)
        return self.diagnosis.step(horizon, self.bank.step(horizon))

    def fill(self) -> None:
        for _ in range(N + 1):
            outcome = self.step()
        assert outcome.report.clearance.state == State.OK


@pytest.mark.parametrize("lead", [1, 7, 20])
def test_limits_grow_with_lead_time_around_the_noise(lead: int) -> None:
    limits, tau = PredictionLimits(DiagnosisSettings()), 0.01 * lead
    fastest, slowest = MU + 3 * SIGMA, MU - 3 * SIGMA
    assert limits.upper[lead - 1, 0] == pytest.approx(0.5 * fastest * tau**2 + 3 * R1)
    assert limits.lower[lead - 1, 0] == pytest.approx(0.5 * slowest * tau**2 - 3 * R1)
    assert limits.upper[lead - 1, 1] == pytest.approx(fastest * tau + 3 * R2)
    assert limits.lower[lead - 1, 1] == pytest.approx(slowest * tau - 3 * R2)


@pytest.mark.parametrize(("beyond", "outside"), [(-1e-6, False), (0.0, False), (1e-6, True)])
def test_a_measurement_is_outside_above_its_limit_only(beyond: float, outside: bool) -> None:
    limits = PredictionLimits(DiagnosisSettings())
    predicted = np.zeros((N, 2))
    at = limits.upper[4].copy()
    assert limits.outside(at + beyond, predicted)[4].tolist() == [outside, outside]
    at = limits.lower[4].copy()
    assert limits.outside(at - beyond, predicted)[4].tolist() == [outside, outside]


def test_confidence_counts_between_zero_and_its_ceiling() -> None:
    indices = np.array([0.4, *[0.5] * 25, 0.49, math.nan])
    counted = confidences(indices, index_threshold=0.5, ceiling=20)
    assert counted.tolist() == [0, *range(1, 21), *[20] * 5, 19, 0]


def test_indices_are_undefined_until_the_store_is_full() -> None:
    both = Both()
    for _ in range(N):
        report = both.step().report
        assert report.clearance.state == State.NOT_READY and math.isnan(report.clearance.index)
    assert "19 of 20 predictions stored" in report.clearance.reason
    assert both.step().report.clearance.index == 0.0


def test_a_jump_of_clearance_is_seen_until_the_predictions_carry_it_too() -> None:
    both = Both()
    both.fill()
    indices = [both.step(clearance=34.0).report.clearance.index for _ in range(N + 1)]
    assert indices[0] == 1.0 and indices[N] == 0.0
    assert all(a >= b for a, b in zip(indices, indices[1:], strict=False))


def test_the_radar_is_as_bad_as_the_worse_of_its_signals() -> None:
    both = Both()
    both.fill()
    for _ in range(10):
        report = both.step(velocity=-10.0, **STEADY).report
    assert report.relative_velocity.state == report.radar.state == State.FAULT
    assert report.clearance.state == State.OK
    assert report.radar.reason.startswith("relative velocity: ")


def test_a_fault_is_dated_and_each_change_is_an_event() -> None:
    both = Both()
    both.fill()
    events = []
    for _ in range(12):
        outcome = both.step(acceleration=4.0)
        events += outcome.events
    assert [(e.signal, e.old_state, e.fault.state) for e in events] == [
        ("acceleration", State.OK, State.SUSPECT),
        ("acceleration", State.SUSPECT, State.FAULT),
    ]
    assert outcome.report.acceleration.since == events[1].stamp
    assert events[1].old_since == events[0].stamp
    assert "6 of 6 observers exclude 4.00 m/s^2" in outcome.report.acceleration.reason


def test_without_the_bank_the_acceleration_is_not_judged() -> None:
    diagnosis = PaperDiagnosis(DiagnosisSettings())
    report = diagnosis.step(make_horizon(1), None).report
    assert report.acceleration.state == State.NOT_READY
    assert "did not answer" in report.acceleration.reason


def test_a_new_lead_is_no_fault_and_says_why_nothing_is_ready() -> None:
    both = Both()
    both.fill()
    report = both.step(clearance=60.0, restart=True, restart_reason="new lead").report
    assert report.radar.state == report.acceleration.state == State.NOT_READY
    assert "new lead" in report.radar.reason


def test_silence_is_no_step_and_leaves_the_stores_alone() -> None:
    both = Both()
    both.fill()
    report, events = both.diagnosis.silence(10**9)
    assert report.step == 0 and len(events) == 4
    assert {f.state for f in (report.clearance, report.radar, report.acceleration)} == {
        State.NO_DATA
    }
    assert both.step().report.clearance.state == State.OK


def test_reconstruction_is_the_oldest_prediction_and_the_mean_lead() -> None:
    both = Both()
    assert not both.step().reconstruction.clearance_valid
    both.fill()
    made = both.step(clearance=34.0).reconstruction
    assert made.clearance == pytest.approx(30.0) and made.clearance_valid
    assert made.acceleration == pytest.approx(MU - made.relative_acceleration)
    tau = 0.01 * N
    assert made.clearance_std == pytest.approx(math.hypot(R1, 0.5 * SIGMA * tau**2))
    for _ in range(12):
        outcome = both.step(velocity=-10.0, **STEADY)
    assert outcome.report.radar.state == State.FAULT
    assert not outcome.reconstruction.acceleration_valid
    assert "radar is faulty" in outcome.reconstruction.reason


def test_pairs_come_in_order_whichever_half_arrives_first() -> None:
    pairing, bank = Pairing(), ObserverBank(BankSettings())
    horizons = [make_horizon(step) for step in range(1, 4)]
    banks = [bank.step(horizon) for horizon in horizons]
    assert pairing.add_bank(banks[1], 0.0) == []
    assert pairing.add_horizon(horizons[0], 0.0) == []
    assert pairing.add_horizon(horizons[1], 0.0) == []
    assert pairing.add_bank(banks[0], 0.0) == [(horizons[0], banks[0]), (horizons[1], banks[1])]
    assert pairing.add_horizon(horizons[2], 1.0) == []
    assert pairing.complete(1.0 + PATIENCE) == []
    assert pairing.complete(1.01 + PATIENCE) == [(horizons[2], None)]


def test_a_horizon_waits_little_for_an_answer_that_was_overtaken() -> None:
    """The bank's answer to a starting diagnosis' first horizon may have been sent too early."""
    pairing, bank = Pairing(), ObserverBank(BankSettings())
    horizons = [make_horizon(step) for step in range(1, 5)]
    banks = [bank.step(horizon) for horizon in horizons]
    assert pairing.add_horizon(horizons[0], 0.0) == []
    assert pairing.add_horizon(horizons[1], 0.01) == []
    assert pairing.complete(2.0 * OVERTAKEN) == []
    assert pairing.add_bank(banks[1], 2.0 * OVERTAKEN) == [
        (horizons[0], None),
        (horizons[1], banks[1]),
    ]
    assert pairing.add_horizon(horizons[2], 0.2) == []
    assert pairing.add_bank(banks[3], 0.2) == []
    assert pairing.add_horizon(horizons[3], 0.2) == []
    in_order = [(horizons[2], banks[2]), (horizons[3], banks[3])]
    assert pairing.add_bank(banks[2], 0.2 + OVERTAKEN) == in_order


def test_simulated_time_without_any_clock_excuses_no_silence_for_long() -> None:
    """As where nobody plays the clock that the node was told to follow."""
    watch = SilenceWatch(0.0)
    watch.heard(5.0)
    told = [watch.silent(5.0 + CLOCK_LOST + off, True) for off in (-0.1, 0.0, 0.01, 0.04)]
    assert told == [False, False, False, True]
    watch.heard(8.0)
    assert not watch.silent(8.5, True) and not watch.silent(8.53, True)


def test_a_pause_of_simulated_time_is_no_silence_but_a_dead_clock_is() -> None:
    watch = SilenceWatch(0.0)

    def silent(wall: float, simulated_time: bool) -> bool:
        """At the second look."""
        watch.silent(wall, simulated_time)
        return watch.silent(wall, simulated_time)

    assert not silent(10.0, simulated_time=True)
    assert silent(10.0, simulated_time=False)
    watch.clock(10.0, 5.0)
    watch.heard(10.0)
    watch.clock(10.0 + LIMIT + 0.1, 5.0)
    assert not silent(10.0 + LIMIT + 0.1, simulated_time=True)
    watch.clock(11.0, 5.0 + LIMIT + 0.1)
    assert silent(11.0, simulated_time=True)
    watch.heard(11.0)
    assert not silent(11.0 + CLOCK_LOST - 0.1, simulated_time=True)
    assert silent(11.1 + CLOCK_LOST, simulated_time=True)


def test_silence_takes_two_looks_and_longer_where_steps_come_in_bursts() -> None:
    watch = SilenceWatch(0.0)
    for number in range(100):
        watch.heard(0.01 * number)
    last = 0.99
    almost = last + LIMIT - 0.001
    assert not watch.silent(almost, False) and not watch.silent(almost, False)
    assert not watch.silent(last + LIMIT + 0.001, False)
    assert watch.silent(last + LIMIT + 0.03, False)
    watch.heard(last + LIMIT + 0.04)
    assert not watch.silent(last + LIMIT + 0.05, False)
    watch.heard(1.5)
    assert watch.limit == LIMIT, "one pause alone is none that may come again"
    for number in range(100):
        watch.heard(2.0 + 0.2 * number)
    assert watch.limit == pytest.approx(0.3)


def test_the_reason_says_what_the_radar_says_of_itself() -> None:
    diagnosis = PaperDiagnosis(DiagnosisSettings())
    report = diagnosis.step(make_horizon(1, sensor_text="partial blockage"), None).report
    assert report.clearance.reason.endswith("; the radar says: partial blockage")
    assert report.radar.reason.endswith("; the radar says: partial blockage")
    assert "radar says" not in diagnosis.step(make_horizon(2), None).report.clearance.reason


def test_simulated_time_that_went_back_hides_no_silence() -> None:
    """As where a replay loops and the controller died."""
    watch = SilenceWatch(0.0)
    for k in range(200):
        watch.clock(0.01 * k, 100.0 + 0.01 * k)
        watch.heard(0.01 * k)
    silent = []
    for k in range(200, 260):
        watch.clock(0.01 * k, 5.0 + 0.01 * (k - 200))
        silent.append(watch.silent(0.01 * k, True))
    assert silent.index(True) == pytest.approx((LIMIT + 0.02) * 100, abs=2)
