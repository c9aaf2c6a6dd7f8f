"""Generated drives: the same for the same seed, and as noisy as their sensors are said to be."""

import math
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lfd_diagnosis.verdict import State
from lfd_mpc.errors import UserError
from lfd_mpc.sampling import ACCELERATION, HOST_SPEED, RADAR
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.generate import (
    DT,
    PROFILES,
    SENSORS,
    Array,
    Driver,
    Truth,
    generate_drive,
    simulate,
)
from lfd_replay.make_drive import main_make
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.read_drive import read_drive

SUITE = SENSORS["esr"]
ROUNDING = 1.0 / math.sqrt(12.0)
"""Standard deviation of rounding to steps of one."""


def truth_of(name: str) -> Truth:
    """What really happens in a drive."""
    return simulate(PROFILES[name], Driver())


def times_of(drive: Drive, name: str) -> Array:
    """Stamps of one input in s."""
    return np.array([s.stamp for s in drive.samples if s.input == name]) * 1e-9


def values_of(drive: Drive, name: str, field: str = "value") -> Array:
    """One field of the samples of one input."""
    return np.array([getattr(s, field) for s in drive.samples if s.input == name])


def clearance_errors(drive: Drive) -> Array:
    """Measured less true clearance in m, outliers included."""
    truth = truth_of(drive.name)
    true = np.interp(times_of(drive, RADAR), truth.time, truth.clearance)
    return values_of(drive, RADAR, "clearance") - true


def assert_on_grid(values: Array, step: float) -> None:
    np.testing.assert_allclose(values, np.round(values / step) * step, rtol=0, atol=1e-9)


@pytest.fixture(scope="module")
def drive() -> Drive:
    return generate_drive("data-1", 0, "esr")


def test_the_same_seed_gives_the_same_drive_in_any_process(drive: Drive) -> None:
    # Python's hash() of text differs from process to process; a drive must not depend on it.
    code = (
        "from lfd_replay.generate import generate_drive; "
        "print([s for s in generate_drive('data-1', 0, 'esr').samples])"
    )
    elsewhere = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONHASHSEED": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert elsewhere.stdout == f"{list(drive.samples)}\n"
    assert generate_drive("data-1", 0, "esr").samples == drive.samples


@pytest.mark.parametrize("input_name", [RADAR, ACCELERATION, HOST_SPEED])
def test_another_seed_changes_every_signal(input_name: str) -> None:
    one, other = (
        [s for s in generate_drive("data-2", seed, "esr").samples if s.input == input_name]
        for seed in (0, 1)
    )
    assert one != other


@pytest.mark.parametrize("name", ["data-1", "data-2"])
def test_a_normal_lead_drives_as_people_do(name: str) -> None:
    truth = truth_of(name)
    lead = truth.host_speed + truth.relative_velocity
    assert 0.04 < truth.lead_acceleration.mean() < 0.10
    assert 0.4 < truth.lead_acceleration.std() < 0.67
    assert np.abs(truth.lead_acceleration).max() < 1.6
    assert np.abs(np.diff(truth.lead_acceleration)).max() / DT < 1.0  # jerk in m/s^3
    assert lead.min() > 8.0 and lead.max() < 25.0


@pytest.mark.parametrize("name", list(PROFILES))
def test_the_follower_keeps_a_safe_gap_and_starts_in_equilibrium(name: str) -> None:
    truth = truth_of(name)
    assert truth.clearance.min() > 15.0 and truth.clearance.max() < 60.0
    assert truth.host_speed.min() > 8.0 and truth.host_speed.max() < 25.0
    start = truth.time < Driver().reaction_time
    assert np.abs(truth.host_acceleration[start]).max() < 1e-9
    assert np.abs(truth.host_acceleration).max() < 2.5


def test_the_lead_of_data_3_brakes_abruptly_at_20_s() -> None:
    truth = truth_of("data-3")
    before = truth.time < 20.0
    assert truth.lead_acceleration[before].min() > -1.6
    assert truth.lead_acceleration.min() == pytest.approx(-2.5)
    assert truth.time[truth.lead_acceleration.argmin()] == pytest.approx(20.4, abs=0.05)
    assert truth.lead_acceleration[truth.time > 23.0].min() > -1.6


def test_a_drive_lasts_80_s_at_the_rates_of_its_sensors(drive: Drive) -> None:
    assert 0 <= drive.zero < 10_000_000
    assert all(isinstance(s.stamp, int) for s in drive.samples)
    assert drive.duration == pytest.approx(80.0, abs=0.02)
    assert drive.count(ACCELERATION) == pytest.approx(8000, abs=1)
    assert drive.count(RADAR) == pytest.approx(1600, abs=15)
    assert drive.count(HOST_SPEED) == pytest.approx(80 * 83.3, abs=2)
    assert not drive.warnings
    assert {s.track_id for s in drive.samples if s.input == RADAR} == {1}


def test_scans_come_as_irregularly_as_recorded(drive: Drive) -> None:
    periods = np.diff(times_of(drive, RADAR))
    assert periods.min() > 0.0439 and periods.max() < 0.0581
    assert periods.max() - periods.min() > 0.010
    assert periods.mean() == pytest.approx(0.050, abs=0.0005)


def test_the_accelerometer_is_almost_regular(drive: Drive) -> None:
    times = times_of(drive, ACCELERATION)
    late = times - np.arange(len(times)) * 0.01
    assert late.min() >= 0.0 and late.max() < 0.001 and late.std() > 0.0


