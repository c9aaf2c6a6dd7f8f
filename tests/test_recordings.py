"""Recordings of other people's cars: bags of each kind, comma2k19 segments, and inspect."""

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from esr_frames import candump, scan_frames
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from test_esr import HOST_DBC, host_frames
from test_live_equals_offline import play_live

from lfd_diagnosis.verdict import State
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR
from lfd_replay.drive import Drive
from lfd_replay.drive_bag import sample_message, typestore
from lfd_replay.errors import run_command
from lfd_replay.import_drive import join_drive, main_import
from lfd_replay.inspect import main_inspect
from lfd_replay.player import PlayOptions, samples_to_play
from lfd_replay.read_drive import ReadOptions, read_drive
from lfd_replay.recordings.can_log import HostSignals
from lfd_replay.recordings.message_definitions import DEFINITIONS
from lfd_replay.recordings.recorded_messages import Mounting
from ros_support import assert_live_equals_offline, offline

KINDS = ("mcap", "sqlite3", "ros1")
SECONDS = 4.0


def store(kind: str) -> Any:
    types = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_JAZZY)
    for name, text in DEFINITIONS.items():
        if name not in types.types:
            types.register(get_types_from_msg(text, name))
    return types


class Car:
    """Makes the messages of one car, of one kind of bag."""

    def __init__(self, kind: str) -> None:
        self.kind, self.store = kind, store(kind)
        self.types = self.store.types

    def make(self, name: str, **fields: Any) -> Any:
        return self.types[name](**fields)

    def header(self, time: float) -> Any:
        nanoseconds = round(time * 1e9)
        stamp = self.make(
            "builtin_interfaces/msg/Time",
            sec=nanoseconds // 1_000_000_000,
            nanosec=nanoseconds % 1_000_000_000,
        )
        extra = {"seq": 0} if self.kind == "ros1" else {}
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id="", **extra)

    def vector(self, x: float, y: float = 0.0, z: float = 0.0) -> Any:
        return self.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def imu(self, time: float, x: float, y: float = 0.0, z: float = 9.81, yaw: float = 0.0) -> Any:
        return self.make(
            "sensor_msgs/msg/Imu",
            header=self.header(time),
            orientation=self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.zeros(9),
            angular_velocity=self.vector(0.0, 0.0, yaw),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector(x, y, z),
            linear_acceleration_covariance=np.zeros(9),
        )

    def twist(self, time: float, speed: float) -> Any:
        twist = self.make(
            "geometry_msgs/msg/Twist", linear=self.vector(speed), angular=self.vector(0.0)
        )
        return self.make("geometry_msgs/msg/TwistStamped", header=self.header(time), twist=twist)

    def odometry(self, time: float, speed: float) -> Any:
        point = self.make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0)
        turn = self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        pose = self.make("geometry_msgs/msg/Pose", position=point, orientation=turn)
        twist = self.make(
            "geometry_msgs/msg/Twist", linear=self.vector(speed), angular=self.vector(0.0)
        )
        return self.make(
            "nav_msgs/msg/Odometry",
            header=self.header(time),
            child_frame_id="",
            pose=self.make(
                "geometry_msgs/msg/PoseWithCovariance", pose=pose, covariance=np.zeros(36)
            ),
            twist=self.make(
                "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)
            ),
        )

    def accel(self, time: float, x: float) -> Any:
        accel = self.make(
            "geometry_msgs/msg/Accel", linear=self.vector(x), angular=self.vector(0.0)
        )
        return self.make(
            "geometry_msgs/msg/AccelWithCovarianceStamped",
            header=self.header(time),
            accel=self.make(
                "geometry_msgs/msg/AccelWithCovariance", accel=accel, covariance=np.zeros(36)
            ),
        )

    def esr_track(self, time: float, number: int, scan: int, **fields: Any) -> Any:
        values = {
            "canmsg": "", "id": number, "lat_rate": 0.0, "grouping_changed": False,
            "oncoming": False, "status": 0, "angle": 0.0, "range": 0.0, "bridge_object": False,
            "rolling_count": bool(scan % 2), "width": 0.0, "range_accel": 0.0,
            "med_range_mode": 0, "range_rate": 0.0,
        }  # fmt: skip
        return self.make(
            "delphi_esr_msgs/msg/EsrTrack", header=self.header(time), **(values | fields)
        )

    def esr_status_4(self, time: float, in_path: int) -> Any:
        return self.make(
            "delphi_esr_msgs/msg/EsrStatus4",
            header=self.header(time), canmsg="", truck_target_det=False,
            lr_only_grating_lobe_det=False, sidelobe_blockage=False, partial_blockage=False,
            mr_lr_mode=0, rolling_count_3=0, path_id_acc=in_path, path_id_cmbb_move=0,
            path_id_cmbb_stat=0, path_id_fcw_move=0, path_id_fcw_stat=0, auto_align_angle=0.0,
            path_id_acc_stat=0,
        )  # fmt: skip

    def radar_tracks(self, time: float, *tracks: tuple[int, float, float, float]) -> Any:
        point, covariance = "geometry_msgs/msg/Point", np.zeros(6, dtype=np.float32)
        return self.make(
            "radar_msgs/msg/RadarTracks",
            header=self.header(time),
            tracks=[
                self.make(
                    "radar_msgs/msg/RadarTrack",
                    uuid=self.make(
                        "unique_identifier_msgs/msg/UUID",
                        uuid=np.full(16, number, dtype=np.uint8),
                    ),
                    position=self.make(point, x=x, y=y, z=0.0),
                    velocity=self.vector(rate),
                    acceleration=self.vector(0.0),
                    size=self.vector(4.0),
                    classification=0,
                    position_covariance=covariance,
                    velocity_covariance=covariance,
                    acceleration_covariance=covariance,
                    size_covariance=covariance,
                )
                for number, x, y, rate in tracks
            ],
        )

    def can_frame(self, time: float, identifier: int, data: bytes) -> Any:
        return self.make(
            "can_msgs/msg/Frame",
            header=self.header(time),
            id=identifier,
            is_rtr=False,
            is_extended=False,
            is_error=False,
            dlc=len(data),
            data=np.frombuffer(data, dtype=np.uint8),
        )

    def write(self, path: Path, rows: list[tuple[str, Any]]) -> Path:
        """Rows of (topic, message) as a bag; an older sqlite3 bag carries no definitions."""
        rows = sorted(rows, key=lambda row: stamp_of(row[1]))
        if self.kind == "ros1":
            path = path.with_suffix(".bag")
            with Writer1(path) as writer:
                self._fill(writer, rows, self.store.serialize_ros1)
            return path
        plugin = StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3
        version = 9 if self.kind == "mcap" else 8
        with Writer2(path, version=version, storage_plugin=plugin) as writer:
            self._fill(writer, rows, self.store.serialize_cdr)
        return path

    def _fill(self, writer: Any, rows: list[tuple[str, Any]], serialize: Any) -> None:
        connections: dict[str, Any] = {}
        for topic, message in rows:
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
            writer.write(connections[topic], stamp_of(message), serialize(message, kind))


