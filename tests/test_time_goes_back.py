"""What a subscriber sees after time went back, as in a looped recording."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from lfd_diagnosis.verdict import Event, State
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, LEAD_ACCELERATION, RadarSample, ScalarSample
from lfd_replay.offline import GraphStep, OfflineGraph
from lfd_replay.profiles import graph_settings

SECOND = 1_000_000_000


class Player:
    """A car that follows a lead at rest relative to it, all the sensors of it, from any time on."""

    def __init__(self, profile: str) -> None:
        self.graph, self.random = OfflineGraph(graph_settings(profile)), np.random.default_rng(1)

    def noise(self, deviation: float) -> float:
        return deviation * float(self.random.standard_normal())

    def samples(
        self, begin: float, seconds: float, lead: Callable[[float], tuple[float, int]]
    ) -> Iterator[RadarSample | ScalarSample]:
        """`lead`: clearance in m and id of the track at a time in s after the beginning."""
        for k in range(round(100 * seconds)):
            stamp = round((begin + 0.01 * k) * SECOND)
            if k % 5 == 0:
                clearance, track = lead(0.01 * k)
                said = clearance + self.noise(0.05), self.noise(0.02)
                yield RadarSample(stamp, True, *said, track)
                yield ScalarSample(LEAD_ACCELERATION, stamp, self.noise(0.05))
            if k % 2 == 0:
                yield ScalarSample(HOST_SPEED, stamp, 20.0 + self.noise(0.01))
            yield ScalarSample(ACCELERATION, stamp, self.noise(0.05))

    def play(
        self, begin: float, seconds: float, lead: Callable[[float], tuple[float, int]]
    ) -> list[GraphStep]:
        return list(self.graph.run(self.samples(begin, seconds, lead)))


def events_of(steps: list[GraphStep], signal: str) -> list[Event]:
    return [e for step in steps for e in step.outcome.events if e.signal == signal]


def test_an_offset_that_ended_before_excuses_none_after_it() -> None:
    player = Player("robust")

    def carried_over(t: float) -> tuple[float, int]:
        if t < 12.0:
            return 30.0 + 4.0 * (t > 10.0), 1
        return 64.0, 2

    first = player.play(1000.0, 25.0, carried_over)
    states = [event.fault.state for event in events_of(first, "clearance")]
    assert states[-2:] == [State.FAULT, State.OK]
    second = player.play(950.0, 20.0, lambda t: (40.0 - 4.0 * (12.0 < t < 16.0), 1))
    told = [(e.fault.state, e.stamp / SECOND - 950.0) for e in events_of(second, "clearance")]
    faults = [at for state, at in told if state == State.FAULT]
    assert faults == [pytest.approx(12.1, abs=0.06)]
    assert told[-1] == (State.OK, pytest.approx(16.5, abs=0.3))


@pytest.mark.parametrize("profile", ["robust", "paper"])
def test_no_state_lasts_since_a_time_to_come(profile: str) -> None:
    player = Player(profile)
    back = [
        *player.play(100.0, 4.0, lambda t: (30.0, 1)),
        *player.play(50.0, 3.0, lambda t: (30.0, 1)),
    ]
    assert back[-1].outcome.report.stamp < 53 * SECOND
    for step in back:
        report = step.outcome.report
        verdicts = [
            getattr(report, name)
            for name in ("clearance", "relative_velocity", "radar", "acceleration")
        ] + [report.host_speed, report.lead_acceleration]
        assert all(verdict.since <= report.stamp for verdict in verdicts)
        assert all(event.old_since <= event.stamp for event in step.outcome.events)
