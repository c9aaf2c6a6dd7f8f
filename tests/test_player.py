"""The player: what is played when, pauses, loops, and what lockstep notices."""

import re
import runpy
import time
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest
from std_srvs.srv import Trigger
from test_live_equals_offline import drive

from lfd_bringup.replay import default_drive, main_replay
from lfd_bringup.simulate import main_simulate
from lfd_diagnosis.decision_node import DecisionNode
from lfd_diagnosis.silence import CLOCK_LOST
from lfd_mpc.errors import UserError
from lfd_mpc.horizon import Mpc
from lfd_mpc.mpc_node import MpcNode
from lfd_mpc.node_process import joined
from lfd_mpc.node_support import PIPELINE_QOS
from lfd_mpc.samples import ACCELERATION, RADAR
from lfd_mpc.sampling import Sampler
from lfd_mpc.settings import MpcSettings
from lfd_msgs.msg import FaultReport, PredictionHorizon
from lfd_replay.drive import Drive
from lfd_replay.drive_bag import replace_folder, sample_message, write_bag, write_drive
from lfd_replay.errors import run_command
from lfd_replay.faults import parse_faults
from lfd_replay.generated.generate import generate_drive
from lfd_replay.lockstep import LockstepError, horizon_difference
from lfd_replay.player import GRAPH_NODES, PlayerNode, PlayOptions, played, samples_to_play
from lfd_replay.read_drive import DRIVE_HELP, read_drive
from ros_support import LOCKSTEP, REPLAY_ARGUMENTS, Graph, next_domain

LAUNCH = Path(__file__).parent.parent / "ros2_ws/src/lfd_bringup/launch/replay.launch.py"


def make_drive() -> Drive:
    return Drive("short", drive(3.0))


def test_only_the_chosen_stretch_is_played() -> None:
    samples = samples_to_play(make_drive(), [], PlayOptions(start=1.0, duration=0.5))
    assert min(s.stamp for s in samples) == 1_000_000_000
    assert max(s.stamp for s in samples) < 1_500_000_000


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (PlayOptions(), "3.0 s"),
        (PlayOptions(duration=9.0), "3.0 s"),
        (PlayOptions(start=1.0, duration=0.5), "1.0 to 1.5 s of 3.0 s"),
        (PlayOptions(start=1.0, duration=9.0), "1.0 to 3.0 s of 3.0 s"),
        (PlayOptions(duration=0.5), "0.0 to 0.5 s of 3.0 s"),
    ],
)
def test_the_stretch_that_is_played_is_said(options: PlayOptions, said: str) -> None:
    assert options.stretch(make_drive()) == said


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (PlayOptions(rate=-1.0), "--rate"),
        (PlayOptions(rate=inf), "--rate"),
        (PlayOptions(start=3.1), "--start"),
        (PlayOptions(duration=0.0), "--duration"),
    ],
)
def test_options_that_cannot_be_played_are_refused(options: PlayOptions, named: str) -> None:
    with pytest.raises(UserError, match=named):
        options.check(make_drive())


def pump_until(graph: Graph, player: PlayerNode, reached, what: str) -> None:
    def step() -> bool:
        graph.executor.spin_once(timeout_sec=min(player.pump(), 0.02))
        return reached()

    graph.spin_until(step, what)


def call(graph: Graph, player: PlayerNode, service: str) -> Trigger.Response:
    client = player.create_client(Trigger, f"bag_player/{service}")
    graph.spin_until(client.service_is_ready, "the service is there")
    future = client.call_async(Trigger.Request())
    graph.spin_until(future.done, "the service answers")
    return future.result()


@pytest.mark.alone
def test_a_pause_holds_the_drive_and_resuming_goes_on() -> None:
    with Graph() as graph:
        player = graph.add(PlayerNode(drive(3.0), PlayOptions(), [], graph.context))
        pump_until(graph, player, lambda: player.played > 0.2, "some of it is played")
        assert call(graph, player, "pause").success
        assert not call(graph, player, "pause").success
        held = player.played
        for _ in range(20):
            player.pump()
            graph.executor.spin_once(timeout_sec=0.02)
        assert player.played == held
        assert call(graph, player, "resume").success
        pump_until(graph, player, lambda: player.played > held + 0.2, "it goes on")
        assert player.played < held + 1.0


