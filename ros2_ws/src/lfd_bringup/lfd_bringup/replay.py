"""replay: a drive through the live node graph in one process, with timeline, bag and report."""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from rclpy.executors import Executor
from rclpy.node import Node
from rich.console import Console
from rich.text import Text

from lfd_bringup.recorder import RecorderNode
from lfd_diagnosis.diagnosis_node import DiagnosisNode
from lfd_diagnosis.verdict import Event, State
from lfd_mpc.errors import UserError
from lfd_mpc.mpc_node import MpcNode
from lfd_mpc.node_process import deliver, interruptible, make_executor, own_arguments
from lfd_mpc.samples import Sample
from lfd_mpc.sampling import Sampler
from lfd_mpc.starting import INTERRUPTED
from lfd_observer.observer_node import ObserverNode
from lfd_replay.bag_player import add_play_options, checked_samples, play, play_options
from lfd_replay.command_line import (
    add_drive_options,
    add_profile_option,
    print_table,
    result_table,
    warn,
)
from lfd_replay.drive import Drive, streams_of
from lfd_replay.drive_bag import refuse_others_bag, replace_folder, write_drive
from lfd_replay.faults import Fault, parse_faults
from lfd_replay.lockstep import LockstepError
from lfd_replay.paths import make_folder, named_path, refuse_to_overwrite, share_folder
from lfd_replay.player import GRAPH_NODES, PlayerNode, PlayOptions, played, refuse_others, settle
from lfd_replay.read_drive import DRIVE_HELP, files_read, read_drive, read_options
from lfd_replay.score import score, shown, timeline
from lfd_replay.text_file import write_text

LEFT = ("bag", "summary.json", "report.html")
"""What a replay leaves in its folder."""

DEFAULT_DRIVE = "data-1"
DEFAULT_FAULT = "offset:clearance=4,relative_velocity=-10@20-30;offset:acceleration=4@50-60"

QUIET = 0.3
"""Seconds without a message after which everything has arrived."""

_COLOURS = {State.FAULT: "bold red", State.SUSPECT: "yellow", State.OK: "green"}


def event_line(event: Event, zero: int) -> Text:
    """One change of state as a line of the timeline; times in s of drive time."""
    fault = event.fault
    line = Text(f"{(event.stamp - zero) * 1e-9:8.2f} s  {event.signal:<17}  ")
    line.append(f"{event.old_state.name:>9} -> ")
    line.append(f"{fault.state.name:<9}", style=_COLOURS.get(fault.state, ""))
    line.append(
        f"  index {fault.index:4.2f} (limit {fault.threshold:.2f})"
        f"  confidence {fault.confidence:2d} (limit {fault.confidence_threshold})  {fault.reason}"
    )
    return line


GRAPH = (MpcNode, ObserverNode, DiagnosisNode)
"""What a replay runs."""


def graph_nodes(
    profile: str, kinds: Sequence[type[Node]] = GRAPH, further: Sequence[str] = ()
) -> list[Node]:
    """Nodes of the graph with a profile's parameters and `further` ROS arguments, for lockstep."""
    params = share_folder("lfd_bringup") / "params"
    arguments = ["--ros-args", "-p", "use_sim_time:=true"]
    for name in (profile, "lockstep"):
        arguments += ["--params-file", str(params / f"{name}.yaml")]
    arguments += further
    return [kind(cli_args=arguments) for kind in kinds]


def default_drive(out: Path, faults: list[Fault], playing: PlayOptions) -> Path:
    """A generated drive, so that nothing from outside is needed.

    Raises UserError, and writes nothing, where it cannot be played so, or where its name is that of
    somebody's file.
    """
    from lfd_replay.generated.generate import generate_drive

    path = out / f"{DEFAULT_DRIVE}.mcap"
    made = generate_drive(DEFAULT_DRIVE, seed=0, sensor="esr")
    checked_samples(path, made, faults, playing)
    if os.path.lexists(path) and not _is_like(path, made):
        raise UserError(
            f"{path}: is not the drive that a replay generates, and stays as it is; another --out "
            "is expected"
        )
    write_drive(made, path)
    return path


def _is_like(path: Path, drive: Drive) -> bool:
    """Whether it holds a drive of the same inputs and length: what is generated may change from
    version to version, and from seed to seed."""
    try:
        there = read_drive(path)
    except UserError:
        return False
    same = streams_of(there.samples).keys() == streams_of(drive.samples).keys()
    return same and abs(there.duration - drive.duration) < 0.1


def _parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="replay", description=__doc__)
    parser.add_argument("--drive", default="", help=f"{DRIVE_HELP} (default: a generated drive)")
    add_play_options(parser)
    add_drive_options(parser)
    add_profile_option(parser)
    parser.add_argument("--out", type=named_path, default=Path("out/replay"), metavar="FOLDER")
    return parser.parse_args(own_arguments("replay", arguments))


def _drive_and_faults(
    options: argparse.Namespace, playing: PlayOptions
) -> tuple[Path, list[Fault]]:
    """What was asked for, or the default drive; it alone has default faults.

    Raises UserError where results would take the place of what is read, or of what is somebody's.
    """
    refuse_others_bag(options.out / "bag")
    faults = parse_faults(options.fault)
    if options.drive:
        path = Path(options.drive)
        for name in LEFT:
            refuse_to_overwrite(options.out / name, files_read(options, path))
        return path, faults
    faults = faults or parse_faults([DEFAULT_FAULT])
    return default_drive(options.out, faults, playing), faults


