"""Drives in and out, generated ones, and every mistake a user can make with them."""

import json
import math
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from esr_frames import candump, scan_frames
from rich.table import Table
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from lfd_mpc.errors import UserError
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RADAR,
    UNKNOWN_TRACK,
    RadarSample,
    Sample,
    ScalarSample,
)
from lfd_replay.calibrate import main_calibrate
from lfd_replay.command_line import CountingProgress, print_table, result_table
from lfd_replay.drive import make_drive, playing_times, streams_of
from lfd_replay.drive_bag import sample_message, typestore, write_drive
from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.evaluate_many import drives_of
from lfd_replay.import_drive import join_drive, main_import
from lfd_replay.inspect import main_inspect
from lfd_replay.journal import Journal
from lfd_replay.make_drive import main_make
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import NODES, graph_settings, profile_file_text
from lfd_replay.read_drive import ReadOptions, read_drive, read_streams
from lfd_replay.text_file import write_text

HEADER = "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2"
ROWS = ["0.00,30.0,-1.0,15.0,0.1", "0.05,29.9,-1.0,15.0,0.1", "0.10,29.8,-1.0,15.0,0.1"]
HOST_DBC = ["--host-dbc", "car.dbc", "--speed-signal", "SPEED"]
PARAMS = Path(__file__).parent.parent / "ros2_ws/src/lfd_bringup/params"


def csv(folder: Path, *rows: str, header: str = HEADER, name: str = "drive.csv") -> Path:
    path = folder / name
    path.write_text("\n".join([header, *(rows or ROWS)]) + "\n")
    return path


def test_a_blank_range_is_an_empty_road_and_other_blanks_are_no_sample(tmp_path: Path) -> None:
    drive = read_drive(csv(tmp_path, "0,30,-1,,0.1", "0.05,,,15,", "0.10,29,,15,0.2"))
    first, second, third = (s for s in drive.samples if s.input == RADAR)
    assert (first.has_target, first.clearance) == (True, 30.0)
    assert not second.has_target
    assert third.has_target and math.isnan(third.relative_velocity)
    assert drive.count(HOST_SPEED) == drive.count(ACCELERATION) == 2


def test_columns_of_other_names_are_mapped_and_tracks_are_read(tmp_path: Path) -> None:
    path = csv(tmp_path, "0,30,-1,15,0.1,7", header=HEADER.replace("range_m", "dist") + ",track_id")
    drive = read_drive(path, ReadOptions(mapping={"range_m": "dist"}))
    assert [s.track_id for s in drive.samples if s.input == RADAR] == [7]


def test_ids_are_read_to_their_last_digit(tmp_path: Path) -> None:
    """As floats 2^53 and 2^53 + 1 are one car."""
    ids = [2**53, 2**53 + 1, -(2**63), 2**63 - 1, 7, 7, UNKNOWN_TRACK, UNKNOWN_TRACK]
    texts = [*map(str, ids[:4]), "7.0", "+7e0", "", "nan"]
    rows = (f"{0.05 * row:.2f},30,-1,15,0.1,{text}" for row, text in enumerate(texts))
    path = csv(tmp_path, *rows, header=f"{HEADER},track_id")
    drive = read_drive(path)
    assert [s.track_id for s in drive.samples if s.input == RADAR] == ids
    write_drive(drive, tmp_path / "ids.mcap")
    assert read_drive(tmp_path / "ids.mcap").samples == drive.samples


@pytest.mark.parametrize(
    ("name", "told"), [("track_addr", True), ("targetId", True), ("lateral_m", False)]
)
def test_ids_under_another_name_are_told_of(tmp_path: Path, name: str, told: bool) -> None:
    path = csv(tmp_path, "0,30,-1,15,0.1,7", "0.05,30,-1,15,0.1,7", header=f"{HEADER},{name}")
    said = [w for w in read_drive(path).warnings if f"--map track_id={name}" in w]
    assert len(said) == told
    assert not read_drive(path, ReadOptions(mapping={"track_id": name})).warnings


def test_what_the_lead_says_is_an_optional_column_and_topic(tmp_path: Path) -> None:
    header = HEADER + ",lead_accel_mps2"
    path = csv(tmp_path, "0,30,-1,15,0.1,-0.5", "0.05,30,-1,15,0.1,", header=header)
    drive = read_drive(path)
    assert [s.value for s in drive.samples if s.input == LEAD_ACCELERATION] == [-0.5]
    bag = tmp_path / "drive.mcap"
    write_drive(drive, bag)
    assert read_drive(bag).samples == drive.samples


def test_samples_of_one_stamp_are_played_with_the_acceleration_last(tmp_path: Path) -> None:
    drive = read_drive(csv(tmp_path))
    assert [sample.input for sample in drive.samples[:3]] == [RADAR, HOST_SPEED, ACCELERATION]


def test_nan_samples_are_accepted_and_warned_of(tmp_path: Path) -> None:
    drive = read_drive(csv(tmp_path, "0,nan,-1,15,inf", "0.05,29,-1,15,0.1"))
    assert len(drive.warnings) == 2 and all("count as no sample" in w for w in drive.warnings)


