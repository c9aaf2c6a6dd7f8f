"""The controller drives the car: comfort, limits, standstill, and what it may never do."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfd_mpc.decision import Action, Decision, FaultLevel
from lfd_mpc.driving import CARRIED, FIRST_DECISION, CarDriver, DrivingMpc, Source
from lfd_mpc.following_model import build_following_model
from lfd_mpc.horizon import Horizon, first_horizon
from lfd_mpc.settings import MpcSettings
from lfd_replay.profiles import graph_settings
from lfd_vehicle.closed_loop import ClosedLoop, LoopStep
from lfd_vehicle.lead import lead_plan
from lfd_vehicle.safety import safety_of
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.world import Scenario

CHOSEN = MpcSettings(driving=True)
PASSENGER_JERK = 3.0
"""m/s^3 that a body feels (over 0.2 s) and a passenger accepts."""


@cache
def run(lead: str, gap: float | None = None, speed: float | None = None) -> list[LoopStep]:
    scenario = Scenario(lead_plan(lead), (), gap, speed)
    return list(ClosedLoop(scenario, graph_settings("robust"), VehicleSettings()).run())


def series(steps: list[LoopStep], name: str) -> np.ndarray:
    return np.array([getattr(step.moment, name) for step in steps])


def safety(steps: list[LoopStep]):
    return safety_of([step.moment for step in steps], [], False)


@pytest.mark.parametrize(("gap", "error"), [(55.0, 20.0), (23.0, -12.0)])
def test_a_steady_lead_is_followed_at_the_desired_clearance(gap: float, error: float) -> None:
    steps = run("20,0@0-20", gap)
    desired = np.array([step.driving.desired_clearance for step in steps])
    left = (series(steps, "clearance") - desired)[100:] / error
    assert left.min() > -0.05, "the overshoot is below 5 %"
    assert np.abs(left[1500:] * error).max() < 1.0
    found = safety(steps)
    acceleration = series(steps, "host_acceleration")
    assert acceleration.max() < CHOSEN.comfortable_acceleration + 0.2
    assert found.largest_deceleration < 2.0 and found.largest_jerk < PASSENGER_JERK


def test_a_slower_lead_far_ahead_is_approached_without_hard_braking() -> None:
    steps = run("10,0@0-15", 170.0, 25.0)
    found = safety(steps)
    assert found.largest_deceleration < CHOSEN.comfortable_braking + 0.5
    assert found.largest_jerk < PASSENGER_JERK
    assert series(steps, "clearance").min() > 0.95 * 20.0


def test_it_stops_behind_a_stopping_lead_without_creeping_and_sets_off_again() -> None:
    steps = run("15,-2@5-12.5,1.5@25-33")
    clearance, speed = series(steps, "clearance"), series(steps, "host_speed")
    stopped = int(np.argmax(speed == 0.0))
    assert 1_300 < stopped < 2_000, "a few seconds after the lead has stopped at 12.5 s"
    start = 2_495
    assert not speed[stopped:start].any() and not np.ptp(clearance[stopped:start])
    assert 4.0 < clearance[stopped] < 7.5
    assert clearance.min() > 4.0
    assert speed[-1] > 8.0, "it sets off behind the lead"
    assert safety(steps[:start]).largest_deceleration < 3.0
    assert all(step.driving.holding for step in steps[stopped + 50 : start])


@pytest.mark.parametrize(("lead", "least"), [("20,-3@5-11.6", 3.0), ("20,-6@5-8.3", 2.0)])
def test_it_stays_behind_a_lead_that_brakes_hard(lead: str, least: float) -> None:
    steps = run(lead)
    commands = np.array([step.driving.command for step in steps])
    assert series(steps, "clearance").min() > least
    assert commands.min() >= CHOSEN.acceleration_lower - 1e-9
    assert series(steps, "host_speed")[-1] == 0.0


def test_the_published_prediction_is_that_of_the_command_that_is_sent() -> None:
    """What a plan that nobody drives by would predict is wrong by what it would do otherwise."""
    settings_ = graph_settings("robust")
    scenario = Scenario(lead_plan("data-3"))
    loop = ClosedLoop(scenario, settings_, VehicleSettings())
    mpc, seen = loop._mpc, []
    push = mpc.push
    mpc.push = lambda sample: seen.extend(made := push(sample)) or made  # type: ignore[method-assign]
    truth = [step.moment.relative_velocity for step in loop.run()]
    horizons = [h for h in seen if h.valid]
    assert len(horizons) > 7000
    ahead = 20
    errors = [
        truth[k + ahead] - h.predicted_relative_velocity[ahead - 1]
        for k, h in enumerate(horizons[500:6500], 500)
    ]
    # The lead's own acceleration is not known, that of the host is.
    assert np.abs(errors).mean() < 0.1
    for horizon in horizons[::500]:
        last = horizon.input_sequence[-1]
        assert abs(last - horizon.command) <= 0.6 * abs(horizon.acceleration - horizon.command)
        assert horizon.record["command"][0] == horizon.command


def horizon(stamp: int, **values) -> Horizon:
    """A measured step: 35 m behind a lead, both at 20 m/s."""
    known = {
        "stamp": stamp,
        "restart": False,
        "has_target": True,
        "measured_clearance": 35.0,
        "measured_relative_velocity": 0.0,
        "measured_acceleration": 0.0,
        "measured_host_speed": 20.0,
        "clearance_age": 0.0,
        "relative_velocity_age": 0.0,
        **{
            f"{name}_stale": False
            for name in ("clearance", "relative_velocity", "acceleration", "host_speed")
        },
        **values,
    }
    made = replace(first_horizon(), **known)
    return made


def decision(stamp: int, action: Action, **values) -> Decision:
    level = FaultLevel(min(int(action), 3))
    usable = dict.fromkeys(
        (f"{n}_usable" for n in ("clearance", "relative_velocity", "acceleration", "host_speed")),
        True,
    )
    nothing = dict.fromkeys(
        ("clearance", "relative_velocity", "relative_acceleration", "acceleration"), float("nan")
    )
    return Decision(
        stamp, 1, level, action, stamp, "", **{**usable, **nothing, "deceleration": 2.5, **values}
    )


def driven(seconds: float, action: Action = Action.FOLLOW, told: dict | None = None, **values):
    """The last state after some time of the same step again and again."""
    driver, state = CarDriver(CHOSEN), None
    for k in range(1, round(seconds * 100) + 1):
        driver.decide(decision((k - 1) * 10_000_000, action, **(told or {})))
        state = driver.drive(horizon(k * 10_000_000, **values))
    assert state is not None
    return state


def test_each_action_has_its_command() -> None:
    far = {"measured_clearance": 80.0}
    assert driven(3.0, Action.FOLLOW, **far).command > 1.0
    assert driven(3.0, Action.WARN, **far).command == 0.0
    stop = driven(3.0, Action.STOP, {"deceleration": 2.5}, **far)
    assert stop.command == -2.5
    assert driven(3.0, Action.STOP, {"deceleration": 5.0}, **far).command == -5.0
    assert driven(3.0, Action.BRAKE, {"deceleration": 8.0}, **far).command == -8.0
    near = driven(1.0, Action.FOLLOW)
    afar = driven(1.0, Action.FOLLOW_FROM_AFAR)
    assert afar.desired_clearance - near.desired_clearance == pytest.approx(
        (CHOSEN.degraded_gap - 1.0) * CHOSEN.preview_time * 20.0
    )
    assert afar.command < near.command - 0.3


@pytest.mark.parametrize("decided", [1.5, CHOSEN.stopping_deceleration, 4.0])
def test_a_stop_is_as_hard_as_was_decided(decided: float) -> None:
    state = driven(4.0, Action.STOP, {"deceleration": decided}, measured_clearance=80.0)
    assert state.command == pytest.approx(-decided, abs=1e-6)


@pytest.mark.parametrize("decided", [1.5, CHOSEN.stopping_deceleration, 4.0])
def test_a_stop_is_no_softer_once_the_decisions_fall_silent(decided: float) -> None:
    driver = CarDriver(CHOSEN)
    driver.decide(decision(10_000_000, Action.STOP, deceleration=decided))
    for k in range(1, 600):
        command = driver.drive(horizon(k * 10_000_000, measured_clearance=80.0)).command
    assert command == pytest.approx(-max(decided, CHOSEN.stopping_deceleration), abs=1e-6)


@pytest.mark.parametrize("action", [Action.STOP, Action.BRAKE])
@pytest.mark.parametrize("told", [0.0, -1.0, float("inf"), float("nan")])
def test_a_stop_that_would_stop_nothing_is_refused(action: Action, told: float) -> None:
    with pytest.raises(ValueError, match="deceleration of"):
        CarDriver(CHOSEN).decide(decision(10_000_000, action, deceleration=told))


def test_a_reconstructed_value_is_driven_by_where_the_measured_one_is_not_usable() -> None:
    told = {"clearance_usable": False, "clearance": 20.0}
    state = driven(1.0, Action.FOLLOW, told)
    assert state.clearance_source == Source.RECONSTRUCTED and state.clearance == 20.0
    assert state.relative_velocity_source == Source.MEASURED and state.command < -0.5
    told = {"relative_velocity_usable": False, "relative_velocity": -5.0}
    state = driven(1.0, Action.FOLLOW, told)
    assert state.relative_velocity == -5.0 and state.command < -0.5
    told = {"acceleration_usable": False, "acceleration": 0.5}
    assert driven(0.1, Action.FOLLOW, told).acceleration == 0.5
    # A speed that is not to be believed is carried on from the last one that was.
    driver = CarDriver(CHOSEN)
    driver.drive(horizon(10_000_000))
    driver.decide(decision(10_000_000, Action.FOLLOW_FROM_AFAR, host_speed_usable=False))
    for k in range(2, 12):
        wrong = horizon(k * 10_000_000, measured_host_speed=3.0, measured_acceleration=1.0)
        state = driver.drive(wrong)
    assert state.host_speed == pytest.approx(20.1) and state.host_speed_source == 2


UNKNOWN = (
    {"clearance_stale": True},
    {"relative_velocity_stale": True},
    {"clearance_stale": True, "relative_velocity_stale": True, "has_target": False},
)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(UNKNOWN),
    st.sampled_from(list(Action)),
    st.floats(0.0, 40.0),
    st.floats(-3.0, 3.0),
)
def test_without_a_valid_clearance_it_never_accelerates(
    values: dict, action: Action, speed: float, acceleration: float
) -> None:
    moving = {"measured_host_speed": speed, "measured_acceleration": acceleration}
    driver = CarDriver(CHOSEN)
    before = driver.drive(horizon(10_000_000, measured_clearance=90.0, **moving)).command
    told = {"clearance_usable": False, "relative_velocity_usable": False}
    for k in range(2, 80):
        if k % 20:
            driver.decide(decision((k - 1) * 10_000_000, action, **told))
        command = driver.drive(horizon(k * 10_000_000, **moving, **values)).command
        assert command <= max(before, 0.0)
        before = command
    assert command <= 0.0


@pytest.mark.parametrize("ever", [True, False], ids=["any more", "ever"])
def test_without_decisions_for_too_long_the_car_is_stopped(ever: bool) -> None:
    driver = CarDriver(CHOSEN)
    if ever:
        driver.decide(decision(10_000_000, Action.FOLLOW))
    last = 1 + round((CHOSEN.decision_timeout if ever else FIRST_DECISION) * 100)
    for k in range(1, last + 1):
        state = driver.drive(horizon(k * 10_000_000))
        assert state.action == Action.FOLLOW, k
    for k in range(last + 1, last + 300):
        state = driver.drive(horizon(k * 10_000_000))
        assert state.action == Action.STOP and "no decision for" in state.reason
    assert -3.0 < state.command <= -CHOSEN.stopping_deceleration
    driver.decide(decision((last + 300) * 10_000_000, Action.FOLLOW))
    assert driver.drive(horizon((last + 301) * 10_000_000)).action == Action.FOLLOW


def test_an_empty_road_is_driven_at_the_set_speed() -> None:
    empty = {"has_target": False, "measured_clearance": float("nan")}
    empty["measured_relative_velocity"] = float("nan")
    assert driven(3.0, **empty).command == pytest.approx(CHOSEN.comfortable_acceleration)
    fast = driven(3.0, measured_host_speed=CHOSEN.set_speed + 3.0, **empty)
    assert fast.command == pytest.approx(-1.0)
    assert driven(1.0, measured_host_speed=CHOSEN.set_speed, **empty).command == 0.0


@pytest.mark.parametrize("value", [float("nan"), -1.0, float("inf")])
def test_a_decision_that_no_node_makes_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="a deceleration of"):
        CarDriver(CHOSEN).decide(decision(0, Action.STOP, deceleration=value))


def test_the_model_behind_the_plan() -> None:
    model = build_following_model(CHOSEN)
    assert np.linalg.eigvalsh(model.problem.P).min() > 0.0
    assert 1.0 < model.approach < 6.0
    stiff = build_following_model(CHOSEN.model_copy(update={"control_clearance_weight": 1.0}))
    assert stiff.approach < model.approach


def test_settings_can_be_changed_while_it_drives() -> None:
    mpc = DrivingMpc(CHOSEN)
    before = mpc._followed.copy()
    mpc.change(CHOSEN.model_copy(update={"actuator_lag": 0.5}))
    assert (mpc._followed < before).all(), "the prediction follows the command by the new lag"
    mpc.change(CHOSEN.model_copy(update={"set_speed": 10.0}))
    empty = {"has_target": False}
    for k in range(1, 200):
        state = mpc.driver.drive(horizon(k * 10_000_000, **empty))
    assert state.command < -1.0


def steps_with(driver: CarDriver, first: int, count: int, told: dict | None = None, **values):
    """The last state after some steps from one on, each with a decision to follow."""
    state = None
    for k in range(first, first + count):
        driver.decide(decision((k - 1) * 10_000_000, Action.FOLLOW, **(told or {})))
        state = driver.drive(horizon(k * 10_000_000, **values))
    assert state is not None
    return state


NO_SPEED = {"measured_host_speed": float("nan"), "host_speed_stale": True}
EMPTY = {
    "has_target": False,
    "measured_clearance": float("nan"),
    "measured_relative_velocity": float("nan"),
}


@pytest.mark.parametrize("lead", [{}, {"measured_clearance": 90.0}, EMPTY])
def test_a_car_that_knows_no_speed_of_its_own_does_not_speed_up(lead: dict) -> None:
    state = steps_with(CarDriver(CHOSEN), 1, 500, **NO_SPEED, **lead)
    assert state.command <= 0.0 and "own speed is not known" in state.reason
    assert state.host_speed_source == Source.NONE
    if "measured_clearance" not in lead:
        assert state.desired_clearance == 35.0, "it comes no nearer"


def test_a_lost_speed_is_carried_on_for_ten_seconds_only() -> None:
    driver = CarDriver(CHOSEN)
    steps_with(driver, 1, 100)
    lost = {"host_speed_usable": False}
    last = 100 + round(100 * CARRIED)
    state = steps_with(driver, 101, last - 120, lost, measured_acceleration=0.1, **EMPTY)
    assert state.host_speed_source == Source.RECONSTRUCTED
    assert state.host_speed == pytest.approx(20.0 + 0.1 * (CARRIED - 0.2), abs=0.05)
    far = state.desired_clearance
    state = steps_with(driver, last, 100, lost, measured_acceleration=0.1, **EMPTY)
    assert state.host_speed_source == Source.NONE and state.command <= 0.0
    assert state.desired_clearance == pytest.approx(far, abs=0.2)


def test_a_speed_of_another_time_is_not_carried_on() -> None:
    driver, lost = CarDriver(CHOSEN), {"host_speed_usable": False}
    steps_with(driver, 1000, 100)
    assert steps_with(driver, 1, 10, lost).host_speed_source == Source.NONE
    assert steps_with(driver, 11, 1).host_speed_source == Source.MEASURED


def test_a_speed_that_jumped_is_carried_on_from_before_the_jump() -> None:
    """Its fault is told two steps later."""
    driver = CarDriver(CHOSEN)
    steps_with(driver, 1, 100)
    steps_with(driver, 101, 3, measured_host_speed=10.0)
    state = steps_with(driver, 104, 10, {"host_speed_usable": False}, measured_host_speed=10.0)
    assert state.host_speed == pytest.approx(20.0, abs=0.1)


def test_time_that_goes_back_gives_no_time_without_decisions() -> None:
    driver = CarDriver(CHOSEN)
    steps_with(driver, 1000, 100)
    for k in range(1, 30):
        state = driver.drive(horizon(k * 10_000_000, restart=k == 1))
        late = k - 1 > round(100 * CHOSEN.decision_timeout)
        assert (state.action == Action.STOP) == late, k


def test_a_decision_of_another_time_is_none() -> None:
    driver = CarDriver(CHOSEN)
    driver.decide(decision(50_000_000_000, Action.FOLLOW))
    state = driver.drive(horizon(10_000_000))
    assert state.action == Action.STOP and "a decision of 49.99 s later" in state.reason


@pytest.mark.parametrize("value", [1.7e308, float("inf")])
def test_a_value_that_no_lead_has_makes_no_command_that_is_no_number(value: float) -> None:
    driver = CarDriver(CHOSEN)
    steps_with(driver, 1, 10)
    steps_with(driver, 11, 1, measured_clearance=value)
    for k in range(12, 100):
        state = steps_with(driver, k, 1)
        assert np.isfinite(state.command)
    assert steps_with(driver, 100, 300).command == pytest.approx(driven(3.0).command, abs=0.05)


def test_what_was_not_measured_is_not_called_so() -> None:
    state = steps_with(CarDriver(CHOSEN), 1, 10, measured_clearance=float("nan"))
    assert state.clearance_source == Source.NONE and np.isnan(state.clearance)
    assert driven(1.0, measured_host_speed=-20.0).desired_clearance >= CHOSEN.minimum_clearance


def test_a_hard_stop_stays_hard_where_the_speed_is_only_carried() -> None:
    driver, stop = CarDriver(CHOSEN), {"host_speed_usable": False, "deceleration": 7.0}
    steps_with(driver, 1, 100, measured_host_speed=3.0)
    for k in range(101, 200):
        driver.decide(decision((k - 1) * 10_000_000, Action.STOP, **stop))
        state = driver.drive(horizon(k * 10_000_000, measured_acceleration=-0.1))
    assert state.host_speed_source == Source.RECONSTRUCTED
    assert state.command == pytest.approx(-7.0)
