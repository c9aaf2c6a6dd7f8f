"""Whatever is in a file or a text, it is read or refused in one line: no crash, no hang."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import can
import pytest
from coverage_fuzzer import CoverageFuzzer
from esr_frames import scan_frames
from test_live_equals_offline import drive

from lfd_mpc.errors import UserError
from lfd_replay.drive import Drive
from lfd_replay.drive_bag import write_drive
from lfd_replay.faults import parse_faults
from lfd_replay.profiles import graph_settings, profile_file_text
from lfd_replay.read_drive import ReadOptions, read_drive

SOAK = os.environ.get("LFD_SOAK") == "1"
COUNT = 50_000 if SOAK else 100
LONGEST = 5.0
"""Seconds that nothing of such size may take."""

CSV = b"""t_s,range_m,range_rate_mps,host_speed_mps,host_accel_mps2,track_id
0.0,30.0,-1.0,20.0,0.1,5
0.05,29.95,-1.0,20.0,0.1,5
0.1,,,20.0,,5
0.15,29.85,-1.0,,0.1,6
"""


def refused_or_read(read: Callable[[], object]) -> None:
    """Anything but a UserError of one line comes through."""
    begin = time.perf_counter()
    try:
        read()
    except UserError as error:
        assert len(str(error).splitlines()) == 1
    assert time.perf_counter() - begin < LONGEST


def fuzz_file(
    capfd, tmp_path: Path, name: str, seeds: list[bytes], read: Callable[[Path], object]
) -> None:
    file = tmp_path / name

    def target(data: bytes) -> None:
        file.write_bytes(data)
        refused_or_read(lambda: read(file))

    fuzz(capfd, name, seeds, target)


def fuzz(capfd, name: str, seeds: list[bytes], target: Callable[[bytes], None]) -> None:
    fuzzer = CoverageFuzzer(seeds, target, 3)
    fuzzer.run(COUNT)
    with capfd.disabled():
        print(
            f"\n  {name}: {COUNT} inputs, {len(fuzzer.corpus)} of them bred further, "
            f"{len(fuzzer.lines)} lines reached"
        )
    assert len(fuzzer.corpus) > len(seeds), "nothing new was reached"


def read_as_drive(file: Path) -> object:
    return read_drive(file, ReadOptions())


def bag(tmp_path: Path) -> bytes:
    file = tmp_path / "seed.mcap"
    write_drive(Drive("seed", drive(0.3)), file)
    return file.read_bytes()


def can_log(tmp_path: Path, suffix: str) -> bytes:
    """Two scans as a log of python-can."""
    file = tmp_path / f"seed{suffix}"
    with can.Logger(str(file)) as log:
        for number in range(2):
            tracks = {1: {"STATUS": 3, "RANGE": 30.0, "RANGE_RATE": -1.0}}
            for stamp, identifier, data in scan_frames(0.05 * number, number, tracks, last=3):
                log(
                    can.Message(
                        timestamp=stamp,
                        arbitration_id=identifier,
                        data=data,
                        is_extended_id=False,
                    )
                )
    return file.read_bytes()


def test_fault_texts(capfd) -> None:
    seeds = [b"offset:clearance=4,relative_velocity=-10@40-60", b"dropout:radar@12.5-13; hold:"]

    def target(data: bytes) -> None:
        refused_or_read(lambda: parse_faults([data.decode("utf-8", "replace")]))

    fuzz(capfd, "fault text", seeds, target)


def test_csv_drives(capfd, tmp_path: Path) -> None:
    fuzz_file(capfd, tmp_path, "drive.csv", [CSV, CSV.replace(b"t_s", b"time")], read_as_drive)


def test_bags(capfd, tmp_path: Path) -> None:
    fuzz_file(capfd, tmp_path, "drive.mcap", [bag(tmp_path)], read_as_drive)


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_can_logs(capfd, tmp_path: Path, suffix: str) -> None:
    fuzz_file(capfd, tmp_path, f"drive{suffix}", [can_log(tmp_path, suffix)], read_as_drive)


def test_parameter_files(capfd, tmp_path: Path) -> None:
    seeds = [profile_file_text("robust").encode(), b"/**:\n  ros__parameters:\n    n_sigma: 3.0\n"]
    fuzz_file(capfd, tmp_path, "params.yaml", seeds, lambda file: graph_settings("robust", file))
