"""What a figure shows, independent of how it is drawn: for the page and for files alike."""

from dataclasses import dataclass, field

import numpy as np

from lfd_mpc.arrays import Array

Interval = tuple[float, float]

COLOURS = {
    "clearance": "#0072B2",
    "relative_velocity": "#D55E00",
    "acceleration": "#009E73",
    "radar": "#CC79A7",
}
"""Okabe and Ito's palette: told apart by colour-blind readers too."""

SERIES = (
    "#0072B2",
    "#D55E00",
    "#009E73",
    "#CC79A7",
    "#56B4E9",
    "#000000",
    "#E69F00",
    "#7F7F7F",
)
"""Colours of series that are no signals, in this order."""

GREY, DARK = "#999999", "#444444"
SHADES = ("#D0D0D0", "#B8B8B8", "#A0A0A0", "#888888", "#606060", "#303030")
"""Of one kind of line, from the first one on; later ones lie on top."""

INJECTED = "#E6B800"
FAULTY, SUSPECTED, SILENT, UNJUDGED = "#B22222", "#F0A090", "#7A3FA0", "#D9D9D9"

BAND_ALPHA = 0.35
"""How much of the paper a band covers."""

POINTS = 2000
"""A line is thinned to about so many points: finer than a screen, and small enough for a page."""


@dataclass(frozen=True)
class Line:
    """`y` (n,) over `x` (n,); NaN interrupts it. `legend`: whether it has an entry of its own."""

    name: str
    x: Array
    y: Array
    colour: str
    width: float = 1.2
    dashed: bool = False
    legend: bool = True


@dataclass(frozen=True)
class Band:
    """The ground between `low` and `high` (n,) over `x` (n,); NaN interrupts it."""

    name: str
    x: Array
    low: Array
    high: Array
    colour: str


@dataclass(frozen=True)
class Points:
    """Points with error bars from `low` to `high` (n,), joined by a line."""

    name: str
    x: Array
    y: Array
    colour: str
    low: Array | None = None
    high: Array | None = None
    joined: bool = True


@dataclass(frozen=True)
class Bars:
    """Bars of height `y` (n,) at `x` (n,)."""

    name: str
    x: Array
    y: Array
    colour: str


@dataclass(frozen=True)
class HeatMap:
    """`z` (len(y), len(x)) from white (0) to `colour` (1); `texts` of the same shape, or none."""

    name: str
    x: Array | list[str]
    y: Array | list[str]
    z: Array
    colour: str
    texts: list[list[str]] | None = None


@dataclass(frozen=True)
class Spans:
    """Thick lines from start to end of each interval, in a lane of the panel."""

    name: str
    intervals: list[Interval]
    lane: int
    shift: float
    colour: str
    legend: bool


@dataclass(frozen=True)
class Limit:
    """A dashed line across the panel."""

    y: float
    colour: str


Mark = Line | Band | Points | Bars | HeatMap | Spans | Limit


@dataclass(frozen=True)
class Panel:
    """One set of axes.

    `shaded`: intervals of x with a coloured ground; `lanes`: names on y; `x_ticks`: where the
    x axis is labelled, if not anywhere.
    """

    title: str
    x_label: str
    y_label: str
    marks: list[Mark]
    shaded: list[Interval] = field(default_factory=list)
    lanes: list[str] = field(default_factory=list)
    x_ticks: list[float] = field(default_factory=list)
    log_x: bool = False
    log_y: bool = False
    y_range: Interval | None = None
    height: float = 1.0


@dataclass(frozen=True)
class Figure:
    """Panels below each other, or in `columns`; `says` is the line that tells what is seen."""

    key: str
    title: str
    says: str
    panels: list[Panel]
    columns: int = 1

    @property
    def row_heights(self) -> list[float]:
        """Height of each row of panels, as a share of an ordinary one's."""
        rows = range(0, len(self.panels), self.columns)
        return [max(p.height for p in self.panels[k : k + self.columns]) for k in rows]


def stretches(band: Band) -> list[tuple[Array, Array, Array]]:
    """What a band is drawn of: x, low and high of each stretch without NaN, thinned to their
    extremes."""
    there = np.isfinite(band.low) & np.isfinite(band.high)
    edges = np.flatnonzero(np.diff(there.astype(np.int8), prepend=0, append=0))
    width = -(-len(band.x) // POINTS)
    found = []
    for start, end in edges.reshape(-1, 2):
        # With its end, without which a short one would be no wider than a point.
        first = np.append(np.arange(start, end - 1, width), end - 1)
        low = np.minimum.reduceat(band.low[:end], first)
        high = np.maximum.reduceat(band.high[:end], first)
        found.append((band.x[first], low, high))
    return found


def thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """A long line with fewer points: of each stretch the extremes, and the ends of its first and
    its last part between gaps. A gap stays one, and a part that is shorter than a stretch does not
    shrink to a point, of which nothing would be drawn."""
    stretch = -(-len(x) // (POINTS // 4))
    if stretch < 5:
        return x, y
    count = len(x) // stretch
    rows = y[: count * stretch].reshape(count, stretch)
    finite = np.isfinite(rows)
    begins, ends = finite.copy(), finite.copy()
    begins[:, 1:] &= ~finite[:, :-1]
    ends[:, :-1] &= ~finite[:, 1:]
    chosen = [
        np.where(finite, rows, np.inf).argmin(axis=1),
        np.where(finite, rows, -np.inf).argmax(axis=1),
        *(part.argmax(axis=1) for part in (begins, ends)),
        *(stretch - 1 - part[:, ::-1].argmax(axis=1) for part in (begins, ends)),
    ]
    inside = (np.arange(count) * stretch + np.array(chosen))[:, finite.any(axis=1)]
    keep = np.unique(np.concatenate([inside.ravel(), np.arange(count * stretch, len(x))]))
    # What is kept goes on to the next gap at most; the axis is as long as all of it.
    gaps = np.flatnonzero(~np.isfinite(y))
    following = np.searchsorted(gaps, keep)
    after = gaps[following[following < len(gaps)]]
    keep = np.unique(np.concatenate([keep, after, [0, len(x) - 1]]))
    return x[keep], y[keep]
