"""Sliding mode observers, the store of predictions and the bank."""

import numpy as np
import pytest
from pydantic import ValidationError

from lfd_mpc.horizon import NOTHING, Horizon
from lfd_observer.bank import ObserverBank
from lfd_observer.prediction_store import PredictionStore
from lfd_observer.settings import BankSettings
from lfd_observer.sliding_mode_observer import (
    OBSERVER,
    A,
    C,
    design,
    observe,
    observers_common,
    reachability_margin,
)

N = 20


def make_horizon(step: int, clearance: float = 30.0, velocity: float = 0.0, **fields) -> Horizon:
    """A horizon whose prediction is `clearance` and `velocity`, unless told otherwise."""
    values = {
        "stamp": step * 10_000_000,
        "step": step,
        "restart": False,
        "restart_reason": "",
        "without_acceleration": False,
        "late_samples": 0,
        "refused_samples": 0,
        "bad_samples": 0,
        "fallbacks": 0,
        "has_target": True,
        "track_id": 1,
        "sensor_flags": 0,
        "sensor_text": "",
        "solver_status": "solved",
        "valid": True,
        "clearance": clearance,
        "relative_velocity": velocity,
        "acceleration": 0.0,
        "host_speed": 15.0,
        "residual": 0.0,
        "solve_time": 0.0,
        "command": 0.0,
        "desired_clearance": clearance,
        "predicted_clearance": np.full(N, clearance),
        "predicted_relative_velocity": np.full(N, velocity),
        "input_sequence": np.zeros(N),
    }
    for name in ("clearance", "relative_velocity", "acceleration", "host_speed"):
        values |= {f"measured_{name}": values[name], f"{name}_age": 0.0, f"{name}_stale": False}
    values |= {
        "measured_lead_acceleration": np.nan,
        "lead_acceleration_age": np.nan,
        "lead_acceleration_stale": True,
    }
    values |= fields
    if not values["valid"]:
        for name in ("predicted_clearance", "predicted_relative_velocity", "input_sequence"):
            values[name] = NOTHING
    return Horizon(**values)


def test_the_transformation_separates_what_slides_from_the_output() -> None:
    made = design()
    null_space = made.transform[0]
    assert C @ null_space == pytest.approx(0.0)
    assert np.linalg.norm(null_space) == pytest.approx(1.0)
    np.testing.assert_array_equal(made.transform[1], C)
    back = np.linalg.inv(made.transform) @ made.transformed_A @ made.transform
    np.testing.assert_allclose(back, A, atol=1e-12)


def test_the_sliding_error_has_the_eigenvalue_minus_one() -> None:
    assert design().reduced_eigenvalue == pytest.approx(-1.0)


def test_the_reachability_margin_is_what_the_gain_has_left() -> None:
    assert reachability_margin(10.0, 8.0, 0.0) == pytest.approx(2.0)
    assert reachability_margin(10.0, 10.0, 0.0) == pytest.approx(0.0)
    assert reachability_margin(10.0, 9.0, 5.0) < 0.0


class Observer:
    """One observer by itself, with a filter of 0.1 s."""

    def __init__(self, gain: float, boundary_layer: float = 0.0) -> None:
        self.common = observers_common(gain, 0.1, boundary_layer, 0.0)[0]
        self.state = np.zeros(1, OBSERVER)[0]

    def feed(self, clearance: float, relative_velocity: float) -> float:
        """The relative acceleration in m/s^2."""
        return observe(self.common, self.state, clearance, relative_velocity)


@pytest.mark.parametrize("acceleration", [-6.0, -1.0, 0.0, 2.5, 6.0])
def test_the_equivalent_injection_becomes_the_relative_acceleration(acceleration: float) -> None:
    observer = Observer(10.0)
    reconstructed = []
    for k in range(400):
        t = k * 0.01
        reconstructed.append(observer.feed(30.0 + 0.5 * acceleration * t**2, acceleration * t))
    assert np.mean(reconstructed[200:]) == pytest.approx(acceleration, abs=0.15)
    assert np.abs(np.array(reconstructed[200:]) - acceleration).max() < 1.2