def test_gaps_that_make_no_steps_are_counted_and_warned_of(tmp_path: Path) -> None:
    at = [k for k in range(200) if not (40 < k < 50 or 100 < k < 120)]
    drive = read_drive(csv(tmp_path, *(f"{k / 20},30,0,15,0.1" for k in at)))
    assert set(drive.warnings) == {
        f"{name} has 2 gaps of up to 1.00 s" for name in (RADAR, HOST_SPEED, ACCELERATION)
    }
    steps = OfflineGraph(graph_settings("paper")).run(drive.samples)
    assert sum("no input for" in step.horizon.restart_reason for step in steps) == 2


@pytest.mark.parametrize("value", ["nan", "inf"])
@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("{t},30,-1,15,{value}", "no acceleration sample at all: each of its 40 is NaN or infin"),
        ("{t},{value},{value},15,0.1", "no radar sample at all: each of its 40 is NaN or infinite"),
    ],
)
def test_samples_that_are_all_nan_are_none_at_all(
    row: str, said: str, value: str, tmp_path: Path, capsys
) -> None:
    path = csv(tmp_path, *(row.format(t=k / 20, value=value) for k in range(40)))
    with pytest.raises(UserError, match=f"{said}.*; a drive needs radar and acceleration"):
        read_drive(path)
    assert main_inspect([str(path)]) == 0
    assert f"the graph cannot run on it: {said}" in " ".join(capsys.readouterr().out.split())
    # What has one sample is a drive, and so is an empty road or one of the radar's two signals.
    rows = ("0,30,-1,15,0.1", *(row.format(t=k / 20, value=value) for k in range(1, 40)))
    for more in (rows, ("0,,,15,0.1", "0.05,,,15,0.1"), ("0,30,,15,0.1", "0.05,30,,15,0.1")):
        read_drive(csv(tmp_path, *more))


