"""The Delphi ESR on CAN: every bit of a frame, damaged frames, and whole logs."""

import json
import math
from pathlib import Path

import can
import pytest
from esr_frames import (
    STATUS_1,
    STATUS_2,
    STATUS_4,
    TRACK,
    candump,
    encode,
    scan_frames,
    track_frame,
)
from hypothesis import given
from hypothesis import strategies as st

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR
from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.import_drive import main_import
from lfd_replay.read_drive import read_drive
from lfd_replay.recordings.can_log import HostSignals, read_can_streams
from lfd_replay.recordings.esr import EsrDecoder, database, esr_track
from lfd_replay.recordings.lead_selection import Track

MS = 1_000_000


def raw_values(layout: dict):
    """A strategy of raw integers for every signal, extremes included."""
    strategies = {}
    for name, (_, length, _, signed) in layout.items():
        low = -(1 << (length - 1)) if signed else 0
        strategies[name] = st.integers(low, low + (1 << length) - 1)
    return st.fixed_dictionaries(strategies)


@given(number=st.integers(1, 64), raw=raw_values(TRACK))
def test_every_track_comes_back_to_its_resolution(number: int, raw: dict) -> None:
    values = {name: raw[name] * TRACK[name][2] for name in raw}
    identifier, data = track_frame(number, **values)
    decoded = database().decode_message(identifier, data, decode_choices=False)
    assert set(decoded) == set(TRACK)
    for name, value in values.items():
        assert decoded[name] == pytest.approx(value, abs=1e-9), name


@given(one=raw_values(STATUS_1), two=raw_values(STATUS_2), four=raw_values(STATUS_4))
def test_every_status_comes_back(one: dict, two: dict, four: dict) -> None:
    for identifier, layout, raw in (
        (0x4E0, STATUS_1, one),
        (0x4E1, STATUS_2, two),
        (0x4E3, STATUS_4, four),
    ):
        data = encode(layout, **{name: raw[name] * layout[name][2] for name in raw})
        decoded = database().decode_message(identifier, data, decode_choices=False)
        for name, value in raw.items():
            assert decoded[name] == pytest.approx(value * layout[name][2]), name


def run(decoder: EsrDecoder, frames: list[tuple[float, int, bytes]]) -> list:
    return [scan for time, i, data in frames for scan in decoder.push(round(time * 1e9), i, data)]


def test_a_scan_is_its_tracks_in_metres_with_the_stamp_of_its_last_frame() -> None:
    track = {"STATUS": 3, "RANGE": 50.0, "ANGLE": 10.0, "RANGE_RATE": -3.25}
    (scan,) = run(EsrDecoder(), scan_frames(1.0, 0, {1: track, 64: {**track, "STATUS": 4}}))
    angle = math.radians(10.0)
    expected = (50.0 * math.cos(angle), -50.0 * math.sin(angle), -3.25)
    first, last = scan.tracks
    assert first.number == 1 and first.measured
    assert (first.clearance, first.lateral, first.relative_velocity) == pytest.approx(expected)
    assert last.number == 64 and not last.measured, "coasted"
    assert scan.stamp == round((1.0 + 64 * 0.00023) * 1e9) and scan.in_path is None


@pytest.mark.parametrize("status", range(1, 8))
def test_coasted_and_invalid_tracks_are_no_measurements(status: int) -> None:
    frames = scan_frames(0.0, 0, {7: {"STATUS": status, "RANGE": 20.0}})
    (scan,) = run(EsrDecoder(), frames)
    assert [t.measured for t in scan.tracks] == [status not in (4, 6, 7)]


def test_the_radar_says_what_ails_it_and_which_track_is_in_its_path() -> None:
    decoder = EsrDecoder()
    healthy = encode(STATUS_2, XCVR_OPERATIONAL=1)
    blocked = encode(STATUS_4, PARTIAL_BLOCKAGE=1, PATH_ID_ACC_MOVE=9)
    frames = [(0.0, 0x4E1, healthy), (0.0, 0x4E3, blocked), *scan_frames(0.01, 0, {})]
    (scan,) = run(decoder, frames)
    assert scan.in_path == 9 and (scan.flags, scan.text) == (32, "partial blockage")
    ill = encode(STATUS_2, XCVR_OPERATIONAL=0, OVERHEAT_ERROR=1)
    frames = [
        (0.05, 0x4E0, encode(STATUS_1, COMM_ERROR=1)),
        (0.05, 0x4E1, ill),
        (0.05, 0x4E3, encode(STATUS_4)),
        *scan_frames(0.06, 1, {}),
    ]
    (scan,) = run(decoder, frames)
    assert scan.in_path == 0 and scan.flags == 1 + 2 + 16
    assert scan.text == "communication error, overheated, transceiver not operational"


