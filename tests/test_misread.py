"""Tables that would be misread in silence are told of, and what the warning advises works."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import pytest

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RadarSample, Sample
from lfd_replay.drive import make_drive, streams_of
from lfd_replay.drive_bag import write_drive
from lfd_replay.evaluate import main_evaluate
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.import_drive import main_import
from lfd_replay.inspect import main_inspect
from lfd_replay.placeholders import placeholders
from lfd_replay.read_drive import ReadOptions, read_drive

HEADER = "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2"
OTHER_NAMES = "time,range_m,range_rate_mps,host_speed_mps,ax"
FAULT = "offset:clearance=4,relative_velocity=-10@40-60"


def row_per_signal(folder: Path, header: str = HEADER, last_lead_s: float = 1e9) -> Path:
    """A generated drive as such a table; `last_lead_s`: from then on the road is empty."""
    lines = []
    for sample in generate_drive("data-1", 1, "esr").samples:
        seconds = sample.stamp * 1e-9
        if isinstance(sample, RadarSample):
            lead = sample.has_target and seconds < last_lead_s
            cells = f"{sample.clearance},{sample.relative_velocity},," if lead else ",,,"
        else:
            place = {HOST_SPEED: ",,{},", ACCELERATION: ",,,{}"}[sample.input]
            cells = place.format(sample.value)
        lines.append(f"{seconds:.4f},{cells}\n")
    path = folder / "signals.csv"
    path.write_text(f"{header}\n" + "".join(lines))
    return path


def row_per_signal_warnings(path: Path, options: ReadOptions | None = None) -> list[str]:
    return [said for said in read_drive(path, options).warnings if "a row per signal" in said]


@pytest.mark.parametrize("header", [HEADER, OTHER_NAMES])
def test_what_is_advised_for_a_row_per_signal_finds_the_fault(
    tmp_path: Path, capsys, header: str
) -> None:
    path = row_per_signal(tmp_path, header)
    mapped = [] if header == HEADER else ["--map", "t_s=time", "--map", "host_accel_mps2=ax"]
    assert main_inspect([str(path), *mapped]) == 0
    assert "note: a row per signal" in capsys.readouterr().out
    assert main_evaluate([str(path), *mapped]) == 0
    (command,) = re.findall("then (import_drive .*)", capsys.readouterr().err)

    first, *rows = path.read_text().splitlines()
    radar = [row for row in rows if row.endswith(",,")]
    (tmp_path / "RADAR.csv").write_text("\n".join([first, *radar, ""]))
    drive, found = tmp_path / "OUT.mcap", tmp_path / "found.json"
    there = command.replace("RADAR.csv", str(tmp_path / "RADAR.csv")).replace(
        "OUT.mcap", str(drive)
    )
    assert main_import(shlex.split(there)[1:]) == 0
    assert main_evaluate([str(drive), "--fault", FAULT, "--json", str(found)]) == 0
    said = capsys.readouterr().err
    assert "row per signal" not in said
    sensors = json.loads(found.read_text())["sensors"]
    assert all(sensors[name]["detected"] for name in ("clearance", "relative_velocity", "radar"))
    assert not sensors["acceleration"]["false_events"]


def test_a_row_per_signal_is_told_of_where_the_lead_is_rare_and_where_it_stays_in_the_file(
    tmp_path: Path, capsys
) -> None:
    path = row_per_signal(tmp_path, last_lead_s=8.0)
    assert len(row_per_signal_warnings(path)) == 1
    both = ["--accel", str(path), "--speed", str(path), "-o", str(tmp_path / "out.mcap")]
    assert main_import([str(path), *both]) == 0
    assert "a row per signal" in capsys.readouterr().err


def test_other_blanks_are_no_row_per_signal(tmp_path: Path) -> None:
    path = tmp_path / "drive.csv"
    tables = {
        "an empty road": ["0,30,-1,15,0.1", "0.05,,,15,0.1", "0.1,,,15,0.1"],
        "no lead at all": ["0,,,15,0.1", "0.05,,,15,0.1"],
        "host values seldom": ["0,30,-1,15,0.1", "0.05,30,-1,,", "0.1,,,,", "0.15,30,-1,,0.1"],
        "no speed": ["0,30,-1,,0.1", "0.05,30,-1,,0.1", "0.1,,,,0.1"],
    }
    for what, rows in tables.items():
        path.write_text("\n".join([HEADER, *rows, ""]))
        assert not row_per_signal_warnings(path), what


def with_placeholder(value: float, windows: int = 3, speed: float | None = None) -> list[Sample]:
    """A generated drive whose radar says `value` for 1 s so often, every 5 s from 10 s on;
    `speed`: what the host says of its speed."""

    def put(sample: Sample) -> Sample:
        if sample.input == HOST_SPEED and speed is not None:
            return replace(sample, value=speed)
        since = (sample.stamp * 1e-9 - 10.0) / 5.0
        if isinstance(sample, RadarSample) and 0.0 <= since < windows and since % 1.0 < 0.2:
            return replace(sample, clearance=value, relative_velocity=0.0)
        return sample

    return [put(sample) for sample in generate_drive("data-1", 1, "esr").samples]


@pytest.mark.parametrize("value", [0.0, -1.0, 255.0, 204.7, 327.67])
def test_a_range_that_stands_for_no_lead_is_told_of(tmp_path: Path, capsys, value: float) -> None:
    samples = with_placeholder(value)
    (said,) = placeholders(streams_of(samples))
    assert re.search(rf" 60 of \d+ scans .* exactly {value:g} m, 3 times .* leave .* blank", said)
    path = tmp_path / "drive.mcap"
    write_drive(make_drive("drive", streams_of(samples)), path)
    assert said in read_drive(path).warnings
    assert main_inspect([str(path)]) == 0
    assert f"note: {said}" in " ".join(capsys.readouterr().out.split())


def test_what_may_be_a_range_is_no_placeholder() -> None:
    """A fault that stays at a value, a car that is touched at standstill, and a farthest range."""
    assert not list(placeholders(streams_of(with_placeholder(0.0, windows=2))))
    near = [
        replace(s, clearance=min(s.clearance, 4.0)) if isinstance(s, RadarSample) else s
        for s in with_placeholder(0.0, speed=0.0)
    ]
    assert not list(placeholders(streams_of(near)))
    assert not list(placeholders({}))


@pytest.mark.parametrize("sensor", ["esr", "coarse", "gnss", "exact"])
@pytest.mark.parametrize("name", ["data-1", "stop-and-go", "cut-in", "traffic-27", "hilly-03"])
def test_a_drive_as_it_should_be_has_no_placeholder_nor_has_one_with_a_fault(
    name: str, sensor: str
) -> None:
    drive = generate_drive(name, 2, sensor)
    assert not drive.warnings
    for text in ("", "zero:radar@20-40", "zero:clearance@20-40", "offset:clearance=-20@10-50"):
        samples = FaultInjector(parse_faults([text]), drive.zero, 0).apply(drive.samples)
        assert not list(placeholders(streams_of(samples))), text


def test_the_recorded_drives_are_not_told_of(data: Path) -> None:
    for name in ("lead", "nearest_in_path"):
        streams = streams_of(read_drive(data / f"comma2k19_rav4_seg40_{name}.csv").samples)
        assert not list(placeholders(streams))
