"""Layouts of PlotJuggler and Foxglove: the same plots in both, made from one table."""

import json
from pathlib import Path
from xml.etree import ElementTree

COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd")

PLOTS: dict[str, dict[str, str]] = {
    "clearance in m": {
        "/radar/target": "clearance",
        "/diagnosis/reconstructed": "clearance",
    },
    "relative velocity in m/s": {
        "/radar/target": "relative_velocity",
        "/diagnosis/reconstructed": "relative_velocity",
    },
    "acceleration in m/s^2": {
        "/vehicle/imu": "linear_acceleration.x",
        "/diagnosis/reconstructed": "acceleration",
    },
    "state": {"/diagnosis/faults": "clearance.state relative_velocity.state acceleration.state"},
    "confidence": {
        "/diagnosis/faults": "clearance.confidence relative_velocity.confidence "
        "acceleration.confidence"
    },
    "fault index": {
        "/diagnosis/faults": "clearance.index relative_velocity.index acceleration.index"
    },
}
"""Title of each plot, and the fields of topics in it."""


def curves(plot: str) -> list[tuple[str, str]]:
    """Topic and field of each curve of a plot."""
    return [(topic, field) for topic, names in PLOTS[plot].items() for field in names.split()]


def plotjuggler_layout() -> str:
    """The layout as PlotJuggler reads it."""
    root = ElementTree.Element("root")
    tabs = ElementTree.SubElement(root, "tabbed_widget", name="Main Window", parent="main_window")
    tab = ElementTree.SubElement(tabs, "Tab", tab_name="fault diagnosis", containers="1")
    share = f"{1.0 / len(PLOTS):.4f}"
    splitter = ElementTree.SubElement(
        ElementTree.SubElement(tab, "Container"),
        "DockSplitter",
        orientation="-",
        sizes=";".join([share] * len(PLOTS)),
        count=str(len(PLOTS)),
    )
    for title in PLOTS:
        area = ElementTree.SubElement(splitter, "DockArea", name=title)
        plot = ElementTree.SubElement(
            area, "plot", style="Lines", mode="TimeSeries", flip_x="false", flip_y="false"
        )
        ElementTree.SubElement(plot, "limitY")
        for (topic, field), colour in zip(curves(title), COLOURS, strict=False):
            name = f"{topic}/{field.replace('.', '/')}"
            ElementTree.SubElement(plot, "curve", name=name, color=colour)
    ElementTree.SubElement(tabs, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def foxglove_layout() -> str:
    """The layout as Foxglove reads it."""
    panels: dict[str, dict] = {}
    for number, title in enumerate(PLOTS):
        panels[f"Plot!{number}"] = {
            "foxglovePanelTitle": title,
            "xAxisVal": "timestamp",
            "isSynced": True,
            "showLegend": True,
            "paths": [
                {
                    "value": f"{topic}.{field}",
                    "enabled": True,
                    "timestampMethod": "headerStamp",
                    "color": colour,
                }
                for (topic, field), colour in zip(curves(title), COLOURS, strict=False)
            ],
        }
    panels["RawMessages!events"] = {"topicPath": "/diagnosis/events", "diffEnabled": False}
    return (
        json.dumps(
            {
                "configById": panels,
                "globalVariables": {},
                "userNodes": {},
                "playbackConfig": {"speed": 1},
                "layout": _stacked(list(panels)),
            },
            indent=1,
        )
        + "\n"
    )


def _stacked(names: list[str]) -> str | dict:
    """Panels one below the other, all of the same height."""
    if len(names) == 1:
        return names[0]
    return {
        "direction": "column",
        "splitPercentage": round(100.0 / len(names), 2),
        "first": names[0],
        "second": _stacked(names[1:]),
    }


LAYOUTS = {"plotjuggler.xml": plotjuggler_layout, "foxglove.json": foxglove_layout}
"""Files in the folder `layouts`."""


def write_layouts(folder: Path) -> None:
    """Write them, for `make parameters`."""
    folder.mkdir(exist_ok=True)
    for name, make in LAYOUTS.items():
        (folder / name).write_text(make())
