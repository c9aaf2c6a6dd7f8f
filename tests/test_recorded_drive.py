"""The recorded drive shows what a faithful build shows."""

import itertools
import json
from pathlib import Path

import pytest
from test_other_sensors import faults

from lfd_diagnosis.verdict import VERDICTS, State
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, INPUTS, RADAR, playing_order
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.evaluation.cases import load_drive
from lfd_replay.evaluation.recorded_noise import RECORDED_SENSORS, recorded_sensors_drive
from lfd_replay.evaluation.recorded_tracks import (
    BACKWARD,
    LANES,
    TRACK_COUNT,
    TRACK_IDS,
    backward,
    recorded_tracks,
    track_drive,
    track_id_drive,
)
from lfd_replay.evaluation.recorded_views import VIEWS, seen_by
from lfd_replay.evaluation.requirements.windows import Run, run_windows
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.import_drive import main_import
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings

NAME = "comma2k19_rav4_seg40"
ZERO = 0.0049
"""The drive's time zero in the file's own time: the first acceleration sample."""

RADAR_FIRST = 7.2583
"""First radar sample in the file's own time, in s."""

START, END = RADAR_FIRST + 20 - ZERO, RADAR_FIRST + 35 - ZERO


@pytest.fixture
def drive(data: Path, tmp_path: Path) -> Path:
    out = tmp_path / "drive.mcap"
    base = data / NAME
    arguments = [f"{base}_lead.csv", "--accel", f"{base}.can_accel_0x24.csv:acc_forward_mps2"]
    assert (
        run_command(main_import, [*arguments, "--speed", f"{base}.speed.csv", "-o", str(out)]) == 0
    )
    return out


def evaluate(drive: Path, fault: str = "", profile: str = "paper") -> dict:
    result = drive.with_suffix(".json")
    faults = ["--fault", f"{fault}@{START:.4f}-{END:.4f}"] if fault else []
    assert (
        run_command(
            main_evaluate, [str(drive), *faults, "--profile", profile, "--json", str(result)]
        )
        == 0
    )
    return json.loads(result.read_text())["sensors"]


def test_healthy_nothing_is_faulty_before_the_lead_brakes_hard(drive: Path) -> None:
    sensors = evaluate(drive)
    assert sensors["clearance"]["flagged"] == sensors["relative_velocity"]["flagged"] == []
    assert all(start > 57.5 - ZERO for start, _ in sensors["acceleration"]["flagged"])
    assert sensors["clearance"]["detected"] is None


def test_an_offset_of_the_radar_is_found_by_the_clearance(drive: Path) -> None:
    sensors = evaluate(drive, "offset:clearance=4,relative_velocity=-10")
    assert sensors["clearance"]["detected"] and sensors["clearance"]["delay_s"] <= 0.150
    assert sensors["clearance"]["flagged_fraction"] >= 0.97
    assert sensors["clearance"]["false_events"] == 0
    assert all(start >= START for start, _ in sensors["acceleration"]["flagged"])


def test_an_offset_of_the_acceleration_is_found(drive: Path) -> None:
    sensors = evaluate(drive, "offset:acceleration=4")
    assert 0.090 <= sensors["acceleration"]["delay_s"] <= 0.130
    assert sensors["acceleration"]["flagged_fraction"] >= 0.97
    assert sensors["clearance"]["flagged"] == sensors["relative_velocity"]["flagged"] == []


def test_offsets_of_both_are_found(drive: Path) -> None:
    sensors = evaluate(drive, "offset:clearance=4,relative_velocity=-10,acceleration=4")
    assert sensors["radar"]["delay_s"] <= 0.150
    assert sensors["acceleration"]["delay_s"] <= 0.350


ROBUST = [
    ("offset:clearance=4,relative_velocity=-10", {"clearance", "relative_velocity"}),
    ("offset:acceleration=4", {"acceleration"}),
    (
        "offset:clearance=4,relative_velocity=-10,acceleration=4",
        {"clearance", "relative_velocity", "acceleration"},
    ),
]


