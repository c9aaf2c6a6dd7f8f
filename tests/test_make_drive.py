"""Generated drives: the same for the same seed, and as noisy as their sensors are said to be."""

import math
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import savgol_filter, welch

from lfd_diagnosis.verdict import State
from lfd_mpc.arrays import Array
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR
from lfd_mpc.settings import STEP_S
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.evaluation.cases import RECORDED, load_drive
from lfd_replay.generated.car_following import Driver
from lfd_replay.generated.generate import drive_truth, generate_drive
from lfd_replay.generated.lead_profiles import NAMES, NORMAL
from lfd_replay.generated.sensor_models import SENSORS
from lfd_replay.make_drive import main_make
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.read_drive import read_drive

SUITE = SENSORS["esr"]
ROUNDING = 1.0 / math.sqrt(12.0)
"""Standard deviation of rounding to steps of one."""


def times_of(drive: Drive, name: str) -> Array:
    """Stamps of one input in s."""
    return np.array([s.stamp for s in drive.samples if s.input == name]) * 1e-9


def values_of(drive: Drive, name: str, field: str = "value") -> Array:
    """One field of the samples of one input."""
    return np.array([getattr(s, field) for s in drive.samples if s.input == name])


def clearance_errors(drive: Drive) -> Array:
    """Measured less true clearance in m, outliers included."""
    truth = drive_truth(drive.name)
    measured = times_of(drive, RADAR) - SUITE.radar.delay
    true = np.interp(measured, truth.time, truth.clearance)
    return values_of(drive, RADAR, "clearance") - true


def assert_on_grid(values: Array, step: float) -> None:
    np.testing.assert_allclose(values, np.round(values / step) * step, rtol=0, atol=1e-9)


@pytest.fixture(scope="module")
def drive() -> Drive:
    return generate_drive("data-1", 0, "esr")