def stamp_of(message: Any) -> int:
    stamp = message.header.stamp
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def clearance_at(time: float) -> float:
    return 30.0 - time


def times(rate: float) -> Iterator[float]:
    return (100.0 + k / rate for k in range(round(SECONDS * rate)))


def host_rows(car: Car) -> list[tuple[str, Any]]:
    rows = [("/imu/data", car.imu(t, 0.5)) for t in times(100.0)]
    return rows + [("/vehicle/speed", car.twist(t, 15.0)) for t in times(50.0)]


def esr_rows(car: Car, in_path: int | None = None) -> list[tuple[str, Any]]:
    rows: list[tuple[str, Any]] = []
    for scan, time in enumerate(times(20.0)):
        if in_path is not None:
            rows.append(("/esr/status4", car.esr_status_4(time, in_path)))
        for number in range(1, 65):
            fields = {}
            if number in (12, 30):
                distance = clearance_at(time - 100.0) + (20.0 if number == 30 else 0.0)
                fields = {"status": 3, "range": distance, "range_rate": -1.0}
            at = time + number * 0.0002
            rows.append(("/esr/tracks", car.esr_track(at, number, scan, **fields)))
    return rows


def check_lead(drive: Drive, ahead: float = 0.0) -> None:
    scans = [s for s in drive.samples if s.input == RADAR]
    assert len(scans) == SECONDS * 20
    seen = [s for s in scans if s.has_target]
    assert len(seen) >= len(scans) - 3 and len({s.track_id for s in seen}) == 1
    for scan in seen:
        expected = clearance_at(scan.stamp * 1e-9 - 100.0) + ahead
        assert scan.clearance == pytest.approx(expected, abs=0.08)
        assert scan.relative_velocity == pytest.approx(-1.0)
    felt = [s.value for s in drive.samples if s.input == ACCELERATION]
    assert len(felt) == SECONDS * 100 and set(felt) == {0.5}


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_esr_tracks_becomes_a_drive(kind: str, tmp_path: Path) -> None:
    car = Car(kind)
    bag = car.write(tmp_path / "bag", esr_rows(car) + host_rows(car))
    drive = read_drive(bag)
    check_lead(drive)
    assert drive.count(HOST_SPEED) == SECONDS * 50 and not drive.warnings