@pytest.mark.parametrize(("fault", "injected"), ROBUST)
def test_the_robust_profile_names_exactly_what_is_faulty(drive: Path, fault, injected) -> None:
    for name, figures in evaluate(drive, fault, "robust").items():
        if name in injected:
            most = 0.2 if name == "acceleration" else 0.13
            assert figures["detected"] and figures["delay_s"] <= most, name
            assert figures["flagged_fraction"] >= 0.97, name
            assert all(end <= END + 1.5 for _, end in figures["flagged"]), name
        elif name != "radar":
            assert figures["flagged"] == [], name
        assert figures["false_events"] == 0 and figures["ready_fraction"] >= 0.95, name


def test_the_robust_profile_is_silent_on_the_healthy_drive(drive: Path) -> None:
    for name, figures in evaluate(drive, profile="robust").items():
        assert figures["flagged"] == [] and figures["ready_fraction"] >= 0.95, name


def test_the_robust_profile_knows_a_car_under_another_id(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "drive.mcap"
    base = data / NAME
    arguments = [f"{base}_nearest_in_path.csv", "--map", "track_id=track_addr", "-o", str(out)]
    arguments += ["--accel", f"{base}.can_accel_0x24.csv:acc_forward_mps2"]
    assert run_command(main_import, [*arguments, "--speed", f"{base}.speed.csv"]) == 0
    for name, figures in evaluate(out, profile="robust").items():
        assert figures["flagged"] == [] and figures["ready_fraction"] >= 0.95, name
    result = out.with_suffix(".json")
    fault = "offset:clearance=4,relative_velocity=-10@22-27"
    assert run_command(main_evaluate, [str(out), "--fault", fault, "--json", str(result)]) == 0
    sensors = json.loads(result.read_text())["sensors"]
    assert sensors["clearance"]["detected"] and sensors["relative_velocity"]["detected"]
    assert sensors["acceleration"]["flagged"] == []


def called_faulty(drive: Drive) -> list[tuple[str, str, str]]:
    """What the robust profile says of a drive: its name, signals and reasons."""
    return [(drive.name, e.signal, e.fault.reason) for e in faults(drive.samples)]


def test_no_track_of_the_recorded_radar_is_called_faulty(data: Path) -> None:
    """Reflections wander over cars, tracks end beside them: none of it is a sensor's fault."""
    assert len(recorded_tracks(data)) == TRACK_COUNT
    drives = [track_drive(data, number) for number in range(TRACK_COUNT)]
    assert sum(drive.duration for drive in drives) > 400.0
    assert [said for drive in drives for said in called_faulty(drive)] == []


def test_targets_that_the_recorded_radar_gives_one_id_are_no_faults(data: Path) -> None:
    """From one scan to the next, or some scans later. Two ids are left: one sees a target 3.3 m off
    after half a second, the other one that is rough."""
    drives = {number: track_id_drive(data, number) for number in TRACK_IDS}
    assert sum(drive.duration for drive in drives.values()) > 600.0
    said = {number for number, drive in drives.items() if called_faulty(drive)}
    assert said <= {529, 532}


def test_a_drive_played_backward_is_another_drive_of_the_same_sensors(data: Path) -> None:
    drive = track_drive(data, 0)
    reverse = backward(drive)
    assert (reverse.zero, reverse.duration) == (drive.zero, drive.duration)
    scans = [s for s in reverse.samples if s.input == "radar"]
    travelled = sum(
        0.5e-9 * (a.relative_velocity + b.relative_velocity) * (b.stamp - a.stamp)
        for a, b in itertools.pairwise(scans)
    )
    assert scans[-1].clearance - scans[0].clearance == pytest.approx(travelled, abs=3.0)
    assert abs(travelled) > 5.0
    again = backward(reverse)
    assert sorted(again.samples, key=playing_order) == sorted(drive.samples, key=playing_order)


@pytest.mark.parametrize(
    ("number", "fault"),
    [(1, "clearance=2@11.3-15.3"), (0, "clearance=-2@36-40"), (2, "clearance=2@31.6-35.6")],
)
def test_a_real_radar_that_says_the_same_for_a_while_is_not_held(data, number, fault) -> None:
    drive = track_drive(data, number)
    samples = FaultInjector(parse_faults([f"offset:{fault}"]), drive.zero, 1).apply(drive.samples)
    assert {event.signal for event in faults(samples)} == {"clearance", "radar"}


def test_traffic_is_seen_by_the_recorded_sensors_as_the_seed_has_it(data: Path) -> None:
    made = recorded_sensors_drive(data, "traffic-02", 1)
    assert recorded_sensors_drive(data, "traffic-02", 1).samples == made.samples
    scans = [sample for sample in made.samples if sample.input == RADAR]
    other = recorded_sensors_drive(data, "traffic-02", 2).samples
    assert [s.clearance for s in other if s.input == RADAR] != [s.clearance for s in scans]
    assert min(scan.clearance for scan in scans) > 1.0
    gaps = [(b.stamp - a.stamp) * 1e-9 for a, b in itertools.pairwise(scans)]
    assert 0.005 < sum(gap > 0.08 for gap in gaps) / len(gaps) < 0.05 and max(gaps) < 2.0


@pytest.mark.parametrize("name", ["traffic-02", "traffic-05", "traffic-68"])
def test_traffic_with_its_stops_raises_no_fault(data: Path, name: str) -> None:
    assert not faults(recorded_sensors_drive(data, name, 1).samples)


@pytest.mark.parametrize("name", ["hilly-17", "hilly-33", "hilly-55", "hilly-61", "hilly-63"])
def test_hills_are_no_faults_of_the_accelerometer(data: Path, name: str) -> None:
    assert not faults(recorded_sensors_drive(data, name, 2).samples)


@pytest.mark.parametrize(
    ("name", "seed", "start"),
    [("normal-03", 528, 36.94), ("normal-17", 530, 36.668), ("normal-22", 530, 66.418)],
)
def test_an_acceleration_that_jumps_on_a_rough_road_is_told_at_once(
    data, name, seed, start
) -> None:
    """A bump widens the limits, but does not last."""
    drive = recorded_sensors_drive(data, name, seed)
    injected = parse_faults([f"offset:acceleration=4@{start}-{start + 4}"])
    samples = FaultInjector(injected, drive.zero, 1).apply(drive.samples)
    found = [
        (event.stamp - drive.zero) * 1e-9
        for event in faults(samples)
        if event.signal == "acceleration"
    ]
    assert len(found) == 1
    assert start < found[0] < start + 0.125


@pytest.mark.parametrize(
    ("view", "name", "seed"),
    [
        ("phone", "traffic-03", 2),
        ("phone", "traffic-32", 2),
        ("phone, joined at 20 Hz", "traffic-06", 2),
        ("phone, joined at 20 Hz", "traffic-48", 2),
        ("phone, joined at 10 Hz", "traffic-75", 2),
        ("phone, joined at 10 Hz", "traffic-41", 4),
    ],
)
@pytest.mark.parametrize("host_speed", [True, False])
def test_a_phone_that_bumps_swing_is_healthy_in_traffic_too(
    data: Path, view: str, name: str, seed: int, host_speed: bool
) -> None:
    samples = recorded_sensors_drive(data, name, seed, None, VIEWS[view]).samples
    assert not faults([s for s in samples if host_speed or s.input != HOST_SPEED])


@pytest.mark.parametrize("name", ["traffic-49", "traffic-86"])
def test_another_part_of_the_car_is_no_held_relative_velocity(data: Path, name: str) -> None:
    """The clearance goes over to it within some scans, while that happens to say the same."""
    assert not faults(recorded_sensors_drive(data, name, 5).samples)


@pytest.mark.parametrize("number", [8, 61, 76])
def test_a_radar_that_loses_its_lead_now_and_then_is_healthy(data: Path, number: int) -> None:
    name, mishap = f"traffic-{number:02}", "a radar that loses its lead"
    run = Run(name, 2, sensor=RECORDED_SENSORS, mishap=mishap)
    assert not any(run_windows(run, data)["robust"]["false"].values())


@pytest.mark.parametrize("number", [16, 64, 82])
def test_an_accelerometer_that_is_silent_now_and_then_is_healthy(data: Path, number: int) -> None:
    run = Run(f"traffic-{number}", 2, sensor=RECORDED_SENSORS, mishap="a silent accelerometer")
    assert not any(run_windows(run, data)["robust"]["false"].values())


@pytest.mark.parametrize(
    ("drive", "start", "most"),
    [(f"{BACKWARD}{NAME}", 20.0, 1.05), (f"{BACKWARD}track 0", 32.0, 0.9)],
)
def test_a_held_relative_velocity_is_told_sooner_where_host_and_lead_say_the_same(
    data: Path, drive: str, start: float, most: float
) -> None:
    """Host and lead alone would be too close to their limit, and so would the clearance."""
    run = Run(drive, 1, (f"hold:relative_velocity@{start}-{start + 4}",))
    (window,) = run_windows(run, data)["robust"]["windows"]
    assert window["signals"]["relative_velocity"]["delay"] <= most
    assert not window["blamed"]


@pytest.mark.parametrize("view", VIEWS)
def test_the_recorded_car_is_healthy_with_other_sensors_too(data: Path, view: str) -> None:
    for number in (None, 0, 2, 4, 5, 9, 23):
        base = load_drive(NAME, data) if number is None else track_drive(data, number)
        seen = seen_by(view, base, data)
        assert all(sample.input in INPUTS for sample in seen.samples)
        assert seen.count(ACCELERATION) > 9 * seen.duration
        flagged = {
            name
            for rows in OfflineGraph(graph_settings("robust")).rows(seen.samples)
            for name in VERDICTS
            if (rows["outcome"][name]["state"] == State.FAULT).any()
        }
        assert not flagged, number


@pytest.mark.parametrize("lane", [*LANES[::5], *(f"{BACKWARD}{lane}" for lane in LANES[1::5])])
def test_whatever_is_nearest_in_a_lane_is_healthy(data: Path, lane: str) -> None:
    """Targets come and go, and take each other's ids."""
    made = run_windows(Run(lane, 0), data)["robust"]
    assert not any(made["false"].values()) and made["ready"]["clearance"] > 0.5


@pytest.mark.parametrize(
    ("view", "number", "fault", "named"),
    [
        # Its relative velocity says the same ten times beside a clearance of zero.
        ("", 2, "zero:clearance@14-18", {"clearance", "radar"}),
        # So does this one, while its clearance already drifts.
        ("", 1, "ramp:clearance=0.5@11-19", {"clearance", "radar"}),
        ("backward ", 3, "ramp:relative_velocity=0.5@11-19", {"relative_velocity", "radar"}),
        # A clearance of a steady target, of which nobody says how fast it is.
        ("backward ", 3, "dropout:relative_velocity@8-12", set()),
    ],
)
def test_what_a_real_radar_repeats_blames_nobody_but_the_faulty_signal(
    data, view, number, fault, named
) -> None:
    drive = track_drive(data, number)
    drive = backward(drive) if view else drive
    samples = FaultInjector(parse_faults([fault]), drive.zero, 1).apply(drive.samples)
    said = faults(samples)
    assert {event.signal for event in said if event.fault.state == State.FAULT} == named


@pytest.mark.parametrize(
    ("view", "number", "fault"),
    [
        ("", 0, "zero:relative_velocity@44-48"),
        ("backward ", 0, "zero:relative_velocity@14-18"),
        ("backward ", 0, "zero:acceleration@20-24"),
        ("", 2, "zero:acceleration@17-21"),
    ],
)
def test_a_real_sensor_that_falls_to_zero_is_told_within_half_a_second(
    data, view, number, fault
) -> None:
    """Below the limits of an offset: zero is not what it would have said."""
    drive = track_drive(data, number)
    drive = backward(drive) if view else drive
    (injected,) = parse_faults([fault])
    samples = FaultInjector([injected], drive.zero, 1).apply(drive.samples)
    event = faults(samples)[0]
    assert event.signal in injected.signals and "the same value" in event.fault.reason
    delay = event.stamp - drive.zero - injected.start
    assert delay <= 0.5e9
