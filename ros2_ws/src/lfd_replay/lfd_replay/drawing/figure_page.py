"""Figures on one self-contained page: nothing is fetched, everything can be zoomed."""

import html
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import ArrayLike, NDArray
from plotly.offline import get_plotlyjs
from plotly.subplots import make_subplots

from lfd_replay.drawing.figures import (
    BAND_ALPHA,
    INJECTED,
    Band,
    Bars,
    Figure,
    HeatMap,
    Limit,
    Line,
    Panel,
    Points,
    Spans,
    stretches,
    thinned,
)
from lfd_replay.text_file import write_text

Rows = Iterable[Iterable[str]]

ROW_HEIGHT = 190
"""Pixels of a row of panels."""


def drawn(figure: Figure) -> str:
    """A figure as the JSON that the page draws."""
    heights = figure.row_heights
    rows = len(heights)
    tall = 1.7 if figure.columns > 1 or rows == 1 else 1.0
    pixels = round(ROW_HEIGHT * tall * sum(heights) + 110)
    stacked = figure.columns == 1
    named_rows = any(isinstance(m, HeatMap) and m.texts for p in figure.panels for m in p.marks)
    plot = make_subplots(
        rows=rows,
        cols=figure.columns,
        shared_xaxes=stacked,
        # Names of rows and columns need room between the panels.
        vertical_spacing=min((50 if stacked else 120) / pixels, 0.9 / max(rows - 1, 1)),
        horizontal_spacing=0.2 if named_rows else None,
        subplot_titles=[panel.title for panel in figure.panels],
        row_heights=heights,
    )
    named: set[str] = set()
    for number, panel in enumerate(figure.panels):
        place = {"row": number // figure.columns + 1, "col": number % figure.columns + 1}
        _draw(plot, panel, place, named)
        if figure.columns > 1 or number == len(figure.panels) - 1:
            plot.update_xaxes(title_text=panel.x_label, **place)
    plot.update_layout(
        height=pixels,
        template="plotly_white",
        margin={"l": 70, "r": 20, "t": 40, "b": 50},
        legend={"orientation": "h", "y": -50 / pixels, "yanchor": "top", "font": {"size": 11}},
        hovermode="x" if figure.columns == 1 else "closest",
        font={"size": 11},
    )
    plot.update_annotations(font_size=12)
    # A closing tag inside of text would end the script that holds it.
    return plot.to_json().replace("</", "<\\/")


def _draw(plot: go.Figure, panel: Panel, place: dict[str, int], named: set[str]) -> None:
    for mark in panel.marks:
        if isinstance(mark, Limit):
            plot.add_hline(mark.y, line={"color": mark.colour, "dash": "dash", "width": 1}, **place)
            continue
        trace = _TRACES[type(mark)](mark)
        if trace.showlegend is not False:
            # The same name in several panels is one entry that switches all of them.
            trace.legendgroup = trace.name
            trace.showlegend = trace.name not in named
            named.add(trace.name)
        plot.add_trace(trace, **place)
    for start, end in panel.shaded:
        plot.add_vrect(start, end, fillcolor=INJECTED, opacity=0.18, line_width=0, **place)
    plot.update_yaxes(title_text=panel.y_label, title_standoff=4, **place)
    if panel.log_x:
        plot.update_xaxes(type="log", **place)
    if panel.log_y:
        plot.update_yaxes(type="log", **place)
    if panel.x_ticks:
        texts = [f"{tick:g}" for tick in panel.x_ticks]
        plot.update_xaxes(tickvals=panel.x_ticks, ticktext=texts, **place)
    if panel.y_range:
        plot.update_yaxes(range=list(panel.y_range), **place)
    if panel.lanes:
        plot.update_yaxes(
            tickvals=list(range(len(panel.lanes))),
            ticktext=panel.lanes,
            range=[-0.5, len(panel.lanes) - 0.5],
            **place,
        )


def _line(mark: Line) -> go.Scatter:
    x, y = thinned(mark.x, mark.y)
    style = {"color": mark.colour, "width": mark.width, "dash": "dash" if mark.dashed else None}
    return go.Scatter(
        x=_small(x), y=_small(y), name=mark.name, mode="lines", line=style, showlegend=mark.legend
    )


def _band(mark: Band) -> go.Scatter:
    # Around each stretch and back; what follows a gap is an outline of its own.
    parts = stretches(mark)
    x = np.concatenate([[np.nan], *(np.r_[x, x[::-1], np.nan] for x, _, _ in parts)])
    y = np.concatenate([[np.nan], *(np.r_[low, high[::-1], np.nan] for _, low, high in parts)])
    return go.Scatter(
        x=_small(x), y=_small(y), name=mark.name, mode="lines", line={"width": 0},
        fill="toself", fillcolor=mark.colour, opacity=BAND_ALPHA, hoverinfo="skip",
    )  # fmt: skip


def _points(mark: Points) -> go.Scatter:
    errors = None
    if mark.low is not None and mark.high is not None:
        errors = {
            "type": "data",
            "array": (mark.high - mark.y).clip(min=0.0),
            "arrayminus": (mark.y - mark.low).clip(min=0.0),
            "thickness": 1,
        }
    mode = "lines+markers" if mark.joined else "markers"
    style = {"color": mark.colour}
    return go.Scatter(
        x=mark.x, y=mark.y, error_y=errors, name=mark.name, mode=mode, line=style,
        marker={"size": 6},
    )  # fmt: skip


def _bars(mark: Bars) -> go.Bar:
    return go.Bar(x=mark.x, y=mark.y, name=mark.name, marker={"color": mark.colour})


def _heat_map(mark: HeatMap) -> go.Heatmap:
    named = isinstance(mark.x, list)
    return go.Heatmap(
        x=_with_breaks(mark.x) if named else _small(mark.x),
        y=_with_breaks(mark.y) if named else _small(mark.y),
        z=mark.z if mark.z.dtype == np.uint8 else _small(mark.z),
        name=mark.name,
        colorscale=[[0, "#FFFFFF"], [1, mark.colour]],
        zmin=0,
        zmax=1,
        showscale=False,
        showlegend=False,
        text=mark.texts,
        texttemplate="%{text}" if mark.texts else None,
    )


def _spans(mark: Spans) -> go.Scatter:
    x, y = [], []
    for start, end in mark.intervals:
        x += [start, end, None]
        y += [mark.lane + mark.shift, mark.lane + mark.shift, None]
    return go.Scatter(
        x=x or [None],
        y=y or [None],
        name=mark.name,
        mode="lines",
        line={"color": mark.colour, "width": 8},
        legendgroup=mark.name,
        showlegend=None if mark.legend else False,
    )


_TRACES: dict[type, Callable[[Any], Any]] = {
    Line: _line,
    Band: _band,
    Points: _points,
    Bars: _bars,
    HeatMap: _heat_map,
    Spans: _spans,
}
"""How each mark is drawn, but a limit, which is no trace."""


def _with_breaks(names: Iterable[str]) -> list[str]:
    return [name.replace("\n", "<br>") for name in names]


def _small(values: ArrayLike) -> NDArray[np.float32]:
    """Half the page's size, and still far finer than a pixel; what is too large to be one of these
    numbers, beyond 3e38, is drawn no more than what is infinite."""
    with np.errstate(over="ignore"):
        return np.asarray(values, dtype=np.float32)


def table_html(header: Iterable[str], rows: Rows, caption: str = "") -> str:
    """A table; cells are text."""
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in rows)
    title = f"<caption>{html.escape(caption)}</caption>" if caption else ""
    return f'<div class="wide"><table>{title}<tr>{head}</tr>{body}</table></div>'


