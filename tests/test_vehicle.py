"""The simulated vehicle: its model, its actuators, its lead and its sensors."""

from dataclasses import replace
from math import inf, nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vehiclemodels.init_mb import init_mb
from vehiclemodels.vehicle_dynamics_mb import vehicle_dynamics_mb

from lfd_mpc.compiled import entry
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample
from lfd_mpc.settings import MpcSettings
from lfd_replay.drive import Drive
from lfd_replay.faults import parse_faults
from lfd_replay.generated.car_following import Truth
from lfd_replay.generated.generate import generate_drive
from lfd_replay.generated.sensor_models import GRAVITY, SENSORS
from lfd_vehicle.lead import Lead, lead_plan, recorded_lead
from lfd_vehicle.library_model import CONSTANTS, PARAMETERS, derivative
from lfd_vehicle.sensing import Moment, Sensing
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.vehicle import DivergenceError, Motion, Vehicle
from lfd_vehicle.world import Scenario, World

MODELS = ("multi_body", "point_mass")


@entry
def compiled_derivative(state, inputs):
    return derivative(state, inputs, CONSTANTS)


@pytest.mark.parametrize(("speed", "acceleration"), [(20.0, -4.0), (1.0, 2.0), (35.0, 0.0)])
def test_the_compiled_model_is_the_librarys(speed: float, acceleration: float) -> None:
    state = np.array(init_mb([0.0, 0.0, 0.02, speed, 0.1, 0.05, 0.01], PARAMETERS))
    state[6:] += np.linspace(-1e-3, 1e-3, len(state) - 6)
    inputs = np.array([0.01, acceleration])
    own = compiled_derivative(state.copy(), inputs)
    assert len(own) == 29
    assert np.allclose(
        own, vehicle_dynamics_mb(list(state), list(inputs), PARAMETERS), rtol=1e-9, atol=1e-9
    )


def drive(vehicle: Vehicle, commands, grade: float = 0.0) -> list[Motion]:
    seen = []
    for command in commands:
        vehicle.command(command)
        seen.append(replace(vehicle.step(grade)))
    return seen


@pytest.mark.parametrize("model", MODELS)
def test_it_does_what_it_is_told_within_its_lags(model: str) -> None:
    vehicle = Vehicle(VehicleSettings(model=model), 0.0, 20.0)
    braking = drive(vehicle, [-3.0] * 300)
    assert braking[14].acceleration > -2.5, "the brakes need time"
    assert braking[299].acceleration == pytest.approx(-3.0, abs=0.15)
    assert braking[299].pitch < -0.01, "the nose goes down"
    speeding = drive(vehicle, [1.5] * 300)
    assert speeding[299].acceleration == pytest.approx(1.5, abs=0.1)
    assert speeding[299].pitch > 0.003
    assert drive(vehicle, [20.0] * 300)[-1].acceleration <= VehicleSettings().strongest_drive + 0.1


@pytest.mark.parametrize("model", MODELS)
def test_it_stops_stands_and_sets_off_again(model: str) -> None:
    vehicle = Vehicle(VehicleSettings(model=model), 0.0, 8.0)
    seen = drive(vehicle, [-3.0] * 500 + [-1.5] * 200 + [1.0] * 600)
    assert all(np.isfinite([m.speed, m.acceleration, m.pitch]).all() for m in seen)
    assert min(m.speed for m in seen) == 0.0
    standing = seen[450:700]
    assert {m.speed for m in standing} == {0.0} and standing[-1].acceleration == 0.0
    assert len({m.position for m in standing}) == 1, "it does not creep"
    assert seen[-1].speed > 4.0
    if model == "multi_body":
        # Both models hand over without a jolt: nothing but the standstill itself changes much.
        slow = [k for k, m in enumerate(seen) if 0.3 < m.speed < 3.0]
        jumps = [
            abs(seen[k].acceleration - seen[k - 1].acceleration) for k in slow if k - 1 in slow
        ]
        assert max(jumps) < 0.15
        pitches = [abs(seen[k].pitch - seen[k - 1].pitch) for k in slow if k - 1 in slow]
        assert max(pitches) < 0.002


@pytest.mark.parametrize("model", MODELS)
def test_a_slope_slows_it_until_its_own_control_makes_up_for_it(model: str) -> None:
    vehicle = Vehicle(VehicleSettings(model=model), 0.0, 20.0)
    seen = drive(vehicle, [0.0] * 800, grade=0.06)
    assert seen[30].acceleration < -0.4
    assert abs(seen[-1].acceleration) < 0.05 and seen[-1].speed > 19.0


@pytest.mark.parametrize("model", MODELS)
def test_without_a_command_it_coasts_and_then_brakes_to_standstill(model: str) -> None:
    chosen = VehicleSettings(model=model)
    vehicle = Vehicle(chosen, 0.0, 15.0)
    drive(vehicle, [1.0] * 100)
    seen = []
    for _ in range(900):
        seen.append(replace(vehicle.step(0.0)))
        assert vehicle.actuation.lost == (len(seen) >= round(100 * chosen.brake_after))
    after = round(100 * chosen.coast_after)
    assert seen[after - 5].acceleration == pytest.approx(1.0, abs=0.1)
    assert abs(seen[48].acceleration) < 0.4
    assert min(m.acceleration for m in seen) == pytest.approx(-chosen.lost_braking, abs=0.3)
    assert seen[-1].speed == 0.0


