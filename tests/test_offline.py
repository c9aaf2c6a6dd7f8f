"""Whole drives in one compiled loop: the same as step by step, one drive or many."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from importlib.util import cache_from_source
from pathlib import Path

import numpy as np
import pytest

from lfd_mpc.samples import HOST_SPEED
from lfd_replay.drive_bag import write_bag, write_drive
from lfd_replay.errors import run_command
from lfd_replay.evaluate import main_evaluate
from lfd_replay.evaluate_many import attempt, drive_key, journal_file, say_failures
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.offline import CHUNK, OfflineGraph
from lfd_replay.profiles import PROFILES, GraphSettings, graph_settings


def free_port() -> int:
    """A port that nobody listens at."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


FAULTS = (
    "offset:clearance=4,relative_velocity=-10@12-16;dropout:radar@18-19;dropout:acceleration@22-23;"
    "hold:acceleration@26-29;offset:acceleration=-4@33-36;zero:host_speed@39-41;"
    "noise:clearance=1@44-47"
)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("solver", ["active_set", "proxqp"])
def test_every_step_of_the_loop_says_what_the_nodes_cores_say(profile: str, solver: str) -> None:
    drive = generate_drive("stop-and-go", 3, "esr")
    samples = FaultInjector(parse_faults([FAULTS]), drive.zero, 0).apply(drive.samples)
    chosen = graph_settings(profile)
    settings = GraphSettings(
        chosen.mpc.model_copy(update={"solver": solver}), chosen.bank, chosen.diagnosis
    )
    stepped = [step.outcome for step in OfflineGraph(settings).run(samples)]
    graph = OfflineGraph(settings)
    looped = [outcome for rows in graph.rows(samples) for outcome in graph.outcomes(rows)]
    assert len(stepped) > CHUNK, "more than one array of rows"
    # As text, since NaN equals nothing: states, indices, confidences, reasons and events.
    assert list(map(str, looped)) == list(map(str, stepped))
    assert {o.report.radar.state for o in looped} >= {1, 3, 4}
    graph = OfflineGraph(settings)
    events = [event for rows in graph.rows(samples) for event in graph.events(rows)]
    assert list(map(str, events)) == [str(event) for o in stepped for event in o.events]


COMPILED = """
import sys
import lfd_diagnosis.decision_node, lfd_diagnosis.diagnosis_node, lfd_observer.observer_node
from lfd_bringup.compile_all import compile_all
from lfd_mpc.compiled import Compiled
import lfd_bringup.simulate

compile_all()
for name, module in sorted(sys.modules.items()):
    for function in vars(module).values() if name.startswith("lfd_") else ():
        if isinstance(function, Compiled) and function.kept:
            print(function.__name__, len(function.dispatcher.signatures))
"""


def test_nothing_is_left_to_compile_for_the_first_start_of_a_node() -> None:
    program = [sys.executable, "-c", COMPILED]
    kept = subprocess.run(program, capture_output=True, text=True, check=True).stdout
    counts = dict(line.split() for line in kept.splitlines())
    assert {"take_clock", "next_inputs", "take_sample"} <= set(counts)
    assert [name for name, count in counts.items() if count == "0"] == []


def test_setup_leaves_bytecode_where_a_start_may_not_write_it() -> None:
    modules = sorted((Path(__file__).parent.parent / "ros2_ws/src").glob("lfd_*/lfd_*/**/*.py"))
    assert len(modules) > 100
    assert [m for m in modules if not Path(cache_from_source(str(m))).is_file()] == []


def test_rows_carry_the_horizons() -> None:
    drive = generate_drive("data-1", 1, "esr")
    samples = [s for s in drive.samples[:3000] if s.input != HOST_SPEED]
    settings = graph_settings("robust")
    horizons = [step.horizon for step in OfflineGraph(settings).run(samples)]
    rows = np.concatenate(list(OfflineGraph(settings).rows(samples)))
    assert len(rows) == len(horizons) > 1000
    for name in ("stamp", "clearance", "command", "residual", "host_speed_age", "valid"):
        expected = [getattr(horizon, name) for horizon in horizons]
        np.testing.assert_array_equal(rows["horizon"][name], expected, err_msg=name)