def _cell(text: str) -> str:
    style = ' class="FAULT"' if text == "FAULT" else ""
    return f"<td{style}>{html.escape(text)}</td>"


def figure_html(figure: Figure) -> str:
    """A figure with its heading and its line of text."""
    return _section(figure.key, figure.title, figure.says) + _data(figure.key, drawn(figure))


def cases_html(cases: list[Figure]) -> str:
    """Figures of which one at a time is chosen and drawn."""
    options = "".join(
        f'<option value="{html.escape(case.key)}">{html.escape(case.title)}</option>'
        for case in cases
    )
    chooser = (
        '<p><label>Case: <select id="case">' + options + "</select></label> "
        '<button id="before" type="button">previous</button> '
        '<button id="next" type="button">next</button></p>'
    )
    data = "".join(_data(case.key, drawn(case)) for case in cases)
    return _section("cases", "Cases", cases[0].says, chooser) + data


def _section(key: str, title: str, says: str, chooser: str = "") -> str:
    return (
        f"<section><h2>{html.escape(title)}</h2><p>{html.escape(says)}</p>{chooser}"
        f'<div class="figure" id="{html.escape(key)}"></div></section>'
    )


def _data(key: str, figure: str) -> str:
    return f'<script type="application/json" data-figure="{html.escape(key)}">{figure}</script>'


