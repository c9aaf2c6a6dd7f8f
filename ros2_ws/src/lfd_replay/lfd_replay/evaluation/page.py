"""The page of the evaluation, and its figures as files."""

import pickle
from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

from lfd_replay.drawing.figure_files import write_figure
from lfd_replay.drawing.figure_page import cases_html, figure_html, table_html, write_page
from lfd_replay.drawing.figures import Figure
from lfd_replay.drawing.panels import Recording
from lfd_replay.drawing.paper_figures import (
    case_figure,
    confusion_figure,
    detector_curves,
    eigenvalue_figure,
    index_histograms,
    limits_figure,
    mpc_figure,
    reconstruction_figure,
)
from lfd_replay.evaluation import summary
from lfd_replay.evaluation.campaign import Evaluation
from lfd_replay.evaluation.cases import RECORDED, Case, added, combination_title, run_case
from lfd_replay.evaluation.detectors import PUBLISHED
from lfd_replay.evaluation.examples import examples_figure
from lfd_replay.profiles import GraphSettings
from lfd_replay.recorded_step import RecordedStep


def _drive_name(case: Case) -> str:
    return "recorded drive" if case.drive == RECORDED else case.drive


def case_title(case: Case) -> str:
    """A case in words."""
    return f"{_drive_name(case)}: {combination_title(case.combination)}"


def figures_of_case(
    case: Case, settings: GraphSettings, recorded: Path | None, folder: Path
) -> bytes:
    """Figures of one case, pickled: its panels, and the paper's others for a fault-free drive.

    Each is left in `folder` as a file.
    """
    drive, faults, steps = run_case(case, 0.0, settings, recorded)
    recording = Recording([RecordedStep.offline(step) for step in steps], drive.zero, faults)
    figures = [
        case_figure(
            case.key,
            case_title(case),
            recording,
            added(drive, case, 0.0),
            settings.diagnosis,
        )
    ]
    if not faults:
        name = _drive_name(case)
        figures += [
            mpc_figure(f"mpc-{case.drive}", f"{name}: the controller (Figs 6, 18)", recording),
            reconstruction_figure(
                f"reconstruction-{case.drive}", f"{name}: reconstruction (Fig 8)", recording
            ),
            limits_figure(
                f"limits-{case.drive}", f"{name}: acceleration limits (Fig 9)", recording
            ),
        ]
    for figure in figures:
        write_figure(figure, folder)
    return pickle.dumps(figures)


def write_evaluation_page(
    found: Evaluation,
    recorded: Path | None,
    folder: Path,
    pool: Executor,
    done: Callable[[], None],
) -> Path:
    """Write `index.html` and `figures/` into a folder; returns the page's path."""
    drawn: list[list[Figure]] = []
    examples = pool.submit(examples_figure)
    futures = [
        pool.submit(figures_of_case, case, found.settings, recorded, folder / "figures")
        for case, _, _ in found.cases
    ]
    for future in futures:
        drawn.append(pickle.loads(future.result()))
        done()
    normal = found.normal[PUBLISHED]
    others = [
        eigenvalue_figure(found.settings.mpc),
        index_histograms(normal.values, normal.zero_share),
        detector_curves(found.rows, "rate"),
        detector_curves(found.rows, "delay"),
        confusion_figure(found.confusion),
        examples.result(),
    ]
    for figure in others:
        write_figure(figure, folder / "figures")
    every = summary.tables(found)
    *detail, injected, table_1, table_3 = every[: summary.PAPER_TABLES]
    detail = [table for table in detail if table[2]]
    robust = [table for table in every[summary.PAPER_TABLES :] if table[2]]
    body = [
        *(table_html(columns, rows, title) for title, columns, rows in (table_3, table_1)),
        cases_html([figures[0] for figures in drawn]),
        # The paper shows these of data-1; the files hold them of every fault-free drive.
        *(figure_html(figure) for figure in (others[0], *drawn[0][1:], *others[1:])),
        *(table_html(columns, rows, title) for title, columns, rows in (injected, *detail)),
        *(table_html(columns, rows, title) for title, columns, rows in reversed(robust)),
    ]
    path = folder / "index.html"
    write_page(path, "The paper's evaluation", body)
    return path