def test_damaged_rows_are_counted(tmp_path: Path, capsys) -> None:
    """A short row is read as an empty road, and a file may be cut off within its last number."""
    path = csv(tmp_path, ROWS[0], "0.05,29.9,-1", "0.07", ROWS[2])
    short = "2 rows have fewer than the header's 5 cells; those that are missing count as blank"
    assert read_drive(path).warnings == (short,)
    path.write_text(path.read_text()[:-1])
    cut = "the file does not end with a line break: its last number may be cut off"
    assert read_drive(path).warnings == (short, cut)
    # A refusal stays one line.
    assert run_command(main_import, [str(path), "-o", f"{path}/out.mcap"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    drive = join_drive(csv(tmp_path, name="whole.csv"), f"{path}:host_accel_mps2", None)
    assert drive.warnings == (f"{path}: {short}", f"{path}: {cut}")
    for ending in ("\r\n", "\r"):
        path.write_bytes(ending.join([HEADER, *ROWS, ""]).encode())
        assert read_drive(path).warnings == ()


def test_all_tracks_of_a_radar_are_no_drive(tmp_path: Path) -> None:
    twice = [row for row in ROWS for _ in range(2)]
    assert "3 radar stamps are repeated" in read_drive(csv(tmp_path, *twice)).warnings
    several = csv(tmp_path, *twice, ROWS[2])
    with pytest.raises(UserError, match="4 of 7 rows have the time .* one row per scan, that of"):
        read_drive(several)
    with pytest.raises(UserError, match="one row per scan"):
        join_drive(several, f"{several}:host_accel_mps2", None)


def write_bag2(path: Path, samples, plugin: StoragePlugin) -> None:
    store = typestore()
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for sample in samples:
            topic, msgtype, message = sample_message(sample)
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, msgtype, typestore=store)
            writer.write(connections[topic], sample.stamp, store.serialize_cdr(message, msgtype))


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_bags_of_both_kinds_give_back_every_sample(tmp_path: Path, plugin) -> None:
    drive = read_drive(csv(tmp_path))
    write_bag2(tmp_path / "bag", drive.samples, plugin)
    assert read_drive(tmp_path / "bag").samples == drive.samples


def test_a_written_drive_is_one_file_that_gives_back_every_sample(tmp_path: Path) -> None:
    drive = read_drive(csv(tmp_path))
    write_drive(drive, tmp_path / "new" / "out.mcap")
    assert read_drive(tmp_path / "new" / "out.mcap").samples == drive.samples
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["out.mcap"]


def loop(begin: float) -> list[Sample]:
    """Two seconds of a drive from a time in s on."""
    stamps = [round(begin * 1e9) + number * 10_000_000 for number in range(200)]
    seen = [RadarSample(s, True, 30.0 + 1e-9 * (s % 10**9), 0.1, 1) for s in stamps[::5]]
    felt = [ScalarSample(ACCELERATION, s, 1e-9 * (s % 10**9)) for s in stamps]
    driven = [ScalarSample(HOST_SPEED, s, 20.0) for s in stamps[::2]]
    return [*make_drive("loop", {RADAR: seen, ACCELERATION: felt, HOST_SPEED: driven}).samples]


@pytest.mark.parametrize("begins", [(100.0,), (100.0, 100.0), (100.0, 98.5, 300.0, 100.0)])
@pytest.mark.parametrize("odd", [None, 0.95, 0.2, -0.3, -4.0, 3600.0])
def test_a_drive_whose_time_goes_back_reads_back_as_it_is(
    begins: tuple[float, ...], odd: float | None, tmp_path: Path
) -> None:
    """Logged at its stamps a looped drive had half of its steps, those of all loops in turn."""
    streams = streams_of(sample for begin in begins for sample in loop(begin))
    if odd is not None:
        for name, number in ((RADAR, 20), (ACCELERATION, 110)):
            stamp = streams[name][number].stamp + round(odd * 1e9)
            streams[name][number] = replace(streams[name][number], stamp=stamp)
    drive = make_drive("looped", streams)
    write_drive(drive, tmp_path / "looped.mcap")
    again = read_drive(tmp_path / "looped.mcap")
    assert again.samples == drive.samples
    write_drive(again, tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "looped.mcap").read_bytes()


def test_a_drive_is_logged_at_its_stamps(tmp_path: Path) -> None:
    write_drive(make_drive("once", streams_of(loop(100.0))), tmp_path / "once.mcap")
    with AnyReader([tmp_path / "once.mcap"]) as reader:
        logged = [at for _, at, _ in reader.messages()]
    assert logged == [sample.stamp for sample in loop(100.0)]


def test_a_time_below_zero_within_a_drive_is_one_wrong_stamp(tmp_path: Path) -> None:
    """It ended import_drive as no log time can be below zero; evaluate takes such a drive."""
    streams = streams_of(loop(100.0))
    streams[RADAR][20] = replace(streams[RADAR][20], stamp=-3_000_000_000)
    drive = make_drive("odd", streams)
    write_drive(drive, tmp_path / "odd.mcap")
    assert read_drive(tmp_path / "odd.mcap").samples == drive.samples


def test_the_case_of_a_suffix_does_not_matter(tmp_path: Path, capsys) -> None:
    """Cameras, loggers and FAT file systems write UP.CSV."""
    drive = read_drive(csv(tmp_path, name="UP.CSV"))
    write_drive(drive, tmp_path / "low.mcap")
    (tmp_path / "low.mcap").rename(tmp_path / "UP.MCAP")
    write_bag2(tmp_path / "bag", drive.samples, StoragePlugin.SQLITE3)
    (tmp_path / "bag/bag.db3").rename(tmp_path / "Up.Db3")
    shutil.rmtree(tmp_path / "bag")
    (tmp_path / "UP.LOG").write_text(candump(scan_frames(0.0, 0, {})))
    assert sorted(p.name for p in drives_of([tmp_path])) == [
        "UP.CSV",
        "UP.LOG",
        "UP.MCAP",
        "Up.Db3",
    ]
    for name in ("UP.MCAP", "Up.Db3"):
        assert read_drive(tmp_path / name).samples == drive.samples
        assert run_command(main_inspect, [str(tmp_path / name)]) == 0
        assert "/radar/target" in capsys.readouterr().out
    assert len(read_streams(tmp_path / "UP.LOG")[0][RADAR]) == 1
    with pytest.raises(UserError, match=r"there are: UP.CSV, UP.LOG, UP.MCAP, Up.Db3"):
        read_drive(tmp_path / "up.csv")


def test_a_ros_1_bag_without_the_topics_says_what_it_has(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    message = store.types["std_msgs/msg/String"](data="x")
    with Writer1(tmp_path / "old.bag") as writer:
        connection = writer.add_connection("/words", "std_msgs/msg/String", typestore=store)
        writer.write(connection, 1, store.serialize_ros1(message, "std_msgs/msg/String"))
    with pytest.raises(
        UserError, match=r"RadarTarget or .*EsrTrack or .*msgs/msg/Frame for.*/words"
    ):
        read_drive(tmp_path / "old.bag")


def test_a_looped_recording_is_two_stretches_of_time() -> None:
    def stretch() -> dict:
        return {
            RADAR: [RadarSample(i * 50_000_000, True, 30.0, 0.0) for i in range(100)],
            ACCELERATION: [ScalarSample(ACCELERATION, i * 10_000_000, 0.0) for i in range(500)],
        }

    once, again = make_drive("one", stretch()), stretch()
    streams = stretch()
    for name, stream in again.items():
        streams[name] = streams[name] + stream
    drive = make_drive("two", streams)
    assert list(drive.samples) == [*once.samples, *once.samples]
    times = playing_times(drive.samples)
    assert times == sorted(times) and times[-1] == pytest.approx(2 * 4.99e9)
    steps = list(OfflineGraph(graph_settings("paper")).run(drive.samples))
    assert [s.horizon.restart_reason[:14] for s in steps if s.horizon.restart] == [
        "start",
        "time went back",
    ]


def test_what_the_lead_says_in_one_loop_alone_scrambles_no_recording() -> None:
    streams = {
        RADAR: [RadarSample(i * 50_000_000, True, 30.0, 0.0) for i in range(100)] * 2,
        ACCELERATION: [ScalarSample(ACCELERATION, i * 10_000_000, 0.0) for i in range(500)] * 2,
    }
    word = [ScalarSample(LEAD_ACCELERATION, i * 100_000_000, 0.0) for i in range(50)]
    twice = make_drive("twice", streams)
    drive = make_drive("said once", {**streams, LEAD_ACCELERATION: word})
    assert [s for s in drive.samples if s.input != LEAD_ACCELERATION] == list(twice.samples)


def test_one_wrong_stamp_moves_nothing_else() -> None:
    streams = {
        RADAR: [RadarSample(i * 50_000_000, True, 30.0, 0.0) for i in range(40)],
        ACCELERATION: [ScalarSample(ACCELERATION, i * 10_000_000, 0.0) for i in range(200)],
    }
    wrong = list(streams[RADAR])
    wrong[20] = RadarSample(90_000_000_000, True, 30.0, 0.0)
    drive = make_drive("wrong", {**streams, RADAR: wrong})
    right = [s for s in make_drive("right", streams).samples if s != streams[RADAR][20]]
    assert [s for s in drive.samples if s.stamp < 90_000_000_000] == right
    assert playing_times(drive.samples)[-1] == 1_990_000_000


def test_without_a_terminal_progress_comes_in_lines(monkeypatch, capsys) -> None:
    with CountingProgress() as progress:
        bar = progress.add_task("evaluating", total=3)
        progress.advance(bar)
        assert capsys.readouterr().err == ""
        monkeypatch.setattr("lfd_replay.command_line.QUIET_S", 0.0)
        progress.advance(bar)
    assert capsys.readouterr().err == "evaluating: 2 of 3\n"


def test_drives_beside_one_that_is_not_there_are_named_or_counted(tmp_path: Path) -> None:
    for number in range(12):
        csv(tmp_path, name=f"{number:02d}.csv")
        names = [f"{k:02d}.csv" for k in range(min(number + 1, 10))]
        more = f" and {number - 9} more" if number > 9 else ""
        with pytest.raises(UserError) as raised:
            read_drive(tmp_path / "x.csv")
        assert str(raised.value).endswith(f"there are: {', '.join(names)}{more}")


MISTAKES = {
    "no such file": (["nowhere.csv"], "no such file"),
    "no drive": (["notes.txt"], "is no drive"),
    "empty": (["empty.csv"], "is empty"),
    "missing column": (["no_range.csv"], "column 'range_m' is missing"),
    "semicolons": (["semicolons.csv"], "has ';' between its columns; commas are expected"),
    "tabs": (["tabs.csv"], "has tabs between its columns; commas are expected"),
    "no time": (["timeless.csv"], "the time is missing or not finite; every line needs one"),
    "text": (["text.csv"], "'fast' is not a number"),
    "underscores": (["underscores.csv"], "'2_0.0' is not a number"),
    "a cell too many": (["wide.csv"], "line 3: has 6 cells, the header 5"),
    "a column twice": (["twice.csv"], "column 'range_m' is there 2 times; one is expected"),
    "time decreases": (["backward.csv"], "time decreases from 14.95 s to 0.0 s; it must not"),
    "cut off": (["cut.csv"], "cut off"),
    "time in ns": (["ns.csv"], "line 2: the time 1.7e+18 s is out of range; t_s is in seconds"),
    "time in ms": (["ms.csv"], "the time 1.7e+12 s is out of range"),
    "time beyond numbers": (["far.csv"], "the time 1e+308 s is out of range"),
    "track beyond 64 bits": (["track.csv"], "column 'track_id': 1e30 is no track id"),
    "half a track": (["half.csv"], "column 'track_id': 7.5 is no track id"),
    "open quote": (["open.csv"], "line 2: cannot be read as CSV"),
    "long open quote": (["long_open.csv"], "line 2: cannot be read as CSV"),
    "long text": (["long.csv"], "'" + 37 * "x" + "...' is not a number"),
    "no acceleration": (["no_accel.csv"], "no acceleration sample"),
    "binary": (["binary.csv"], "no text in UTF-8"),
    "Latin-1": (["latin.csv"], "no text in UTF-8); a CSV drive in UTF-8 is expected"),
    "UTF-16": (["utf16.csv"], "no text in UTF-8"),
    "time below 0": (["early.csv"], "time -1.0 s is negative; t_s is in seconds, from 0 on"),
    "no path": ([""], "'' is no path; the name of a file or a folder is expected"),
    "no folder for the report": (["good.csv", "--report", ""], "'' is no path"),
    "damaged bag": (["damaged.mcap"], "cannot be read as a bag"),
    "cut bag": (["cut.mcap"], "cannot be read as a bag"),
    "empty folder": (["folder"], "metadata.yaml"),
    "unknown kind": (["good.csv", "--fault", "melt:radar@1-2"], "unknown kind 'melt'"),
    "unknown signal": (["good.csv", "--fault", "zero:lidar@1-2"], "unknown signal 'lidar'"),
    "no value": (["good.csv", "--fault", "offset:clearance@1-2"], "needs a finite number"),
    "a value too many": (["good.csv", "--fault", "zero:clearance=1@1-2"], "takes no value"),
    "a value for the radar": (
        ["good.csv", "--fault", "gain:radar=2@1-2"],
        "unknown signal 'radar'",
    ),
    "a value for a silent radar": (
        ["good.csv", "--fault", "dropout:radar=1@20-30"],
        "dropout takes no value",
    ),
    "no window": (["good.csv", "--fault", "zero:clearance"], "KIND:SIGNAL"),
    "a time beyond numbers": (
        ["good.csv", "--fault", f"zero:clearance@0-{'9' * 320}"],
        "it must end before 2147483648 s",
    ),
    "ends first": (["good.csv", "--fault", "zero:clearance@2-1"], "start before it ends"),
    "mapping": (["good.csv", "--map", "range_m"], "NAME=COLUMN"),
    "mapping of nothing": (["good.csv", "--map", "colour=x"], "no such column of a drive"),
    "profile": (["good.csv", "--profile", "magic"], "unknown; there are: robust, paper"),
    "no parameter file": (["good.csv", "--params", "no.yaml"], "no.yaml"),
    "unknown parameter": (
        ["good.csv", "--params", "typo.yaml"],
        "unknown parameter 'preview_tiem' for mpc_node; known: acceleration_lower, ",
    ),
    "parameter without a name": (
        ["good.csv", "--params", "number.yaml"],
        "unknown parameter '7' for mpc_node; known: ",
    ),
    "refused parameter": (["good.csv", "--params", "refused.yaml"], "preview_time"),
    "no process": (["good.csv", "--jobs", "0"], "--jobs 0: 1 or more is expected"),
    "unknown node": (
        ["good.csv", "--params", "node.yaml"],
        "unknown node '/**/mcp_node'; there are: /**, mpc_node, observer_node",
    ),
    "no node of ours": (
        ["good.csv", "--params", "others.yaml"],
        "others.yaml: names no node of the graph; there are: /**, mpc_node, observer_node",
    ),
    "a number in quotes": (
        ["good.csv", "--params", "quoted.yaml"],
        "diagnosis_node: parameter clearance_floor: Input should be a valid number, got '1.0'",
    ),
    "a switch for a number": (
        ["good.csv", "--params", "switch.yaml"],
        "mpc_node: parameter preview_time: Input should be a valid number, got True",
    ),
    "lags that do not increase": (
        ["good.csv", "--params", "lags.yaml"],
        "lags.yaml: observer_node: lags must increase, got [3, 0]",
    ),
    "a name too long": (["x" * 300 + ".csv"], "File name too long; a path that can be opened"),
    "mapping to nothing": (
        ["good.csv", "--map", "range_m=dist"],
        "--map range_m=dist: column 'dist' is missing; there are: t_s, range_m",
    ),
    "no number of processes": (["good.csv", "--jobs", "two"], "--jobs two: 1 or more is expected"),
    "unwritable": (["good.csv", "--json", "good.csv/out.json"], "cannot be written"),
    "written over a folder": (["good.csv", "--json", "folder"], "folder: cannot be written"),
}


@pytest.mark.parametrize("mistake", list(MISTAKES))
def test_evaluate_ends_a_mistake_with_one_line(mistake, tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    csv(tmp_path, name="good.csv")
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "empty.csv").write_text("")
    csv(tmp_path, "0,1,1,1", header=HEADER.replace(",range_m", ""), name="no_range.csv")
    csv(tmp_path, "nan,30,-1,15,0.1", name="timeless.csv")
    for name, mark in (("semicolons", ";"), ("tabs", "\t")):
        text = "\n".join((HEADER, *ROWS))
        (tmp_path / f"{name}.csv").write_text(text.replace(",", mark) + "\n")
    csv(tmp_path, "0,30,fast,15,0.1", name="text.csv")
    csv(tmp_path, "0,2_0.0,0,15,0.1", name="underscores.csv")
    csv(tmp_path, ROWS[0], "0.05,29,5,-1,15,0.1", name="wide.csv")
    csv(tmp_path, "0,99,30,1,15,0.1", header=HEADER + ",range_m", name="twice.csv")
    csv(tmp_path, "14.95,30,-1,15,0.1", ROWS[0], name="backward.csv")
    csv(tmp_path, "-1,30,-1,15,0.1", name="early.csv")
    for name, encoding in (("latin", "latin-1"), ("utf16", "utf-16")):
        (tmp_path / f"{name}.csv").write_text(f"{HEADER},bemerkung_ä\n{ROWS[0]}\n", encoding)
    (tmp_path / "cut.csv").write_text(HEADER + "\n" + ROWS[0] + "\n0.05,29")
    for name, time in (("ns", "1.7e18"), ("ms", "1.7e12"), ("far", "1e308")):
        csv(tmp_path, f"{time},30,-1,15,0.1", name=f"{name}.csv")
    for name, track in (("track", "1e30"), ("half", "7.5")):
        csv(tmp_path, f"0,30,-1,15,0.1,{track}", header=HEADER + ",track_id", name=f"{name}.csv")
    csv(tmp_path, '0,"30,-1,15,0.1', *ROWS, name="open.csv")
    csv(tmp_path, '0,"30,-1,15,0.1', *ROWS * 5000, name="long_open.csv")
    csv(tmp_path, f'0,"{"x" * 120_000}",-1,15,0.1', name="long.csv")
    csv(tmp_path, "0,30,-1,15,", name="no_accel.csv")
    (tmp_path / "binary.csv").write_bytes(b"\x00\xff\x00\x01")
    (tmp_path / "damaged.mcap").write_bytes(b"\x89MCAP0\r\n" + b"x" * 100)
    write_drive(read_drive(tmp_path / "good.csv"), tmp_path / "whole.mcap")
    whole = (tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "folder").mkdir()
    (tmp_path / "typo.yaml").write_text("/**/mpc_node: {ros__parameters: {preview_tiem: 1.0}}")
    (tmp_path / "node.yaml").write_text("/**/mcp_node: {ros__parameters: {preview_time: 1.0}}")
    (tmp_path / "others.yaml").write_text("diagnosis: {ros__parameters: {clearance_floor: 9.0}}")
    for name, text in (
        ("quoted", "diagnosis_node: {ros__parameters: {clearance_floor: '1.0'}}"),
        ("switch", "mpc_node: {ros__parameters: {preview_time: true}}"),
        ("lags", "observer_node: {ros__parameters: {lags: [3, 0]}}"),
    ):
        (tmp_path / f"{name}.yaml").write_text(text)
    (tmp_path / "number.yaml").write_text("/**/mpc_node: {ros__parameters: {7: 1.0}}")
    (tmp_path / "refused.yaml").write_text("/**/mpc_node: {ros__parameters: {preview_time: -1.0}}")
    before = sorted(tmp_path.iterdir())
    arguments, said = MISTAKES[mistake]
    assert run_command(main_evaluate, arguments) == 2
    errors = capsys.readouterr().err
    assert len(errors.strip().splitlines()) == 1 and said in errors
    assert sorted(tmp_path.iterdir()) == before


def test_a_drive_in_other_units_of_time_is_refused_by_all_that_read_it(tmp_path, capsys) -> None:
    path = csv(tmp_path, "1.7e12,30,-1,15,0.1")
    for command, more in ((main_inspect, []), (main_import, ["-o", str(tmp_path / "out.mcap")])):
        assert run_command(command, [str(path), *more]) == 2
        errors = capsys.readouterr().err
        assert errors.count("\n") == 1 and "t_s is in seconds, below 2147483648" in errors
    last = read_drive(csv(tmp_path, "2147483647.9,30,-1,15,0.1"))
    write_drive(last, tmp_path / "out.mcap")
    assert read_drive(tmp_path / "out.mcap").samples == last.samples


def test_a_track_that_is_not_finite_is_unknown(tmp_path: Path) -> None:
    path = csv(tmp_path, "0,30,-1,15,0.1,nan", "1,30,-1,15,0.1,", header=HEADER + ",track_id")
    assert {s.track_id for s in read_drive(path).samples if s.input == RADAR} == {UNKNOWN_TRACK}


@pytest.mark.parametrize(
    ("command", "arguments"),
    [
        (main_evaluate, ["good.csv", "--json", "good.csv"]),
        (main_evaluate, ["good.csv", "--json", "link.csv"]),
        (main_evaluate, ["good.csv", "--params", "p.yaml", "--json", "p.yaml"]),
        (main_evaluate, ["good.csv", "good.mcap", "--json", "good.mcap"]),
        (main_evaluate, ["bag", "--json", "bag/metadata.yaml"]),
        (main_evaluate, ["bag", "--report", "bag"]),
        (main_evaluate, [".", "--json", "bag/bag.mcap"]),
        (main_inspect, ["good.csv", "--json", "good.csv"]),
        (main_import, ["good.mcap", "-o", "good.mcap"]),
        (main_import, ["good.csv", "--accel", "a.mcap:x", "-o", "a.mcap"]),
        (main_calibrate, ["good.csv", "good.mcap", "-o", "good.mcap"]),
        (main_calibrate, ["good.csv", *HOST_DBC, "-o", "car.dbc"]),
    ],
)
def test_what_is_read_is_never_written_over(
    command, arguments, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    drive = read_drive(csv(tmp_path, name="good.csv"))
    write_drive(drive, tmp_path / "good.mcap")
    write_bag2(tmp_path / "bag", drive.samples, StoragePlugin.MCAP)
    (tmp_path / "link.csv").symlink_to("good.csv")
    for name in ("p.yaml", "a.mcap", "car.dbc"):
        (tmp_path / name).write_text("/**/mpc_node: {ros__parameters: {preview_time: 1.25}}")
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert run_command(command, arguments) == 2
    errors = capsys.readouterr().err
    assert errors.count("\n") == 1 and "would be written over" in errors
    after = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert after == before and (tmp_path / "link.csv").is_symlink()


def test_results_may_lie_among_the_drives_of_a_folder(tmp_path: Path, capsys) -> None:
    csv(tmp_path, name="good.csv")
    for _ in range(2):
        assert main_evaluate([str(tmp_path), "--jobs", "1", "--json", f"{tmp_path}/all.json"]) == 0
    capsys.readouterr()


def test_the_title_of_a_table_is_one_line_however_narrow_the_table(capsys) -> None:
    title = f"/a/long/[path]/{'x' * 150}.csv: 10.0 s"
    print_table(result_table({}, title))
    assert capsys.readouterr().out.splitlines()[0] == title


def test_a_word_that_is_too_long_for_its_column_is_broken_and_not_cut_off(capsys) -> None:
    words = [f"{letter * 40}=-{number}" for letter, number in zip("abcdef", range(6), strict=True)]
    table = Table(*"123456")
    table.add_row(*words)
    print_table(table)
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert all(printed.count(word[0]) == 40 and word[-3:] in printed for word in words)


PRINTS = """
from lfd_replay.errors import run_command
exit(run_command(lambda _: print("a line" * {times}) or 0))
"""


@pytest.mark.parametrize("times", [1, 100_000])
def test_a_full_disk_under_what_is_printed_is_one_line(times: int) -> None:
    """Told by the line itself, or where it is short when all is printed."""
    program = [sys.executable, "-c", PRINTS.format(times=times)]
    with open("/dev/full", "w") as full:
        done = subprocess.run(program, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "the output cannot be written (No space left on device)" in done.stderr


@pytest.mark.parametrize("status", [0, 2])
@pytest.mark.parametrize("how", ["print('a line', flush=True)", "Console().print('a line')"])
def test_a_reader_that_goes_costs_a_command_only_what_it_prints(how: str, status: int) -> None:
    """As `| head` does: what comes afterwards is done, and the status is the command's own."""
    reader, closed = os.pipe()
    os.close(reader)
    program = f"""
from rich.console import Console
from lfd_replay.errors import run_command
exit(run_command(lambda _: ({how}, open(2, "w", closefd=False).write("done"), {status})[-1]))
"""
    with open(closed, "w") as output:
        done = subprocess.run(
            [sys.executable, "-c", program], stdout=output, stderr=subprocess.PIPE, text=True
        )
    assert (done.returncode, done.stderr) == (status, "done")


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
@pytest.mark.parametrize("how", ["print('a line')", "Console().print('a line')"])
def test_what_is_printed_where_nothing_is_open_is_lost_and_nothing_else(
    how: str, closed: str, tmp_path: Path
) -> None:
    program = f"""
import sys
from rich.console import Console
from lfd_replay.errors import run_command
def command(_):
    {how}
    print("said", file=sys.stderr)
    open("done", "w").close()
    return 3
exit(run_command(command))
"""
    shell = ["bash", "-c", f'exec "$@" {closed}', "bash", sys.executable, "-c", program]
    assert subprocess.run(shell, cwd=tmp_path).returncode == 3
    assert (tmp_path / "done").exists()


@pytest.mark.parametrize(
    ("command", "arguments", "said"),
    [
        (main_import, ["nowhere.csv", "-o", "out.mcap"], "no such file"),
        (main_import, ["good.csv", "--accel", "two.csv", "-o", "out.mcap"], "which column?"),
        (main_import, ["good.csv", "--accel", "two.csv:z", "-o", "out.mcap"], "'z' is missing"),
        (main_import, ["good.csv", "-o", "out.txt"], "must end in .mcap"),
        (main_import, ["good.csv", "-o", "good.csv/out.mcap"], "cannot be written"),
        (main_make, ["data-9", "-o", "out.mcap"], "there are: data-1"),
        (main_make, ["data-1", "--sensor", "lidar", "-o", "out.mcap"], "there are: esr"),
        (main_make, ["data-1", "--seed", "-1", "-o", "out.mcap"], "--seed"),
    ],
)
def test_makers_of_drives_end_a_mistake_with_one_line(
    command, arguments, said, tmp_path, monkeypatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    csv(tmp_path, name="good.csv")
    csv(tmp_path, "0,1,2", header="t_s,a,b", name="two.csv")
    before = sorted(tmp_path.iterdir())
    assert run_command(command, arguments) == 2
    errors = capsys.readouterr().err
    assert len(errors.strip().splitlines()) == 1 and said in errors
    assert sorted(tmp_path.iterdir()) == before


def test_a_given_file_replaces_the_column_of_the_first(tmp_path: Path) -> None:
    csv(tmp_path)
    csv(tmp_path, "0.01,9.0,1", "0.02,8.0,1", header="t_s,fwd,yaw", name="accel.csv")
    out = tmp_path / "out.mcap"
    arguments = [
        str(tmp_path / "drive.csv"),
        "--accel",
        f"{tmp_path}/accel.csv:fwd",
        "-o",
        str(out),
    ]
    assert run_command(main_import, arguments) == 0
    drive = read_drive(out)
    assert [s.value for s in drive.samples if s.input == ACCELERATION] == [9.0, 8.0]
    assert drive.count(HOST_SPEED) == 3


def joined_with_accelerations(folder: Path, first_s: float, seconds: float) -> list[str]:
    """Ten seconds of radar, and an acceleration file of its own, as options of import_drive."""
    rows = (f"{k / 20},30,0,15," for k in range(201))
    felt = (f"{first_s + k / 100:.2f},0.1" for k in range(round(seconds * 100) + 1))
    recording = csv(folder, *rows, name="radar.csv")
    accel = csv(folder, *felt, header="t_s,host_accel_mps2", name="accel.csv")
    return [str(recording), "--accel", str(accel), "-o", str(folder / "out.mcap")]


@pytest.mark.parametrize(
    ("first_s", "seconds", "told"),
    [
        (0.0, 9.5, []),
        (0.0, 4.0, ["acceleration ends 6.00 s before the drive does"]),
        (3.0, 7.0, ["acceleration begins 3.00 s after the drive does"]),
        (
            1.7e9,
            10.0,
            [
                "radar ends 1700000000.00 s before the drive does",
                "acceleration begins 1700000000.00 s after the drive does",
                "host_speed ends 1700000000.00 s before the drive does",
                "the graph cannot run on it: radar ends 1699999990.000 s before acceleration "
                "begins: they are never there at once",
            ],
        ),
    ],
)
def test_inputs_that_are_there_for_part_of_the_time_are_told_of(
    first_s: float, seconds: float, told: list[str], tmp_path: Path, capsys
) -> None:
    assert run_command(main_import, joined_with_accelerations(tmp_path, first_s, seconds)) == 0
    out = tmp_path / "out.mcap"
    prefix = f"warning: {tmp_path / 'radar.csv'}: "
    assert capsys.readouterr().err.splitlines() == [prefix + line for line in told]
    assert main_inspect([str(out)]) == 0
    printed = capsys.readouterr().out
    assert all(line in printed for line in told)


def test_a_drive_that_the_graph_cannot_run_on_is_told_of_by_all_alike(
    tmp_path: Path, capsys
) -> None:
    """Each step of an empty road is ready: the figures alone look like those of a healthy drive."""
    path = str(csv(tmp_path, *(f"{k / 20},,,15,0.1" for k in range(60))))
    said = "the graph cannot run on it: the radar never sees a lead"
    assert main_inspect([path]) == 0 and said in capsys.readouterr().out
    for arguments in ([path], [path, path, "--jobs", "1"]):
        assert main_evaluate(arguments) == 0
        errors = capsys.readouterr().err.splitlines()
        assert set(errors) == {f"warning: {path}: {said}"}


@pytest.mark.parametrize(
    "key", ["mpc_node", "/mpc_node", "/car/mpc_node", "/**/mpc_node", "/**", "/*", "'*'"]
)
def test_a_parameter_file_names_nodes_as_ros_does(key: str, tmp_path: Path) -> None:
    file = tmp_path / "params.yaml"
    other = "/camera: {ros__parameters: {exposure: 3}}"
    file.write_text(f"{key}: {{ros__parameters: {{preview_time: 1.25}}}}\n{other}\n")
    assert graph_settings("robust", file).mpc.preview_time == 1.25


@pytest.mark.parametrize("profile", ["robust", "paper"])
def test_the_parameter_file_of_a_profile_is_current_and_complete(profile: str) -> None:
    file = PARAMS / f"{profile}.yaml"
    text = file.read_text()
    assert text == profile_file_text(profile)
    # The file alone makes the profile, whatever the default is.
    assert graph_settings("robust", file) == graph_settings(profile)
    assert all(f"/**/{node}:" in text for node in NODES)


def test_the_figures_of_evaluate_are_those_that_scripts_read(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    csv(tmp_path, *(f"{k / 20},30,0,15,0.1" for k in range(60)), name="d.csv")
    command = ["d.csv", "--fault", "offset:clearance=4@1-2", "--json", "out.json"]
    assert run_command(main_evaluate, command) == 0
    result = json.loads((tmp_path / "out.json").read_text())
    about_the_run = "drive profile faults duration_s steps elapsed_s realtime_factor sensors"
    assert set(result) == set(about_the_run.split())
    assert result["faults"] == ["offset:clearance=4@1-2"]
    # To the digits that are written.
    factor = result["duration_s"] / result["elapsed_s"]
    assert result["realtime_factor"] == pytest.approx(factor, rel=1e-3, abs=1e-3)
    sensors = result["sensors"]
    assert set(sensors) == {"clearance", "relative_velocity", "radar", "acceleration"}
    about_a_sensor = (
        "truth flagged detected delay_s flagged_fraction false_events false_s ready_fraction "
        "windows"
    )
    for figures in sensors.values():
        assert set(figures) == set(about_a_sensor.split())
    for name in ("clearance", "radar"):
        (window,) = sensors[name]["windows"]
        assert set(window) == {"start", "found", "delay_s", "fraction", "already_flagged"}
        assert sensors[name]["truth"] == [[1.0, 2.0]] and window["start"] == 1.0
    assert sensors["acceleration"]["truth"] == sensors["acceleration"]["windows"] == []


def test_a_line_with_nothing_on_it_is_no_row(tmp_path: Path) -> None:
    whole = csv(tmp_path, *ROWS, name="whole.csv")
    spaced = tmp_path / "spaced.csv"
    spaced.write_text(whole.read_text().replace("\n", "\n\n") + "\n\n")
    assert read_drive(spaced).samples == read_drive(whole).samples


def test_what_is_written_to_a_link_or_a_pipe_leaves_it_one(tmp_path: Path) -> None:
    target, link, pipe = tmp_path / "target", tmp_path / "link", tmp_path / "pipe"
    target.write_text("before")
    link.symlink_to(target)
    write_text(link, "after")
    assert link.is_symlink() and target.read_text() == "after"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(pipe, "through it")
        assert os.read(reader, 100) == b"through it" and pipe.is_fifo()
    finally:
        os.close(reader)


def test_a_drive_that_begins_below_zero_is_no_bag(tmp_path: Path) -> None:
    felt, seen = [ScalarSample(ACCELERATION, -5, 0.0)], [RadarSample(0, True, 30.0, 0.0)]
    early = make_drive("early", {ACCELERATION: felt, RADAR: seen})
    with pytest.raises(UserError, match="early: begins at -0.000 s; a bag holds no time below 0"):
        write_drive(early, tmp_path / "early.mcap")


def test_results_of_other_recorded_drives_do_not_count(tmp_path: Path) -> None:
    recorded = tmp_path / "recorded"
    recorded.mkdir()
    (recorded / "drive.csv").write_text("one")
    Journal(tmp_path / "journal", recorded).add("key", 1)
    assert Journal(tmp_path / "journal", recorded).results == {"key": 1}
    (recorded / "drive.csv").write_text("another")
    assert not Journal(tmp_path / "journal", recorded).results
