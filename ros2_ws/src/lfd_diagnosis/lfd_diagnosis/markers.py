"""Markers for RViz: the lead as measured and as reconstructed, its limits, and the verdicts."""

from math import isfinite

from builtin_interfaces.msg import Time
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from lfd_diagnosis.verdict import COVERS, SIGNALS, Outcome, State
from lfd_mpc.horizon import Horizon

CAR = (4.5, 1.8, 1.5)
"""Length, width and height in m of a car that is drawn."""

MARKER_STEPS = 5
"""Steps between two pictures."""

GREY = (0.5, 0.5, 0.5)

COLOURS = {
    State.FAULT: (0.85, 0.1, 0.1),
    State.NO_DATA: (0.5, 0.25, 0.65),
    State.SUSPECT: (0.95, 0.7, 0.1),
    State.NOT_READY: GREY,
    State.OK: (0.2, 0.7, 0.3),
    State.NO_TARGET: (0.5, 0.65, 0.75),
}
"""Colours of all states, the worst first; an empty road is no worse than a sensor that is OK."""


def new_marker(frame: str, stamp: Time, number: int, name: str, kind: int) -> Marker:
    """A marker that vanishes when it is not renewed."""
    marker = Marker(ns=name, id=number, type=kind, action=Marker.ADD)
    marker.header.frame_id, marker.header.stamp = frame, stamp
    marker.pose.orientation.w = 1.0
    # What is not renewed vanishes: a verdict of a dead node must not stay on the screen.
    marker.lifetime.nanosec = 500_000_000
    return marker


def as_car(
    marker: Marker, clearance: float, colour: tuple[float, float, float], alpha: float
) -> Marker:
    """Make a marker a car whose rear is at `clearance` (m), `alpha` opaque."""
    marker.pose.position.x = clearance + CAR[0] / 2.0
    marker.pose.position.z = CAR[2] / 2.0
    marker.scale.x, marker.scale.y, marker.scale.z = CAR
    marker.color = colour_of(colour, alpha)
    return marker


def colour_of(colour: tuple[float, float, float], alpha: float) -> ColorRGBA:
    """A colour of a marker."""
    return ColorRGBA(r=colour[0], g=colour[1], b=colour[2], a=alpha)


def markers(horizon: Horizon, outcome: Outcome, frame: str, stamp: Time) -> MarkerArray:
    """What is known at one step, in a frame whose origin is the radar, x forward, in m."""
    report, made = outcome.report, outcome.reconstruction
    array = MarkerArray()
    if isfinite(horizon.measured_clearance):
        marker = new_marker(frame, stamp, 0, "lead as measured", Marker.CUBE)
        colour = COLOURS[report.clearance.state]
        array.markers.append(as_car(marker, horizon.measured_clearance, colour, 0.9))
    if made.clearance_valid:
        marker = new_marker(frame, stamp, 1, "lead as reconstructed", Marker.CUBE)
        array.markers.append(as_car(marker, made.clearance, (0.2, 0.4, 0.9), 0.4))
        limits = new_marker(frame, stamp, 2, "95 % of the reconstruction", Marker.CUBE)
        limits.pose.position.x = made.clearance
        limits.scale.x = max(2.0 * COVERS * made.clearance_std, 0.01)
        limits.scale.y, limits.scale.z = 2.0 * CAR[1], 0.05
        limits.color = colour_of((0.2, 0.4, 0.9), 0.5)
        array.markers.append(limits)
    words = new_marker(frame, stamp, 3, "verdicts", Marker.TEXT_VIEW_FACING)
    words.pose.position.z = 3.0
    words.scale.z = 0.6
    verdicts = {name: getattr(report, name) for name in SIGNALS}
    states = {verdict.state for verdict in verdicts.values()}
    worst = next(state for state in COLOURS if state in states)
    words.color = colour_of(COLOURS[worst], 1.0)
    words.text = "\n".join(
        f"{name}: {verdict.state.name} {verdict.confidence}/{verdict.confidence_threshold}"
        for name, verdict in verdicts.items()
    )
    array.markers.append(words)
    return array
