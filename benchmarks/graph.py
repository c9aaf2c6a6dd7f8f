"""Lockstep, playing as fast as it goes, starting, and memory over a long drive."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

from drives import long_drive
from measure import Figure, against, in_turn, middle
from offline import read_with_rosbags

from lfd_replay.drive_bag import write_drive

START = (
    "import rclpy; from {module} import {maker}; rclpy.init(); node = {maker}({arguments}); "
    "rclpy.spin_once(node, timeout_sec=0.0); rclpy.shutdown()"
)
"""A node that has loaded all it needs."""

BARE = START.format(module="rclpy", maker="create_node", arguments="'bare'")
"""What any node has to do before it can do anything."""

NODES = {
    f"{package}.{name}_node": START.format(
        module=f"{package}.{name}_node", maker=f"{name.capitalize()}Node", arguments=""
    )
    for package, name in (
        ("lfd_mpc", "mpc"),
        ("lfd_observer", "observer"),
        ("lfd_diagnosis", "diagnosis"),
    )
}
"""The programs that start the nodes."""


def _domain(offset: int) -> dict[str, str]:
    return {**os.environ, "ROS_DOMAIN_ID": str(1 + (os.getpid() * 11 + offset) % 100)}


def _quiet(command: list[str], offset: int = 0) -> str:
    done = subprocess.run(command, env=_domain(offset), check=True, capture_output=True, text=True)
    return done.stdout


def lockstep(seconds: float, folder: Path, root: Path) -> list[Figure]:
    """The whole graph in one process, each step waiting for its answers."""
    bag = folder / "lockstep.mcap"
    write_drive(long_drive(seconds), bag)
    command = [str(root / "run"), "lfd_bringup", "replay", "--drive", str(bag), "--rate", "0"]
    figures = []
    for profile in ("robust", "paper"):
        rates = []
        for number in range(3):
            out = folder / f"replay-{profile}"
            text = _quiet([*command, "--profile", profile, "--out", str(out)], number)
            played, wall = re.search(r"played ([\d.]+) s in ([\d.]+) s", text).groups()
            rates.append(float(wall) / float(played))
        goal = "at most 0.25", lambda _, ratio: ratio <= 0.25
        label = f"lockstep, {profile}, per s of driving"
        figures.append(against(label, middle(rates), "s", "real time", 1.0, *goal))
    return figures


def player(seconds: float, folder: Path, root: Path) -> list[Figure]:
    """Messages per second with nobody listening, against reading the same bag."""
    bag = folder / "player.mcap"
    drive = long_drive(seconds)
    write_drive(drive, bag)
    count = len(drive.samples)
    command = [str(root / "run"), "lfd_replay", "bag_player", str(bag), "--rate", "1e6"]
    walls: list[float] = []

    def play() -> None:
        text = _quiet(command)
        walls.append(float(re.search(r" in ([\d.]+) s", text).group(1)))

    spent = in_turn({"play": play, "read": lambda: read_with_rosbags(bag)}, 3)
    value, peer = count / middle(walls), count / middle(spent["read"])
    goal = "at least half", lambda _, ratio: ratio >= 0.5
    label = "bag_player as fast as it goes"
    return [against(label, value, "messages/s", "rosbags alone", peer, *goal)]


def starting(folder: Path, root: Path) -> list[Figure]:
    """From the command to the first report, and of each node to its ready-made core."""
    bag = folder / "start.mcap"
    write_drive(long_drive(20.0), bag)
    command = [str(root / "run"), "lfd_bringup", "replay", "--drive", str(bag), "--rate", "0"]
    command += ["--duration", "3", "--out", str(folder / "start")]
    reported: list[float] = []

    def replay() -> None:
        begin = time.perf_counter()
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, env=_domain(50), bufsize=1
        )
        assert process.stdout is not None
        for line in process.stdout:
            if "->" in line:
                reported.append(time.perf_counter() - begin)
                break
        process.stdout.read()
        process.wait()

    calls = {"bare": lambda: _quiet([sys.executable, "-c", BARE], 60), "replay": replay}
    for name, program in NODES.items():
        calls[name] = lambda p=program: _quiet([sys.executable, "-c", p], 61)
    spent = {name: middle(rounds) for name, rounds in in_turn(calls, 5).items()}
    peer, bare = "bare node", spent["bare"]
    goal = "at most 1 s more", lambda value, _: value - bare <= 1.0
    first = against("replay to first change of state", middle(reported), "s", peer, bare, *goal)
    return [
        first,
        *(
            against(f"start of {name}, loaded", spent[name], "s", peer, bare, *goal)
            for name in NODES
        ),
    ]


def _memory(process: int) -> int:
    """Resident memory in KB."""
    text = Path(f"/proc/{process}/status").read_text()
    return int(re.search(r"VmRSS:\s+(\d+) kB", text).group(1))


def memory(seconds: float, folder: Path, root: Path) -> list[Figure]:
    """Each node as a process over a long drive in lockstep, against a minute of it."""
    bag = folder / "memory.mcap"
    write_drive(long_drive(seconds), bag)
    environment = _domain(70)
    install = root / "ros2_ws/install"
    params = install / "lfd_bringup/share/lfd_bringup/params/lockstep.yaml"
    options = ["--ros-args", "-p", "use_sim_time:=true", "--params-file", str(params)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    nodes = {}
    for module in NODES:
        package, name = module.split(".")
        program = install / package / "lib" / package / name
        nodes[name] = subprocess.Popen([str(program), *options], **quiet)
    player = subprocess.Popen(
        [str(root / "run"), "lfd_replay", "bag_player", str(bag), "--rate", "0"], **quiet
    )
    try:
        # A minute of driving takes some 15 s in lockstep, and reading the bag as long.
        early: dict[str, int] = {}
        begin, latest = time.monotonic(), {}
        while player.poll() is None:
            time.sleep(1.0)
            latest = {name: _memory(node.pid) for name, node in nodes.items()}
            if not early and time.monotonic() - begin > 60.0:
                early = latest
        assert player.returncode == 0, "the drive was not played to its end"
        early = early or latest
    finally:
        for process in (player, *nodes.values()):
            process.terminate()
            process.wait(timeout=10.0)
    goal = "no growth (at most 1 %)", lambda _, ratio: ratio <= 1.01
    label, peer = f"after {seconds / 60:g} minutes of driving", "after a minute of wall time"
    return [
        against(
            f"memory of {name} {label}", latest[name] / 1e3, "MB", peer, early[name] / 1e3, *goal
        )
        for name in nodes
    ]
