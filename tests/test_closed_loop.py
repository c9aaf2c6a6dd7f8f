"""The closed loop: live equals offline, what the diagnosis prevents, what a user sees."""

import json
import os
import signal
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest
import rclpy
from rosbags.highlevel import AnyReader
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait
from std_msgs.msg import Float64
from test_nodes import Subscriber

from lfd_bringup.recorder import LOOP_TOPICS, RecorderNode
from lfd_bringup.replay import INTERRUPTED, write_bag
from lfd_bringup.simulate import main_simulate
from lfd_diagnosis.decision_node import DecisionNode
from lfd_diagnosis.diagnosis_node import DiagnosisNode
from lfd_mpc.decision import Decision
from lfd_mpc.driving import DrivingState
from lfd_mpc.errors import UserError
from lfd_mpc.messages import from_message
from lfd_msgs.msg import VehicleTruth
from lfd_observer.observer_node import ObserverNode
from lfd_replay.drive_bag import write_drive
from lfd_replay.faults import parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.profiles import graph_settings
from lfd_vehicle.closed_loop import ClosedLoop
from lfd_vehicle.closed_loop_evaluation import (
    Case,
    case_rows,
    goals,
    leave,
    main_closed_loop,
    run_case,
)
from lfd_vehicle.lead import lead_plan
from lfd_vehicle.scenarios import FAULTS, MUST_COLLIDE, SITUATIONS, Situation, timed
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.vehicle_node import LOOP_NODES, VehicleNode
from lfd_vehicle.world import Scenario
from ros_support import ROOT, Graph, difference, next_domain, profile_arguments, run

LEAD = "20,-4@3-5"
FAULT = "offset:clearance=4,relative_velocity=10@3.2-8"


def lived(graph: Graph, profile: str, lead: str, fault: str) -> RecorderNode:
    """The closed loop in lockstep, until it ends."""
    recorder = graph.add(RecorderNode(lambda _: None, graph.context, LOOP_TOPICS))
    arguments = [*profile_arguments(profile), "-p", "mpc_node:driving:=true"]
    graph.add_graph(arguments)
    graph.add(DecisionNode(context=graph.context, cli_args=arguments))
    given = {"lead": lead, "faults": fault, "rate": 0.0}
    vehicle = graph.add(
        VehicleNode(
            graph.context,
            (*LOOP_NODES, "recorder"),
            parameter_overrides=[rclpy.Parameter(n, value=v) for n, v in given.items()],
        )
    )
    assert vehicle.status is None
    graph.spin_until(lambda: vehicle.status is not None, "it ends", 120.0)
    assert vehicle.status == 0, vehicle.error
    graph.spin_until(
        lambda: recorder.count("diagnosis/decision") == recorder.count("mpc/driving"), "all came"
    )
    graph.spin_for(0.3)
    return recorder


@pytest.mark.parametrize("profile", ["robust", "paper"])
def test_the_closed_loop_in_lockstep_gives_what_it_gives_without_ros(
    profile: str, monkeypatch
) -> None:
    if profile == "paper":
        # To standstill it goes under the other one.
        monkeypatch.setattr("lfd_vehicle.lead.AFTER_STEPS", 4.0)
    scenario = Scenario(lead_plan(LEAD), tuple(parse_faults([FAULT])))
    loop = ClosedLoop(scenario, graph_settings(profile), VehicleSettings())
    own = list(loop.run())
    with Graph() as graph:
        recorder = lived(graph, profile, LEAD, FAULT)
        kinds = {"mpc/driving": DrivingState, "diagnosis/decision": Decision}
        live = {t: [from_message(k, m) for m in recorder.messages(t)] for t, k in kinds.items()}
        steps = recorder.steps()
        truth = recorder.messages("vehicle/truth")
    assert len(own) == len(live["mpc/driving"]) == len(steps)
    for k, step in enumerate(own):
        found = difference(live["mpc/driving"][k], step.driving)
        found = found or difference(live["diagnosis/decision"][k], step.decision)
        found = found or difference(steps[k].report, step.report)
        assert not found, f"step {k}: {found}"
    for step in steps:
        assert step.bank and step.reconstruction, "nothing is lost in lockstep"
        assert step.bank.stamp == step.reconstruction.stamp == step.report.stamp
    end = truth[-1]
    assert end.step == loop.world.steps and end.clearance == loop.world.moment.clearance
    assert any(step.decision.level for step in own), "the fault is acted on"


