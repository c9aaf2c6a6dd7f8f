"""The paper's figures from data: what each one shows, and the line that says so."""

from dataclasses import replace

import numpy as np

from lfd_diagnosis.settings import DiagnosisSettings
from lfd_mpc.arrays import Array
from lfd_mpc.prediction_model import build_prediction_model
from lfd_mpc.settings import STEP_S, MpcSettings
from lfd_replay.drawing.figures import (
    COLOURS,
    DARK,
    SERIES,
    Bars,
    Figure,
    HeatMap,
    Line,
    Mark,
    Panel,
    Points,
)
from lfd_replay.drawing.panels import (
    TIME,
    UNITS,
    Recording,
    acceleration_panel,
    contour_panels,
    index_panel,
    label,
    measured_panel,
    output_error_panel,
    verdict_panel,
)
from lfd_replay.evaluation.detectors import is_at_equal
from lfd_replay.evaluation.trace import JUDGED


def case_figure(
    key: str,
    title: str,
    recording: Recording,
    injected: dict[str, tuple[Array, Array]],
    settings: DiagnosisSettings,
) -> Figure:
    """Panels (a) to (f) of Figs 14 to 24.

    `injected`: for each signal, times in s and what the fault added there.
    """
    faults = Panel(
        "injected fault signals",
        TIME,
        "m, m/s, m/s²",
        [
            Line(f"{label(signal)}, injected", *injected[signal], COLOURS[signal])
            for signal in JUDGED
        ],
        height=0.8,
    )
    panels = {
        "a": [faults],
        "b": [output_error_panel(recording)],
        "c": contour_panels(recording, settings),
        "d": [acceleration_panel(recording)],
        "e": [index_panel(recording)],
        "f": [verdict_panel(recording)],
    }
    lettered = [
        replace(panel, title=f"({letter}) {panel.title}")
        for letter, own in panels.items()
        for panel in own
    ]
    says = (
        "From top to bottom: what was added to the signals; how far the observers are off; which "
        "of the 20 stored predictions exclude the measurement; the host's acceleration between "
        "the limits of all observers; the indices with their thresholds (dashed); and the verdict."
    )
    return Figure(key, title, says, lettered)


def eigenvalue_figure(settings: MpcSettings) -> Figure:
    """Fig 5."""
    values = build_prediction_model(settings).eigenvalues
    points = Points("eigenvalues", values, np.zeros(len(values)), SERIES[0], joined=False)
    says = (
        f"All {len(values)} eigenvalues are real and positive, from {values[0]:.4f} to "
        f"{values[-1]:.2f}: the quadratic program has one solution."
    )
    panel = Panel("eigenvalues of P", "real part", "imaginary part", [points], log_x=True)
    return Figure("fig-5", "Eigenvalues of P (Fig 5)", says, [panel])


def mpc_figure(key: str, title: str, recording: Recording) -> Figure:
    """Figs 6 and 18: velocities, the controller's acceleration, and its predictions."""
    time = recording.time
    host = recording.horizon("host_speed")
    lead = host + recording.horizon("relative_velocity")
    panels = [
        Panel(
            "velocities",
            TIME,
            "m/s",
            [Line("lead", time, lead, SERIES[1]), Line("host", time, host, SERIES[0])],
        ),
        Panel(
            "acceleration: what the controller wants, and what the driver does",
            TIME,
            "m/s²",
            [
                Line("wanted by the controller", time, recording.horizon("command"), SERIES[4]),
                Line(
                    "host, measured",
                    time,
                    recording.horizon("acceleration"),
                    COLOURS["acceleration"],
                ),
            ],
        ),
        measured_panel(recording, "clearance", "m"),
        measured_panel(recording, "relative_velocity", "m/s"),
    ]
    says = (
        "The controller plans from the measured state at each step. The car is not driven by it "
        "here, so what it would do differently from the driver comes back as prediction error."
    )
    return Figure(key, title, says, panels)


def reconstruction_figure(key: str, title: str, recording: Recording) -> Figure:
    """Fig 8: the relative acceleration that the first observer reconstructs."""
    time = recording.time
    reconstructed = recording.bank("relative_acceleration")[:, 0]
    velocity = recording.horizon("relative_velocity")
    half = round(0.5 / STEP_S)
    # Only to compare with: it looks half a second ahead, which the observer cannot.
    differentiated = np.full(len(velocity), np.nan)
    differentiated[half:-half] = (velocity[2 * half :] - velocity[: -2 * half]) / (
        2 * half * STEP_S
    )
    panels = [
        Panel(
            "relative acceleration",
            TIME,
            "m/s²",
            [
                Line("reconstructed by the observer", time, reconstructed, SERIES[0], 0.8),
                Line("relative velocity, differentiated over 1 s", time, differentiated, SERIES[1]),
            ],
        ),
        Panel(
            "output error of the observer",
            TIME,
            "m + m/s",
            [Line("output error", time, recording.bank("output_error")[:, 0], DARK, 0.8)],
        ),
    ]
    off = np.sqrt(np.nanmean((reconstructed - differentiated) ** 2))
    says = (
        f"The equivalent injection follows the relative acceleration; it differs from the "
        f"derivative, taken afterwards, by {off:.2f} m/s² rms, most of it the injection's ripple."
    )
    return Figure(key, title, says, panels)


