"""The paper's evaluation: detectors set alike, faults spread over drives, results kept."""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lfd_diagnosis.verdict import Kind, State
from lfd_mpc.errors import UserError
from lfd_mpc.samples import ACCELERATION, RADAR, UNKNOWN_TRACK, RadarSample, ScalarSample
from lfd_replay.calibrate import main_calibrate, with_noise
from lfd_replay.check_requirements import main_check
from lfd_replay.drawing.paper_figures import detector_curves
from lfd_replay.drive import Drive, make_drive
from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.evaluation import campaign, comparison
from lfd_replay.evaluation.cusum import Cusum
from lfd_replay.evaluation.detectors import (
    EQUAL_EVENTS,
    ROBUST,
    ROBUST_SET,
    CountedIndex,
    at_equal,
    choose,
    count_false_events,
)
from lfd_replay.evaluation.fault_windows import LENGTH, PAUSE, Cell, offset_cells
from lfd_replay.evaluation.kalman import KalmanGate, LeadModel
from lfd_replay.evaluation.normal_driving import lead_acceleration, scan_deviations
from lfd_replay.evaluation.requirements import plan
from lfd_replay.evaluation.requirements.judge import Judge, kinds_confusion
from lfd_replay.evaluation.requirements.measure import measure
from lfd_replay.evaluation.requirements.mechanisms import AS_IT_IS, ablation_table
from lfd_replay.evaluation.requirements.rows import Row, rows
from lfd_replay.evaluation.requirements.windows import (
    CLEAR_FOR,
    Seen,
    clear_from,
    false_events,
    made_of,
)
from lfd_replay.evaluation.statistics import median, rate
from lfd_replay.evaluation.summary import case_rows, equal_rows, mechanism_rows, summary, tables
from lfd_replay.evaluation.trace import JUDGED, Trace, load_trace, record_trace
from lfd_replay.evaluation.variants import LINEAR, SINGLE, variants
from lfd_replay.faults import MEASURED, FaultInjector, parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.generated.sensor_models import SENSORS
from lfd_replay.journal import Journal, Task, run_tasks, workers
from lfd_replay.make_drive import main_make
from lfd_replay.offline import OfflineGraph
from lfd_replay.paper_evaluation import main_paper_evaluation
from lfd_replay.profiles import graph_settings
from lfd_replay.score import find_windows
from ros_support import Graph

SETTINGS = graph_settings("paper")
FAULTS = parse_faults(
    [
        "offset:clearance=4,relative_velocity=-10@20-24",
        "offset:acceleration=4@40-44",
    ]
)


@pytest.fixture(scope="module")
def healthy() -> Trace:
    drive = generate_drive("data-1", 0, "esr")
    return record_trace(OfflineGraph(SETTINGS).rows(drive.samples), drive.zero)


@pytest.fixture(scope="module")
def faulty() -> Trace:
    drive = generate_drive("data-1", 0, "esr")
    samples = FaultInjector(FAULTS, drive.zero, 0).apply(drive.samples)
    return record_trace(OfflineGraph(SETTINGS).rows(samples), drive.zero)


def test_the_counted_index_is_the_published_decision(faulty: Trace) -> None:
    detector = CountedIndex("paper", "paper", SETTINGS.diagnosis)
    setting = SETTINGS.diagnosis.confidence_threshold
    assert detector.headroom == SETTINGS.diagnosis.confidence_max - setting
    seen = 0
    for signal, score in detector.scores(faulty).items():
        published = faulty.state(signal) == State.FAULT
        np.testing.assert_array_equal(detector.flags(signal, score, setting), published)
        seen += published.any()
    assert seen >= 2


def test_a_trace_survives_its_file(healthy: Trace, tmp_path: Path) -> None:
    healthy.save(tmp_path / "a" / "b.npz")
    again = load_trace(tmp_path / "a" / "b.npz")
    for name, array in vars(healthy).items():
        np.testing.assert_array_equal(array, getattr(again, name))


def kalman() -> KalmanGate:
    return KalmanGate((0.063, 0.024), LeadModel(0.07, 0.67))


