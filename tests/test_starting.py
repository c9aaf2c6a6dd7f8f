"""A command or node that is told to end while it loads does so without a word."""

import os
import signal
import subprocess
import sys
from importlib.metadata import entry_points
from pathlib import Path

import pytest

from ros_support import next_domain

TOLD = """
import signal
signal.raise_signal(signal.{name})
raise ImportError("what libraries in C make of it")
"""
SIGNALS = ("SIGINT", "SIGTERM")


def status_of(code: str, folder: Path) -> tuple[int, str]:
    """Exit status and words of a process that runs the code, and finds modules in the folder."""
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path, "ROS_DOMAIN_ID": str(next_domain())},
        # Tests that run in the background of a shell are deaf to it, and so would this be.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        capture_output=True,
        text=True,
        timeout=60,
    )
    return done.returncode, done.stdout + done.stderr


@pytest.mark.parametrize("name", SIGNALS)
def test_a_command_that_is_told_to_end_while_it_loads(name: str, tmp_path: Path) -> None:
    (tmp_path / "loads.py").write_text(TOLD.format(name=name))
    code = "import sys; from lfd_mpc.starting import command; sys.exit(command('loads')())"
    assert status_of(code, tmp_path) == (130, "")


@pytest.mark.parametrize("name", SIGNALS)
def test_a_node_that_is_told_to_end_before_it_has_joined_ros(name: str, tmp_path: Path) -> None:
    (tmp_path / "rclpy.py").write_text(TOLD.format(name=name))
    code = "import sys; from lfd_mpc.executables import mpc_node; sys.exit(mpc_node())"
    assert status_of(code, tmp_path) == (0, "")


def test_a_command_is_interrupted_as_ever_when_it_has_loaded(tmp_path: Path) -> None:
    (tmp_path / "loads.py").write_text(
        "import signal\n"
        "def main():\n"
        "    try:\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "    finally:\n"
        "        print('nothing is lost')\n"
    )
    code = "import sys; from lfd_mpc.starting import command; sys.exit(command('loads')())"
    assert status_of(code, tmp_path) == (130, "nothing is lost\n")


def test_every_executable_starts_so_and_loads_nothing_before(tmp_path: Path) -> None:
    ours = [p for p in entry_points(group="console_scripts") if p.module.startswith("lfd_")]
    assert len(ours) >= 20
    assert {p.module for p in ours} == {f"{p.module.split('.')[0]}.executables" for p in ours}
    named = "; ".join(f"from {p.module} import {p.attr}" for p in ours)
    loaded = "print(sorted({'argparse', 'numpy', 'rclpy'} & set(sys.modules)))"
    assert status_of(f"import sys; {named}; {loaded}", tmp_path) == (0, "[]\n")


@pytest.mark.parametrize("name", SIGNALS)
def test_an_interrupted_player_says_so_like_any_command(name: str, tmp_path: Path) -> None:
    drive = tmp_path / "short.csv"
    rows = "".join(f"{k / 20},30,0,15,0.1\n" for k in range(60))
    drive.write_text(f"t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2\n{rows}")
    code = (
        "import signal, sys\n"
        "from lfd_replay import bag_player\n"
        f"bag_player.play = lambda *_: signal.raise_signal(signal.{name})\n"
        f"sys.argv[1:] = ['{drive}']\n"
        "sys.exit(bag_player.main())\n"
    )
    assert status_of(code, tmp_path) == (130, "")


@pytest.mark.parametrize("place", ["a pipe that nobody reads", "a full disk"])
def test_the_help_of_a_node_that_cannot_be_printed_is_no_traceback(place: str) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    if place == "a full disk":
        os.close(writer)
        writer = os.open("/dev/full", os.O_WRONLY)
    code = "import sys; from lfd_mpc.executables import mpc_node; sys.exit(mpc_node())"
    done = subprocess.run(
        [sys.executable, "-c", code, "--help"],
        stdout=writer,
        stderr=subprocess.PIPE,
        text=True,
        timeout=60,
    )
    os.close(writer)
    said = "the output cannot be written (No space left on device); a disk with room is expected\n"
    assert (done.returncode, done.stderr) == ((2, said) if place == "a full disk" else (0, ""))