@pytest.mark.alone
def test_a_loop_begins_again() -> None:
    with Graph() as graph:
        options = PlayOptions(rate=20.0, loop=True)
        player = graph.add(PlayerNode(drive(1.0), options, [], graph.context))
        pump_until(graph, player, lambda: player.played > 0.8, "nearly all is played")
        pump_until(graph, player, lambda: player.played < 0.5, "it has begun again")
        assert not player.done


@pytest.mark.alone
def test_steps_get_past_a_gap() -> None:
    samples = [s for s in drive(0.2) if not 50_000_000 < s.stamp < 100_000_000]
    with Graph() as graph:
        zero = samples[0].stamp - 14 * 10**9
        player = graph.add(PlayerNode(samples, PlayOptions(), [], graph.context, zero=zero))
        pump_until(graph, player, lambda: player.started is not None, "it has begun")
        assert call(graph, player, "pause").success
        said = [call(graph, player, "step").message for _ in range(25)]
        assert "at 14.07 s of drive time" in said and "at 14.11 s of drive time" in said
        assert player.done
        assert call(graph, player, "step").message == "is at the end"


@pytest.mark.alone
def test_lockstep_begins_again_at_the_end_of_a_loop() -> None:
    with Graph() as graph:
        graph.add_graph(REPLAY_ARGUMENTS)
        options = PlayOptions(rate=0.0, loop=True)
        player = graph.add(PlayerNode(drive(0.5), options, GRAPH_NODES, graph.context))
        before, deadline = 0.0, time.monotonic() + 15.0
        while player.played >= before:
            before = player.played
            graph.executor.spin_once(timeout_sec=min(player.pump(), 0.02))
            assert not player.done and time.monotonic() < deadline
        assert before > 0.45


def test_lockstep_heeds_only_receipts_of_what_it_sent() -> None:
    """Decisions are confirmed, too, and the newest receipts of a drive before are latched."""
    with Graph() as graph:
        driving = [*REPLAY_ARGUMENTS, "-p", "mpc_node:driving:=true"]
        graph.add_graph(driving)
        graph.add(DecisionNode(context=graph.context, cli_args=driving))
        for _ in range(2):
            graph.play(drive(0.5), 0.0, [*GRAPH_NODES, "decision_node"])
            graph.remove(graph.nodes[-1])


def test_lockstep_without_receipts_is_refused_at_once() -> None:
    with Graph() as graph:
        graph.add_graph([*REPLAY_ARGUMENTS, "-p", "mpc_node:receipts:=false"])
        player = PlayerNode(drive(0.5), PlayOptions(rate=0.0), GRAPH_NODES, graph.context)
        with pytest.raises(UserError, match="reliable subscription.*lockstep.yaml"):
            pump_until(graph, graph.add(player), lambda: player.done, "never")


def test_lockstep_notices_a_sample_that_was_not_used() -> None:
    samples = drive(1.0)
    mpc, sampler = Mpc(MpcSettings()), Sampler()
    steps = [
        (step, horizon)
        for sample in samples
        for step, horizon in zip(sampler.push(sample), mpc.push(sample), strict=True)
    ]
    assert not any(horizon_difference(step, horizon) for step, horizon in steps)
    step, horizon = steps[30]
    assert "clearance value" in horizon_difference(step, replace(horizon, measured_clearance=1.0))
    assert "answered for" in horizon_difference(step, replace(horizon, stamp=0))
    said = replace(horizon, measured_lead_acceleration=-7.0)
    assert "lead_acceleration value" in horizon_difference(step, said)


def test_lockstep_without_an_answer_is_an_error_that_says_what_is_owed(monkeypatch) -> None:
    monkeypatch.setattr("lfd_replay.lockstep.STEP_DEADLINE", 0.2)
    with Graph() as graph:
        player = graph.add(PlayerNode(drive(1.0), PlayOptions(rate=0.0), [], graph.context))
        with pytest.raises(LockstepError, match="mpc/received"):
            pump_until(graph, player, lambda: player.done, "never")


