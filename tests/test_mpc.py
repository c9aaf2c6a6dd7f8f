"""Prediction model, quadratic program and controller."""

import numpy as np
import pytest
import quadprog

from lfd_mpc.box_qp import BoxQp, available_solvers
from lfd_mpc.horizon import Horizon, Mpc
from lfd_mpc.prediction_model import build_prediction_model
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RadarSample, ScalarSample
from lfd_mpc.settings import STEP_S, MpcSettings

N = 20
LOWER, UPPER = -5.0, 3.0


@pytest.fixture(scope="module")
def model():
    return build_prediction_model(MpcSettings())


def make_qp(model, solver: str, residual_limit: float = 1e-9) -> BoxQp:
    return BoxQp(model.P, np.full(N, LOWER), np.full(N, UPPER), solver, residual_limit)


def linear_terms(model, count: int, seed: int):
    """Problems from states well inside the limits to far outside of them."""
    generator = np.random.default_rng(seed)
    for _ in range(count):
        size = 10.0 ** generator.uniform(-2.0, 3.0)
        error = generator.normal(size=2) * [size, size / 3]
        yield model.f_error @ error + model.f_input * generator.uniform(-10.0, 8.0)


def exact(model, f) -> np.ndarray:
    sides = np.hstack([np.eye(N), -np.eye(N)])
    limits = np.concatenate([np.full(N, LOWER), np.full(N, -UPPER)])
    return quadprog.solve_qp(model.P.copy(), -f, sides, limits)[0]


def test_eigenvalues_of_the_cost_are_those_of_a_faithful_build(model) -> None:
    assert model.eigenvalues[0] == pytest.approx(0.0706, abs=5e-5)
    assert model.eigenvalues[-1] == pytest.approx(39.77, abs=5e-3)


def test_weights_that_break_convexity_are_refused() -> None:
    with pytest.raises(ValueError, match="positive definite"):
        build_prediction_model(MpcSettings(input_weight=0.0))


def test_the_prediction_is_the_model_stepped_through_time(model) -> None:
    generator = np.random.default_rng(1)
    error, inputs, now = generator.normal(size=2), generator.normal(size=N), 0.7
    state, applied = error.copy(), [now, *inputs]
    for k in range(N):
        # eq 3, one step after the other
        state = np.array([state[0] + STEP_S * state[1], state[1] - STEP_S * applied[k]])
        np.testing.assert_allclose(model.predict(error, inputs, now)[k], state, atol=1e-12)


def test_the_cost_is_the_sum_of_weighted_outputs_and_input_changes(model) -> None:
    """Eq 4 written out, against its quadratic form up to a constant and the scale."""
    generator = np.random.default_rng(2)
    error, now = np.array([3.0, -1.0]), 0.4
    along = np.tanh(2.0 * np.arange(1, N + 1) / N)
    f = model.f_error @ error + model.f_input * now

    def written_out(u: np.ndarray) -> float:
        outputs = along[:, None] * model.predict(error, u, now)
        changes = u - np.append(u[1:], 0.0)
        return 0.5 * float((outputs**2).sum() + 10.0 * (changes**2).sum())

    def quadratic(u: np.ndarray) -> float:
        return float(0.5 * u @ model.P @ u + f @ u)

    zero, one = np.zeros(N), generator.normal(size=N)
    scale = (written_out(one) - written_out(zero)) / quadratic(one)
    for _ in range(5):
        u = generator.normal(size=N)
        assert written_out(u) - written_out(zero) == pytest.approx(scale * quadratic(u))


def test_matrices_are_read_only(model) -> None:
    with pytest.raises(ValueError):
        model.P[0, 0] = 1.0


@pytest.mark.parametrize("solver", available_solvers())
@pytest.mark.filterwarnings("ignore")
def test_each_solver_agrees_with_the_active_set_solver(model, solver: str) -> None:
    count = 5000 if solver == "proxqp" else 1000
    qp = make_qp(model, solver)
    for f in linear_terms(model, count, seed=3):
        solution = qp.solve(f)
        assert solution.u is not None
        np.testing.assert_allclose(solution.u, exact(model, f), atol=1e-6)
        assert solution.residual <= 1e-9 or solution.fell_back