@pytest.mark.alone
def test_a_dead_controller_leaves_a_car_that_brakes_by_itself() -> None:
    with Graph() as graph:
        arguments = ["--ros-args", "-p", "use_sim_time:=true"]
        for kind in (ObserverNode, DiagnosisNode, DecisionNode):
            graph.add(kind(context=graph.context, cli_args=arguments))
        controller = subprocess.Popen(
            [ROOT / "ros2_ws/install/lfd_mpc/lib/lfd_mpc/mpc_node", *arguments, "-p"]
            + ["driving:=true"],
            env={**os.environ, "ROS_DOMAIN_ID": str(graph.domain)},
            stderr=subprocess.DEVNULL,
        )
        try:
            _drive_without(graph, controller)
        finally:
            controller.kill()
            controller.wait(timeout=10)


def _drive_without(graph: Graph, controller: subprocess.Popen) -> None:
    """Until the controller is killed, and beyond."""
    overrides = [rclpy.Parameter("lead", value="4"), rclpy.Parameter("rate", value=2.0)]
    vehicle = graph.add(VehicleNode(graph.context, parameter_overrides=overrides))
    watcher = graph.add(rclpy.create_node("watcher", context=graph.context))
    truth = Subscriber(watcher, VehicleTruth, "vehicle/truth")
    steer = watcher.create_publisher(Float64, "lead/acceleration", 10)
    graph.spin_until(lambda: vehicle.world.steps > 200, "it drives")
    graph.spin_until(lambda: truth.messages[-1].host_speed > 3.5, "it follows")
    assert not truth.messages[-1].command_lost
    # The lead is steered live; what no car can do is refused.
    steer.publish(Float64(data=99.0))
    steer.publish(Float64(data=1.0))
    graph.spin_until(lambda: vehicle.world.lead.speed > 4.3, "the lead speeds up")
    controller.kill()
    graph.spin_until(lambda: truth.messages[-1].command_lost, "it misses the command")
    graph.spin_until(lambda: truth.messages[-1].host_speed == 0.0, "it stops")
    assert not truth.messages[-1].collided


def test_a_lost_graph_is_a_clear_error_in_lockstep(monkeypatch) -> None:
    monkeypatch.setattr("lfd_mpc.node_support.READY_DEADLINE", 0.2)
    with Graph() as graph:
        overrides = [rclpy.Parameter("rate", value=0.0)]
        vehicle = graph.add(VehicleNode(graph.context, parameter_overrides=overrides))
        graph.spin_until(lambda: vehicle.error is not None, "it gives up")
        assert "diagnosis_node, mpc_node, observer_node" in str(vehicle.error)
        assert vehicle.status == 2


@pytest.mark.parametrize(
    ("name", "value", "named"),
    [("lead", "nowhere", "lead 'nowhere': no file"), ("faults", "jump:x@1-2", ".*unknown kind"),
     ("rate", -1.0, "parameter rate: -1.0 is out of range; 0.0 to 100.0 is expected"),
     ("rate", 1e-4, "parameter rate: 0.0001; expected: 0 or 0.001 to 100"),
     ("model", "tricycle", "parameter model: .*multi_body")],
)  # fmt: skip
def test_wrong_parameters_of_the_vehicle_are_refused(name: str, value, named: str) -> None:
    with Graph() as graph, pytest.raises(UserError, match=f"^vehicle_node: {named}"):
        VehicleNode(graph.context, parameter_overrides=[rclpy.Parameter(name, value=value)])


def test_a_lead_and_a_rate_may_be_whole_numbers() -> None:
    overrides = [rclpy.Parameter("lead", value=20), rclpy.Parameter("rate", value=1)]
    with Graph() as graph:
        vehicle = graph.add(VehicleNode(graph.context, parameter_overrides=overrides))
        assert vehicle.world.lead.speed == 20.0
        assert vehicle.get_parameter("rate").value == 1.0


# --- does it help?


def case(fault: str, heeded: bool, situation: Situation = SITUATIONS[2]) -> Case:
    return Case("faults", situation, fault, "robust", heeded, 1)


@pytest.fixture(scope="module")
def rows() -> list[dict]:
    made = [
        run_case(case(timed(MUST_COLLIDE), heeded, situation))
        for heeded in (False, True)
        for situation in SITUATIONS[2:]
    ]
    healthy = Case("healthy", Situation("braking:-6", "braking:-6"), "", "robust", True, 1)
    return [*made, run_case(healthy)]


def test_a_fault_that_collides_does_not_when_the_diagnosis_is_heeded(rows: list[dict]) -> None:
    without, with_it = rows[:2], rows[2:4]
    assert all(row["collided"] or row["least_clearance"] < 2.0 for row in without)
    assert not any(row["collided"] for row in with_it)
    assert min(row["least_clearance"] for row in with_it) > 5.0
    assert all(row["worst_level"] >= 2 for row in with_it)
    healthy = rows[4]
    assert healthy["interventions"] == 0 and not healthy["collided"]
    assert "found" not in without[0], "without the diagnosis there is none"