def test_the_kalman_filter_finds_the_radar_fault_in_two_scans_and_no_outlier(
    healthy: Trace, faulty: Trace
) -> None:
    detector = kalman()
    quiet = choose(detector, count_false_events(detector, healthy, 0)["clearance"], 0)
    assert quiet.false_events == 0
    flags = detector.flags("clearance", detector.scores(faulty)["clearance"], quiet.setting)
    (found,), _ = find_windows(faulty.stamps, flags, [(20.0, 24.0)])
    assert found.delay is not None and 0.04 < found.delay <= 0.13
    outlier = np.nanmax(np.abs(np.diff(healthy.measured[:, 0])))
    assert outlier > 1.0, "the drive must hold an outlying scan for this test to mean something"


def test_a_cusum_counts_what_lies_beyond_its_drift() -> None:
    detector = Cusum(0.0, np.zeros(3), np.ones(3))
    score = np.concatenate([np.full(50, 0.9), np.full(50, 2.0), np.zeros(100)])
    flags = detector.flags("clearance", score, 10.0)
    assert not flags[:59].any() and flags[59], "1 a step from step 50 on, 10 at the tenth"
    assert flags[99] and not flags[120:].any(), "held below two limits, it comes down in 10 steps"
    assert not detector.flags("clearance", np.full(50, np.nan), 1.0).any()
    np.testing.assert_array_equal(detector.flags("clearance", -score, 10.0), flags)


def test_the_setting_is_the_most_nervous_one_with_so_few_false_events() -> None:
    detector = kalman()
    counts = [9, 5, 2, 1, 2, 1, 0] + [0] * (len(detector.settings) - 7)
    assert choose(detector, counts, 1).setting == detector.settings[5]
    assert choose(detector, counts, 1).false_events == 1
    assert choose(detector, counts, 0).setting == detector.settings[6]
    deaf = choose(detector, [3] * len(detector.settings), 0)
    assert deaf.setting == detector.settings[-1] and deaf.false_events == 3


def test_faults_of_a_cell_stand_apart_spread_over_the_scan_and_change_sign() -> None:
    cell = Cell("offset", (("clearance", 2.0),), signed=True)
    faults = [f for seed in range(20) for f in cell.faults("normal-01", seed, 100.0)]
    one = cell.faults("normal-01", 0, 100.0)
    assert len(one) >= 9 and one == cell.faults("normal-01", 0, 100.0)
    for before, after in zip(one, one[1:], strict=False):
        assert after.start - before.end >= PAUSE * 1e9 - 1e6
    assert one[-1].end * 1e-9 <= 100.0 - PAUSE and one[0].end - one[0].start == LENGTH * 1e9
    assert {fault.values for fault in one} == {(("clearance", 2.0),), (("clearance", -2.0),)}
    phase = np.histogram([f.start * 1e-9 % 0.05 for f in faults], bins=5, range=(0, 0.05))[0]
    assert phase.min() > len(faults) / 10


def test_the_full_run_has_the_sizes_that_were_asked_for() -> None:
    sizes = {}
    for cell in offset_cells(full=True):
        ((signal, size),) = cell.values
        sizes.setdefault(signal, []).append(size)
    assert sizes["clearance"][0] == sizes["acceleration"][0] == 0.25
    assert sizes["clearance"][-1] == sizes["acceleration"][-1] == 4.0
    assert (sizes["relative_velocity"][0], sizes["relative_velocity"][-1]) == (0.25, 10.0)


def test_variants_differ_in_one_part_only() -> None:
    made = variants(SETTINGS)
    assert made[SINGLE].bank.lags == (0,) and made[SINGLE].mpc == SETTINGS.mpc
    assert made[LINEAR].mpc.prediction == "linear" and made[LINEAR].bank == SETTINGS.bank


def test_rates_and_medians_carry_intervals() -> None:
    share, low, high = rate(45, 50)
    assert share == 0.9 and 0.78 < low < 0.9 < high < 0.96
    assert rate(0, 10)[1:] == pytest.approx((0.0, 0.278), abs=1e-3)
    middle, least, most = median([0.1 * k for k in range(101)])
    assert middle == pytest.approx(5.0) and 3.5 < least < 5.0 < most < 6.5
    assert median([2.0]) == (2.0, 2.0, 2.0)


def double(value: int) -> int:
    if value < 0:
        raise ValueError("negative")
    return 2 * value


TIMES = np.arange(0.0, 12.0, 0.1)
NONE = np.zeros(len(TIMES), dtype=bool)

Spans = tuple[tuple[float, float], ...]


def within(spans: Spans) -> np.ndarray:
    return np.any([NONE, *((a - 0.05 < TIMES) & (b - 0.05 > TIMES) for a, b in spans)], axis=0)


