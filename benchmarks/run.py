"""Measure everything, print the table, and write it to a file.

`python benchmarks/run.py --out out/bench [--full] [--only PART]...`
"""

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from pathlib import Path

import folder
import graph
import live
import numba
import numpy as np
import offline
import solve
import step
from measure import Figure
from rich.console import Console
from rich.table import Table

from lfd_mpc.errors import UserError
from lfd_replay.errors import run_command
from lfd_replay.evaluation.cases import lead_file
from lfd_replay.paths import make_folder

ROOT = Path(__file__).resolve().parent.parent
RECORDED = lead_file(ROOT.parent / "shared/data")


def parts(full: bool, work: Path) -> dict:
    """What is measured by name; `full`: for as long as the goals say."""
    recorded = RECORDED if RECORDED.is_file() else None
    return {
        "solve": lambda: solve.measure(recorded, 2000 if full else 500),
        "step": lambda: step.measure(120.0 if full else 60.0),
        "offline": lambda: offline.measure(3600.0, work, ROOT),
        "live": lambda: live.measure(600.0 if full else 20.0, 4 if full else 2, ROOT),
        "lockstep": lambda: graph.lockstep(60.0 if full else 20.0, work, ROOT),
        "player": lambda: graph.player(600.0, work, ROOT),
        "start": lambda: graph.starting(work, ROOT),
        "memory": lambda: graph.memory(3600.0 if full else 300.0, work, ROOT),
        "folder": lambda: folder.measure(200 if full else 20, work),
    }


def table(figures: list[Figure]) -> Table:
    """As people read it."""
    made = Table("what", "value", "against", "its value", "ratio", "goal", "met")
    marks = {True: "yes", False: "NO", None: ""}
    for f in figures:
        made.add_row(
            f.what,
            f"{f.value:.4g} {f.unit}",
            f.peer,
            f"{f.peer_value:.4g} {f.unit}",
            f"{f.ratio:.3g}",
            f.goal,
            marks[f.met],
        )
    return made


def main(arguments: list[str]) -> int:
    """Measure, print and write. Raises UserError."""
    parser = argparse.ArgumentParser(prog="bench", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/bench"))
    parser.add_argument("--full", action="store_true", help="an hour and more")
    parser.add_argument("--only", action="append", metavar="PART", help="one part; may be repeated")
    options = parser.parse_args(arguments)
    figures: list[Figure] = []
    console = Console(width=160)
    with tempfile.TemporaryDirectory() as work:
        chosen = parts(options.full, Path(work))
        unknown = set(options.only or ()) - set(chosen)
        if unknown:
            raise UserError(f"--only {unknown.pop()}: there are: {', '.join(chosen)}")
        make_folder(options.out)
        for name, measure in chosen.items():
            if options.only and name not in options.only:
                continue
            started = time.perf_counter()
            found = measure()
            figures += found
            console.print(table(found))
            print(f"{name}: {time.perf_counter() - started:.0f} s", flush=True)
    summary = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "full": options.full,
        "figures": [figure.as_dict() for figure in figures],
    }
    (options.out / "summary.json").write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n")
    missed = [figure.what for figure in figures if figure.met is False]
    print(f"{len(figures)} figures, {len(missed)} goals missed: {options.out / 'summary.json'}")
    return 0


if __name__ == "__main__":
    sys.exit(run_command(main))