def test_a_gain_below_the_acceleration_cannot_follow_it() -> None:
    observer = Observer(2.0)
    for k in range(400):
        t = k * 0.01
        reconstructed = observer.feed(30.0 + 2.5 * t**2, 5.0 * t)
    assert reconstructed < 2.1 and abs(observer.state["output_error"]) > 1.0


def test_observers_start_at_their_first_measurement_with_nothing_reconstructed() -> None:
    fed, unfed = Observer(10.0), Observer(10.0)
    assert fed.feed(30.0, -2.0) == 0.0 and fed.state["output_error"] == 0.0
    assert np.isnan(unfed.feed(np.nan, np.nan)) and np.isnan(unfed.state["output_error"])


def test_a_boundary_layer_makes_the_injection_smooth() -> None:
    ripples = []
    for observer in (Observer(10.0), Observer(10.0, boundary_layer=0.5)):
        values = [observer.feed(30.0, 0.02 * k) for k in range(300)]
        ripples.append(np.std(values[200:]))
    assert ripples[1] < 0.2 * ripples[0]


def test_the_store_gives_for_each_lead_time_what_was_said_about_now() -> None:
    store = PredictionStore(N)
    solutions = np.random.default_rng(0).normal(size=(50, N, 2))
    for k, solution in enumerate(solutions):
        for i, row in enumerate(store.for_now(), start=1):
            if k >= i:
                np.testing.assert_array_equal(row, solutions[k - i, i - 1])
            else:
                assert np.isnan(row).all()
        assert store.count == min(k, N)
        store.push(solution)
    with pytest.raises(ValueError, match="20 steps"):
        store.push(np.zeros((3, 2)))


def test_weights_fall_by_five_percent_and_sum_to_one() -> None:
    state = ObserverBank(BankSettings()).step(make_horizon(1))
    assert state.weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(state.weights[1:] / state.weights[:-1], 0.95)
    assert state.lags.tolist() == [0, 3, 6, 9, 12, 15]


def test_limits_are_those_of_the_lead_less_the_relative_acceleration() -> None:
    bank = ObserverBank(BankSettings())
    for step in range(1, 40):
        state = bank.step(make_horizon(step))
    upper = 0.0728 + 3 * 0.6698 - state.relative_acceleration
    lower = 0.0728 - 3 * 0.6698 - state.relative_acceleration
    np.testing.assert_allclose(state.acceleration_upper, upper)
    np.testing.assert_allclose(state.acceleration_lower, lower)


def test_the_index_is_undefined_until_the_stores_are_full() -> None:
    bank = ObserverBank(BankSettings())
    states = [bank.step(make_horizon(step)) for step in range(1, 31)]
    assert [state.ready for state in states] == [False] * N + [True] * 10
    assert np.isnan(states[N - 1].acceleration_index) and states[N].acceleration_index == 0.0


def test_the_index_is_the_weight_of_the_observers_that_disagree() -> None:
    bank = ObserverBank(BankSettings())
    for step in range(1, 40):
        bank.step(make_horizon(step))
    state = bank.step(make_horizon(40, acceleration=4.0))
    assert state.outside.all() and state.acceleration_index == pytest.approx(1.0)
    stale = bank.step(make_horizon(41, acceleration_stale=True))
    assert np.isnan(stale.acceleration_index)


@pytest.mark.parametrize(
    "change", [{"restart": True, "restart_reason": "x"}, {"valid": False}, {"step": 99}]
)
def test_a_restart_a_missing_solution_and_a_lost_horizon_empty_the_stores(change: dict) -> None:
    bank = ObserverBank(BankSettings())
    for step in range(1, 31):
        state = bank.step(make_horizon(step))
    assert state.ready
    assert not bank.step(make_horizon(**{"step": 31, **change})).ready


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"lags": (3, 0)}, "increase"),
        ({"lags": (0, 21)}, "largest lag"),
        ({"injection_gain": 8.0}, "injection_gain"),
        ({"lead_acceleration_std": 0.0}, "lead_acceleration_std"),
    ],
)
def test_settings_that_cannot_work_are_refused(change: dict, named: str) -> None:
    with pytest.raises(ValidationError, match=named):
        BankSettings(**change)