@pytest.mark.parametrize("command", [float("nan"), float("inf"), -float("inf")])
def test_a_command_that_is_no_number_is_refused(command: float) -> None:
    vehicle = Vehicle(VehicleSettings(), 0.0, 15.0)
    with pytest.raises(ValueError, match="a command of"):
        vehicle.command(command)
    assert np.isfinite(vehicle.step(0.0).speed)


def test_a_model_that_diverges_says_so() -> None:
    vehicle = Vehicle(VehicleSettings(), 0.0, 15.0)
    assert vehicle._state is not None
    vehicle._state[9] = 1e6
    with pytest.raises(DivergenceError, match="point_mass"):
        drive(vehicle, [0.0] * 10)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.floats(-9.0, 4.0), min_size=1, max_size=8), st.floats(0.0, 40.0))
def test_any_commands_leave_it_possible(commands: list[float], speed: float) -> None:
    vehicle = Vehicle(VehicleSettings(), 0.0, speed)
    for command in commands:
        for motion in drive(vehicle, [command] * 60):
            assert 0.0 <= motion.speed < 60.0 and abs(motion.pitch) < 0.2
            assert -12.0 < motion.acceleration < 6.0


# --- the lead


def test_a_lead_in_steps() -> None:
    motion = lead_plan("20,-3@1-3,2@4-5")
    lead = Lead(motion, 30.0)
    speeds = []
    for _ in range(600):
        lead.step(0.0)
        speeds.append(lead.speed)
    assert speeds[99] == pytest.approx(20.0)
    assert speeds[299] == pytest.approx(14.0) and speeds[350] == pytest.approx(14.0)
    assert speeds[-1] == pytest.approx(16.0)
    assert lead.position > 30.0 + 5.0 * 14.0


def test_a_lead_stops_and_does_not_drive_backwards_and_can_be_told() -> None:
    lead = Lead(lead_plan("5,-3@0-10"), 30.0)
    for _ in range(400):
        lead.step(0.0)
    assert lead.speed == 0.0 and lead.acceleration == 0.0
    lead.tell(1.0)
    for _ in range(200):
        lead.step(0.0)
    assert lead.speed == pytest.approx(2.0, abs=0.05)
    for wrong in (float("nan"), 13.0, -13.0, float("inf")):
        with pytest.raises(ValueError, match="lead cannot"):
            lead.tell(wrong)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("nowhere", "lead 'nowhere': no file"),
        ("20,-3@5", "is no step"),
        ("20,-3@5-3", "start before"),
        ("20,-13@5-6", "-12 to 12"),
        ("-1", "speed of 0 to 70"),
        ("90", "speed of 0 to 70"),
        ("60,5@0-10", "would reach"),
        ("braking:-9", "lead 'braking:-9': peak -9: -8 to -0.5"),
        ("braking:nan", "lead 'braking:nan': peak nan: -8 to -0.5"),
        ("braking:hard", "is no number"),
        ("data-1:-3", "lead 'data-1:-3': a peak belongs"),
        ("20,nan@1-2", "is no step"),
    ],
)
def test_an_impossible_lead_is_refused_in_one_line(text: str, named: str) -> None:
    with pytest.raises(UserError) as caught:
        lead_plan(text)
    assert named in str(caught.value) and "\n" not in str(caught.value)


def test_a_recorded_lead_moves_as_the_recorded_one_did() -> None:
    recorded = generate_drive("data-3", 1, "esr")
    own = recorded_lead(recorded)
    made = lead_plan("data-3")
    count = min(len(own.acceleration), len(made.acceleration))
    speed = own.speed + np.cumsum(own.acceleration[:count]) * 0.01
    wanted = made.speed + np.cumsum(made.acceleration[:count]) * 0.01
    assert np.abs(speed - wanted).max() < 0.5, "a wheel radius may be off by 1 %"
    assert own.acceleration.min() < -1.5
    without = [s for s in recorded.samples if s.input != HOST_SPEED]
    with pytest.raises(UserError, match="host speed"):
        recorded_lead(replace(recorded, samples=without))


@pytest.mark.parametrize("odd", [nan, inf, -inf])
def test_a_host_speed_that_is_no_number_costs_no_recorded_lead(odd: float) -> None:
    recorded = generate_drive("data-3", 1, "esr")
    samples = list(recorded.samples)
    number = [i for i, s in enumerate(samples) if s.input == HOST_SPEED][100]
    left_out = [*samples[:number], *samples[number + 1 :]]
    samples[number] = replace(samples[number], value=odd)
    own = recorded_lead(replace(recorded, samples=samples))
    wanted = recorded_lead(replace(recorded, samples=left_out))
    assert (own.acceleration == wanted.acceleration).all()