def write_page(path: Path, title: str, body: Iterable[str]) -> None:
    """Write a page whole or not at all; `body` is made of the functions above.

    Raises UserError where it cannot be written.
    """
    parts = {
        "TITLE": html.escape(title),
        "PLOTLY": get_plotlyjs(),
        "BODY": "\n".join(body),
        "SCRIPT": _SCRIPT,
    }
    # At once: what is put in may hold the name of a place itself.
    write_text(path, re.sub("%([A-Z]+)%", lambda place: parts[place[1]], _PAGE))


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>%TITLE%</title>
<link rel="icon" href="data:,">
<style>
body { font: 15px/1.4 system-ui, sans-serif; margin: 1.5rem auto; max-width: 1300px;
  padding: 0 1rem; color: #222; background: #fff; }
h1 { font-size: 1.4rem; } h2 { font-size: 1.1rem; margin-top: 2rem; }
table { border-collapse: collapse; margin: 1rem 0; font-size: 13px; }
caption { text-align: left; font-weight: 600; padding: .3rem 0; }
th, td { text-align: left; padding: .25rem .7rem; border-bottom: 1px solid #ddd; }
code { background: #f3f3f3; padding: .1rem .3rem; }
.wide { overflow-x: auto; }
@media (max-width: 900px) { table { font-size: 12px; } th, td { padding: .25rem .3rem; } }
.FAULT { color: #B22222; font-weight: 600; }
</style>
<script>%PLOTLY%</script>
</head><body>
<h1>%TITLE%</h1>
%BODY%
<script>%SCRIPT%</script>
</body></html>
"""

_SCRIPT = """
"use strict";
function draw(place, key) {
  const data = document.querySelector('script[data-figure="' + key + '"]');
  const figure = JSON.parse(data.textContent);
  delete place.dataset.drawn;
  return Plotly.react(place, figure.data, figure.layout, {responsive: true, displaylogo: false})
    .then(() => { place.dataset.drawn = key; });
}
const chooser = document.getElementById("case");
function choose(step) {
  const count = chooser.options.length;
  chooser.selectedIndex = (chooser.selectedIndex + step + count) % count;
  draw(document.getElementById("cases"), chooser.value);
}
if (chooser) {
  chooser.addEventListener("change", () => choose(0));
  document.getElementById("before").addEventListener("click", () => choose(-1));
  document.getElementById("next").addEventListener("click", () => choose(1));
}
(async () => {
  for (const place of document.querySelectorAll(".figure")) {
    await draw(place, place.id === "cases" ? chooser.value : place.id);
  }
})();
"""