def test_the_same_seed_gives_the_same_drive_in_any_process(drive: Drive) -> None:
    # Python's hash() of text differs from process to process; a drive must not depend on it.
    code = (
        "from lfd_replay.generated.generate import generate_drive; "
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


def lead_speed(name: str) -> Array:
    truth = drive_truth(name)
    return truth.host_speed + truth.relative_velocity


@pytest.mark.parametrize("name", ["data-1", "data-2"])
def test_a_normal_lead_drives_as_people_do(name: str) -> None:
    truth = drive_truth(name)
    assert 0.04 < truth.lead_acceleration.mean() < 0.10
    assert 0.4 < truth.lead_acceleration.std() < 0.67
    assert np.abs(truth.lead_acceleration).max() < 1.6
    assert np.abs(np.diff(truth.lead_acceleration)).max() / STEP_S < 1.0  # jerk in m/s^3
    assert lead_speed(name).min() > 8.0 and lead_speed(name).max() < 25.0


@pytest.mark.parametrize("name", ["data-1", "data-2", "data-3", *NORMAL])
def test_the_follower_keeps_a_safe_gap_and_starts_in_equilibrium(name: str) -> None:
    truth = drive_truth(name)
    assert truth.clearance.min() > 10.0 and truth.clearance.max() < 90.0
    assert truth.host_speed.min() > 6.0 and truth.host_speed.max() < 37.0
    start = truth.time < Driver().reaction_time
    assert np.abs(truth.host_acceleration[start]).max() < 1e-9
    assert np.abs(truth.host_acceleration).max() < 3.0
    assert len(set(truth.track_id)) == 1


def test_the_lead_of_data_3_brakes_abruptly_at_20_s() -> None:
    truth = drive_truth("data-3")
    before = truth.time < 20.0
    assert truth.lead_acceleration[before].min() > -1.6
    assert truth.lead_acceleration.min() == pytest.approx(-2.5)
    assert truth.time[truth.lead_acceleration.argmin()] == pytest.approx(20.25, abs=0.05)
    assert truth.lead_acceleration[truth.time > 22.0].min() > -1.6
    assert 0.4 < (truth.lead_acceleration < -1.94).sum() * STEP_S < 1.0


def test_the_normal_drives_are_the_paper_s_27_in_length_and_statistics() -> None:
    truths = [drive_truth(name) for name in NORMAL]
    assert len(truths) == 27 and min(truth.time[-1] for truth in truths) >= 100.0
    pooled = np.concatenate([truth.lead_acceleration for truth in truths])
    assert pooled.mean() == pytest.approx(0.07, rel=0.1)
    assert pooled.std() == pytest.approx(0.67, rel=0.1)
    assert (np.abs(pooled - pooled.mean()) > 3 * pooled.std()).mean() < 0.01
    for truth in truths:
        # Smooth: no jerk that a passenger would complain of.
        assert np.abs(np.diff(truth.lead_acceleration)).max() / STEP_S < 1.5
    speeds = [truth.host_speed.mean() for truth in truths]
    assert min(speeds) < 14.0 and max(speeds) > 28.0, "from town to motorway"
    assert len({tuple(truth.lead_acceleration[:100]) for truth in truths}) == 27


@pytest.mark.parametrize("peak", [-8.0, -6.0, -3.0])
def test_a_braking_lead_reaches_its_peak_within_a_second_and_nobody_crashes(peak: float) -> None:
    truth = drive_truth("braking", peak)
    acceleration = truth.lead_acceleration
    assert acceleration.min() == pytest.approx(peak)
    assert truth.time[acceleration.argmin()] == pytest.approx(20.0 - peak / 12.0, abs=0.05)
    jerk = np.diff(acceleration) / STEP_S
    assert jerk.min() > -13.0, "brakes need time to come on"
    assert truth.clearance.min() > 3.0
    assert 5.0 < lead_speed("braking").min() < 10.0


def test_a_cut_in_is_another_car_nearer_and_under_another_track_id() -> None:
    drive, truth = generate_drive("cut-in", 0, "esr"), drive_truth("cut-in")
    tracks = values_of(drive, RADAR, "track_id")
    assert list(dict.fromkeys(tracks)) == [1, 2, 3]
    clearance = values_of(drive, RADAR, "clearance")
    times = times_of(drive, RADAR)
    for before, after, nearer in ((1, 2, True), (2, 3, False)):
        (last,), (first,) = np.nonzero(tracks == before)[0][-1:], np.nonzero(tracks == after)[0][:1]
        assert first == last + 1
        assert abs(clearance[first] - clearance[last]) > 8.0
        assert (clearance[first] < clearance[last]) == nearer
        # No scan lies between the two cars.
        true = np.interp(times[first] - SUITE.radar.delay, truth.time, truth.clearance)
        assert abs(clearance[first] - true) < 2.0


def test_stop_and_go_stands_still_and_goes_on_behind_the_lead() -> None:
    truth = drive_truth("stop-and-go")
    standing = truth.host_speed == 0.0
    assert standing.sum() * STEP_S > 3.0 and truth.host_speed[-1] > 5.0
    assert truth.clearance.min() > 2.0
    assert (truth.host_acceleration[standing] >= 0.0).all(), "nobody is pushed backwards"
    assert np.abs(truth.clearance[-1] - truth.clearance[0]) < 60.0


def test_a_hill_is_felt_by_the_accelerometer_alone() -> None:
    truth = drive_truth("hill")
    assert truth.grade.max() == pytest.approx(0.06)
    felt = []
    for seed in range(10):
        drive = generate_drive("hill", seed, "esr")
        times = times_of(drive, ACCELERATION)
        error = values_of(drive, ACCELERATION) - np.interp(
            times, truth.time, truth.host_acceleration
        )
        felt.append(error[(times > 32) & (times < 49)].mean() - error[times < 24].mean())
    assert np.mean(felt) == pytest.approx(9.81 * 0.06, abs=0.2)


@pytest.mark.parametrize(("name", "steepest"), [("hilly-01", 0.17), ("hilly-66", 0.08)])
def test_hills_lie_along_the_way(name: str, steepest: float) -> None:
    truth = drive_truth(name)
    assert 0.5 * steepest < np.abs(truth.grade).max() <= steepest
    steeper = np.diff(truth.grade)
    assert (steeper[truth.host_speed[1:] == 0.0] == 0.0).all(), "a car that stands climbs nothing"
    curve = np.abs(steeper / STEP_S).max() / truth.host_speed.max()
    assert curve < 0.34 / 6.0, "roads have no edges"


def test_bumps_are_short_bursts() -> None:
    truth = drive_truth("bumps")
    drive = generate_drive("bumps", 0, "esr")
    times, value = times_of(drive, ACCELERATION), values_of(drive, ACCELERATION)
    shaking = np.abs(np.diff(value, 2))
    near = np.zeros(len(times), dtype=bool)
    for bump in truth.bumps:
        own = (times >= bump) & (times < bump + 0.3)
        near |= own
        assert np.ptp(value[own]) > 1.5, bump
    assert shaking[near[2:]].max() > 2 * shaking[~near[2:]].max()


@pytest.mark.parametrize("name", NAMES)
def test_every_drive_has_every_sensor_suite_without_a_warning(name: str) -> None:
    for sensor in SENSORS:
        drive = generate_drive(name, 0, sensor)
        assert not drive.warnings and drive.duration >= 59.0
        assert all(s.clearance >= 0.0 for s in drive.samples if s.input == RADAR)


def test_coarse_values_are_coarse_and_old() -> None:
    drive = generate_drive("data-1", 0, "coarse")
    assert_on_grid(values_of(drive, RADAR, "clearance"), 1.0)
    assert_on_grid(values_of(drive, RADAR, "relative_velocity"), 0.29)
    assert drive.count(RADAR) == pytest.approx(800, abs=2)
    clearance = values_of(drive, RADAR, "clearance")
    np.testing.assert_array_equal(clearance[:-1:2], clearance[1::2])
    # Where a car brakes hard, the lag can be told from the slow deviation.
    hard, truth = generate_drive("braking", 0, "coarse"), drive_truth("braking")
    times, value = times_of(hard, ACCELERATION), values_of(hard, ACCELERATION)
    lags = np.arange(0.0, 0.5, 0.02)
    alike = [
        np.corrcoef(value, np.interp(times - lag, truth.time, truth.host_acceleration))[0, 1]
        for lag in lags
    ]
    assert lags[np.argmax(alike)] == pytest.approx(0.2, abs=0.05)


def test_gnss_is_smooth_and_all_at_ten_hertz() -> None:
    drive, truth = generate_drive("data-1", 0, "gnss"), drive_truth("data-1")
    for name in (RADAR, ACCELERATION, HOST_SPEED):
        assert drive.count(name) == pytest.approx(800, abs=3)
    times = times_of(drive, RADAR)
    error = values_of(drive, RADAR, "clearance") - np.interp(times, truth.time, truth.clearance)
    assert error.std() < 0.03
    times = times_of(drive, ACCELERATION)
    error = values_of(drive, ACCELERATION) - np.interp(times, truth.time, truth.host_acceleration)
    assert error.std() < 0.08 and abs(error.mean()) < 0.01


def test_a_drive_lasts_80_s_at_the_rates_of_its_sensors(drive: Drive) -> None:
    assert 0 <= drive.zero < 10_000_000
    assert all(isinstance(s.stamp, int) for s in drive.samples)
    assert drive.duration == pytest.approx(80.0, abs=0.02)
    assert drive.count(ACCELERATION) == pytest.approx(8000, abs=1)
    assert drive.count(RADAR) == pytest.approx(1600, abs=2)
    assert drive.count(HOST_SPEED) == pytest.approx(80 * 83.3, abs=2)
    assert not drive.warnings
    assert {s.track_id for s in drive.samples if s.input == RADAR} == {1}


def test_scans_come_as_irregularly_as_recorded(drive: Drive) -> None:
    periods = np.diff(times_of(drive, RADAR))
    assert periods.min() > 0.0439 and periods.max() < 0.0581
    assert periods.max() - periods.min() > 0.008
    assert periods.mean() == pytest.approx(0.050, abs=0.0005)


def test_the_accelerometer_is_almost_regular(drive: Drive) -> None:
    times = times_of(drive, ACCELERATION)
    late = times - np.arange(len(times)) * 0.01
    assert late.min() >= 0.0 and late.max() < 0.001 and late.std() > 0.0


def test_radar_values_lie_on_the_grid_of_its_frames_with_the_noise_stated() -> None:
    truth, clearance, velocity = drive_truth("data-1"), [], []
    for seed in range(6):
        drive = generate_drive("data-1", seed, "esr")
        assert_on_grid(values_of(drive, RADAR, "clearance"), 0.1)
        assert_on_grid(values_of(drive, RADAR, "relative_velocity"), 0.01)
        error = clearance_errors(drive)
        clearance.append(error[np.abs(error) < 0.7])
        measured = times_of(drive, RADAR) - SUITE.radar.delay
        true = np.interp(measured, truth.time, truth.relative_velocity)
        velocity.append(values_of(drive, RADAR, "relative_velocity") - true)
    error = np.concatenate(clearance)
    assert error.std() == pytest.approx(math.hypot(0.056, 0.1 * ROUNDING), rel=0.06)
    assert abs(error.mean()) < 0.01
    error = np.concatenate(velocity)
    assert error.std() == pytest.approx(math.hypot(0.023, 0.01 * ROUNDING), rel=0.06)
    assert abs(error.mean()) < 0.003


def test_outliers_are_single_scans_about_once_a_minute() -> None:
    total = 0
    for seed in range(20):
        error = np.abs(clearance_errors(generate_drive("data-1", seed, "esr")))
        (off,) = np.nonzero(error > 0.7)
        assert (error[off] < SUITE.radar.outlier + 0.4).all()
        assert all(b - a > 100 for a, b in pairwise(off))
        total += len(off)
    assert 20 * 80 / 75 <= total <= 20 * 80 / 45


def test_the_accelerometer_deviates_as_stated() -> None:
    truth = drive_truth("data-1")
    slow = []
    for seed in range(20):
        drive = generate_drive("data-1", seed, "esr")
        times = times_of(drive, ACCELERATION)
        error = values_of(drive, ACCELERATION) - np.interp(
            times, truth.time, truth.host_acceleration
        )
        slow.append(error[: len(error) // 100 * 100].reshape(-1, 100).mean(axis=1))
    everything = np.concatenate(slow)
    assert everything.std() == pytest.approx(0.3, rel=0.2)
    assert everything.mean() == pytest.approx(0.05, abs=0.08)


def test_host_speed_is_rounded_late_and_off_by_up_to_one_percent() -> None:
    truth, scales = drive_truth("data-2"), []
    for seed in range(10):
        drive = generate_drive("data-2", seed, "esr")
        speed = values_of(drive, HOST_SPEED)
        assert_on_grid(speed, 0.01)
        true = np.interp(times_of(drive, HOST_SPEED) - 0.05, truth.time, truth.host_speed)
        scale = float(speed @ true / (true @ true))
        assert (speed - scale * true).std() == pytest.approx(0.013, abs=0.002)
        scales.append(scale - 1.0)
    assert max(np.abs(scales)) <= 0.0101 and np.ptp(scales) > 0.005


def bands(times: Array, values: Array, rate: float, window: float, edges: tuple) -> Array:
    """Rms of what is left of a signal beside a smooth curve, by bands of frequency in Hz."""
    even = np.arange(times[0], times[-1], 1.0 / rate)
    signal = np.interp(even, times, values)
    rest = signal - savgol_filter(signal, round(window * rate) | 1, 2)
    frequency, power = welch(rest, rate, nperseg=min(512, len(rest) // 4), average="median")
    width = frequency[1] - frequency[0]
    return np.sqrt(
        [
            power[(frequency >= low) & (frequency < high)].sum() * width
            for low, high in pairwise(edges)
        ]
    )


SPECTRA = [
    (RADAR, "clearance", 20.0, (1, 3, 6, 10)),
    (RADAR, "relative_velocity", 20.0, (1, 3, 6, 10)),
    (ACCELERATION, "value", 80.0, (2, 8, 16, 25, 40)),
    (HOST_SPEED, "value", 80.0, (2, 8, 16, 25, 40)),
]


@pytest.mark.parametrize(("name", "field", "rate", "edges"), SPECTRA)
def test_noise_has_the_size_and_the_spectrum_of_the_recorded_one(
    data: Path, name: str, field: str, rate: float, edges: tuple
) -> None:
    """Within 35 % over all frequencies, within a factor of 2.2 in each band.

    Medians over time, so that the recorded car's rough spots are not taken for its noise.
    """

    def of(drive: Drive) -> Array:
        window = 1.0 if name != ACCELERATION else 0.5
        return bands(times_of(drive, name), values_of(drive, name, field), rate, window, edges)

    recorded = of(load_drive(RECORDED, data))
    generated = np.mean([of(generate_drive("data-1", seed, "esr")) for seed in range(4)], axis=0)
    total = np.linalg.norm(generated) / np.linalg.norm(recorded)
    assert 1 / 1.35 < total < 1.35, total
    ratio = generated / recorded
    assert ratio.max() < 2.2 and ratio.min() > 1 / 2.2, ratio


def deviation(drive: Drive) -> tuple[float, float]:
    """Rms of the accelerometer's slow deviation from the derivative of speed, in m/s^2.

    And its correlation with itself 3 s later.
    """
    even = np.arange(1.0, drive.duration - 1.0, 0.05)
    speed = np.interp(even, times_of(drive, HOST_SPEED), values_of(drive, HOST_SPEED))
    felt = np.interp(even, times_of(drive, ACCELERATION), values_of(drive, ACCELERATION))
    off = savgol_filter(felt, 21, 2) - savgol_filter(speed, 21, 2, deriv=1, delta=0.05)
    off -= off.mean()
    return float(off.std()), float(np.corrcoef(off[:-60], off[60:])[0, 1])


def test_the_accelerometer_wanders_as_slowly_as_the_recorded_one(data: Path) -> None:
    rms, memory = deviation(load_drive(RECORDED, data))
    assert rms == pytest.approx(0.3, abs=0.04), "what the project says of the recorded drive"
    generated = np.array([deviation(generate_drive("data-1", seed, "esr")) for seed in range(12)])
    assert generated[:, 0].mean() == pytest.approx(rms, rel=0.3)
    assert generated[:, 1].mean() == pytest.approx(memory, abs=0.25)


def test_scans_come_late_as_the_recorded_ones(data: Path) -> None:
    def percentiles(drive: Drive) -> Array:
        times = times_of(drive, RADAR)
        return np.percentile(np.diff(times), [1, 5, 25, 75, 95, 99])

    recorded = percentiles(load_drive(RECORDED, data))
    generated = percentiles(generate_drive("data-1", 0, "esr"))
    np.testing.assert_allclose(generated, recorded, atol=0.0015)


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
        (
            ["x"],
            "unknown drive 'x'; there are: "
            "data-1, data-2, data-3, cut-in, stop-and-go, hill, bumps, braking, "
            "normal-01 to normal-27, traffic-01 to traffic-198, hilly-01 to hilly-132",
        ),
        (
            ["data-1", "--sensor", "y"],
            "unknown sensor 'y'; there are: esr, coarse, gnss, exact",
        ),
        (["braking", "--peak", "-9"], "peak -9: -8 to -0.5 m/s^2 expected"),
        (["data-1", "--peak", "-3"], "a peak belongs to 'braking', not to 'data-1'"),
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