def test_radar_values_lie_on_the_grid_of_its_frames_with_the_noise_stated(drive: Drive) -> None:
    assert_on_grid(values_of(drive, RADAR, "clearance"), 0.1)
    assert_on_grid(values_of(drive, RADAR, "relative_velocity"), 0.01)
    error = clearance_errors(drive)
    ordinary = error[np.abs(error) < 0.7]
    assert ordinary.std() == pytest.approx(math.hypot(0.056, 0.1 * ROUNDING), rel=0.06)
    assert abs(ordinary.mean()) < 0.01
    truth = truth_of("data-1")
    true = np.interp(times_of(drive, RADAR), truth.time, truth.relative_velocity)
    error = values_of(drive, RADAR, "relative_velocity") - true
    assert error.std() == pytest.approx(math.hypot(0.023, 0.01 * ROUNDING), rel=0.06)
    assert abs(error.mean()) < 0.003


def test_outliers_are_single_scans_about_once_a_minute() -> None:
    total = 0
    for seed in range(20):
        error = np.abs(clearance_errors(generate_drive("data-1", seed, "esr")))
        (off,) = np.nonzero(error > 0.7)
        assert (error[off] < SUITE.outlier + 0.4).all()
        assert all(b - a > 100 for a, b in pairwise(off))
        total += len(off)
    assert 20 * 80 / 75 <= total <= 20 * 80 / 45


def test_the_accelerometer_deviates_as_stated() -> None:
    truth = truth_of("data-1")
    slow, noise = [], []
    for seed in range(10):
        drive = generate_drive("data-1", seed, "esr")
        times = times_of(drive, ACCELERATION)
        error = values_of(drive, ACCELERATION) - np.interp(
            times, truth.time, truth.host_acceleration
        )
        noise.append(np.diff(error).std() / math.sqrt(2.0))
        slow.append(error[: len(error) // 100 * 100].reshape(-1, 100).mean(axis=1))
    assert np.mean(noise) == pytest.approx(0.05, rel=0.05)
    everything = np.concatenate(slow)
    assert everything.std() == pytest.approx(0.15, rel=0.25)
    assert everything.mean() == pytest.approx(0.05, abs=0.08)


def test_host_speed_is_rounded_late_and_off_by_up_to_one_percent() -> None:
    truth, scales = truth_of("data-2"), []
    for seed in range(10):
        drive = generate_drive("data-2", seed, "esr")
        speed = values_of(drive, HOST_SPEED)
        assert_on_grid(speed, 0.01)
        true = np.interp(times_of(drive, HOST_SPEED) - 0.05, truth.time, truth.host_speed)
        scale = float(speed @ true / (true @ true))
        assert np.abs(speed - scale * true).max() < 0.0051
        scales.append(scale - 1.0)
    assert max(np.abs(scales)) <= 0.0101 and np.ptp(scales) > 0.005


@pytest.mark.parametrize("name", ["data-1", "data-2"])
def test_healthy_driving_shows_no_fault(name: str) -> None:
    for step in OfflineGraph(graph_settings("paper")).run(generate_drive(name, 0, "esr").samples):
        report = step.outcome.report
        faults = (report.clearance, report.relative_velocity, report.radar, report.acceleration)
        assert State.FAULT not in {fault.state for fault in faults}, report.stamp


def test_a_written_drive_reads_back_the_same(
    drive: Drive, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "folder" / "drive.mcap"
    assert run_command(main_make, ["data-1", "-o", str(out)]) == 0
    assert read_drive(out).samples == drive.samples
    assert capsys.readouterr().out == f"{out}: 80.0 s, {len(drive.samples)} samples\n"


def test_an_older_drive_is_replaced(tmp_path: Path) -> None:
    out = tmp_path / "drive.mcap"
    out.write_text("an older one")
    assert run_command(main_make, ["data-1", "--seed", "3", "-o", str(out)]) == 0
    assert read_drive(out).samples == generate_drive("data-1", 3, "esr").samples
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["x"], "make_drive: unknown drive 'x'; there are: data-1, data-2, data-3"),
        (["data-1", "--sensor", "y"], "make_drive: unknown sensor 'y'; there are: esr"),
        (["data-1", "--seed", "-1"], "--seed -1: a whole number of 0 or more is expected"),
    ],
)
def test_mistakes_end_with_one_line(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_command(main_make, [*arguments, "-o", str(tmp_path / "drive.mcap")]) == 2
    assert capsys.readouterr().err == said + "\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("out", ["file/drive.mcap", "folder.mcap", "drive.bag"])
def test_where_nothing_can_be_written_nothing_is_left(
    out: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("a file, no folder")
    (tmp_path / "folder.mcap").mkdir()
    before = sorted(tmp_path.rglob("*"))
    assert run_command(main_make, ["data-1", "-o", str(tmp_path / out)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and str(tmp_path / out) in error
    assert sorted(tmp_path.rglob("*")) == before


def test_a_failure_while_writing_keeps_the_older_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full_disk(*_: object) -> None:
        raise OSError(28, "No space left on device")

    out = tmp_path / "drive.mcap"
    out.write_text("an older one")
    monkeypatch.setattr("lfd_replay.drive_bag.Writer.write", full_disk)
    assert run_command(main_make, ["data-1", "-o", str(out)]) == 2
    assert "No space left on device" in capsys.readouterr().err
    assert out.read_text() == "an older one" and list(tmp_path.iterdir()) == [out]


def test_an_unknown_name_is_a_user_error() -> None:
    with pytest.raises(UserError, match="there are: data-1, data-2, data-3"):
        generate_drive("data-4", 0, "esr")
