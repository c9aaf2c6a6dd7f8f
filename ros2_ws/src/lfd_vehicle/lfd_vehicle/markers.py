"""Markers for RViz: both cars of the simulated world as they really are."""

from builtin_interfaces.msg import Time
from visualization_msgs.msg import Marker, MarkerArray

from lfd_diagnosis.markers import CAR, GREY, as_car, new_marker
from lfd_vehicle.sensing import Moment

FRAME = "radar"
"""Origin at the host's front bumper, x forward."""

HOST = (0.2, 0.4, 0.9)


def markers(moment: Moment, stamp: Time) -> MarkerArray:
    """What really is at one step, in m; the host's box is pitched as its body is."""
    lead = as_car(new_marker(FRAME, stamp, 0, "lead", Marker.CUBE), moment.clearance, GREY, 0.9)
    host = as_car(new_marker(FRAME, stamp, 1, "host", Marker.CUBE), -CAR[0], HOST, 0.9)
    # Small angles: half of the rotation about y, nose up.
    host.pose.orientation.y = -0.5 * moment.pitch
    return MarkerArray(markers=[lead, host])
