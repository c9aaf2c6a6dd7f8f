"""bag_player: plays a drive into the node graph, with faults if wanted."""

import argparse
import sys
import time
from pathlib import Path

from rclpy.executors import Executor
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from lfd_mpc.errors import UserError
from lfd_mpc.node_process import LEAVING, deliver, make_executor, own_arguments, ros_started
from lfd_mpc.samples import Sample
from lfd_mpc.starting import INTERRUPTED
from lfd_replay.command_line import add_drive_options, warn
from lfd_replay.drive import Drive
from lfd_replay.errors import run_command
from lfd_replay.faults import Fault, parse_faults
from lfd_replay.lockstep import LockstepError
from lfd_replay.paths import named_path
from lfd_replay.player import (
    GRAPH_NODES,
    PlayerNode,
    PlayOptions,
    samples_to_play,
)
from lfd_replay.read_drive import DRIVE_HELP, read_drive, read_options


def add_play_options(parser: argparse.ArgumentParser) -> None:
    """Options of playing."""
    parser.add_argument(
        "--rate", type=float, default=1.0, help="x real time; 0 = lockstep (default: 1)"
    )
    parser.add_argument(
        "--start", type=float, default=0.0, metavar="S", help="begin at this s of drive time"
    )
    parser.add_argument(
        "--duration", type=float, default=float("inf"), metavar="S", help="play so many s"
    )


def play_options(options: argparse.Namespace, loop: bool = False) -> PlayOptions:
    """Options of playing from a parsed command line."""
    return PlayOptions(options.rate, options.start, options.duration, loop, options.seed)


def checked_samples(
    path: Path, drive: Drive, faults: list[Fault], playing: PlayOptions
) -> list[Sample]:
    """What is to be played of the drive that was read from `path`, with faults applied.

    Raises UserError for options of playing that this drive cannot be played by.
    """
    playing.check(drive)
    samples = samples_to_play(drive, faults, playing)
    if not samples:
        raise UserError(f"{path}: no sample between --start and --start + --duration")
    return samples


def play(player: PlayerNode, executor: Executor, console: Console) -> float:
    """Spin until the drive is played, with a progress line where there is a terminal.

    Returns the seconds that playing took, from the first sample on.

    Raises UserError when nodes do not become ready, LockstepError when a step fails.
    """
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} / {task.total:.1f} s"),
        TextColumn("{task.fields[speed]:.1f} x"),
    )
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        task = progress.add_task("replay", total=player.total, speed=0.0)
        shown = 0.0
        while not player.done:
            pause = player.pump()
            deliver(executor, max(pause, 0.0))
            now = time.monotonic()
            if player.started is not None and now - shown > 0.2:
                shown = now
                speed = player.played / max(now - player.started, 1e-9)
                progress.update(task, completed=player.played, speed=speed)
    assert player.started is not None, "what is played has a sample"
    return time.monotonic() - player.started


def main_play(arguments: list[str]) -> int:
    """The command line of `bag_player`."""
    parser = argparse.ArgumentParser(prog="bag_player", description=__doc__)
    parser.add_argument("drive", type=named_path, help=DRIVE_HELP)
    add_play_options(parser)
    parser.add_argument("--loop", action="store_true", help="begin again at the end")
    parser.add_argument(
        "--wait-for",
        nargs="*",
        metavar="NODE",
        help="nodes that must be ready first (default: none; in lockstep the whole graph)",
    )
    add_drive_options(parser)
    options = parser.parse_args(own_arguments("bag_player", arguments))

    playing = play_options(options, options.loop)
    faults = parse_faults(options.fault)
    drive = read_drive(options.drive, read_options(options))
    samples = checked_samples(options.drive, drive, faults, playing)
    warn(drive, faults)
    wait_for = options.wait_for
    if wait_for is None:
        wait_for = list(GRAPH_NODES) if playing.rate == 0.0 else []

    try:
        with ros_started(arguments, LEAVING, INTERRUPTED):
            player = PlayerNode(samples, playing, wait_for, zero=drive.zero)
            executor = make_executor()
            executor.add_node(player)
            wall = play(player, executor, Console(stderr=True))
            print(f"played {player.total:.1f} s of {drive.name} in {wall:.1f} s")
    except LockstepError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def main() -> int:
    """Entry point of `lfd_replay bag_player`."""
    return run_command(main_play)