def view_of(flagged: Spans, silent: Spans = (), targets: np.ndarray | None = None) -> Seen:
    """What is said of a clearance, all else being healthy; rebuilt as 0 +- 1."""
    by_signal = {name: NONE for name in MEASURED}
    return Seen(
        TIMES,
        np.zeros(len(TIMES), dtype=np.int64) if targets is None else targets,
        by_signal | {"clearance": within(flagged)},
        {name: ~NONE for name in MEASURED},
        by_signal | {"clearance": within(silent)},
        *({name: np.zeros(len(TIMES)) for name in MEASURED} for _ in range(3)),
        np.zeros((len(TIMES), 3)),
        np.ones((len(TIMES), 3)),
    )


def made_of_clearance(view: Seen, unseen: Spans = ()) -> dict:
    """Of a fault from 5 to 7 s; the healthy radar sees nothing meanwhile."""
    (fault,) = parse_faults(["offset:clearance=4@5-7"])
    healthy = np.zeros((len(TIMES), 4))
    healthy[within(unseen)] = np.nan
    return made_of(view, np.zeros((len(TIMES), 4)), healthy, fault)


def test_a_flag_that_stood_before_a_fault_does_not_find_it() -> None:
    made = made_of_clearance(view_of(((5.3, 7.2),)))
    assert made["signals"]["clearance"]["delay"] == pytest.approx(0.3)
    made = made_of_clearance(view_of(((4.0, 7.2),)))
    assert made["signals"]["clearance"]["delay"] is None
    made = made_of_clearance(view_of(((4.0, 5.5), (6.0, 7.2))))
    assert made["signals"]["clearance"]["delay"] == pytest.approx(1.0)


def test_what_is_called_faulty_only_once_it_is_over_is_said_so() -> None:
    late = view_of(((7.2, 9.0),))
    made = made_of_clearance(late)["signals"]["clearance"]
    assert made["late"] and made["delay"] is None
    assert not made_of_clearance(view_of(((5.2, 6.9), (7.2, 9.0))))["signals"]["clearance"]["late"]
    assert not made_of_clearance(view_of(((8.2, 9.0),)))["signals"]["clearance"]["late"]
    # In the second after a fault a flag is no false event, later on it is.
    faults = parse_faults(["offset:clearance=4@5-7"])
    assert not false_events(late, faults)["clearance"]
    assert false_events(view_of(((8.2, 9.0),)), faults)["clearance"] == [8.2]


def test_kinds_are_those_of_windows_in_which_the_fault_was_found() -> None:
    made = [
        {"delay": 0.1, "kind": int(Kind.RAMP)},
        {"delay": None, "kind": None},
        {"delay": None, "kind": int(Kind.OFFSET)},  # of a flag that stood before
        {"delay": 3.99, "kind": None},
    ]
    windows = [{"signals": {"clearance": one}} for one in made]
    assert kinds_confusion({"ramp": windows}) == {"ramp": {"ramp": 1, "not found": 2, "unknown": 1}}


def test_where_nothing_is_injected_nothing_is_found_to_its_end() -> None:
    """A share of no windows at all would read as if all of them were found."""
    found = {"delay": 0.1, "fraction": 1.0, "clear": 0.2}
    windows = {"healthy": [], "faults": [{"signals": {"clearance": found}, "blamed": []}]}

    def of(run: plan.Run, _profile: str) -> dict:
        quiet = {"false": {"clearance": []}, "ready": dict.fromkeys(JUDGED, 1.0)}
        return {"windows": windows[run.drive], **quiet}

    table = ablation_table({(AS_IT_IS, name): [plan.Run(name, 1)] for name in windows}, of)
    healthy, faults = mechanism_rows(table)
    assert healthy[1:4] == ("healthy", "-", "-") and faults[2:4] == ("100.0% of 1", "100.0%")
    assert table[AS_IT_IS]["healthy"]["found"] is table[AS_IT_IS]["healthy"]["flagged"] is None


@pytest.mark.parametrize(("unseen", "one"), [((6.0, 6.4), True), ((6.0, 6.9), False)])
def test_a_target_goes_on_through_lost_scans_whatever_the_diagnosis_says(unseen, one) -> None:
    targets = np.where(within((unseen,)), UNKNOWN_TRACK, 3)
    view = view_of((), silent=((2.0, 9.0),), targets=targets)
    assert made_of_clearance(view, (unseen,))["one_target"] is one
    targets = np.where(TIMES > 8.0, 4, targets)
    assert not made_of_clearance(replace(view, targets=targets))["one_target"]


