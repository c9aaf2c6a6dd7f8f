"""A folder of drives: one process against all cores."""

import os
from pathlib import Path

from measure import Figure, against, in_turn, middle

from lfd_replay.drive_bag import write_drive
from lfd_replay.evaluate import Question, evaluate_drive
from lfd_replay.evaluate_many import drives_of, evaluate_all
from lfd_replay.generated.generate import generate_drive
from lfd_replay.profiles import graph_settings
from lfd_replay.read_drive import ReadOptions


def measure(count: int, folder: Path) -> list[Figure]:
    """Seconds of the whole folder."""
    drives = folder / "drives"
    drives.mkdir()
    for number in range(count):
        drive = generate_drive(f"normal-{number % 27 + 1:02d}", number, "esr")
        write_drive(drive, drives / f"{number:03d}.mcap")
    question = Question(graph_settings("robust"), [], 0, ReadOptions())
    paths = drives_of([drives])
    cores = os.cpu_count() or 1

    def evaluate(jobs: int) -> None:
        results = evaluate_all(paths, question, [], evaluate_drive, None, jobs, None)
        assert not any("error" in result for result in results)

    calls = {"one": lambda: evaluate(1), "all": lambda: evaluate(cores)}
    spent = {name: middle(rounds) for name, rounds in in_turn(calls, 1).items()}
    most = 1.0 / (0.7 * cores)
    goal = f"at most {most:.2f}", lambda _, ratio: ratio <= most
    label = f"folder of {count} drives on {cores} cores"
    return [against(label, spent["all"], "s", "one process", spent["one"], *goal)]
