"""The report: one self-contained page with the paper's panels and the verdicts."""

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from lfd_diagnosis.verdict import SIGNALS, Report, State
from lfd_mpc.horizon import Horizon
from lfd_observer.bank import BankState
from lfd_replay.faults import SIGNALS as FAULT_SIGNALS
from lfd_replay.faults import Fault, truth_windows
from lfd_replay.score import SUMMARY_COLUMNS, intervals, summary_rows
from lfd_replay.text_file import write_text

Array = NDArray[np.float64]

COLOURS = {
    "clearance": "#0072B2",
    "relative_velocity": "#D55E00",
    "acceleration": "#009E73",
    "radar": "#CC79A7",
}
"""Okabe and Ito's palette: told apart by colour-blind readers too."""

PREDICTED = "#999999"
FAULTY, INJECTED, UNJUDGED = "#B22222", "#E6B800", "#D9D9D9"

MAX_CHANGES = 200
"""Rows in the list of changes of state."""

PANELS = (
    "clearance (m)",
    "relative velocity (m/s)",
    "host acceleration and its limits (m/s²)",
    "fault index",
    "confidence (steps)",
    "verdict",
)


@dataclass(frozen=True)
class RecordedStep:
    """What every node said about one step; `bank` is None where its answer was lost."""

    horizon: Horizon
    bank: BankState | None
    report: Report


