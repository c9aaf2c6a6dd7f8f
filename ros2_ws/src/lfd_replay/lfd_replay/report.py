"""The report: one self-contained page with the paper's panels and the verdicts."""

import html
from math import isnan
from pathlib import Path

from lfd_diagnosis.verdict import SIGNALS, State
from lfd_replay.drawing.figure_page import figure_html, table_html, write_page
from lfd_replay.drawing.figures import Figure
from lfd_replay.drawing.panels import (
    Recording,
    acceleration_panel,
    confidence_panel,
    index_panel,
    sensor_panel,
    verdict_panel,
)
from lfd_replay.evaluation.trace import JUDGED
from lfd_replay.faults import Fault
from lfd_replay.score import SUMMARY_COLUMNS, summary_rows

MAX_CHANGES = 200
"""Rows in the list of changes of state."""

NO_BREAK = "\u00a0"
"""A figure is on one line, however narrow its column."""


def write_report(
    folder: Path, title: str, recording: Recording, sensors: dict[str, dict], profile: str
) -> Path:
    """Write `report.html` into a folder and return its path.

    `sensors` are the figures of `score`. Raises UserError where the page cannot be written.
    """
    body = [_injected(recording.faults)]
    if recording.steps:
        body += [
            table_html(SUMMARY_COLUMNS, summary_rows(sensors)),
            figure_html(_figure(recording, profile)),
            _changes(recording),
        ]
    else:
        body.append("<p>There is no step: nothing was diagnosed.</p>")
    path = folder / "report.html"
    write_page(path, title, body)
    return path


def _figure(recording: Recording, profile: str) -> Figure:
    panels = [sensor_panel(recording, signal) for signal in JUDGED]
    says = "What was measured, and beneath it what it should be by everything but itself"
    if profile == "paper":
        panels.append(acceleration_panel(recording))
        says += "; the acceleration between the limits of the observers"
    panels += [index_panel(recording), confidence_panel(recording), verdict_panel(recording)]
    says += "; the indices and confidences with their thresholds (dashed), and the verdicts."
    return Figure("drive", "The drive", says, panels)


def _injected(faults: list[Fault]) -> str:
    if not faults:
        return "<p>No fault was injected.</p>"
    texts = ", ".join(f"<code>{html.escape(fault.text)}</code>" for fault in faults)
    return f"<p>Injected, in s of drive time: {texts}</p>"


def _changes(recording: Recording) -> str:
    rows = []
    before = {name: State.NOT_READY for name in SIGNALS}
    for time, step in zip(recording.time, recording.steps, strict=True):
        for name in SIGNALS:
            fault = getattr(step.report, name)
            if fault.state == before[name]:
                continue
            index = "–" if isnan(fault.index) else f"{fault.index:.2f}"
            rows.append(
                (
                    f"{time:.2f}{NO_BREAK}s",
                    name,
                    before[name].name,
                    fault.state.name,
                    f"{index} / {fault.threshold:.3f}".replace(" ", NO_BREAK),
                    f"{fault.confidence} of {fault.confidence_threshold}".replace(" ", NO_BREAK),
                    fault.reason,
                )
            )
            before[name] = fault.state
    left_out = len(rows) - MAX_CHANGES
    note = f"<p>{left_out} more are left out.</p>" if left_out > 0 else ""
    header = ("time", "signal", "from", "to", "index / threshold", "confidence", "reason")
    return f"<h2>Changes of state</h2>{table_html(header, rows[:MAX_CHANGES])}{note}"
