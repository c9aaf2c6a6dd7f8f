"""paper_evaluation: the paper's evaluation, and the detectors that people would pick instead."""

import argparse
import json
import sys
import time
from pathlib import Path

from rich.table import Table

from lfd_mpc.errors import UserError
from lfd_replay.command_line import CountingProgress, parse_campaign, print_table
from lfd_replay.errors import run_command
from lfd_replay.evaluation import summary
from lfd_replay.evaluation.campaign import evaluate_paper, full, plain
from lfd_replay.evaluation.cases import lead_file
from lfd_replay.evaluation.page import write_evaluation_page
from lfd_replay.journal import workers
from lfd_replay.paths import named_path
from lfd_replay.profiles import graph_settings
from lfd_replay.text_file import write_text


def recorded_drive(folder: Path) -> Path | None:
    """The folder, where the recorded drive lies in it; None and a word where it does not."""
    lead = lead_file(folder)
    if lead.is_file():
        return folder
    print(f"NOT RUN on the recorded drive: {folder} holds no {lead.name}", file=sys.stderr)
    return None


def main_paper_evaluation(arguments: list[str]) -> int:
    """The command line of `paper_evaluation`."""
    parser = argparse.ArgumentParser(prog="paper_evaluation", description=__doc__)
    parser.add_argument("--full", action="store_true", help="every size, kind, drive and start")
    parser.add_argument("--params", type=named_path, metavar="FILE.yaml", help="ROS parameter file")
    options = parse_campaign(parser, arguments, "out/evaluate")
    size = full() if options.full else plain()
    settings = graph_settings("paper", options.params)
    if settings.profile != "paper":
        raise UserError(
            f"--params {options.params}: is of the {settings.profile} profile; a file of the paper "
            "profile is expected, as `calibrate --profile paper` writes it"
        )
    recorded = recorded_drive(options.recorded)
    started = time.perf_counter()
    with CountingProgress() as progress, workers(options.jobs) as pool:
        bar = progress.add_task("evaluating", total=size.tasks)
        found = evaluate_paper(
            size, settings, recorded, options.out / "work", pool, lambda: progress.advance(bar)
        )
        progress.update(bar, description="drawing")
        page = write_evaluation_page(
            found, recorded, options.out, pool, lambda: progress.advance(bar)
        )
    elapsed = time.perf_counter() - started
    result = summary.summary(found, options.full, elapsed)
    write_text(options.out / "summary.json", json.dumps(result, indent=1, allow_nan=False) + "\n")
    for title, columns_of, rows in summary.tables(found):
        if not rows:
            continue
        table = Table(*columns_of, title=title, title_justify="left")
        for row in rows:
            table.add_row(*row)
        print_table(table)
    print(f"{elapsed:.0f} s   page: {page}   figures: {options.out / 'summary.json'}")
    return 0


def main() -> int:
    """Entry point of `lfd_replay paper_evaluation`."""
    return run_command(main_paper_evaluation)