def play_with_a_stall(graph: Graph, seconds: float) -> list[FaultReport]:
    """In lockstep, the bank being stopped in the midst; reports that no step made."""
    player = graph.add(PlayerNode(drive(1.5), PlayOptions(rate=0.0), GRAPH_NODES, graph.context))
    reports: list[FaultReport] = []
    player.create_subscription(FaultReport, "diagnosis/faults", reports.append, PIPELINE_QOS)
    pump_until(graph, player, lambda: player.played > 0.7, "half of it")
    before = len(reports)
    (bank,) = (node for node in graph.nodes if node.get_name() == "observer_node")
    graph.executor.remove_node(bank)
    stopped = time.monotonic()
    pump_until(graph, player, lambda: time.monotonic() - stopped > seconds, "a stall")
    graph.executor.add_node(bank)
    pump_until(graph, player, lambda: player.done, "the rest")
    return [report for report in reports[before:] if not report.step]


@pytest.mark.alone
def test_each_step_of_a_paused_lockstep_goes_on_whatever_must_be_confirmed_first() -> None:
    """An accelerometer of 20 Hz releases five steps at a time, once the radar's scan is there."""
    samples = [s for s in drive(2.0) if s.input != ACCELERATION or s.stamp % 50_000_000 == 0]
    with Graph() as graph:
        graph.add_graph(REPLAY_ARGUMENTS)
        player = graph.add(PlayerNode(samples, PlayOptions(rate=0.0), GRAPH_NODES, graph.context))
        horizons: list[PredictionHorizon] = []
        player.create_subscription(PredictionHorizon, "mpc/horizon", horizons.append, PIPELINE_QOS)
        pump_until(graph, player, lambda: player.played > 0.5, "some of it")
        assert call(graph, player, "pause").success
        for _ in range(3):
            pump_until(graph, player, lambda: not player._waiting, "all is answered")
            before = len(horizons)
            assert call(graph, player, "step").success
            pump_until(graph, player, lambda n=before: len(horizons) == n + 5, "five steps further")


@pytest.mark.alone
def test_a_stall_in_lockstep_is_no_silence() -> None:
    with Graph() as graph:
        graph.add_graph(["--ros-args", "--params-file", str(LOCKSTEP)])
        assert play_with_a_stall(graph, CLOCK_LOST + 0.5) == []


@pytest.mark.alone
def test_a_stall_in_lockstep_that_was_taken_for_silence_is_an_error() -> None:
    with Graph() as graph:
        graph.add_graph(["--ros-args", "-p", "mpc_node:receipts:=true"])
        with pytest.raises(LockstepError, match="stalled: start its nodes with -p use_sim_time"):
            play_with_a_stall(graph, 1.0)


def test_a_step_that_fails_loses_nothing_of_a_replay(monkeypatch, tmp_path: Path, capfd) -> None:
    def failing(*_) -> float:
        raise LockstepError("lockstep: step at 0.50 s: the controller answered for another")

    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    monkeypatch.setattr("lfd_bringup.replay.play", failing)
    write_drive(make_drive(), tmp_path / "short.mcap")
    out = tmp_path / "out"
    with joined([]) as since:
        arguments = ["--drive", str(tmp_path / "short.mcap"), "--out", str(out)]
        assert main_replay(arguments, since) == 1
    assert {path.name for path in out.iterdir()} == {"bag", "report.html", "summary.json"}
    with joined([]) as since:
        part = ["--start", "1", "--duration", "1"]
        assert main_replay([*arguments, *part], since) == 1, "its own bag is replaced"
    assert "short.mcap: 1.0 to 2.0 s of 3.0 s, profile" in capfd.readouterr().out