def test_some_of_these_problems_are_inside_the_limits_and_some_at_them(model) -> None:
    at_limit = [
        np.any((u <= LOWER + 1e-9) | (u >= UPPER - 1e-9))
        for u in (exact(model, f) for f in linear_terms(model, 300, seed=3))
    ]
    assert 0.2 < np.mean(at_limit) < 0.8


def test_an_answer_above_the_residual_limit_is_solved_again_exactly(model) -> None:
    qp = make_qp(model, "proxqp", residual_limit=1e-300)
    f = next(linear_terms(model, 1, seed=4))
    solution = qp.solve(f)
    assert solution.fell_back and solution.status == "solved by quadprog"
    np.testing.assert_allclose(solution.u, exact(model, f), atol=1e-9)


@pytest.mark.parametrize("solver", available_solvers())
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_an_unsolvable_problem_says_so_instead_of_raising(model, solver: str, value) -> None:
    solution = make_qp(model, solver).solve(np.full(N, value))
    assert solution.u is None and np.isnan(solution.residual)
    assert solution.status == "no solution found"


def test_an_unknown_solver_is_refused_with_what_is_there(model) -> None:
    with pytest.raises(ValueError, match=r"'magic'.*quadprog"):
        make_qp(model, "magic")


def planned(
    clearance: float,
    relative_velocity: float,
    acceleration: float,
    host_speed: float | None,
    **settings,
) -> Horizon:
    """The step at which all of that is measured."""
    mpc = Mpc(MpcSettings(**settings))
    mpc.push(RadarSample(0, True, clearance, relative_velocity))
    if host_speed is not None:
        mpc.push(ScalarSample(HOST_SPEED, 0, host_speed))
    (horizon,) = mpc.push(ScalarSample(ACCELERATION, 0, acceleration))
    return horizon


def test_without_host_speed_only_the_relative_velocity_is_regulated() -> None:
    free = planned(40.0, 0.0, 0.0, None)
    assert free.desired_clearance == 40.0
    assert abs(free.command) < 1e-9
    assert planned(40.0, 0.0, 0.0, 10.0).desired_clearance == 10.0 * 1.5 + 5.0


def test_a_gap_that_is_too_small_brakes_and_one_too_large_accelerates() -> None:
    assert planned(10.0, -2.0, 0.0, 15.0).command < 0.0
    assert planned(80.0, 2.0, 0.0, 15.0).command > 0.0


def test_the_prediction_of_clearance_starts_from_the_clearance() -> None:
    made = planned(40.0, -1.0, 0.3, 12.0)
    assert made.predicted_clearance[0] == pytest.approx(40.0 - 1.0 * STEP_S)
    assert made.predicted_relative_velocity[0] == pytest.approx(-1.0 - 0.3 * STEP_S)


def test_what_is_published_is_the_prediction_that_the_cost_is_made_of(model) -> None:
    made = planned(40.0, -1.0, 0.3, 12.0)
    error = np.array([40.0 - made.desired_clearance, -1.0])
    off = model.predict(error, made.input_sequence, 0.3)
    np.testing.assert_allclose(
        made.predicted_clearance, off[:, 0] + made.desired_clearance, atol=1e-12
    )
    np.testing.assert_allclose(made.predicted_relative_velocity, off[:, 1], atol=1e-12)


def test_the_linear_prediction_keeps_the_relative_velocity_and_the_command_stays() -> None:
    state = (40.0, -1.0, 0.3, 12.0)
    linear = planned(*state, prediction="linear")
    lead = STEP_S * np.arange(1, N + 1)
    np.testing.assert_allclose(linear.predicted_clearance, 40.0 - lead, atol=1e-12)
    np.testing.assert_allclose(linear.predicted_relative_velocity, -1.0, atol=1e-12)
    assert linear.command == planned(*state).command


def test_where_no_limit_is_active_the_solver_is_not_needed(model) -> None:
    inside = model.f_error @ np.array([0.5, 0.1])
    solution = make_qp(model, "proxqp").solve(inside)
    np.testing.assert_allclose(solution.u, exact(model, inside), atol=1e-9)
    assert solution.residual <= 1e-9 and not solution.fell_back