def limits_figure(key: str, title: str, recording: Recording) -> Figure:
    """Fig 9: the limits of one observer, and of all."""
    single = acceleration_panel(recording, observers=1)
    several = acceleration_panel(recording)
    says = (
        "One observer gives one pair of limits; those fed with earlier predictions add a pair "
        "each, and the index is the weighted share of pairs that exclude the acceleration."
    )
    return Figure(
        key,
        title,
        says,
        [
            replace(single, title="(a) single observer"),
            replace(several, title="(b) all observers"),
        ],
    )


def index_histograms(values: dict[str, Array], zero_share: dict[str, float]) -> Figure:
    """Figs 11 and 12: the indices of normal driving that are not zero; `values` by signal."""
    edges = np.linspace(0.0, 1.0, 21)
    panels = []
    for signal in JUDGED:
        counts, _ = np.histogram(values[signal], bins=edges)
        share = counts / max(counts.sum(), 1)
        centres = (edges[1:] + edges[:-1]) / 2
        panels.append(
            Panel(
                f"{label(signal)}: zero {zero_share[signal]:.1%} of the time",
                "index",
                "share of those above zero",
                [Bars(label(signal), centres, share, COLOURS[signal])],
            )
        )
    says = (
        f"In fault-free driving all three indices are zero {zero_share['all']:.1%} of the time "
        "(the paper: about 94 %); the bars are what remains."
    )
    return Figure("fig-11-12", "Fault indices of normal driving (Figs 11, 12)", says, panels, 3)


def detector_curves(rows: list[dict], figure: str) -> Figure:
    """Detection rate or delay against the size of an offset, one line per detector.

    `rows` as in `summary.json`; `figure` is `rate` or `delay`.
    """
    if figure == "rate":
        columns = "size", "detected", "detected_low", "detected_high"
        title, y_label = "How many faults are found, against their size", "share of windows found"
        says = "Share of 4 s windows in which a detector raised a fault of the injected signal."
    else:
        columns = "size", "delay_s", "delay_low_s", "delay_high_s"
        title, y_label = "How soon faults are found, against their size", "delay (s)"
        says = "Median delay of those that were found; where few are found it means little."
    says += (
        " All detectors but the published one are set to the same number of false events on the "
        "normal drives. Bars are 95 % intervals."
    )
    offsets = [r for r in rows if r["kind"] == "offset" and len(r["injected"]) == 1]
    # Those set to equal false events are in the table.
    names = list(dict.fromkeys(r["name"] for r in offsets if not is_at_equal(r["name"])))
    panels = [
        Panel(
            label(signal),
            f"offset ({UNITS[signal]})",
            y_label,
            _curves([row for row in offsets if row["signal"] == signal], names, columns),
            log_x=True,
            log_y=figure == "delay",
            x_ticks=sorted({row["size"] for row in offsets if row["signal"] == signal}),
            y_range=(-0.05, 1.05) if figure == "rate" else None,
        )
        for signal in JUDGED
    ]
    return Figure(f"detector-{figure}", title, says, panels, 3)


def _curves(rows: list[dict], names: list[str], columns: tuple[str, str, str, str]) -> list[Mark]:
    """One curve per name; `columns`: of the size, and of the value, low and high to draw."""
    marks: list[Mark] = []
    for number, name in enumerate(names):
        own = [row for row in rows if row["name"] == name and row[columns[1]] is not None]
        own.sort(key=lambda row: row["size"])
        if own:
            # Side by side, so that intervals do not hide each other.
            shift = 1.0 + 0.03 * (number - len(names) / 2)
            size, value, low, high = (np.array([row[c] for row in own]) for c in columns)
            marks.append(Points(name, size * shift, value, SERIES[number], low, high))
    return marks


def confusion_figure(matrices: dict[str, dict[str, dict[str, int]]]) -> Figure:
    """Fault injected against fault reported, in windows, for each detector."""
    panels = []
    for name, matrix in matrices.items():
        if is_at_equal(name):
            continue
        counts = np.array([list(row.values()) for row in matrix.values()], dtype=float)
        total = counts.sum(axis=1, keepdims=True)
        panels.append(
            Panel(
                name,
                "reported",
                "injected",
                [
                    HeatMap(
                        "share of the row",
                        [_broken(text) for text in matrix],
                        list(reversed(list(matrix))),
                        np.divide(counts, total, where=total > 0, out=np.zeros_like(counts))[::-1],
                        SERIES[0],
                        [[f"{c:.0f}" for c in row] for row in counts[::-1]],
                    )
                ],
            )
        )
    says = (
        "Windows of the paper's fault sizes, by what was injected (rows) and what was reported "
        "(columns) within them; on the diagonal both agree."
    )
    return Figure("confusion", "Isolation: injected against reported", says, panels, 2)


def _broken(text: str) -> str:
    return text.replace(" and ", " and\n").replace("relative velocity", "relative\nvelocity")