def test_a_recorded_lead_must_be_there_for_most_of_the_time() -> None:
    recorded = generate_drive("data-3", 1, "esr")
    zero, end = recorded.zero, recorded.zero + round(recorded.duration * 1e9)

    def seen(shares: tuple[float, float]) -> Drive:
        """With an empty road from one share of the drive to another."""
        first, last = (zero + share * (end - zero) for share in shares)
        samples = [
            replace(s, has_target=False, clearance=nan, relative_velocity=nan)
            if isinstance(s, RadarSample) and first < s.stamp < last
            else s
            for s in recorded.samples
        ]
        return replace(recorded, samples=samples)

    whole = len(recorded_lead(recorded).acceleration)
    assert len(recorded_lead(seen((0.2, 0.6))).acceleration) == whole
    # What comes before the lead and after it is not driven.
    late = len(recorded_lead(seen((-0.1, 0.8))).acceleration)
    assert late == pytest.approx(0.2 * whole, rel=0.05)
    with pytest.raises(UserError, match=r"no lead for \d+\.\d of .* s .* 50% of that time"):
        recorded_lead(seen((0.1, 0.9)))


# --- the sensors


def test_sensing_step_by_step_gives_what_sensing_at_once_gives() -> None:
    count = 900
    time = np.arange(count) * 0.01
    truth = Truth(
        time=time,
        clearance=30.0 + np.sin(time),
        relative_velocity=np.cos(time),
        host_speed=20.0 - np.sin(0.5 * time),
        host_acceleration=-0.5 * np.cos(0.5 * time),
        lead_acceleration=np.zeros(count),
        grade=0.02 * np.sin(time),
        track_id=np.where(time < 5.0, 1, 2),
        bumps=(3.0, 6.5),
        pitch=0.01 * np.sin(2.0 * time),
    )
    whole = SENSORS["esr"].sense(truth, 3, "x")
    sensing = Sensing(SENSORS["esr"], float(time[-1]), truth.bumps, 3, "x")
    seen = []
    for k in range(count):
        moment = Moment(
            *(
                float(getattr(truth, name)[k])
                for name in ("clearance", "relative_velocity", "host_speed")
            ),
            float(truth.host_acceleration[k]),
            0.0,
            float(truth.grade[k]),
            float(truth.pitch[k]),
            int(truth.track_id[k]),
        )
        seen += sensing.sense(moment)
    for name in (RADAR, HOST_SPEED):
        own = [sample for sample in seen if sample.input == name]
        assert own == whole[name][: len(own)] and len(whole[name]) - len(own) <= 2
    own = [s for s in seen if s.input == ACCELERATION]
    expected = whole[ACCELERATION][: len(own)]
    assert [s.stamp for s in own] == [s.stamp for s in expected]
    # What is sensed within the last 10 ms is not yet there to interpolate to.
    off = [abs(a.value - b.value) for a, b in zip(own, expected, strict=True)]
    assert max(off) < 2e-3


def test_the_accelerometer_feels_gravity_in_the_pitching_body() -> None:
    own = SENSORS["esr"].accelerometer
    silent = replace(own.noise, white=0.0, shaking=0.0)
    suite = replace(SENSORS["esr"], accelerometer=replace(own, bias=0.0, wander=0.0, noise=silent))
    sensing = Sensing(suite, 5.0, (), 1, "x")
    seen = []
    for _ in range(200):
        seen += sensing.sense(Moment(30.0, 0.0, 20.0, 1.0, 0.0, 0.05, 0.02, 1))
    felt = [s.value for s in seen if s.input == ACCELERATION][-1]
    assert felt == pytest.approx(1.0 + GRAVITY * np.sin(np.arctan(0.05) + 0.02), abs=1e-6)


def test_the_world_injects_faults_and_ends_at_a_collision() -> None:
    faults = tuple(parse_faults(["offset:clearance=4@0.5-1;dropout:acceleration@1-2"]))
    world = World(Scenario(lead_plan("10"), faults, 20.0, 20.0), VehicleSettings(), MpcSettings())
    seen = []
    while not world.ended:
        seen += world.sense()
        world.vehicle.command(0.0)
        world.step()
    assert world.collided and world.moment.clearance <= 0.0
    assert world.stamp == pytest.approx(2e9, abs=0.05e9)
    scans = {round(s.stamp * 1e-9, 2): s.clearance for s in seen if s.input == RADAR}
    assert scans[0.45] == pytest.approx(20.0 - 4.5 + 0.2, abs=0.5)
    assert scans[0.55] == pytest.approx(20.0 - 5.5 + 0.2 + 4.0, abs=0.5)
    assert not [s for s in seen if s.input == ACCELERATION and s.stamp >= 1_000_000_000]


def test_a_beginning_that_cannot_be_is_refused() -> None:
    with pytest.raises(UserError, match="a gap of"):
        World(Scenario(lead_plan("10"), (), -3.0), VehicleSettings(), MpcSettings())
    with pytest.raises(UserError, match="esr"):
        World(Scenario(lead_plan("10")), VehicleSettings(sensors="sonar"), MpcSettings())
