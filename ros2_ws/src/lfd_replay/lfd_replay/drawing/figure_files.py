"""Figures as files for papers and slides."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure as Canvas

from lfd_replay.drawing.figures import (
    BAND_ALPHA,
    INJECTED,
    Band,
    Bars,
    Figure,
    HeatMap,
    Limit,
    Line,
    Mark,
    Panel,
    Points,
    Spans,
    stretches,
    thinned,
)

WIDTH, HEIGHT = 9.0, 1.9
"""Of a figure, and of one row of panels, in inches."""

LEGEND_COLUMNS, BESIDE_TITLE = 6, 3
"""Names that a figure is wide enough for, in a shared legend and beside a panel's title."""


def write_figure(figure: Figure, folder: Path) -> Path:
    """Draw a figure into `FOLDER/KEY.png` and return its path."""
    heights = figure.row_heights
    rows = len(heights)
    tall = 1.6 if figure.columns > 1 or rows == 1 else 1.0
    canvas = Canvas(figsize=(WIDTH, HEIGHT * tall * sum(heights) + 0.5), layout="constrained")
    FigureCanvasAgg(canvas)
    canvas.suptitle(figure.title, fontsize=10)
    share = figure.columns == 1 and rows > 1
    axes = canvas.subplots(
        rows, figure.columns, squeeze=False, sharex=share, height_ratios=heights
    ).ravel()
    for place, panel in zip(axes, figure.panels, strict=False):
        _draw(place, panel, last=not share or panel is figure.panels[-1])
        if figure.columns == 1:
            _legend(place)
    for place in axes[len(figure.panels) :]:
        place.set_visible(False)
    if figure.columns > 1:
        # Narrow panels share one legend below.
        entries = {
            name: handle
            for place in axes
            for handle, name in zip(*place.get_legend_handles_labels(), strict=True)
        }
        if len(entries) > 1:
            canvas.legend(
                entries.values(),
                entries.keys(),
                loc="outside lower center",
                fontsize=7,
                frameon=False,
                ncols=min(len(entries), LEGEND_COLUMNS),
            )
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{figure.key}.png"
    canvas.savefig(path, dpi=130)
    return path


def _draw(axes: Axes, panel: Panel, last: bool) -> None:
    axes.set_title(panel.title, fontsize=8, loc="left")
    axes.tick_params(labelsize=7)
    if last:
        axes.set_xlabel(panel.x_label, fontsize=7)
    axes.set_ylabel(panel.y_label, fontsize=7)
    axes.spines[["top", "right"]].set_visible(False)
    for start, end in panel.shaded:
        axes.axvspan(start, end, color=INJECTED, alpha=0.18, lw=0)
    for mark in panel.marks:
        _mark(axes, mark)
    if panel.log_x:
        axes.set_xscale("log")
    if panel.log_y:
        axes.set_yscale("log")
    if panel.x_ticks:
        axes.set_xticks(panel.x_ticks, [f"{tick:g}" for tick in panel.x_ticks])
        axes.set_xticks([], minor=True)
    if panel.y_range:
        axes.set_ylim(*panel.y_range)
    if panel.lanes:
        axes.set_yticks(range(len(panel.lanes)), panel.lanes)
        axes.set_ylim(-0.5, len(panel.lanes) - 0.5)


def _legend(axes: Axes) -> None:
    """Above the panel, where it hides no line."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > 1:
        axes.legend(
            handles,
            labels,
            loc="lower right",
            bbox_to_anchor=(1.0, 1.0),
            borderaxespad=0.1,
            fontsize=6,
            frameon=False,
            ncols=min(len(labels), BESIDE_TITLE),
        )


def _mark(axes: Axes, mark: Mark) -> None:
    if isinstance(mark, Line):
        x, y = thinned(mark.x, mark.y)
        style = "--" if mark.dashed else "-"
        text = mark.name if mark.legend else None
        axes.plot(x, y, style, color=mark.colour, lw=0.7 * mark.width, label=text)
    elif isinstance(mark, Band):
        for x, low, high in stretches(mark):
            axes.fill_between(x, low, high, color=mark.colour, alpha=BAND_ALPHA, lw=0)
        axes.fill_between([], [], color=mark.colour, alpha=BAND_ALPHA, lw=0, label=mark.name)
    elif isinstance(mark, Points):
        errors = None
        if mark.low is not None and mark.high is not None:
            errors = np.vstack([mark.y - mark.low, mark.high - mark.y]).clip(min=0.0)
        axes.errorbar(
            mark.x,
            mark.y,
            yerr=errors,
            color=mark.colour,
            fmt="o-" if mark.joined else "o",
            ms=3,
            lw=1,
            label=mark.name,
        )
    elif isinstance(mark, Bars):
        width = 0.9 * (mark.x[1] - mark.x[0]) if len(mark.x) > 1 else 1.0
        axes.bar(mark.x, mark.y, width=width, color=mark.colour, label=mark.name)
    elif isinstance(mark, HeatMap):
        _heat_map(axes, mark)
    elif isinstance(mark, Spans):
        style = {"color": mark.colour, "lw": 5, "solid_capstyle": "butt"}
        for start, end in mark.intervals:
            lane = mark.lane + mark.shift
            axes.plot([start, end], [lane, lane], **style)
        if mark.legend:
            axes.plot([], [], label=mark.name, **style)
    elif isinstance(mark, Limit):
        axes.axhline(mark.y, color=mark.colour, ls="--", lw=0.8)


def _heat_map(axes: Axes, mark: HeatMap) -> None:
    shades = LinearSegmentedColormap.from_list(mark.name, ["#FFFFFF", mark.colour])
    named = isinstance(mark.x, list)
    x = np.arange(len(mark.x)) if named else mark.x
    y = np.arange(len(mark.y)) if named else mark.y
    axes.pcolormesh(x, y, mark.z, cmap=shades, vmin=0, vmax=1, shading="nearest")
    if named:
        axes.set_xticks(x, mark.x, fontsize=6)
        axes.set_yticks(y, mark.y, fontsize=6)
    for row, texts in enumerate(mark.texts or []):
        for column, text in enumerate(texts):
            colour = "white" if mark.z[row, column] > 0.5 else "black"
            axes.text(column, row, text, ha="center", va="center", fontsize=7, color=colour)
