"""closed_loop_evaluation: does the diagnosis help where the controller drives the car?

Every fault in every situation, with and without the decision heeded; healthy drives; and the
paper's comparison of predictions, here where the controller does drive.
"""

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from itertools import product
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from lfd_diagnosis.verdict import Report, State
from lfd_mpc.settings import STEP_S
from lfd_replay.command_line import CountingProgress, add_jobs_option, print_table
from lfd_replay.drawing.figure_page import table_html, write_page
from lfd_replay.errors import run_command
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import parse_faults
from lfd_replay.generated.lead_profiles import NORMAL
from lfd_replay.journal import workers
from lfd_replay.paths import make_folder, named_path
from lfd_replay.profiles import PROFILES, graph_settings
from lfd_replay.score import score, timeline
from lfd_replay.text_file import write_text
from lfd_vehicle.closed_loop import ClosedLoop
from lfd_vehicle.lead import lead_plan
from lfd_vehicle.safety import safety_of
from lfd_vehicle.scenarios import (
    FAULTS,
    HEALTHY,
    MUST_COLLIDE,
    ONSET,
    SITUATIONS,
    Situation,
    timed,
)
from lfd_vehicle.settings import VehicleSettings
from lfd_vehicle.world import Scenario

NEARLY = 2.0
"""m of clearance below which a run nearly ended in a collision."""

PREDICTIONS = ("mpc", "linear")

COMPARED = (
    "offset:clearance=4,relative_velocity=-10",
    "offset:clearance=4",
    "offset:relative_velocity=-10",
    "offset:relative_velocity=2",
    "offset:acceleration=4",
)
"""Faults of the comparison of predictions."""


@dataclass(frozen=True)
class Case:
    """One run: `heeded` = the decision is; `fault` with its times, empty = healthy."""

    table: str
    situation: Situation
    fault: str
    profile: str
    heeded: bool
    seed: int
    prediction: str = "mpc"


def run_case(case: Case) -> dict[str, Any]:
    """Figures of one run, with what it was."""
    situation = case.situation
    scenario = Scenario(
        lead_plan(situation.lead),
        tuple(parse_faults([case.fault])),
        situation.gap,
        situation.speed,
    )
    graph = graph_settings(case.profile)
    graph = replace(graph, mpc=graph.mpc.model_copy(update={"prediction": case.prediction}))
    vehicle = VehicleSettings(seed=case.seed)
    diagnosed = case.heeded or case.table == "prediction"
    loop = ClosedLoop(scenario, graph, vehicle, case.heeded, diagnosed)
    steps = list(loop.run())
    levels = [int(step.decision.level) for step in steps if step.decision is not None]
    safety = safety_of([step.moment for step in steps], levels, loop.world.collided)
    row = {
        "table": case.table,
        "situation": situation.name,
        "fault": case.fault,
        "profile": case.profile,
        "heeded": case.heeded,
        "seed": case.seed,
        "prediction": case.prediction,
        "duration_s": len(steps) * STEP_S,
        **safety.figures(),
    }
    if not diagnosed:
        return row
    reports = [step.report for step in steps if step.report is not None]
    sensors = score(timeline(reports, 0), list(scenario.faults))
    return {
        **row,
        "false_events": {name: found["false_events"] for name, found in sensors.items()},
        "found": {
            name: [window["found"] for window in found["windows"]]
            for name, found in sensors.items()
        },
        "delay_s": {name: found["delay_s"] for name, found in sensors.items()},
        "index_above_zero": _index_above_zero(reports),
    }


def _index_above_zero(reports: Sequence[Report]) -> dict[str, float]:
    """Share of judged steps whose index is not zero."""
    shares = {}
    for name in JUDGED:
        verdicts = [getattr(report, name) for report in reports]
        judged = [v.index for v in verdicts if v.state in (State.OK, State.SUSPECT, State.FAULT)]
        shares[name] = float(np.mean(np.array(judged) > 0.0)) if judged else 0.0
    return shares


def cases(full: bool) -> list[Case]:
    """All runs; `full`: three seeds and both profiles, and all normal drives."""
    seeds = (1, 3, 5) if full else (1,)
    profiles = tuple(PROFILES) if full else ("robust",)
    made = []
    for seed, situation, fault in product(seeds, SITUATIONS, FAULTS):
        text = timed(fault, ONSET + 0.02 * seed)
        made.append(Case("faults", situation, text, "robust", False, seed))
        made += [Case("faults", situation, text, profile, True, seed) for profile in profiles]
    leads = (*HEALTHY, *(NORMAL if full else NORMAL[::6]))
    for seed, lead, profile in product(seeds, leads, profiles):
        made.append(Case("healthy", Situation(lead, lead), "", profile, True, seed))
    for seed, prediction, fault in product(seeds, PREDICTIONS, ("", *COMPARED)):
        for lead in ("data-1", "data-2") if full else ("data-1",):
            text = timed(fault, 20.0 + 0.02 * seed) if fault else ""
            made.append(
                Case("prediction", Situation(lead, lead), text, "paper", False, seed, prediction)
            )
    return made


