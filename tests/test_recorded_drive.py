"""The recorded drive shows what a faithful build shows."""

import json
from pathlib import Path

import pytest

from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.import_drive import main_import

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