def test_the_evaluation_says_what_is_met_and_what_is_not(rows: list[dict], tmp_path) -> None:
    from rich.console import Console

    assert all(holds for _, holds, _ in goals(rows))
    worse = [{**row, "collided": True, "least_clearance": 0.0} for row in rows]
    assert [holds for _, holds, _ in goals(worse)] == [True, False, False, False, True]
    cried = [{**row, "interventions": 1} for row in rows]
    assert not goals(cried)[-1][1]
    assert len(case_rows(rows)) == len(FAULTS)
    leave(rows, tmp_path, Console(quiet=True))
    assert len(json.loads((tmp_path / "closed-loop.json").read_text())) == len(rows)
    assert "The closed loop" in (tmp_path / "closed-loop.html").read_text()


# --- the command, and the page


def simulate(*arguments: str) -> subprocess.CompletedProcess:
    return run("lfd_bringup", "simulate", *arguments)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--lead", "nowhere"), "no file"),
        (("--lead", "10", "--fault", "offset:x=1@1-2"), "unknown signal"),
        (("--profile", "brave"), "robust, paper"),
        (("--seed", "-1"), "--seed"),
        (("--lead", "10", "--rate", "-2"), "rate"),
    ],
)
def test_wrong_arguments_are_one_line_and_status_2(arguments, named, tmp_path) -> None:
    done = simulate(*arguments, "--out", str(tmp_path))
    assert done.returncode == 2 and named in done.stderr.strip().splitlines()[-1]
    assert "Traceback" not in done.stderr and not (tmp_path / "bag").exists()