def write_report(
    folder: Path,
    title: str,
    steps: Sequence[RecordedStep],
    zero: int,
    faults: list[Fault],
    sensors: dict[str, dict],
) -> Path:
    """Write `report.html` into a folder and return its path.

    `zero` is the drive's time zero in ns, `sensors` the figures of `score`. Raises UserError where
    the page cannot be written.
    """
    body = [f"<h1>{html.escape(title)}</h1>", _injected(faults)]
    if steps:
        figure = _figure(steps, zero, faults)
        body += [
            _table(SUMMARY_COLUMNS, summary_rows(sensors)),
            figure.to_html(full_html=False, include_plotlyjs=True, config={"responsive": True}),
            _changes(steps, zero),
        ]
    else:
        body.append("<p>There is no step: nothing was diagnosed.</p>")
    path = folder / "report.html"
    write_text(path, _PAGE.format(title=html.escape(title), body="\n".join(body)))
    return path


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<style>
body {{ font: 15px/1.4 system-ui, sans-serif; margin: 1.5rem auto;
  max-width: 1300px; padding: 0 1rem; color: #222; background: #fff; }}
h1 {{ font-size: 1.4rem; }} h2 {{ font-size: 1.1rem; }}
table {{ border-collapse: collapse; margin: 1rem 0; font-size: 13px; }}
th, td {{ text-align: left; padding: .25rem .7rem; border-bottom: 1px solid #ddd; }}
code {{ background: #f3f3f3; padding: .1rem .3rem; }}
.FAULT {{ color: #B22222; font-weight: 600; }}
</style></head><body>
{body}
</body></html>
"""


def _injected(faults: list[Fault]) -> str:
    if not faults:
        return "<p>No fault was injected.</p>"
    texts = ", ".join(f"<code>{html.escape(fault.text)}</code>" for fault in faults)
    return f"<p>Injected, in s of drive time: {texts}</p>"


def _table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><tr>{head}</tr>{body}</table>"


def _changes(steps: Sequence[RecordedStep], zero: int) -> str:
    rows = []
    before = {name: State.NOT_READY for name in SIGNALS}
    for step in steps:
        for name in SIGNALS:
            fault = getattr(step.report, name)
            if fault.state == before[name]:
                continue
            rows.append(
                (
                    f"{(step.report.stamp - zero) * 1e-9:.2f} s",
                    name,
                    before[name].name,
                    f'<span class="{fault.state.name}">{fault.state.name}</span>',
                    "–" if isnan(fault.index) else f"{fault.index:.2f}",
                    f"{fault.threshold:.3f}",
                    f"{fault.confidence} of {fault.confidence_threshold}",
                    html.escape(fault.reason),
                )
            )
            before[name] = fault.state
    left_out = len(rows) - MAX_CHANGES
    note = f"<p>{left_out} more are left out.</p>" if left_out > 0 else ""
    header = ("time", "signal", "from", "to", "index", "threshold", "confidence", "reason")
    return f"<h2>Changes of state</h2>{_table(header, rows[:MAX_CHANGES])}{note}"


def _figure(steps: Sequence[RecordedStep], zero: int, faults: list[Fault]) -> go.Figure:
    stamps = np.array([step.horizon.stamp - zero for step in steps])
    time = stamps * 1e-9
    figure = make_subplots(
        rows=len(PANELS),
        shared_xaxes=True,
        vertical_spacing=0.03,
        subplot_titles=PANELS,
        row_heights=[1, 1, 1.2, 1, 0.8, 0.9],
    )
    _add_radar(figure, time, steps)
    _add_acceleration(figure, time, steps)
    _add_indices(figure, time, steps)
    _add_verdicts(figure, stamps, steps, faults)
    for row, name in enumerate(("clearance", "relative_velocity", "acceleration"), start=1):
        for start, end in truth_windows(faults, name):
            figure.add_vrect(
                start, end, row=row, col=1, fillcolor=INJECTED, opacity=0.18, line_width=0
            )
    figure.update_layout(
        height=1500,
        template="plotly_white",
        margin={"l": 60, "r": 20, "t": 40, "b": 40},
        legend={"orientation": "h", "y": -0.04},
        hovermode="x unified",
    )
    figure.update_xaxes(title_text="drive time (s)", row=len(PANELS), col=1)
    return figure


def _line(figure: go.Figure, row: int, x: Array, y: Array, name: str, **style) -> None:
    # Half the page's size, and still far finer than a pixel.
    x, y = x.astype(np.float32), y.astype(np.float32)
    legend = style.pop("legend", True)
    line = {"color": style.pop("colour"), "width": style.pop("width", 1.3), **style}
    figure.add_trace(
        go.Scatter(x=x, y=y, name=name, mode="lines", line=line, showlegend=legend), row=row, col=1
    )


def _predicted(steps: Sequence[RecordedStep], field: str) -> Array:
    """For each step what the oldest solution that reaches it predicted; NaN where there is none."""
    predicted = np.full(len(steps), np.nan)
    for k, step in enumerate(steps):
        states = getattr(step.horizon, field)
        lead = len(states)
        anew = any(later.horizon.restart for later in steps[k + 1 : k + lead + 1])
        if lead and k + lead < len(steps) and not anew:
            predicted[k + lead] = states[-1]
    return predicted


def _add_radar(figure: go.Figure, time: Array, steps: Sequence[RecordedStep]) -> None:
    for row, name in enumerate(("clearance", "relative_velocity"), start=1):
        used = np.array([getattr(step.horizon, name) for step in steps])
        predicted = _predicted(steps, f"predicted_{name}")
        _line(
            figure,
            row,
            time,
            predicted,
            "predicted 0.2 s before",
            colour=PREDICTED,
            legend=row == 1,
        )
        label = name.replace("_", " ")
        _line(figure, row, time, used, f"{label}, measured", colour=COLOURS[name])


def _add_acceleration(figure: go.Figure, time: Array, steps: Sequence[RecordedStep]) -> None:
    row = 3
    with_bank = [(t, step.bank) for t, step in zip(time, steps, strict=True) if step.bank]
    if with_bank:
        x = np.array([t for t, _ in with_bank])
        for side in ("upper", "lower"):
            limits = np.array([getattr(bank, f"acceleration_{side}") for _, bank in with_bank])
            # Lag 0 last, so that it lies on top.
            for observer, lag in reversed(list(enumerate(with_bank[0][1].lags))):
                first = observer == 0
                _line(
                    figure,
                    row,
                    x,
                    limits[:, observer],
                    f"limits, lag {lag}",
                    colour="#444444" if first else "#BBBBBB",
                    width=1.2 if first else 0.6,
                    legend=first and side == "upper",
                )
    measured = np.array(
        [np.nan if step.horizon.acceleration_stale else step.horizon.acceleration for step in steps]
    )
    _line(figure, row, time, measured, "acceleration, measured", colour=COLOURS["acceleration"])


def _add_indices(figure: go.Figure, time: Array, steps: Sequence[RecordedStep]) -> None:
    for name in ("clearance", "relative_velocity", "acceleration"):
        faults = [getattr(step.report, name) for step in steps]
        label, colour = name.replace("_", " "), COLOURS[name]
        index = np.array([fault.index for fault in faults])
        confidence = np.array([fault.confidence for fault in faults], dtype=float)
        _line(figure, 4, time, index, f"{label}, index", colour=colour, legend=False)
        _line(figure, 5, time, confidence, f"{label}, confidence", colour=colour, legend=False)
        figure.add_hline(
            faults[0].threshold, row=4, col=1, line={"color": colour, "dash": "dash", "width": 1}
        )
    figure.add_hline(
        faults[0].confidence_threshold, row=5, col=1, line={"dash": "dash", "width": 1}
    )


def _add_verdicts(
    figure: go.Figure, stamps: NDArray[np.int64], steps: Sequence[RecordedStep], faults: list[Fault]
) -> None:
    """Lanes: what was injected above, what was said below."""
    row = len(PANELS)
    lanes = [name for name in SIGNALS if name == "radar" or name in FAULT_SIGNALS]
    for lane, name in enumerate(reversed(lanes)):
        states = np.array([getattr(step.report, name).state for step in steps])
        unjudged = (State.NOT_READY, State.NO_DATA, State.NO_TARGET)
        drawn = (
            ("injected", truth_windows(faults, name), INJECTED, 0.1),
            ("FAULT", intervals(stamps, states == State.FAULT), FAULTY, -0.1),
            ("not judged", intervals(stamps, np.isin(states, unjudged)), UNJUDGED, -0.1),
        )
        for label, spans, colour, shift in drawn:
            x, y = [], []
            for start, end in spans:
                x += [start, end, None]
                y += [lane + shift, lane + shift, None]
            figure.add_trace(
                go.Scatter(
                    x=x or [None],
                    y=y or [None],
                    name=label,
                    mode="lines",
                    line={"color": colour, "width": 9},
                    legendgroup=label,
                    showlegend=lane == 0,
                ),
                row=row,
                col=1,
            )
    figure.update_yaxes(
        tickvals=list(range(len(lanes))),
        ticktext=[name.replace("_", " ") for name in reversed(lanes)],
        range=[-0.5, len(lanes) - 0.5],
        row=row,
        col=1,
    )