@pytest.mark.parametrize("report", [False, True])
def test_the_time_is_that_of_warm_code_with_and_without_a_page(
    report: bool, tmp_path: Path, monkeypatch
) -> None:
    drive, out = tmp_path / "drive.csv", tmp_path / "out.json"
    rows = [f"{k * 0.05:.2f},30,0,15,0" for k in range(40)]
    drive.write_text(
        "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n" + "\n".join(rows)
    )
    fetching, own = [1.0], OfflineGraph.rows

    def fetched_first(self, samples):
        if fetching:
            time.sleep(fetching.pop())
        return own(self, samples)

    monkeypatch.setattr(OfflineGraph, "rows", fetched_first)
    options = ["--report", str(tmp_path / "page")] if report else []
    assert main_evaluate([str(drive), *options, "--json", str(out)]) == 0
    assert 0.0 < json.loads(out.read_text())["elapsed_s"] < 0.9 and not fetching


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Three drives, and one that is none."""
    made = tmp_path_factory.mktemp("drives")
    for number in (1, 2, 3):
        write_drive(generate_drive(f"normal-{number:02d}", 1, "esr"), made / f"{number}.mcap")
    (made / "bad.csv").write_text("t_s\n")
    return made


EVALUATE = [sys.executable, "-c", "from lfd_replay.evaluate import main; exit(main())"]
ARGUMENTS = ["--fault", "offset:clearance=4@30-40", "--jobs", "2"]


def check_together(file: Path) -> None:
    result = json.loads(file.read_text())
    assert [Path(d["drive"]).name for d in result["drives"]] == [
        "1.mcap",
        "2.mcap",
        "3.mcap",
        "bad.csv",
    ]
    assert result["failed"] == 1 and "is empty" in result["drives"][3]["error"]
    assert result["sensors"]["clearance"] == {"windows": 3, "found": 3, "false_events": 0}
    assert result["hours"] == pytest.approx(
        sum(d["steps"] for d in result["drives"][:3]) * 0.01 / 3600, abs=1e-6
    )


def test_a_bad_drive_is_named_and_does_not_stop_the_rest(folder, tmp_path, capfd) -> None:
    out = tmp_path / "all.json"
    assert main_evaluate([str(folder), *ARGUMENTS, "--json", str(out)]) == 2
    check_together(out)
    printed = capfd.readouterr()
    assert "3 of 3, 0" in printed.out and "bad.csv: is empty" in printed.err
    assert not journal_file(out, []).exists(), "nothing is left behind"


@pytest.mark.parametrize("name", ["pipe.csv", "pipe.mcap", "pipe.log"])
def test_a_pipe_among_drives_is_named_and_waited_for_by_nobody(
    name: str, tmp_path: Path, capfd
) -> None:
    os.mkfifo(tmp_path / name)
    said = f"{tmp_path / name}: is a pipe or a device; a file or a folder is expected"
    write_drive(generate_drive("data-1", 0, "esr"), tmp_path / "good.mcap")
    program = "from lfd_replay.{0} import main; exit(main())"
    for command, arguments in (
        ("evaluate", [tmp_path, "--jobs", "1"]),
        ("evaluate", [tmp_path / name]),
        ("inspect", [tmp_path / name]),
    ):
        call = [sys.executable, "-c", program.format(command), *arguments]
        done = subprocess.run(call, capture_output=True, text=True, timeout=30)
        assert done.returncode == 2 and said in done.stderr.splitlines()[-1]
        assert ("good.mcap" in done.stdout) == (tmp_path in arguments)


ROW = "t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n"


def test_a_drive_that_was_not_judged_is_no_healthy_hour(tmp_path: Path, capfd) -> None:
    many, out = tmp_path / "many", tmp_path / "all.json"
    many.mkdir()
    for name, unit in (("micro", 50_000), ("seconds", 0.05)):
        rows = "".join(f"{k * unit:.2f},30,0,15,0\n" for k in range(200))
        (many / f"{name}.csv").write_text(ROW + rows)
    arguments = ["--jobs", "1", "--json", str(out), "--fault", "zero:clearance@20-21"]
    assert main_evaluate([str(many), *arguments]) == 0
    result = json.loads(out.read_text())
    steps = [drive["steps"] for drive in result["drives"]]
    assert steps == [200, 996] and result["hours"] == pytest.approx(sum(steps) / 360_000, abs=1e-6)
    printed, said = capfd.readouterr()
    assert [row.split()[5] for row in printed.splitlines() if ".csv" in row] == ["0.0%", "96.1%"]
    never = "micro.csv: never ready: clearance, relative_velocity, radar, acceleration\n"
    assert "micro.csv: the graph cannot run on it: radar comes every 50000.000 s" in said
    assert never in said and "seconds.csv: fault 'zero:clearance@20-21' starts after" in said
    assert said.count("seconds.csv") == 1, "nothing else is wrong with it"
    assert main_evaluate([str(many / "micro.csv")]) == 0
    assert never in capfd.readouterr().err


def test_an_unexpected_failure_is_shown_and_does_not_stop_the_rest(capsys) -> None:
    def fails(_path: Path, _question: object) -> tuple:
        raise IndexError("no such\nrow")

    result = attempt(fails, Path("odd.csv"), None)
    assert result["error"] == "odd.csv: failed unexpectedly (IndexError: no such row)"
    assert "Traceback" in capsys.readouterr().err and say_failures([result]) == 2


def test_an_interrupted_run_goes_on_where_it_stopped(folder, tmp_path) -> None:
    many = tmp_path / "many"
    many.mkdir()
    for number in range(10):
        shutil.copy(folder / "1.mcap", many / f"{number:02d}.mcap")
    out = tmp_path / "all.json"
    kept = journal_file(out, [])
    running = subprocess.Popen(
        [*EVALUATE, str(many), "--jobs", "1", "--json", str(out)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        # Tests that run in the background of a shell are deaf to it, and so would this be.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    deadline = time.monotonic() + 120.0
    while not kept.is_file() or len(kept.read_text().splitlines()) < 2:
        assert time.monotonic() < deadline and running.poll() is None
        time.sleep(0.02)
    running.send_signal(signal.SIGINT)
    assert running.wait(timeout=60.0) == 130 and not out.exists()
    done = {json.loads(line)["key"] for line in kept.read_text().splitlines()[1:] if line}
    assert 0 < len(done) < 10
    said = f"interrupted: {len(done)} of 10 drives are done and kept; the same command goes on"
    assert said in running.stderr.read()
    # What is kept is not evaluated again: it is taken as it stands in the journal.
    text = kept.read_text()
    kept.write_text(text.replace('"duration_s"', '"from_journal": true, "duration_s"'))
    assert main_evaluate([str(many), "--jobs", "2", "--json", str(out)]) == 0
    drives = json.loads(out.read_text())["drives"]
    assert sum(d.get("from_journal", False) for d in drives) == len(done)
    assert len(drives) == 10


def test_what_has_changed_is_evaluated_again(tmp_path: Path) -> None:
    """The time of a bag's folder stays when a file in it is damaged, and so does a DBC's name."""
    bag, dbc = tmp_path / "bag", tmp_path / "car.dbc"
    write_bag([], bag)
    dbc.write_text("one")
    file = bag / "bag.mcap"
    folder, whole = bag.stat(), file.stat()

    def key() -> str:
        return drive_key(bag, "question", [dbc])

    seen = {key()}
    assert key() in seen
    file.write_bytes(file.read_bytes()[:-9])
    assert bag.stat().st_mtime_ns == folder.st_mtime_ns
    os.utime(file, ns=(whole.st_atime_ns, whole.st_mtime_ns))
    assert key() not in seen, "another size"
    seen.add(key())
    os.utime(file, ns=(whole.st_atime_ns, whole.st_mtime_ns + 1))
    assert key() not in seen, "another time"
    seen.add(key())
    dbc.write_text("two")
    assert key() not in seen, "another DBC"


def test_a_folder_without_drives_and_a_wrong_scheduler_are_refused(
    tmp_path, folder, capfd, monkeypatch
) -> None:
    assert run_command(main_evaluate, [str(tmp_path)]) == 2
    assert "holds no drive" in capfd.readouterr().err
    monkeypatch.setattr("lfd_replay.journal.SCHEDULER_DEADLINE", 0.5)
    nobody = f"tcp://127.0.0.1:{free_port()}"
    assert run_command(main_evaluate, [str(folder), "--scheduler", nobody]) == 2
    refused = capfd.readouterr().err
    assert "no Dask scheduler answers" in refused and "Traceback" not in refused


def test_drives_are_evaluated_behind_a_dask_scheduler(folder, tmp_path) -> None:
    """Two workers in processes of their own."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    scheduler = [
        *(sys.executable, "-m", "distributed.cli.dask_scheduler"),
        *("--host", "127.0.0.1", "--port", str(port), "--no-dashboard"),
    ]
    worker = [
        *(sys.executable, "-m", "distributed.cli.dask_worker", address),
        *("--nthreads", "1", "--no-dashboard", "--no-nanny"),
    ]
    started = [subprocess.Popen(scheduler, **quiet)]
    started += [subprocess.Popen(worker, **quiet) for _ in range(2)]
    try:
        from distributed import Client

        with Client(address, timeout="60s") as client:
            client.wait_for_workers(2, timeout=60)
            assert len(set(client.run(os.getpid).values())) == 2
        out = tmp_path / "all.json"
        arguments = [*ARGUMENTS[:2], "--scheduler", address, "--json", str(out)]
        assert main_evaluate([str(folder), *arguments]) == 2
        check_together(out)
    finally:
        # The scheduler last: a worker that loses it tries for long to find it again.
        for process in reversed(started):
            process.terminate()
            process.wait(timeout=30.0)