def test_a_run_of_less_than_a_second_leaves_its_bag_and_figures(tmp_path) -> None:
    process = subprocess.Popen(
        [ROOT / "run", "lfd_bringup", "simulate", "--lead", "20", "--rate", "0.5"]
        + ["--out", tmp_path],
        env={**os.environ, "ROS_DOMAIN_ID": str(next_domain())},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    with process:
        while "NOT_READY -> OK" not in process.stdout.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED and "interrupted: what was recorded" in errors
    assert "Traceback" not in errors and "bag:" in output and (tmp_path / "bag").is_dir()
    assert json.loads((tmp_path / "summary.json").read_text())["safety"]["largest_jerk"] == 0.0


def test_a_folder_that_cannot_be_written_is_refused_before_anything_is_run(monkeypatch) -> None:
    monkeypatch.setattr("lfd_vehicle.closed_loop_evaluation.run_all", None)
    with pytest.raises(UserError, match="--out /proc: cannot be made or written"):
        main_closed_loop(["--out", "/proc"])


def test_a_bag_that_cannot_be_replaced_is_one_line(tmp_path) -> None:
    (tmp_path / "bag").write_text("a file, no folder")
    with Graph() as graph, pytest.raises(UserError, match="bag: cannot be written"):
        write_bag(graph.add(RecorderNode(lambda _: None, graph.context)), tmp_path / "bag")
    assert [path.name for path in tmp_path.iterdir()] == ["bag"]


def test_simulate_writes_over_nobody_elses_bag(tmp_path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag/own.mcap").write_bytes(b"a drive")
    done = simulate("--lead", LEAD, "--out", str(tmp_path))
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1
    assert [path.name for path in (tmp_path / "bag").iterdir()] == ["own.mcap"]


@pytest.mark.parametrize("left", ["bag", "summary.json", "report.html", "watch.html"])
def test_simulate_writes_nothing_over_the_lead_that_it_reads(
    left: str, monkeypatch, tmp_path: Path
) -> None:
    """Run twice with the first run's bag as the lead, that bag was gone; one linked to, too."""
    monkeypatch.setattr("lfd_bringup.simulate.ros_started", None)
    recording, out = tmp_path / "drive.mcap", tmp_path / "out"
    write_drive(generate_drive("data-3", 0, "esr"), recording)
    out.mkdir()
    (out / left).symlink_to(recording)
    with pytest.raises(UserError, match=f"out/{left}: would be written over .*drive.mcap"):
        main_simulate(["--lead", str(recording), "--out", str(out)])
    assert [path.name for path in out.iterdir()] == [left]


def test_a_fault_after_the_end_is_told_of_before_anything_is_run(
    monkeypatch, tmp_path: Path, capsys
) -> None:
    """Not found, it would look like one that was missed; the loop goes on for 15 s at the end."""
    monkeypatch.setattr("lfd_bringup.simulate.ros_started", None)
    faults = ["--fault", "zero:host_speed@15-17;zero:clearance@17-18"]
    with pytest.raises(TypeError):
        main_simulate(["--lead", "20,-1@0-1", *faults, "--out", str(tmp_path)])
    said = "fault 'zero:clearance@17-18' starts after the end of the drive (16.0 s)"
    assert capsys.readouterr().err == f"warning: 20,-1@0-1: {said}\n"


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("simulate") / "out [x]"
    done = simulate("--lead", LEAD, "--fault", FAULT, "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert "worst level TAKE_OVER" in done.stdout and "watch.html" in done.stdout
    assert f"bag: {out / 'bag'} " in done.stdout, "what is in brackets is no markup"
    return out


def test_simulate_leaves_bag_report_and_figures(simulated: Path) -> None:
    summary = json.loads((simulated / "summary.json").read_text())
    assert summary["safety"]["collided"] is False
    assert summary["sensors"]["clearance"]["detected"] is True
    assert (simulated / "report.html").stat().st_size > 100_000
    with AnyReader([simulated / "bag"]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert set(counts) == {f"/{topic}" for topic in LOOP_TOPICS}
    assert counts["/mpc/driving"] == counts["/diagnosis/decision"] == counts["/mpc/command"]
    assert counts["/vehicle/truth"] >= counts["/mpc/driving"]


def test_the_run_can_be_watched(simulated: Path, browser) -> None:
    browser.set_window_size(1200, 1200)
    browser.get((simulated / "watch.html").as_uri())
    level = browser.find_element(By.ID, "level")
    assert level.text == browser.find_element(By.ID, "why").text == "no decision yet"
    browser.execute_script("at.value = 20; show();")
    assert level.text.startswith("NORMAL")
    browser.execute_script("at.value = 105; show();")
    assert "TAKE_OVER: STOP" in level.text
    assert "FAULT" in browser.find_element(By.ID, "verdicts").text
    why = browser.find_element(By.ID, "why").text
    assert "nothing makes up for relative_velocity" in why
    assert "relative_velocity FAULT: offset by prediction residual" in why
    drawn = browser.execute_script(
        "return ['road','gap','speeds','accelerations','lanes'].map(id => {"
        " const c = document.getElementById(id);"
        " const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;"
        " const seen = new Set(); for (let i = 0; i < d.length; i += 4)"
        " seen.add(d[i] + ',' + d[i+1] + ',' + d[i+2]); return seen.size; })"
    )
    assert min(drawn) > 5, drawn
    browser.execute_script("at.value = 0; show();")
    browser.find_element(By.ID, "play").click()
    clock = browser.find_element(By.ID, "clock")
    WebDriverWait(browser, 10).until(lambda _: float(clock.text.split()[0]) > 1.0)
    assert [e for e in browser.get_log("browser") if e["level"] == "SEVERE"] == []


WRITTEN = """
const seen = {};
const write = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  (seen[this.canvas.id] ||= []).push([text, this.fillStyle]);
  write.call(this, text, x, y);
};
show();
return seen;
"""
"""What the page writes on each canvas, and in which colour."""


def test_what_is_watched_is_what_was_measured(tmp_path: Path, browser) -> None:
    done = simulate("--lead", "20,-1@0-1", "--fault", "dropout:radar@2-3", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    browser.get((tmp_path / "watch.html").as_uri())
    run = browser.execute_script("return run")
    unseen = [t for t, v in zip(run["time"], run["measured_clearance"], strict=True) if v is None]
    assert unseen and 2.0 < unseen[0] < 2.3 and 2.9 < unseen[-1] < 3.1
    written = browser.execute_script(WRITTEN)
    texts = [text for text, _ in written["accelerations"]]
    ticks = [float(text) for text in texts[: texts.index("0 s")]]
    (step,) = {round(after - before, 6) for before, after in pairwise(ticks)}
    assert step in (0.5, 1.0, 2.0), "round numbers"
    assert "2 s" in texts and "2 s" in [text for text, _ in written["lanes"]]
    felt = [value for value in run["measured_acceleration"] if value is not None]
    assert min(ticks) <= min(felt) and max(felt) <= max(ticks)
    assert browser.execute_script("return ticked(-0.01, 1) + ticked(-0.06, 1)") == "0.0-0.1"
    colours = dict(map(tuple, written["gap"]))
    key = browser.execute_script(
        "return [...document.querySelectorAll('#key span')].map(s =>"
        " [s.nextSibling.textContent.trim(), s.style.backgroundColor])"
    )
    legend = {text.split(",")[0].partition(" (")[0]: colour for text, colour in key}
    assert legend.pop("while a fault is injected")
    assert {"measured", "driven by", "reconstructed", "true"} == set(legend)
    for name, colour in legend.items():
        numbers = [int(colours[name][k : k + 2], 16) for k in (1, 3, 5)]
        assert colour == f"rgb({', '.join(map(str, numbers))})", name