def print_injected(faults: list[Fault], console: Console) -> None:
    """Say what is injected, a line for each fault."""
    for fault in faults:
        console.print(f"  injected: {fault.text}", highlight=False)


def main_replay(arguments: list[str], joined: float) -> int:
    """The command line of `replay`; `joined`: `time.monotonic()` at which ROS was joined."""
    options = _parse(arguments)
    playing, reading = play_options(options), read_options(options)
    path, faults = _drive_and_faults(options, playing)
    console = Console(soft_wrap=True, markup=False)
    executor = make_executor()
    nodes: list[Node] = []
    try:
        drive = read_drive(path, reading)
        samples = checked_samples(path, drive, faults, playing)

        make_folder(options.out)
        warn(drive, faults)
        seen = played(faults, playing)
        for fault in faults:
            if fault not in seen:
                print(f"fault '{fault.text}' lies outside of what is played", file=sys.stderr)
        stretch = playing.stretch(drive)
        console.print(f"replay of {drive.name}: {stretch}, profile {options.profile}")
        print_injected(faults, console)
        recorder = RecorderNode(
            lambda event: console.print(event_line(event, drive.zero), highlight=False)
        )
        nodes.append(recorder)
        # Before there is a node that another graph would hear.
        settle(joined)
        refuse_others(recorder)
        awaited = [*GRAPH_NODES, "recorder"]
        player = PlayerNode(samples, playing, awaited, joined=joined, zero=drive.zero)
        nodes += [*graph_nodes(options.profile), player]
        for node in nodes:
            executor.add_node(node)
        wall, status = _play_to_the_end(player, executor, recorder, console)
        if wall is not None:
            speed = player.total / wall
            console.print(f"played {player.total:.1f} s in {wall:.1f} s ({speed:.1f} x real time)")
        with interruptible():
            count = _leave(options.out, drive, seen, recorder, options.profile, console)
            if wall is not None:
                tell_lost(count, samples)
    finally:
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
    return status


def _play_to_the_end(
    player: PlayerNode, executor: Executor, recorder: RecorderNode, console: Console
) -> tuple[float | None, int]:
    """Seconds that playing took, and the exit status.

    None if it was interrupted or a step failed: what was recorded until then is not lost.
    """
    try:
        wall = play(player, executor, console)
        drain(executor, recorder)
    except KeyboardInterrupt:
        print("interrupted: what was recorded until now is written", file=sys.stderr)
        return None, INTERRUPTED
    except LockstepError as error:
        print(error, file=sys.stderr)
        return None, 1
    return wall, 0


def drain(executor: Executor, recorder: RecorderNode) -> None:
    """Spin until nothing arrives any more."""
    received, quiet_since = -1, time.monotonic()
    while time.monotonic() - quiet_since < QUIET:
        deliver(executor, QUIET)
        if recorder.received != received:
            received, quiet_since = recorder.received, time.monotonic()


def write_bag(recorder: RecorderNode, bag: Path) -> None:
    """Write what was recorded, in place of an older bag. Raises UserError where it does not fit."""
    try:
        with tempfile.TemporaryDirectory(dir=bag.parent, prefix=".writing-") as folder:
            writing = Path(folder) / "bag"
            written, count = recorder.write(writing)
            replace_folder(writing, bag)
    except OSError as error:
        raise UserError(f"{bag}: cannot be written ({error.strerror})") from error
    if written < count:
        raise UserError(
            f"{bag}: the disk is full: it holds the first {written} of {count} messages, "
            "and there is no report"
        )


def _leave(
    out: Path,
    drive: Drive,
    faults: list[Fault],
    recorder: RecorderNode,
    profile: str,
    console: Console,
) -> int:
    """Bag, report and summary; returns how many steps they are of."""
    # What draws is loaded when there is something to draw, not before the first report.
    from lfd_replay.drawing.panels import Recording
    from lfd_replay.report import write_report

    write_bag(recorder, out / "bag")
    steps = recorder.steps()
    line = timeline((step.report for step in steps), drive.zero)
    write_text(out / "summary.json", json.dumps(score(line, faults), indent=1) + "\n")
    sensors = shown(line, faults)
    recording = Recording(steps, drive.zero, faults)
    report = write_report(out, drive.name, recording, sensors, profile)
    print_table(result_table(sensors, f"{len(steps)} steps"))
    console.print(f"bag: {out / 'bag'}   report: {report}", highlight=False)
    return len(steps)


def tell_lost(count: int, samples: Sequence[Sample]) -> None:
    """Say on stderr where `count` steps are fewer than the samples that were played release.

    No queue holds more than some seconds: what is played too fast is lost, and looks judged.
    """
    sampler = Sampler()
    released = sum(len(sampler.push(sample)) for sample in samples)
    if count < released:
        print(
            f"warning: {released - count} of {released} steps were lost on the way, and all "
            "figures are of the others: a lower --rate is expected, or 0, which loses none",
            file=sys.stderr,
        )
