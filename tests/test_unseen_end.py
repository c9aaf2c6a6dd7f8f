"""Where the end of a fault that nobody saw leaves the slope."""

import pytest

from lfd_diagnosis.acceleration_state import ACCELERATION, start_acceleration
from lfd_diagnosis.evidence import Ground, set_check
from lfd_diagnosis.ring import append
from lfd_diagnosis.settings import DiagnosisSettings
from lfd_diagnosis.unseen_end import take_for_slope
from lfd_diagnosis.verdict import Kind
from lfd_mpc.compiled import make_state
from lfd_mpc.settings import settings_record


@pytest.mark.parametrize("reference", [0.13, 0.61])
def test_the_slope_is_what_is_felt_by_then_whatever_the_fault_was_counted_from(
    reference: float,
) -> None:
    """A drift of 1.7 m/s^2 from a slope of 0.13, also where a moment ago 0.61 was felt."""
    monitor = make_state(ACCELERATION)[0]
    start_acceleration(monitor, settings_record(DiagnosisSettings())[0])
    monitor["slope"], monitor["difference"], monitor["filtered"] = 0.13, 1.83, 2.0
    for _ in range(20):
        append(monitor["samples"], 2.0)
    set_check(monitor["check"], Ground.HOST_SPEED, 1.7, 1.3, Kind.OFFSET, reference)
    take_for_slope(monitor)
    assert monitor["slope"] == pytest.approx(1.83)