@pytest.mark.parametrize(("rate", "loses"), [(1.0, False), (1000.0, True)])
def test_a_replay_that_was_too_fast_says_how_much_it_lost(
    rate: float, loses: bool, monkeypatch, tmp_path: Path, capfd
) -> None:
    """Its table looked like any other: faults of lost steps were not found, nothing said why."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    seconds = 30.0 if loses else 1.0
    write_drive(Drive("long", drive(seconds)), tmp_path / "long.mcap")
    with joined([]) as since:
        where = ["--drive", str(tmp_path / "long.mcap"), "--out", str(tmp_path / "out")]
        assert main_replay([*where, "--rate", f"{rate}"], since) == 0
    printed = capfd.readouterr()
    lost = re.search(r"(\d+) of (\d+) steps were lost on the way", printed.err)
    assert bool(lost) == loses
    if lost:
        made = re.search(r"^(\d+) steps", printed.out, re.MULTILINE)
        assert made and int(made[1]) + int(lost[1]) == int(lost[2])


def test_a_stamp_below_zero_loses_nothing_of_a_replay(monkeypatch, tmp_path: Path) -> None:
    """A log time cannot be below zero: bag, summary and report were lost at the very end."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    samples = drive(2.0)
    number = next(i for i, s in enumerate(samples) if s.input == RADAR and s.stamp > 10**9)
    samples[number] = replace(samples[number], stamp=-3_000_000_000)
    write_drive(Drive("odd", samples), tmp_path / "odd.mcap")
    out = tmp_path / "out"
    with joined([]) as since:
        arguments = ["--drive", str(tmp_path / "odd.mcap"), "--rate", "0", "--out", str(out)]
        assert main_replay(arguments, since) == 0
    assert {path.name for path in out.iterdir()} == {"bag", "report.html", "summary.json"}
    recorded = read_drive(out / "bag").samples
    assert sorted(s.stamp for s in recorded) == sorted(s.stamp for s in samples)


@pytest.mark.parametrize("name", ["a [old] b", "dir[/b]"])
def test_a_replay_prints_names_as_they_are(name: str, monkeypatch, tmp_path: Path, capfd) -> None:
    def failing(*_) -> float:
        raise LockstepError("lockstep: step at 0.50 s: the controller answered for another")

    monkeypatch.setenv("ROS_DOMAIN_ID", str(next_domain()))
    monkeypatch.setattr("lfd_bringup.replay.play", failing)
    file, out = tmp_path / f"{name}.mcap", tmp_path / "out [x]"
    write_drive(make_drive(), file)
    with joined([]) as since:
        assert main_replay(["--drive", str(file), "--out", str(out)], since) == 1
    printed = capfd.readouterr().out
    assert f"replay of {file}: " in printed and f"bag: {out / 'bag'} " in printed


def test_help_names_every_kind_of_drive(capsys) -> None:
    with pytest.raises(SystemExit):
        main_replay(["--help"], 0.0)
    assert DRIVE_HELP in " ".join(capsys.readouterr().out.split())


def somebodys_bag(bag: Path) -> None:
    write_bag([(s.stamp, *sample_message(s)) for s in drive(1.0)], bag)


def another_drive(file: Path) -> None:
    write_drive(make_drive(), file)


def a_bag_with_notes(bag: Path) -> None:
    write_bag([], bag)
    (bag / "notes.txt").touch()


def contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.mark.parametrize("kept", [somebodys_bag, a_bag_with_notes, Path.touch])
def test_a_replay_removes_no_bag_but_its_own(
    kept: Callable[[Path], None], tmp_path: Path, capsys
) -> None:
    write_drive(make_drive(), tmp_path / "short.mcap")
    kept(tmp_path / "bag")
    before = contents(tmp_path)
    arguments = ["--drive", str(tmp_path / "short.mcap"), "--out", str(tmp_path)]
    assert run_command(lambda own: main_replay(own, 0.0), arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "bag: cannot be written" in said
    with pytest.raises(UserError, match="bag: cannot be written"):
        replace_folder(tmp_path / "short.mcap", tmp_path / "bag")
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["bag", "bag/bag.mcap"])
def test_a_replay_does_not_replace_what_it_reads(name: str, tmp_path: Path, capsys) -> None:
    write_bag([], tmp_path / "bag")
    before = contents(tmp_path)
    arguments = ["--drive", str(tmp_path / name), "--out", str(tmp_path)]
    assert run_command(lambda own: main_replay(own, 0.0), arguments) == 2
    assert "would be written over" in capsys.readouterr().err
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("asked", "named"),
    [
        (["--fault", "melt:radar@1-2"], "unknown kind 'melt'"),
        (["--rate", "-1"], "--rate -1"),
        (["--start", "500"], "--start 500"),
        (["--start", "10.0001", "--duration", "1e-6"], "no sample between --start"),
        (["--map", "range_m"], "NAME=COLUMN"),
    ],
)
def test_a_mistake_leaves_no_default_drive(
    asked: list[str], named: str, tmp_path: Path, capsys
) -> None:
    out = tmp_path / "out"
    assert run_command(lambda own: main_replay(own, 0.0), [*asked, "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and named in said
    assert not out.exists()


@pytest.mark.parametrize("kept", [lambda path: path.write_text("mine"), Path.mkdir, another_drive])
def test_the_default_drive_takes_nobodys_place(
    kept: Callable[[Path], None], tmp_path: Path, capsys
) -> None:
    kept(tmp_path / "data-1.mcap")
    before = contents(tmp_path)
    assert run_command(lambda own: main_replay(own, 0.0), ["--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "data-1.mcap: is not the drive that a replay gene" in said
    assert contents(tmp_path) == before


def test_the_default_drive_is_made_again_in_its_own_place(tmp_path: Path) -> None:
    path = default_drive(tmp_path, [], PlayOptions())
    first = path.read_bytes()
    write_drive(generate_drive("data-1", 1, "esr"), path)
    assert path.read_bytes() != first, "as of another version, it says something else"
    assert default_drive(tmp_path, [], PlayOptions()).read_bytes() == first


def test_nodes_that_do_not_come_are_named(monkeypatch) -> None:
    monkeypatch.setattr("lfd_mpc.node_support.READY_DEADLINE", 0.2)
    with Graph() as graph:
        player = graph.add(PlayerNode(drive(1.0), PlayOptions(), ["mpc_node"], graph.context))
        with pytest.raises(UserError, match="mpc_node to be ready"):
            pump_until(graph, player, lambda: player.done, "never")


def test_a_second_player_in_the_same_domain_is_refused() -> None:
    with Graph() as graph:
        first = graph.add(PlayerNode(drive(1.0), PlayOptions(), [], graph.context))
        second = graph.add(PlayerNode(drive(1.0), PlayOptions(), [], graph.context))
        graph.spin_until(
            lambda: second.count_publishers("radar/target") == 2, "they see each other"
        )
        with pytest.raises(UserError, match="radar/target.*ROS_DOMAIN_ID"):
            pump_until(graph, first, lambda: first.done, "never")


@pytest.mark.parametrize("module", ["replay", "simulate"])
def test_where_a_graph_runs_already_no_other_is_made(module: str, monkeypatch, tmp_path) -> None:
    """Each node of a second one would mix with the first one, before anything is refused."""
    monkeypatch.setattr(f"lfd_bringup.{module}.graph_nodes", None)
    write_drive(make_drive(), tmp_path / "short.mcap")
    with Graph() as graph:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(graph.domain))
        graph.add(MpcNode(context=graph.context))
        with pytest.raises(UserError, match="mpc/horizon.*ROS_DOMAIN_ID"):
            if module == "simulate":
                main_simulate(["--lead", "20", "--out", str(tmp_path)])
            else:
                with joined([]) as since:
                    drive_options = ["--drive", str(tmp_path / "short.mcap")]
                    main_replay([*drive_options, "--out", str(tmp_path)], since)


def test_the_launch_file_describes_the_graph() -> None:
    pytest.importorskip("launch_ros", reason="launch_ros is not installed: not checked here")
    assert runpy.run_path(str(LAUNCH))["generate_launch_description"]().entities


def test_only_faults_that_are_played_are_looked_for() -> None:
    faults = parse_faults(["zero:clearance@1-3;zero:host_speed@4-5;hold:clearance@6-7"])
    assert played(faults, PlayOptions(start=3.0, duration=3.0)) == faults[1:2]
    assert played(faults, PlayOptions()) == faults