def run_all(chosen: Sequence[Case], jobs: int) -> list[dict[str, Any]]:
    """Run in processes, with one progress bar; in the order of the cases."""
    rows: list[dict[str, Any] | None] = [None] * len(chosen)
    with CountingProgress() as progress, workers(jobs) as pool:
        bar = progress.add_task("closed loop", total=len(chosen))
        running = {pool.submit(run_case, case): number for number, case in enumerate(chosen)}
        for future in as_completed(running):
            rows[running[future]] = future.result()
            progress.advance(bar)
    return [row for row in rows if row is not None]


def fault_rows(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """What a fault does in each situation, with and without the decision."""
    made = []
    kinds = [(False, "robust"), *((True, profile) for profile in PROFILES)]
    for situation, (heeded, profile) in product(SITUATIONS, kinds):
        own = [
            row
            for row in rows
            if (row["situation"], row["heeded"], row["profile"])
            == (situation.name, heeded, profile)
        ]
        if not own:
            continue
        times = [_or_infinity(row["least_time_to_collision"]) for row in own]
        made.append(
            (
                situation.name,
                profile if heeded else "no diagnosis",
                str(len(own)),
                str(sum(row["collided"] for row in own)),
                f"{max(row['contact_speed'] for row in own):.1f}",
                str(sum(row["least_clearance"] < NEARLY for row in own)),
                f"{min(row['least_clearance'] for row in own):.1f}",
                f"{min(times):.1f}",
                f"{max(row['largest_deceleration'] for row in own):.1f}",
                f"{max(row['largest_jerk'] for row in own):.0f}",
            )
        )
    return made


FAULT_COLUMNS = (
    "situation", "diagnosis", "runs", "collisions", "worst contact m/s", f"below {NEARLY:g} m",
    "least clearance m", "least time to collision s", "deceleration m/s^2", "jerk m/s^3",
)  # fmt: skip


def _or_infinity(value: float | None) -> float:
    return inf if value is None else value


HEALTHY_COLUMNS = (
    "profile", "runs", "hours", "interventions", "runs with one", "share of time", "collisions",
    "least clearance m", "deceleration m/s^2",
)  # fmt: skip


def healthy_rows(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """What is done about sensors that are healthy."""
    made = []
    for profile in PROFILES:
        own = [row for row in rows if row["profile"] == profile]
        if own:
            duration = sum(row["duration_s"] for row in own)
            share = sum(row["intervened"] * row["duration_s"] for row in own) / duration
            made.append(
                (
                    profile,
                    str(len(own)),
                    f"{duration / 3600:.2f}",
                    str(sum(row["interventions"] for row in own)),
                    str(sum(row["interventions"] > 0 for row in own)),
                    f"{100 * share:.1f} %",
                    str(sum(row["collided"] for row in own)),
                    f"{min(row['least_clearance'] for row in own):.1f}",
                    f"{max(row['largest_deceleration'] for row in own):.1f}",
                )
            )
    return made


PREDICTION_COLUMNS = (
    "prediction", "fault", "runs", "clearance", "relative velocity", "acceleration",
)  # fmt: skip


def prediction_rows(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """The paper's comparison: how often the index is above zero, and what is found after how long.

    A signal that was not injected shows its false events.
    """
    made = []
    for prediction, fault in product(PREDICTIONS, ("", *COMPARED)):
        own = [
            row
            for row in rows
            if row["prediction"] == prediction and row["fault"].partition("@")[0] == fault
        ]
        if not own:
            continue
        cells = []
        for name in JUDGED:
            windows = [found for row in own for found in row["found"][name]]
            false = sum(row["false_events"][name] for row in own)
            if windows:
                delays = [row["delay_s"][name] for row in own if row["delay_s"][name] is not None]
                after = f" after {1e3 * float(np.median(delays)):.0f} ms" if delays else ""
                cells.append(f"{sum(windows)} of {len(windows)}{after}")
            elif fault:
                cells.append(f"{false} false")
            else:
                share = np.mean([row["index_above_zero"][name] for row in own])
                cells.append(f"index above 0: {100 * share:.1f} %; {false} false")
        made.append((prediction, fault or "none", str(len(own)), *cells))
    return made


def goals(rows: list[dict[str, Any]]) -> list[tuple[str, bool, str]]:
    """What the closed loop must show: name, whether it does, and the figure."""
    faults = [row for row in rows if row["table"] == "faults" and row["profile"] == "robust"]
    healthy = [row for row in rows if row["table"] == "healthy" and row["profile"] == "robust"]
    with_it = [row for row in faults if row["heeded"]]
    hard = [
        row
        for row in faults
        if row["fault"].startswith(f"{MUST_COLLIDE}@") and "braking" in row["situation"]
    ]
    bad = [row for row in hard if not row["heeded"] and row["least_clearance"] < NEARLY]
    safe = [row for row in hard if row["heeded"] and not row["collided"]]
    half = len(hard) // 2
    collided = sum(row["collided"] for row in with_it)
    near = sum(row["least_clearance"] < NEARLY for row in with_it)
    interventions = sum(row["interventions"] for row in healthy)
    return [
        (f"{MUST_COLLIDE} behind a braking lead, without: collides or nearly so",
         0 < len(bad) == half, f"{len(bad)} of {half}"),
        ("the same with the diagnosis: never collides",
         0 < len(safe) == half, f"{len(safe)} of {half}"),
        ("no collision with any fault", collided == 0, f"{collided} of {len(with_it)}"),
        (f"never below {NEARLY:g} m with any fault", near == 0, f"{near} of {len(with_it)}"),
        ("no intervention on healthy drives", interventions == 0,
         f"{interventions} in {len(healthy)} drives"),
    ]  # fmt: skip


TABLES = (
    ("faults", "Faults in the closed loop", FAULT_COLUMNS, fault_rows),
    ("healthy", "Healthy drives in the closed loop", HEALTHY_COLUMNS, healthy_rows),
    ("prediction", "Predictions where the controller drives (paper profile, not heeded)",
     PREDICTION_COLUMNS, prediction_rows),
)  # fmt: skip


def case_rows(rows: list[dict[str, Any]]) -> list[tuple[str, ...]]:
    """Every fault in every situation: least clearance without, and with, m; 0 = collision."""
    names = [situation.name for situation in SITUATIONS]
    made = []
    for fault in FAULTS:
        cells = []
        for name, heeded in product(names, (False, True)):
            own = [
                row["least_clearance"]
                for row in rows
                if row["situation"] == name
                and row["fault"].startswith(f"{fault}@")
                and row["heeded"] == heeded
                and row["profile"] == "robust"
            ]
            cells.append(f"{min(own):.1f}" if own else "–")
        made.append((fault, *cells))
    return made


def leave(rows: list[dict[str, Any]], out: Path, console: Console) -> None:
    """Print the tables, and write them as JSON and as a page."""
    body = []
    for table, title, columns, make in TABLES:
        made = make([row for row in rows if row["table"] == table])
        printed = Table(*columns, title=title)
        for row in made:
            printed.add_row(*row)
        print_table(printed)
        body += [f"<h2>{title}</h2>", table_html(columns, made)]
    met = goals(rows)
    for name, holds, figure in met:
        console.print(f"{'met' if holds else 'NOT MET':>8}  {name}: {figure}", highlight=False)
    body.insert(
        0, table_html(("must show", "", "figure"),
                      [(n, "met" if h else "NOT MET", f) for n, h, f in met])
    )  # fmt: skip
    columns = ["fault"]
    for situation in SITUATIONS:
        columns += [f"{situation.name}, without", "with"]
    body.append("<h2>Least clearance of every fault in m (0: collision)</h2>")
    body.append(table_html(columns, case_rows([r for r in rows if r["table"] == "faults"])))
    write_text(out / "closed-loop.json", json.dumps(rows, indent=1) + "\n")
    write_page(out / "closed-loop.html", "The closed loop", body)
    console.print(f"page: {out / 'closed-loop.html'}", highlight=False)


def main_closed_loop(arguments: list[str]) -> int:
    """The command line of `closed_loop_evaluation`."""
    parser = argparse.ArgumentParser(prog="closed_loop_evaluation", description=__doc__)
    parser.add_argument("--out", type=named_path, default=Path("out/evaluate"), metavar="FOLDER")
    parser.add_argument(
        "--full", action="store_true", help="three seeds, both profiles, all normal drives"
    )
    add_jobs_option(parser)
    options = parser.parse_args(arguments)
    make_folder(options.out)
    console = Console(soft_wrap=True, markup=False)
    leave(run_all(cases(options.full), options.jobs), options.out, console)
    return 0


def main() -> int:
    """Entry point of `lfd_vehicle closed_loop_evaluation`."""
    return run_command(main_closed_loop)