@pytest.mark.parametrize("kind", KINDS)
def test_the_radar_s_own_choice_in_a_bag_goes_first(kind: str, tmp_path: Path) -> None:
    car = Car(kind)
    bag = car.write(tmp_path / "bag", esr_rows(car, in_path=30) + host_rows(car))
    check_lead(read_drive(bag), ahead=20.0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_radar_tracks_becomes_a_drive(kind: str, tmp_path: Path) -> None:
    car = Car(kind)
    rows = [
        (
            "/radar/tracks",
            car.radar_tracks(t, (7, clearance_at(t - 100), 0.2, -1.0), (9, 12.0, 5.0, 0.0)),
        )
        for t in times(20.0)
    ]
    check_lead(read_drive(car.write(tmp_path / "bag", rows + host_rows(car))))


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_can_frames_becomes_a_drive(kind: str, tmp_path: Path) -> None:
    car, dbc = Car(kind), tmp_path / "car.dbc"
    dbc.write_text(HOST_DBC)
    frames = []
    for scan, time in enumerate(times(20.0)):
        lead = {"STATUS": 3, "RANGE": clearance_at(time - 100.0), "RANGE_RATE": -1.0}
        frames += scan_frames(time, scan, {12: lead})
    for time in times(100.0):
        frames += host_frames(time, 15.0, 0.5)
    rows = [("/can/rx", car.can_frame(*frame)) for frame in frames]
    bag, out = car.write(tmp_path / "bag", rows), tmp_path / "out.mcap"
    options = ["--host-dbc", str(dbc), "--speed-signal", "SPEED.SPEED", "--accel-signal", "ACCEL_X"]
    assert run_command(main_import, [str(bag), *options, "-o", str(out)]) == 0
    check_lead(read_drive(out))


def host_on_can(car: Car) -> list[tuple[str, Any]]:
    """Frames of the host, and of a second radar that sees another car at 80 m."""
    frames = [frame for time in times(100.0) for frame in host_frames(time, 15.0, 0.5)]
    for scan, time in enumerate(times(20.0)):
        frames += scan_frames(time, scan, {3: {"STATUS": 3, "RANGE": 80.0}})
    return [("/can/rx", car.can_frame(*frame)) for frame in frames]


ON_CAN = ["--speed-signal", "SPEED.SPEED", "--accel-signal", "ACCEL_X"]


@pytest.mark.parametrize("radar", ["/radar/target", "/esr/tracks"])
def test_host_signals_on_can_go_with_any_radar(radar: str, tmp_path: Path) -> None:
    car, dbc, out = Car("mcap"), tmp_path / "car.dbc", tmp_path / "out.mcap"
    dbc.write_text(HOST_DBC)
    bag = car.write(tmp_path / "bag", esr_rows(car) + host_rows(car))
    if radar == "/radar/target":
        samples = [s for s in read_drive(bag).samples if s.input == RADAR]
        rows = [sample_message(s)[::2] for s in samples]
        car.store = typestore()
    else:
        rows = esr_rows(car) + [("/vehicle/speed", car.twist(t, 99.0)) for t in times(50.0)]
    bag = car.write(tmp_path / "mixed", rows + host_on_can(car))
    arguments = [str(bag), "--host-dbc", str(dbc), *ON_CAN, "-o", str(out)]
    assert run_command(main_import, arguments) == 0
    drive = read_drive(out)
    check_lead(drive)
    speeds = [s.value for s in drive.samples if s.input == HOST_SPEED]
    assert len(speeds) == SECONDS * 100 and set(speeds) == {15.0}, "the topic's are another source"


def test_the_lead_on_can_is_chosen_as_fast_and_as_bent_as_the_host_drives(tmp_path: Path) -> None:
    car = Car("mcap")
    rows = [("/imu/data", car.imu(t, 0.5, yaw=0.1)) for t in times(100.0)]
    rows += [("/vehicle/speed", car.twist(t, 15.0)) for t in times(50.0)]
    # One message that says nothing must not undo what is known.
    rows += [("/imu/data", car.imu(102.001, 0.5, yaw=math.nan))]
    rows += [("/vehicle/speed", car.twist(102.001, math.nan))]
    for scan, time in enumerate(times(20.0)):
        parked = {"STATUS": 3, "RANGE": 20.0, "RANGE_RATE": -15.0}
        aside = {"STATUS": 3, "RANGE": 60.0, "ANGLE": -11.3}
        frames = scan_frames(time + 0.001, scan, {3: parked, 12: aside})
        rows += [("/can/rx", car.can_frame(*frame)) for frame in frames]
    drive = read_drive(car.write(tmp_path / "bag", rows))
    seen = [s for s in drive.samples if s.input == RADAR and s.has_target]
    assert len(seen) >= SECONDS * 20 - 3
    assert {round(s.clearance, 1) for s in seen} == {58.8}


@pytest.mark.parametrize(
    ("rotation", "turning"),
    [
        ((180.0, 0.0, 0.0), (0.0, 0.0, -0.1)),
        ((0.0, 90.0, 0.0), (-0.1, 0.0, 0.0)),
        ((90.0, 0.0, 0.0), (0.0, 0.1, 0.0)),
        ((0.0, 0.0, 180.0), (0.0, 0.0, 0.1)),
    ],
)
def test_a_turned_sensor_s_yaw_rate_bends_the_path_to_its_side(
    rotation: tuple[float, float, float], turning: tuple[float, float, float], tmp_path: Path
) -> None:
    assert Mounting(rotation).yaw_rate(*turning) == pytest.approx(0.1)
    car, rows = Car("mcap"), []
    for time in times(100.0):
        imu = car.imu(time, 0.5)
        imu.angular_velocity = car.vector(*turning)
        rows += [("/imu", imu), ("/speed", car.twist(time, 15.0))]
    for time in times(20.0):
        cars = ((7, 60.0, 12.0, 0.0), (9, 50.0, -8.3, 0.0), (11, 40.0, 0.0, 0.0))
        rows.append(("/radar/tracks", car.radar_tracks(time, *cars)))
    bag = car.write(tmp_path / "bag", rows)
    drive = read_drive(bag, ReadOptions(mounting=Mounting(rotation)))
    seen = [s for s in drive.samples if s.input == RADAR and s.has_target]
    assert {s.clearance for s in seen[3:]} == {60.0}, "the one to the left"


def test_odometry_and_acceleration_with_covariance_are_host_signals(tmp_path: Path) -> None:
    car = Car("mcap")
    rows = esr_rows(car)
    rows += [("/odom", car.odometry(t, 15.0)) for t in times(50.0)]
    rows += [("/accel", car.accel(t, 0.5)) for t in times(100.0)]
    drive = read_drive(car.write(tmp_path / "bag", rows))
    check_lead(drive)
    assert {s.value for s in drive.samples if s.input == HOST_SPEED} == {15.0}


def test_the_imported_drive_is_what_every_command_reads_from_the_bag(tmp_path: Path) -> None:
    car = Car("mcap")
    bag = car.write(tmp_path / "bag", esr_rows(car) + host_rows(car))
    out = tmp_path / "out.mcap"
    assert run_command(main_import, [str(bag), "-o", str(out)]) == 0
    # By their text, since an unmeasured value is not equal to itself.
    assert str(read_drive(out).samples) == str(read_drive(bag).samples)


@pytest.mark.alone
def test_an_esr_bag_is_played_straight_into_the_graph(tmp_path: Path) -> None:
    car = Car("mcap")
    drive = read_drive(car.write(tmp_path / "bag", esr_rows(car) + host_rows(car)))
    samples = samples_to_play(drive, [], PlayOptions())
    own = offline(samples)
    assert_live_equals_offline(play_live(samples, 0.0), own)
    assert own["diagnosis/faults"][-1].clearance.state == State.OK


def test_several_topics_of_one_type_must_be_chosen_from(tmp_path: Path, capsys) -> None:
    car = Car("mcap")
    rows = esr_rows(car) + host_rows(car)
    rows += [("/imu/raw", car.imu(t, 7.0)) for t in times(100.0)]
    bag, out = car.write(tmp_path / "bag", rows), tmp_path / "out.mcap"
    assert run_command(main_import, [str(bag), "-o", str(out)]) == 2
    error = capsys.readouterr().err
    assert "/imu/data, /imu/raw; choose one with --accel-topic" in error
    assert run_command(main_import, [str(bag), "--accel-topic", "/imu/data", "-o", str(out)]) == 0
    check_lead(read_drive(out))
    assert run_command(main_import, [str(bag), "--accel-topic", "/x", "-o", str(out)]) == 2
    assert "no such topic; there are: /esr/tracks" in capsys.readouterr().err
    assert run_command(main_import, [str(bag), "--radar-topic", "/imu/raw", "-o", str(out)]) == 2
    assert "is sensor_msgs/msg/Imu; one of lfd_msgs/msg/RadarTarget" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rotation", "felt"),
    [
        ((0.0, 0.0, 180.0), (-0.5, 0.0, 9.81)),
        ((0.0, 0.0, 90.0), (0.0, -0.5, 9.81)),
        ((180.0, 0.0, 0.0), (0.5, 0.0, -9.81)),
        ((0.0, 90.0, 0.0), (-9.81, 0.0, 0.5)),
    ],
)
def test_a_turned_accelerometer_is_turned_back(
    rotation: tuple[float, float, float], felt: tuple[float, float, float], tmp_path: Path
) -> None:
    assert Mounting(rotation).forward(*felt) == pytest.approx(0.5)
    car = Car("mcap")
    rows = esr_rows(car) + [("/imu", car.imu(t, *felt)) for t in times(100.0)]
    bag = car.write(tmp_path / "bag", rows)
    drive = read_drive(bag, ReadOptions(mounting=Mounting(rotation, 0.2)))
    values = [s.value for s in drive.samples if s.input == ACCELERATION]
    np.testing.assert_allclose(values, 0.3, atol=1e-9)


