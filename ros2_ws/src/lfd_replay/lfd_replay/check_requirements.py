"""check_requirements: some rows of what the robust profile must show, on seeds of one's choice.

`paper_evaluation` reports on seeds that were looked at while mending; others tell whether what is
true of those is true of any.
"""

import argparse
from dataclasses import replace
from functools import partial

from rich.table import Table

from lfd_mpc.errors import UserError
from lfd_replay.command_line import CountingProgress, parse_campaign, print_table
from lfd_replay.errors import run_command
from lfd_replay.evaluation.requirements.measure import measure
from lfd_replay.evaluation.requirements.plan import full_extent
from lfd_replay.evaluation.requirements.rows import rows
from lfd_replay.evaluation.summary import REQUIREMENT_COLUMNS, requirement_rows
from lfd_replay.journal import Journal, run_tasks, workers
from lfd_replay.paper_evaluation import recorded_drive

SEEDS_HELP = (
    "of generated drives (default: %(default)s); rows of faults take the first, but single faults "
    "and healthy drives all of them, Table 3 and real leads seeds of their own"
)


def parse_seeds(text: str) -> tuple[int, ...]:
    """Seeds from `2,4`. Raises UserError."""
    try:
        seeds = tuple(int(part) for part in text.split(","))
    except ValueError:
        seeds = ()
    if not seeds or min(seeds) < 0:
        raise UserError(f"--seeds '{text}': expected whole numbers from 0 on, such as 2,4")
    return seeds


def main_check(arguments: list[str]) -> int:
    """The command line of `check_requirements`."""
    parser = argparse.ArgumentParser(prog="check_requirements", description=__doc__)
    parser.add_argument("title", help="what the titles of the rows contain, such as 'in traffic'")
    parser.add_argument("--seeds", default="2", help=SEEDS_HELP)
    options = parse_campaign(parser, arguments, "out/requirements")
    seeds = parse_seeds(options.seeds)
    recorded = recorded_drive(options.recorded)
    extent = replace(full_extent(), seeds=seeds, healthy_seeds=seeds, ablation=False)
    every = rows(extent, recorded is not None)
    chosen = [row for row in every if options.title in row.title]
    if not chosen:
        titles = ", ".join(row.title for row in every)
        raise UserError(f"no row's title contains '{options.title}'; there are: {titles}")
    journal = Journal(options.out / "journal.jsonl", recorded)
    with CountingProgress() as progress, workers(options.jobs) as pool:
        runs = len({run.key for row in chosen for run in row.runs})
        bar = progress.add_task("checking", total=runs)
        done = partial(progress.advance, bar)
        run_all = partial(run_tasks, journal=journal, pool=pool, done=done)
        found = measure(extent, recorded, run_all, chosen)
    table = Table(*REQUIREMENT_COLUMNS, title=f"What must show, seeds {options.seeds}")
    for cells in requirement_rows(found.findings):
        table.add_row(*cells)
    print_table(table)
    return 0


def main() -> int:
    """Entry point of `lfd_replay check_requirements`."""
    return run_command(main_check)