def test_damaged_and_unknown_frames_lose_nothing_else_and_are_counted() -> None:
    decoder = EsrDecoder()
    track = {"STATUS": 3, "RANGE": 30.0}
    frames = scan_frames(0.0, 0, {5: track, 9: track})
    frames[4] = (frames[4][0], frames[4][1], frames[4][2][:5])
    frames.insert(3, (0.0008, 0x123, b"\x01"))
    (scan,) = run(decoder, frames)
    assert [t.number for t in scan.tracks] == [9]
    assert decoder.counts["ESR frames of a wrong length"] == 1
    assert decoder.counts["frames of unknown identifiers"] == 1


def test_a_scan_that_lost_its_last_frame_ends_where_the_next_one_begins() -> None:
    decoder = EsrDecoder()
    track = {"STATUS": 3, "RANGE": 30.0}
    frames = scan_frames(0.0, 0, {5: track}, last=60) + scan_frames(0.05, 1, {5: track})
    scans = run(decoder, frames)
    assert len(scans) == 2 and all(len(scan.tracks) == 1 for scan in scans)
    assert scans[0].stamp == round(60 * 0.00023 * 1e9)
    assert decoder.counts["scans without their last track"] == 1
    assert not list(decoder.flush())
    run(decoder, scan_frames(0.1, 2, {5: track}, last=10))
    (cut,) = decoder.flush()
    assert len(cut.tracks) == 1


def test_a_stuck_rolling_count_is_an_old_frame_again() -> None:
    decoder = EsrDecoder()
    track = {"STATUS": 3, "RANGE": 30.0}
    seen = []
    for scan in range(10):
        stuck = {**track, "ROLLING_COUNT": 0} if scan >= 4 else track
        (found,) = run(decoder, scan_frames(scan * 0.05, scan, {5: stuck, 6: track}))
        seen.append([t.number for t in found.tracks])
    assert seen[3] == seen[5] == [5, 6], "one lost scan looks the same"
    assert seen[8] == seen[9] == [6]
    assert decoder.counts["tracks with a stuck rolling count"] >= 2
    never = EsrDecoder()
    for scan in range(10):
        (found,) = run(never, scan_frames(scan * 0.05, 0, {5: track}))
        assert len(found.tracks) == 1, "a radar that never counts is taken as it is"


HOST_DBC = """VERSION ""
NS_ :
BS_:
BU_: Car
BO_ 36 KINEMATICS: 8 Car
 SG_ ACCEL_X : 7|16@0- (0.01,0) [-100|100] "m/s^2" Car
BO_ 180 SPEED: 8 Car
 SG_ SPEED : 7|16@0+ (0.01,0) [0|300] "km/h" Car
 SG_ SPEED_2 : 23|16@0+ (0.01,0) [0|300] "furlong" Car
"""


def host_frames(time: float, speed: float, acceleration: float) -> list[tuple[float, int, bytes]]:
    return [
        (time, 0xB4, round(speed * 3.6 / 0.01).to_bytes(2, "big") + bytes(6)),
        (time, 0x24, round(acceleration / 0.01).to_bytes(2, "big", signed=True) + bytes(6)),
    ]


def log_frames(seconds: float = 3.0) -> list[tuple[float, int, bytes]]:
    """A lead at 30 m that comes nearer by 1 m/s, scans every 50 ms and the host every 10 ms."""
    frames = []
    for scan in range(round(seconds * 20)):
        time = 1_700_000_000.0 + scan * 0.05
        lead = {"STATUS": 3, "RANGE": 30.0 - scan * 0.05, "RANGE_RATE": -1.0}
        frames += scan_frames(time, scan, {12: lead})
        for k in range(5):
            frames += host_frames(time + k * 0.01, 15.0, 0.5)
    return sorted(frames, key=lambda frame: frame[0])


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(HOST_DBC)
    return path


def write_log(path: Path, frames: list[tuple[float, int, bytes]]) -> Path:
    if path.suffix == ".log":
        path.write_text(candump(frames))
        return path
    with can.Logger(str(path)) as logger:
        for time, identifier, data in frames:
            logger.on_message_received(
                can.Message(
                    timestamp=time, arbitration_id=identifier, data=data, is_extended_id=False
                )
            )
    return path


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_a_log_of_each_kind_becomes_a_drive(suffix: str, tmp_path: Path, dbc: Path) -> None:
    log = write_log(tmp_path / f"drive{suffix}", log_frames())
    streams, _ = read_can_streams(log, HostSignals(dbc, "SPEED.SPEED", "ACCEL_X"))
    assert len(streams[RADAR]) == 60 and len(streams[HOST_SPEED]) == 300
    assert {round(s.value, 2) for s in streams[HOST_SPEED]} == {15.0}
    assert {round(s.value, 2) for s in streams[ACCELERATION]} == {0.5}
    seen = [s for s in streams[RADAR] if s.has_target]
    assert len(seen) >= 57 and {s.track_id for s in seen} == {1}
    last = streams[RADAR][-1]
    assert last.clearance == pytest.approx(30.0 - 59 * 0.05, abs=0.051)
    assert last.relative_velocity == pytest.approx(-1.0)
    steps = {b.stamp - a.stamp for a, b in zip(seen, seen[1:], strict=False)}
    assert all(abs(step - 50 * MS) <= 2 * MS for step in steps)