def test_a_value_that_is_not_valid_is_not_rebuilt() -> None:
    view = view_of(((5.1, 7.0),))
    rebuilt = made_of_clearance(view)["rebuilt"]["clearance"]
    assert rebuilt["worst"] == 0.0 and rebuilt["steps"] == rebuilt["flagged"] == 19
    view.rebuilt[TIMES > 5.5] = np.nan
    rebuilt = made_of_clearance(view)["rebuilt"]["clearance"]
    assert rebuilt["worst"] is None and rebuilt["steps"] == 5 and rebuilt["flagged"] == 19


def test_no_window_at_all_meets_nothing() -> None:
    judge = Judge("a row", "robust", [])
    judge.share("found", [], 0.99)
    assert judge.findings[0].met is False and judge.findings[0].value == "of none"


def test_a_fault_that_goes_on_after_a_silence_is_no_false_event_and_one_after_it_is() -> None:
    # Faulty from 2 s to 4 s, then silent for 2 s; called faulty until 6.5 s and once more at 9 s.
    seen = view_of(((1.0, 1.2), (2.1, 4.0), (6.0, 6.5), (9.0, 9.2)), silent=((4.0, 6.0),))
    faults = parse_faults(["offset:clearance=4@2-4"])
    assert false_events(seen, faults) == {name: [] for name in MEASURED} | {"clearance": [1.0, 9.0]}
    assert false_events(seen, [])["clearance"] == [1.0, 2.1, 6.0, 9.0]


@pytest.mark.parametrize("calm", [0.5, CLEAR_FOR - 0.01, CLEAR_FOR, 5.0])
def test_a_fault_is_over_when_its_flag_stays_away(calm: float) -> None:
    times = np.round(0.01 * np.arange(1000), 2)
    again = (times >= 2.5 + calm - 1e-6) & (times < 9.0 - 1e-6)
    flags = (times < 2.5) | again
    assert clear_from(times, flags, 2.0) == (2.5 if calm >= CLEAR_FOR else 9.0)
    assert clear_from(times, ~flags | (times > 9.5), 9.6) is None


def test_a_run_goes_on_where_it_stopped(tmp_path: Path) -> None:
    file = tmp_path / "work" / "journal.jsonl"
    done: list[int] = []
    with ThreadPoolExecutor(1) as pool:
        tasks = [Task("a", double, (1,)), Task("b", double, (-1,)), Task("c", double, (3,))]
        with pytest.raises(ValueError):
            run_tasks(tasks, Journal(file), pool, lambda: done.append(1))
        with file.open("a") as cut_off:
            cut_off.write('\n{"key": "c", "resu')
        journal = Journal(file)
        assert journal.results["a"] == 2 and "b" not in journal.results
        tasks[1] = Task("b", double, (2,))
        assert run_tasks(tasks, journal, pool, lambda: None) == {"a": 2, "b": 4, "c": 6}
    assert Journal(file).results == {"a": 2, "b": 4, "c": 6}
    file.write_text(file.read_text().replace('{"code": "', '{"code": "0'))
    assert Journal(file).results == {}, "results of other code do not count"
    with pytest.raises(UserError, match="cannot be kept there"):
        Journal(file / "journal")


