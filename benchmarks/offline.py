"""A whole drive offline: from CSV against real time, from MCAP against reading it, and stepping."""

import os
import subprocess
import sys
import time
from pathlib import Path

from drives import long_drive, write_csv
from measure import Figure, against, in_turn, middle
from rosbags.highlevel import AnyReader

from lfd_replay.drive_bag import typestore, write_drive
from lfd_replay.evaluate import Question, evaluate_drive
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import PROFILES, graph_settings
from lfd_replay.read_drive import ReadOptions, read_drive


def read_with_rosbags(bag: Path) -> int:
    """Read and deserialise every message."""
    count = 0
    with AnyReader([bag], default_typestore=typestore()) as reader:
        for connection, _, data in reader.messages():
            reader.deserialize(data, connection.msgtype)
            count += 1
    return count


def _cold(csv: Path, folder: Path, root: Path) -> float:
    """Seconds of a process that has to compile everything first."""
    code = "import sys; from lfd_replay.evaluate import main; sys.exit(main())"
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", code, str(csv)],
        env={**os.environ, "LFD_CACHE": str(folder)},
        stdout=subprocess.DEVNULL,
        check=True,
        cwd=root,
    )
    return time.perf_counter() - start


def measure(seconds: float, folder: Path, root: Path) -> list[Figure]:
    """Medians of three rounds in turn; the stepping on a tenth of the drive."""
    drive = long_drive(seconds)
    csv, bag = folder / "long.csv", folder / "long.mcap"
    write_csv(drive, csv)
    write_drive(drive, bag)
    questions = {
        profile: Question(graph_settings(profile), [], 0, ReadOptions()) for profile in PROFILES
    }
    calls = {}
    for profile, question in questions.items():
        calls[f"csv {profile}"] = lambda q=question: evaluate_drive(csv, q)
        calls[f"mcap {profile}"] = lambda q=question: evaluate_drive(bag, q)
    calls["rosbags"] = lambda: read_with_rosbags(bag)
    for profile in PROFILES:
        evaluate_drive(csv, questions[profile])
    spent = {name: middle(rounds) for name, rounds in in_turn(calls, 3).items()}
    figures = []
    for profile in PROFILES:
        goal = "at most 0.001", lambda _, ratio: ratio <= 0.001
        label = f"evaluate {seconds / 3600:g} h from CSV, {profile}"
        figures.append(against(label, spent[f"csv {profile}"], "s", "real time", seconds, *goal))
        goal = "at most 1.5", lambda _, ratio: ratio <= 1.5
        label = f"evaluate {seconds / 3600:g} h from MCAP, {profile}"
        peer = "rosbags reads it"
        figures.append(against(label, spent[f"mcap {profile}"], "s", peer, spent["rosbags"], *goal))
    part = read_drive(bag).samples[: len(drive.samples) // 10]
    for profile in PROFILES:

        def looped(profile: str = profile) -> int:
            return sum(len(r) for r in OfflineGraph(graph_settings(profile)).rows(part))

        def stepped(profile: str = profile) -> int:
            return sum(1 for _ in OfflineGraph(graph_settings(profile)).run(part))

        both = {n: middle(r) for n, r in in_turn({"loop": looped, "step": stepped}, 3).items()}
        steps = looped()
        goal = "at most 0.05", lambda _, ratio: ratio <= 0.05
        figures.append(
            against(
                f"a step in the loop, {profile}",
                both["loop"] / steps * 1e6,
                "us",
                "step by step",
                both["step"] / steps * 1e6,
                *goal,
            )
        )
    label = "the same from CSV, with everything to compile first"
    figures.append(against(label, _cold(csv, folder / "cache", root), "s", "real time", seconds))
    return figures