def test_a_log_cut_in_the_middle_loses_nothing_else(tmp_path: Path, dbc: Path) -> None:
    text = candump(log_frames())
    lines = text.splitlines()
    lines[100] = lines[100][:20]
    lines[200] = "garbage"
    lines[300] = "(1700000000.5) can0 7FF#GG"
    lines[301] = "(1e30) can0 7FF#00"
    lines[302] = "(nan) can0 7FF#00"
    log = tmp_path / "cut.log"
    log.write_text("\n".join(lines)[:-7])
    host = HostSignals(dbc, "SPEED.SPEED", "ACCEL_X")
    streams, remarks = read_can_streams(log, host)
    assert len(streams[RADAR]) >= 59 and len(streams[ACCELERATION]) >= 296
    assert any("damaged lines" in remark for remark in remarks), remarks
    assert "2 frames without a possible stamp" in remarks
    blf = write_log(tmp_path / "whole.blf", log_frames())
    half = tmp_path / "half.blf"
    half.write_bytes(blf.read_bytes()[: blf.stat().st_size * 2 // 3])
    streams, remarks = read_can_streams(half, host)
    assert isinstance(streams[RADAR], list)


def test_a_log_goes_through_import_and_evaluate(tmp_path: Path, dbc: Path, capsys) -> None:
    log = write_log(tmp_path / "drive.log", log_frames(4.0))
    out, result = tmp_path / "out.mcap", tmp_path / "result.json"
    options = ["--host-dbc", str(dbc), "--speed-signal", "SPEED.SPEED", "--accel-signal", "ACCEL_X"]
    assert run_command(main_import, [str(log), *options, "-o", str(out)]) == 0
    assert read_drive(out).count(RADAR) == 80
    assert run_command(main_evaluate, [str(log), *options, "--json", str(result)]) == 0
    figures = json.loads(result.read_text())
    assert figures["sensors"]["clearance"]["false_events"] == 0
    assert figures["sensors"]["clearance"]["ready_fraction"] > 0.85


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "no acceleration sample at all"),
        (["--speed-signal", "SPEED.SPEED"], "need --host-dbc FILE"),
        (
            ["--host-dbc", "DBC", "--accel-signal", "AX"],
            "no such signal; there are: KINE",
        ),
        (["--host-dbc", "DBC", "--speed-signal", "SPEED_2"], "unit 'furlong' is not understood"),
        (["--host-dbc", "LOG", "--speed-signal", "X"], "cannot be read as a DBC file"),
    ],
)
def test_mistakes_end_with_one_line(
    options: list[str], said: str, tmp_path: Path, dbc: Path, capsys
) -> None:
    log = write_log(tmp_path / "drive.log", log_frames(0.2))
    names = {"DBC": str(dbc), "LOG": str(log)}
    arguments = [str(log), *(names.get(o, o) for o in options), "-o", str(tmp_path / "out.mcap")]
    assert run_command(main_import, arguments) == 2
    error = capsys.readouterr().err
    assert said in error and error.count("\n") == 1, error
    assert not (tmp_path / "out.mcap").exists()


@pytest.mark.parametrize("name", ["empty.log", "text.blf", "text.asc"])
def test_a_file_of_another_kind_is_refused(name: str, tmp_path: Path, capsys) -> None:
    log = tmp_path / name
    log.write_text("" if name.startswith("empty") else "this is no log\n" * 5)
    assert run_command(main_import, [str(log), "-o", str(tmp_path / "out.mcap")]) == 2
    error = capsys.readouterr().err
    assert name in error and "candump log, ASC or BLF file is expected" in error


def test_the_track_of_the_decoder_is_the_selector_s() -> None:
    (scan,) = run(EsrDecoder(), scan_frames(0.0, 0, {3: {"STATUS": 3, "RANGE": 10.0}}))
    assert scan.tracks == (Track(3, 10.0, -0.0, 0.0),)


@pytest.mark.parametrize("angle", [math.inf, -math.inf, math.nan])
def test_an_angle_that_is_no_number_is_no_position(angle: float) -> None:
    track = esr_track(1, 3, 30.0, angle, 0.0)
    assert track is not None and not track.is_possible