def test_workers_end_with_a_run_that_is_killed() -> None:
    run = """
import time
from lfd_replay.journal import workers

if __name__ == "__main__":
    with workers(2) as pool:
        pool.submit(abs, 1).result()
        print("at work", flush=True)
        time.sleep(600)
"""
    with subprocess.Popen([sys.executable, "-c", run], stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"at work\n"
        process.kill()
        # The pipe ends when the last of those that inherited it has.
        assert process.communicate(timeout=60) == (b"", None)


def test_the_lead_and_the_radar_are_read_off_a_drive() -> None:
    drive = generate_drive("data-2", 0, "esr")
    lead = lead_acceleration(drive)
    assert lead.std() == pytest.approx(0.5, rel=0.15)
    clearance, velocity = scan_deviations([drive])
    # The difference of two scans, with the noise and the resolution of each.
    radar = SENSORS["esr"].radar
    fresh = 2.0 * (1.0 - radar.clearance_memory) * radar.clearance_noise**2
    noise = np.sqrt(fresh + 2.0 * radar.clearance_step**2 / 12.0)
    assert clearance == pytest.approx(noise, rel=0.15)
    assert radar.velocity_noise < velocity < 0.06


def slow_drive(stretches: list[list[float]]) -> Drive:
    """A lead in each stretch, with the seconds from scan to scan within it."""
    times = np.cumsum([step for own in stretches for step in [5.0, *own]])
    tracks = [number for number, own in enumerate(stretches) for _ in range(len(own) + 1)]
    radar = [
        RadarSample(round(time * 1e9), True, 30.0, float(np.sin(time)), track)
        for time, track in zip(times, tracks, strict=True)
    ]
    stamps = range(0, round(times[-1] * 1e9), 100_000_000)
    felt = [ScalarSample(ACCELERATION, stamp, 0.0) for stamp in stamps]
    return make_drive("slow", {RADAR: radar, ACCELERATION: felt})


@pytest.mark.parametrize(
    "short",
    [
        pytest.param([1.0] * 3, id="four scans of one a second"),
        pytest.param([0.01] * 6, id="scans of a moment"),
    ],
)
def test_a_stretch_too_short_to_differentiate_tells_no_lead(short: list[float]) -> None:
    """It ended calibrate."""
    whole = slow_drive([[1.0] * 30])
    lead = lead_acceleration(whole)
    assert len(lead) == 31 and np.isfinite(lead).all()
    assert len(lead_acceleration(slow_drive([[1.0] * 30, short]))) == 31
    with pytest.raises(UserError, match="lead is followed for two seconds and 5 scans"):
        with_noise(graph_settings("robust"), [slow_drive([[1.0] * 3] * 4)])


def test_calibrate_writes_parameters_that_evaluate_and_nodes_take(tmp_path: Path, capfd) -> None:
    drive, params, result = tmp_path / "d.mcap", tmp_path / "p.yaml", tmp_path / "r.json"
    assert run_command(main_make, ["data-1", "-o", str(drive)]) == 0
    assert run_command(main_calibrate, [str(drive), "-o", str(params)]) == 0
    text = params.read_text()
    assert "False events per hour" in text.splitlines()[1]
    settings = graph_settings("paper", params)
    assert settings.bank.lead_acceleration_std == settings.diagnosis.lead_acceleration_std != 0.6698
    assert settings.diagnosis.clearance_std < 0.15
    arguments = [str(drive), "--params", str(params), "--json", str(result)]
    assert run_command(main_evaluate, arguments) == 0
    for figures in json.loads(result.read_text())["sensors"].values():
        assert figures["false_events"] == 0, "it was calibrated to none on this very drive"
    with Graph() as graph:
        graph.add_graph(["--ros-args", "--params-file", str(params)])
        node = next(n for n in graph.nodes if n.get_name() == "diagnosis_node")
        live = node.get_parameter("clearance_std").value
        assert live == settings.diagnosis.clearance_std
    capfd.readouterr()
    assert run_command(main_calibrate, [str(tmp_path / "no.mcap"), "-o", str(params)]) == 2
    assert "no.mcap: no such file" in capfd.readouterr().err
    assert params.read_text() == text, "nothing is lost"


@pytest.mark.parametrize(
    ("rates", "said"),
    [
        ([0.0, 0.0], "lead_acceleration_std: Input should be greater than 0, got 0.0"),
        ([9.0, -9.0], "lead_acceleration_std: Input should be less than or equal to 10, got"),
    ],
)
def test_calibrate_refuses_drives_without_figures_of_driving(
    rates: list[float], said: str, tmp_path: Path, capsys
) -> None:
    drive, params = tmp_path / "d.csv", tmp_path / "p.yaml"
    rows = [f"{k * 0.05:.2f},30,{rates[k // 10 % 2]},15,0" for k in range(200)]
    drive.write_text(
        "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n" + "\n".join(rows)
    )
    assert run_command(main_calibrate, [str(drive), "-o", str(params)]) == 2
    error = capsys.readouterr().err
    assert said in error and str(drive) in error and error.count("\n") == 1
    assert not params.exists()


def few_rows(extent: plan.Extent, recorded: bool) -> list[Row]:
    """Of each way to judge one row, on few drives."""
    chosen = {
        "Table 3: all three": 1,
        "Table 3: all three, rebuilt": 1,
        "offset clearance +-2": 1,
        "hold host_speed": 1,
        "ramp clearance": 1,
        "noise acceleration": 1,
        "dropout clearance": 1,
        "healthy drives": 2,
    }
    return [
        replace(row, runs=row.runs[: chosen[row.title]])
        for row in rows(extent, recorded)
        if row.title in chosen
    ]


def test_a_row_counts_as_the_fault_that_it_injects() -> None:
    """Titles are for people: they tell rows apart, and nothing else hangs on them."""
    every = rows(plan.full_extent(), True)
    assert len({row.title for row in every}) == len(every)
    assert all(run.profiles == row.runs[0].profiles for row in every for run in row.runs)
    counted = [row for row in every if row.counts_as]
    assert {"offset", "hold", "noise"} < {row.counts_as[0] for row in counted}
    for row in counted:
        injected = {
            (fault.kind, *fault.signals) for run in row.runs for fault in parse_faults(run.faults)
        }
        assert injected == {row.counts_as}, row.title


def test_rows_are_checked_on_seeds_of_ones_choice(tmp_path: Path, monkeypatch, capsys) -> None:
    """Other seeds are other drives: the figures say of how many, and are kept by seed."""
    monkeypatch.setattr("lfd_replay.check_requirements.rows", few_healthy)
    asked = ["healthy", "--recorded", str(tmp_path), "--out", str(tmp_path), "--jobs", "2"]
    assert run_command(main_check, [*asked, "--seeds", "2,4"]) == 0
    printed = capsys.readouterr()
    assert "seeds 2,4" in printed.out and "0 in 0.04 h" in printed.out
    assert "NOT RUN on the recorded drive" in printed.err
    kept = [json.loads(line) for line in (tmp_path / "journal.jsonl").read_text().split("\n")[2:]]
    assert len({entry["key"] for entry in kept}) == 2


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["no such row"], "no row's title contains 'no such row'; there are: Table 3"),
        (["Table 3", "--seeds", "two"], "--seeds 'two': expected whole numbers"),
        (["Table 3", "--seeds", "-1"], "--seeds '-1': expected whole numbers"),
        (["Table 3", "--jobs", "0"], "--jobs 0: 1 or more is expected"),
    ],
)
def test_rows_that_there_are_not_are_named(tmp_path: Path, capsys, arguments, named) -> None:
    places = ["--recorded", str(tmp_path), "--out", str(tmp_path / "out")]
    assert run_command(main_check, [*arguments, *places]) == 2
    *_, last = capsys.readouterr().err.splitlines()
    assert named in last
    assert not (tmp_path / "out").exists()