def test_an_offset_is_told_at_standstill(tmp_path: Path, capsys) -> None:
    car = Car("mcap")
    rows = esr_rows(car)
    rows += [("/imu", car.imu(t, -0.62 + (1.0 if t > 102 else 0.0))) for t in times(100.0)]
    rows += [("/speed", car.twist(t, 0.0 if t < 102 else t - 102)) for t in times(50.0)]
    bag, out = car.write(tmp_path / "bag", rows), tmp_path / "out.mcap"
    arguments = [str(bag), "--imu-offset", "standstill", "-o", str(out)]
    assert run_command(main_import, arguments) == 0
    values = [s.value for s in read_drive(out).samples if s.input == ACCELERATION]
    assert values[0] == pytest.approx(0.0) and values[-1] == pytest.approx(1.0)
    moving = Car("mcap")
    bag = moving.write(tmp_path / "moving", esr_rows(moving) + host_rows(moving))
    arguments[0] = str(bag)
    assert run_command(main_import, arguments) == 2
    assert "the car stands for 0 accelerations only" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (["--imu-rotation", "1,2"], "3 numbers with commas between are expected"),
        (["--imu-offset", "much"], "a number is expected"),
        (["--host-dbc", "car.dbc"], "--host-dbc needs --speed-signal"),
        (["--host-dbc", "DBC", *ON_CAN], "--host-dbc: no topic of type can_msgs/msg/Frame"),
        (
            ["--host-dbc", "DBC", *ON_CAN, "--speed-topic", "/v"],
            "--speed-topic /v and --speed-signal SPEED.SPEED: give one",
        ),
        (["--map", "range_m=x"], "--map is for a CSV drive, and this is a bag"),
    ],
)
def test_options_that_make_no_sense_are_refused(
    option: list[str], said: str, tmp_path: Path, capsys
) -> None:
    car = Car("mcap")
    bag, dbc = car.write(tmp_path / "bag", esr_rows(car) + host_rows(car)), tmp_path / "car.dbc"
    dbc.write_text(HOST_DBC)
    option = [str(dbc) if word == "DBC" else word for word in option]
    assert run_command(main_import, [str(bag), *option, "-o", str(tmp_path / "o.mcap")]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


ROWS = (
    "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n0,30,-1,15,0.5\n0.1,30,-1,15,0.7\n"
)


def accelerations(drive: Drive) -> list[float]:
    return [s.value for s in drive.samples if s.input == ACCELERATION]


def test_the_offset_is_taken_off_whatever_the_recording_is(tmp_path: Path) -> None:
    csv, dbc = tmp_path / "drive.csv", tmp_path / "car.dbc"
    csv.write_text(ROWS)
    dbc.write_text(HOST_DBC)
    tilted = ReadOptions(
        mounting=Mounting(offset=0.25), host=HostSignals(dbc, "SPEED.SPEED", "ACCEL_X")
    )
    log = tmp_path / "drive.log"
    log.write_text(candump(scan_frames(0.0, 0, {}) + host_frames(0.02, 15.0, 0.5)))
    assert accelerations(read_drive(log, tilted)) == pytest.approx([0.25])
    tilted = replace(tilted, host=None)
    assert accelerations(read_drive(csv, tilted)) == pytest.approx([0.25, 0.45])
    assert accelerations(join_drive(csv, None, None, tilted)) == pytest.approx([0.25, 0.45])
    accel = tmp_path / "accel.csv"
    accel.write_text("t_s,forward\n0,1\n")
    car = Car("mcap")
    bag = car.write(tmp_path / "bag", esr_rows(car) + host_rows(car))
    for recording in (csv, bag):
        drive = join_drive(recording, f"{accel}:forward", None, tilted)
        assert accelerations(drive) == pytest.approx([0.75])
    found = inspected(csv, tmp_path, "--imu-offset", "3")
    assert found["inputs"][ACCELERATION]["ranges"]["acceleration"]["least"] == -2.5


@pytest.mark.parametrize(
    ("name", "option", "said"),
    [
        ("drive.csv", ["--imu-rotation", "0,0,180"], "--imu-rotation is for a bag or a comma2k19"),
        ("drive.csv", ["--accel-topic", "/imu"], "--accel-topic is for a bag, and this is a CSV"),
        ("drive.csv", ["--host-dbc", "car.dbc", *ON_CAN], "--host-dbc is for a bag or a CAN log"),
        ("drive.log", ["--imu-rotation", "0,0,180"], "and this is a CAN log"),
        ("drive.log", ["--radar-topic", "/radar"], "--radar-topic is for a bag"),
        ("segment", ["--lead-acceleration-topic", "/x"], "and this is a comma2k19 segment"),
    ],
)
def test_options_that_cannot_apply_are_refused(
    name: str, option: list[str], said: str, tmp_path: Path, capsys
) -> None:
    (tmp_path / "segment" / "processed_log").mkdir(parents=True)
    (tmp_path / "drive.log").write_text(candump(scan_frames(0.0, 0, {})))
    (tmp_path / "drive.csv").write_text(ROWS)
    arguments = [str(tmp_path / name), *option, "-o", str(tmp_path / "out.mcap")]
    assert run_command(main_import, arguments) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def segment_of(data: Path, folder: Path, named: bool = True) -> Path:
    """The recorded drive in the layout of the data set that it is from."""
    base = f"{data}/comma2k19_rav4_seg40"
    tracks = np.genfromtxt(f"{base}.radar_alltracks.csv", delimiter=",", names=True)
    speed = np.genfromtxt(f"{base}.speed.csv", delimiter=",", names=True)
    phone = np.genfromtxt(f"{base}.imu_phone.csv", delimiter=",", names=True)
    unused = np.full(len(tracks), np.nan)
    nothing = np.zeros(len(phone))
    logs = {
        "CAN/radar": (
            tracks["t_s"],
            np.column_stack(
                [tracks["range_m"], tracks["lateral_m"], tracks["range_rate_mps"], unused, unused,
                 tracks["track_addr"], tracks["new_track"]]
            ),
        ),
        f"CAN/{'speed' if named else 'car_speed'}": (
            speed["t_s"],
            speed["host_speed_mps"][:, None],
        ),
        "IMU/accelerometer": (
            phone["t_s"],
            np.column_stack([phone["acc_forward_mps2"], nothing, nothing + 9.81]),
        ),
    }  # fmt: skip
    for name, (time, value) in logs.items():
        log = folder / "processed_log" / name
        log.mkdir(parents=True)
        for array, file in ((time, "t"), (value, "value")):
            with (log / file).open("wb") as out:
                np.save(out, array)
    return folder


@pytest.mark.parametrize("named", [True, False])
def test_a_comma2k19_segment_is_imported_by_naming_its_folder(
    data: Path, tmp_path: Path, named: bool
) -> None:
    segment, out = segment_of(data, tmp_path / "40", named), tmp_path / "out.mcap"
    accel = f"{data}/comma2k19_rav4_seg40.can_accel_0x24.csv:acc_forward_mps2"
    assert run_command(main_import, [str(segment), "--accel", accel, "-o", str(out)]) == 0
    drive = read_drive(out)
    csv = join_drive(data / "comma2k19_rav4_seg40_lead.csv", accel, None)
    known = {s.stamp: s for s in csv.samples if s.input == RADAR}
    stamps = np.array(sorted(known))
    late = [s for s in drive.samples if s.input == RADAR and s.stamp > 12e9]
    near = [known[stamps[np.abs(stamps - s.stamp).argmin()]].clearance for s in late]
    assert np.mean([abs(s.clearance - c) < 1.0 for s, c in zip(late, near, strict=True)]) > 0.98
    assert len({s.track_id for s in late}) == 1
    felt = [s for s in drive.samples if s.input == ACCELERATION]
    assert felt == [s for s in csv.samples if s.input == ACCELERATION]


def test_the_phone_s_offset_can_be_given(data: Path, tmp_path: Path) -> None:
    segment = segment_of(data, tmp_path / "40")
    plain, shifted = (
        [s.value for s in read_drive(segment, options).samples if s.input == ACCELERATION]
        for options in (ReadOptions(), ReadOptions(mounting=Mounting(offset=-0.62)))
    )
    np.testing.assert_allclose(np.subtract(shifted, plain), 0.62)


def test_a_damaged_segment_is_named(data: Path, tmp_path: Path, capsys) -> None:
    segment, out = segment_of(data, tmp_path / "40"), tmp_path / "out.mcap"
    value = segment / "processed_log" / "CAN" / "radar" / "value"
    value.write_bytes(value.read_bytes()[:1000])
    assert run_command(main_import, [str(segment), "-o", str(out)]) == 2
    assert "CAN/radar: cannot be read as numpy arrays" in capsys.readouterr().err
    value.parent.joinpath("t").unlink()
    assert run_command(main_import, [str(segment), "-o", str(out)]) == 2
    assert "no log CAN/radar; there are: CAN/speed" in capsys.readouterr().err


def small_segment(folder: Path, damage: tuple[str, str, Any] | None = None) -> Path:
    """A lead at 30 m for one second; `damage` replaces an array by (log, file, what it holds)."""
    time = np.arange(20) * 0.05
    rows = [[30.0, 0.0, -1.0, np.nan, np.nan, 7.0, 0.0]] * 20
    arrays: dict[tuple[str, str], Any] = {
        ("CAN/radar", "value"): rows,
        ("CAN/speed", "value"): [15.0] * 20,
        ("IMU/accelerometer", "value"): [[0.5, 0.0, 9.81]] * 20,
        ("IMU/gyro", "value"): [[0.0, 0.0, 0.0]] * 20,
    }
    arrays |= {(log, "t"): time for log, _ in arrays}
    if damage is not None:
        arrays[damage[:2]] = damage[2]
    for (log, file), array in arrays.items():
        (folder / "processed_log" / log).mkdir(parents=True, exist_ok=True)
        with (folder / "processed_log" / log / file).open("wb") as out:
            np.save(out, np.array(array))
    return folder


NO_TIME = [np.nan, *np.arange(1, 20) * 0.05]


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (("CAN/radar", "t", NO_TIME), "CAN/radar: time 1 is nan; s, finite and below 2147483648"),
        (("CAN/speed", "t", [1e12] * 20), "CAN/speed: time 1 is 1000000000000.0"),
        (("CAN/radar", "value", [30.0] * 20), "rows of at least 6 values are expected"),
        (("IMU/accelerometer", "value", [0.5] * 20), "values of shape (20, 1); a row of times and"),
        (("IMU/gyro", "value", [0.5] * 20), "IMU/gyro: times of shape (20,)"),
        (("IMU/gyro", "t", 0.5), "IMU/gyro: times of shape ()"),
        (("CAN/speed", "value", []), "CAN/speed: 20 times and 0 values"),
        (("CAN/speed", "value", ["fast"] * 20), "CAN/speed: cannot be read as numpy arrays"),
    ],
)
def test_a_segment_s_array_that_is_damaged_is_named(
    damage: tuple[str, str, Any], said: str, tmp_path: Path, capsys
) -> None:
    segment = small_segment(tmp_path / "40", damage)
    assert run_command(main_import, [str(segment), "-o", str(tmp_path / "out.mcap")]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1


def test_a_segment_takes_what_is_not_finite_and_does_without_speed(tmp_path: Path) -> None:
    odd = [[12.0, 0.0, -1.0, 0.0, 0.0, np.nan, 0.0]] + [[30.0, 0.0, -1.0, 0.0, 0.0, 7.0, 0.0]] * 19
    segment = small_segment(tmp_path / "40", ("CAN/radar", "value", odd))
    for file in ("t", "value"):
        with (segment / "processed_log" / "CAN" / "speed" / file).open("wb") as out:
            np.save(out, np.array([]))
    drive = read_drive(segment)
    assert drive.count(HOST_SPEED) == 0
    assert {s.clearance for s in drive.samples if s.input == RADAR and s.has_target} == {30.0}


def inspected(path: Path, tmp_path: Path, *options: str) -> dict:
    file = tmp_path / "inspected.json"
    assert run_command(main_inspect, [str(path), *options, "--json", str(file)]) == 0
    return json.loads(file.read_text())


def test_inspect_says_what_is_there_and_that_the_graph_runs(tmp_path: Path, capsys) -> None:
    car = Car("mcap")
    bag = car.write(tmp_path / "bag", esr_rows(car, in_path=12) + host_rows(car))
    found = inspected(bag, tmp_path)
    assert found["runs"] and not found["missing"]
    assert {t["name"]: t["messages"] for t in found["topics"]} == {
        "/esr/status4": 80,
        "/esr/tracks": 5120,
        "/imu/data": 400,
        "/vehicle/speed": 200,
    }
    radar = found["inputs"][RADAR]
    assert radar["rate_hz"] == pytest.approx(20.0) and radar["share_with_lead"] == 1.0
    assert radar["ranges"]["clearance"]["greatest"] == pytest.approx(30.0, abs=0.01)
    assert found["inputs"][ACCELERATION]["ranges"]["acceleration"]["least"] == 0.5
    assert "the graph can run on it" in capsys.readouterr().out


def test_inspect_takes_what_the_graph_cannot_run_on(tmp_path: Path, capsys) -> None:
    car = Car("mcap")
    found = inspected(car.write(tmp_path / "bag", host_rows(car)), tmp_path)
    assert not found["runs"] and "no topic of type lfd_msgs/msg/RadarTarget" in found["missing"][0]
    assert len(found["topics"]) == 2
    # What it lacks hides nothing of what it has.
    assert found["inputs"][ACCELERATION]["rate_hz"] == pytest.approx(100.0)
    assert found["inputs"][HOST_SPEED]["samples"] == 200 and not found["inputs"][RADAR]["samples"]
    twice = [("/imu/other", car.imu(t, 0.5)) for t in times(100.0)]
    found = inspected(car.write(tmp_path / "two", esr_rows(car) + host_rows(car) + twice), tmp_path)
    assert "more than one topic of type sensor_msgs/msg/Imu" in found["missing"][0]
    assert found["inputs"][RADAR]["rate_hz"] == pytest.approx(20.0)
    assert not found["inputs"][ACCELERATION]["samples"]
    neither = [("/esr/status4", car.esr_status_4(t, 1)) for t in times(20.0)]
    found = inspected(car.write(tmp_path / "neither", neither), tmp_path)
    assert not found["runs"] and not any(own["samples"] for own in found["inputs"].values())
    csv = tmp_path / "odd.csv"
    rows = [f"{k * 0.05:.2f},{30 if k % 2 else ''},-1,15," for k in range(40)]
    rows[20:20] = [rows[19], rows[19]]
    csv.write_text("t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n" + "\n".join(rows))
    found = inspected(csv, tmp_path)
    assert found["missing"] == ["no acceleration sample at all"]
    assert found["inputs"][RADAR]["share_with_lead"] == pytest.approx(0.5, abs=0.05)
    assert found["inputs"][RADAR]["repeated_stamps"] == 2
    assert any("repeated stamps" in remark for remark in found["remarks"])


def test_inspect_takes_a_csv_that_is_no_drive(data: Path, tmp_path: Path) -> None:
    found = inspected(data / "comma2k19_rav4_seg40.radar_alltracks.csv", tmp_path)
    assert not found["runs"] and "column 'host_speed_mps' is missing" in found["missing"][0]
    assert found["inputs"][RADAR]["samples"] == 10100
    csv = tmp_path / "back.csv"
    rows = [f"{k % 30 * 0.05:.2f},30,-1,15,0.1" for k in range(60)]
    csv.write_text("t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n" + "\n".join(rows))
    found = inspected(csv, tmp_path)
    assert not found["runs"] and "time decreases" in found["missing"][0]
    for name in (RADAR, ACCELERATION, HOST_SPEED):
        assert found["inputs"][name]["backward_stamps"] == 1
    assert any("backward stamps" in remark for remark in found["remarks"])


def test_messages_without_a_stamp_are_counted(tmp_path: Path) -> None:
    car = Car("mcap")
    rows = host_rows(car) + esr_rows(car)
    bag = tmp_path / "bag"
    with Writer2(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for topic, message in sorted(rows, key=lambda row: stamp_of(row[1])):
            kind, received = message.__msgtype__, stamp_of(message)
            if topic == "/imu/data":
                message.header.stamp.sec = message.header.stamp.nanosec = 0
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=car.store)
            writer.write(connections[topic], received, car.store.serialize_cdr(message, kind))
    found = inspected(bag, tmp_path)
    said = "400 messages without a stamp count as stamped when they were received"
    assert found["runs"] and found["remarks"] == [said]
    assert said in read_drive(bag).warnings


@pytest.mark.parametrize(("later", "runs"), [(3.9, True), (4.1, False), (1e6, False)])
def test_inspect_tells_inputs_that_are_never_there_at_once(
    later: float, runs: bool, tmp_path: Path, capsys
) -> None:
    """As of another clock, or of two recordings."""
    car = Car("mcap")
    rows = host_rows(car)
    late = [("/imu/data", car.imu(t + later, 0.5)) for t in times(100.0)]
    rows = [row for row in rows if row[0] != "/imu/data"] + late
    found = inspected(car.write(tmp_path / "bag", rows + esr_rows(car)), tmp_path)
    assert found["runs"] == runs
    if not runs:
        (said,) = found["missing"]
        assert said.startswith("radar ends ") and said.endswith("never there at once")
        assert said in capsys.readouterr().out


def test_inspect_tells_gaps_and_clock_steps(tmp_path: Path) -> None:
    car = Car("mcap")
    rows = [row for row in host_rows(car) if not 101.0 < stamp_of(row[1]) * 1e-9 < 101.5]
    rows += [("/imu/data", car.imu(t + 50.0, math.nan)) for t in times(100.0)]
    found = inspected(car.write(tmp_path / "bag", rows + esr_rows(car)), tmp_path)
    felt = found["inputs"][ACCELERATION]
    assert felt["gaps"] == 2 and felt["clock_steps"] == 1
    assert felt["longest_gap_s"] == pytest.approx(46.01, abs=0.02)
    assert felt["ranges"]["acceleration"]["not_finite"] == 400


@pytest.mark.parametrize(
    ("name", "option", "said"),
    [
        ("drive.csv", ["--map", "foo=bar"], "--map foo: no such column of a drive"),
        ("drive.csv", ["--map", "range_m=dist"], "--map range_m=dist: column 'dist' is missing"),
        ("drive.csv", ["--radar-topic", "/radar"], "--radar-topic is for a bag"),
        ("bag", ["--radar-topic", "/rada"], "--radar-topic /rada: no such topic"),
        ("bag", ["--accel-topic", "/esr/tracks"], "is delphi_esr_msgs/msg/EsrTrack; one of"),
        ("bag", ["--map", "range_m=dist"], "--map is for a CSV drive"),
        ("bag", ["--host-dbc", "no.dbc", *ON_CAN], "no.dbc: cannot be read as a DBC file"),
    ],
)
def test_inspect_refuses_wrong_options(
    name: str, option: list[str], said: str, tmp_path: Path, capsys
) -> None:
    car = Car("mcap")
    car.write(tmp_path / "bag", esr_rows(car) + host_rows(car))
    (tmp_path / "drive.csv").write_text(ROWS)
    assert run_command(main_inspect, [str(tmp_path / name), *option]) == 2
    printed = capsys.readouterr()
    assert said in printed.err and printed.err.count("\n") == 1 and not printed.out


@pytest.mark.parametrize("name", ["no.mcap", "broken.mcap", "text.txt"])
def test_inspect_refuses_only_what_cannot_be_read(name: str, tmp_path: Path, capsys) -> None:
    path = tmp_path / name
    if not name.startswith("no"):
        path.write_text("this is no recording")
    assert run_command(main_inspect, [str(path)]) == 2
    error = capsys.readouterr().err
    assert name in error and error.count("\n") == 1