def test_a_folder_of_recorded_drives_that_is_not_there_is_refused_but_for_the_usual_one(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    """A name that is mistyped would cost minutes, and leave the recorded drives out."""
    monkeypatch.chdir(tmp_path)
    for command, title in ((main_check, ["healthy"]), (main_paper_evaluation, [])):
        assert run_command(command, [*title, "--recorded", "nowhere", "--out", "out"]) == 2
        (said,) = capsys.readouterr().err.splitlines()
        assert said.startswith("--recorded nowhere: no such folder; ")
    assert not (tmp_path / "out").exists()
    monkeypatch.setattr("lfd_replay.check_requirements.rows", few_healthy)
    usual = ["healthy", "--recorded", "../shared/data", "--out", "out", "--jobs", "1"]
    assert run_command(main_check, [*usual, "--seeds", "2"]) == 0
    assert "NOT RUN on the recorded drive: ../shared/data" in capsys.readouterr().err


def few_healthy(extent: plan.Extent, recorded: bool) -> list[Row]:
    runs = tuple(plan.Run("data-1", seed) for seed in extent.healthy_seeds)
    return [Row("healthy", runs, lambda judge: judge.no_false_events())]


def test_the_whole_evaluation_in_small(tmp_path: Path, monkeypatch) -> None:
    extent = plan.plain_extent()
    few = partial(measure, only=few_rows(extent, False))
    monkeypatch.setattr(campaign, "measure", few)
    small = campaign.Size(
        normal=("data-1", "data-2"),
        starts=1,
        cells=(Cell("offset", (("acceleration", 4.0),), signed=True),),
        offset_drives=("data-2",),
        other_drives=(),
        parts=True,
        extent=extent,
    )
    done: list[int] = []
    with workers(2) as pool:
        found = campaign.evaluate_paper(
            small, SETTINGS, None, tmp_path, pool, lambda: done.append(1)
        )
        assert 0 < len(done) <= small.tasks
        result = json.loads(json.dumps(summary(found, False, 1.0), allow_nan=False))
        # A second run takes everything from the first one.
        size = tmp_path.joinpath("journal.jsonl").stat().st_size
        again = campaign.evaluate_paper(small, SETTINGS, None, tmp_path, pool, lambda: None)
        assert tmp_path.joinpath("journal.jsonl").stat().st_size == size
    assert again.rows == found.rows
    check_cases_and_normal_drives(found, result)
    check_detectors(found, result)
    check_requirements(result)
    for title, columns, table in tables(found):
        assert all(len(row) == len(columns) for row in table), title


def check_cases_and_normal_drives(found: campaign.Evaluation, result: dict) -> None:
    cases = {(c["drive"], *c["faults"]): c["sensors"] for c in result["cases"]}
    assert len(cases) == 9
    radar = cases["data-1", "offset:clearance=4,relative_velocity=-10@40.0000-60.0000"]
    assert radar["clearance"]["detected"] and radar["clearance"]["delay_s"] <= 0.15
    assert set(result["normal"]) == {
        "hours",
        "zero_share",
        "mean",
        "std",
        "false_events_per_hour",
    }
    assert result["normal"]["hours"] == pytest.approx(160 / 3600, rel=0.01)
    in_words = case_rows(found)
    assert len(in_words) == 9
    # The page stands alone, and the paper's letters are not explained on it.
    assert {row[1] for row in in_words} == {
        "no fault",
        "clearance and relative velocity",
        "acceleration",
        "clearance and relative velocity and acceleration",
    }


def check_detectors(found: campaign.Evaluation, result: dict) -> None:
    rows = {row["name"]: row for row in result["detectors"]}
    assert set(rows) == {
        "paper",
        SINGLE,
        LINEAR,
        "Kalman filter",
        "CUSUM",
        comparison.AS_PUBLISHED,
        ROBUST,
        ROBUST_SET,
        *(at_equal(n, k) for n in ("paper", "Kalman filter", "CUSUM") for k in EQUAL_EVENTS),
    }
    robust = rows[ROBUST]
    assert robust["detected"] == 1.0 and robust["false_events"] == 0
    assert rows[ROBUST_SET]["detected"] == 1.0 and rows[ROBUST_SET]["false_events"] == 0
    assert {row[2] for row in equal_rows(found.rows)} == {n for n in rows if n.endswith(" false")}
    for figure in ("rate", "delay"):
        drawn = {
            mark.name
            for panel in detector_curves(found.rows, figure).panels
            for mark in panel.marks
        }
        assert drawn == {name for name in rows if not name.endswith(" false")}
    published = rows[comparison.AS_PUBLISHED]
    assert published["windows"] >= 6 and published["detected"] == 1.0
    assert published["delay_s"] < 0.13 and published["signal"] == "acceleration"
    for name, matrix in result["confusion"].items():
        assert sum(matrix["acceleration"].values()) == published["windows"], name
        assert sum(matrix["no fault"].values()) > 10, name
    assert all(set(by_signal) == set(JUDGED) for by_signal in result["settings"].values())
    hourly = round(result["normal"]["hours"] * campaign.FALSE_EVENTS_PER_HOUR)
    for name, by_signal in found.chosen.items():
        allowed = int(name.split()[-2]) if name.endswith(" false") else hourly
        for signal, choice in by_signal.items():
            assert choice.false_events <= allowed, f"{name} {signal}"


def check_requirements(result: dict) -> None:
    told = {(f["profile"], f["row"], f["what"]): f for f in result["requirements"]}
    assert told["robust", "Table 3: all three", "clearance found"]["met"]
    assert told["robust", "Table 3: all three", "no healthy signal blamed"]["met"]
    assert told["robust", "healthy drives", "false events"]["value"].startswith("0 in")
    assert not told["paper", "offset clearance +-2", "clearance found"]["met"]
    assert told["robust", "hold host_speed", "found within 0.5 s of having moved enough"]["met"]
    assert told["robust", "dropout clearance", "clearance: NO_DATA in time"]["met"]
    assert result["kinds"]["clearance"]["offset"].keys() == {"offset"}
