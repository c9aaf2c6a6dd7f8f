"""Which of many tracks is the lead."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from math import inf, isnan, nan
from pathlib import Path

import numpy as np
import pytest

from lfd_mpc.samples import RadarSample
from lfd_replay.recordings.lead_selection import CONFIRMED, PATIENCE_NS, LeadSelector, Track

SCAN_NS = 50_000_000


class Drive:
    """Feeds scans to a selector."""

    def __init__(self, **host) -> None:
        self.counts: Counter[str] = Counter()
        self.selector, self.host, self.stamp = LeadSelector(self.counts), host, 0

    def see(self, *tracks: Track, times: int = 1, **more) -> RadarSample:
        for _ in range(times):
            self.stamp += SCAN_NS
            sample = self.selector.select(self.stamp, tracks, **{**self.host, **more})
        return sample


def track(number: int, clearance: float, lateral: float = 0.0, rate: float = 0.0, **more) -> Track:
    return Track(number, clearance, lateral, rate, **more)


def test_the_nearest_track_in_the_path_is_the_lead() -> None:
    drive = Drive()
    sample = drive.see(track(1, 60), track(2, 40), track(3, 20, 3.5), times=5)
    assert sample.has_target and sample.clearance == 40 and sample.track_id == 1


def test_a_road_without_a_track_is_empty() -> None:
    sample = Drive().see(track(1, 20, 5.0), times=5)
    assert not sample.has_target and isnan(sample.clearance) and sample.track_id == -1
    assert not Drive().see().has_target


def test_clutter_of_one_or_two_scans_is_no_lead() -> None:
    drive = Drive()
    drive.see(track(1, 40), times=5)
    assert drive.see(track(1, 40), track(9, 12), times=CONFIRMED - 1).clearance == 40
    assert drive.see(track(1, 40)).clearance == 40
    assert drive.see(track(1, 40), track(9, 12)).track_id == 1


def test_a_car_that_cuts_in_is_another_lead() -> None:
    drive = Drive()
    first = drive.see(track(1, 40), times=5)
    second = drive.see(track(1, 40), track(2, 20), times=CONFIRMED)
    assert second.clearance == 20 and second.track_id != first.track_id
    assert drive.see(track(1, 40), times=20).track_id not in (first.track_id, second.track_id)


def test_duplicates_of_one_car_do_not_swap() -> None:
    drive = Drive()
    drive.see(track(1, 40.0), times=5)
    seen = {drive.see(track(1, 40.0), track(2, 39.2)).clearance for _ in range(10)}
    assert seen == {40.0}
    sample = drive.see(track(2, 39.4), times=3)
    assert sample.track_id == 1 and sample.clearance == 39.4, "the same car under another number"


@pytest.mark.parametrize("number", [nan, inf, -inf, 1e6, 1e155, 1e200, -1e308])
@pytest.mark.parametrize("of", ["clearance", "lateral", "relative_velocity"])
def test_a_track_that_cannot_be_is_left_out_and_counted(of: str, number: float) -> None:
    """The square of such a clearance is more than a number can be, and ended the adapter."""
    drive = Drive(host_speed=10.0, yaw_rate=0.001)
    drive.see(track(1, 40), times=5)
    odd = replace(track(2, 20), **{of: number})
    for more in ({}, {"in_path": 1}):
        sample = drive.see(odd, track(1, 40), times=CONFIRMED, **more)
        assert (sample.clearance, sample.track_id) == (40, 1)
    assert isnan(drive.see(odd, in_path=2).clearance), "named by the radar, it is none, too"
    said = {"tracks with an impossible position or rate": 2 * CONFIRMED + 1}
    assert +drive.counts == said
    drive.see(replace(odd, measured=False))
    assert +drive.counts == said, "what is not measured may say anything"


def test_a_coasted_lead_is_waited_for_and_is_no_measurement() -> None:
    drive = Drive()
    drive.see(track(1, 40), times=5)
    sample = drive.see(track(1, 40, measured=False), track(7, 90))
    assert sample.has_target and isnan(sample.clearance) and sample.track_id == 1
    assert drive.see(track(1, 40)).track_id == 1
    gone = drive.see(times=PATIENCE_NS // SCAN_NS + 1)
    assert not gone.has_target


def test_a_standing_object_is_no_lead_and_a_lead_that_stops_is() -> None:
    drive = Drive(host_speed=15.0)
    assert not drive.see(track(1, 40, rate=-15.0), times=10).has_target
    assert drive.see(track(2, 50, rate=-1.0), times=5).has_target
    clearance = 50.0
    for rate in np.arange(-1.0, -15.1, -0.5):
        clearance += rate * 0.05
        sample = drive.see(track(2, clearance, rate=float(rate)))
    assert sample.has_target and sample.track_id == 1


def test_what_the_radar_says_of_motion_counts() -> None:
    drive = Drive(host_speed=15.0)
    assert not drive.see(track(1, 40, moving=False), times=5).has_target
    assert drive.see(track(1, 40, rate=-15.0, moving=True), times=5).has_target


def test_the_path_bends_with_the_yaw_rate() -> None:
    # 40 m ahead on a left curve of 200 m radius the path is 4 m to the left.
    curve = {"host_speed": 20.0, "yaw_rate": 0.1}
    in_curve, straight_on = track(1, 40, 4.0), track(2, 30, 0.0)
    assert Drive(**curve).see(in_curve, straight_on, times=5).clearance == 40
    assert Drive(host_speed=20.0).see(in_curve, straight_on, times=5).clearance == 30
    # At a walk the yaw rate tells nothing.
    assert Drive(host_speed=1.0, yaw_rate=0.5).see(track(1, 30, moving=True), times=5).has_target


def test_the_radar_s_own_choice_goes_first() -> None:
    drive = Drive()
    sample = drive.see(track(1, 20), track(2, 50, 4.0), in_path=2)
    assert sample.clearance == 50 and sample.track_id == 1
    assert drive.see(track(1, 20), track(2, 50, 4.0), in_path=0).has_target is False
    # The radar renames one car: no change of lead.
    drive.see(track(2, 50), in_path=2, times=3)
    before = drive.see(track(2, 50), in_path=2).track_id
    assert drive.see(track(5, 50.3), in_path=5).track_id == before
    assert drive.see(track(6, 20), in_path=6).track_id != before


def scans(path: Path) -> Iterator[tuple[float, list[Track]]]:
    rows = np.genfromtxt(path, delimiter=",", names=True)
    time = rows["t_s"]
    for own in np.split(np.arange(len(time)), np.flatnonzero(np.diff(time) > 0.02) + 1):
        yield (
            float(time[own[-1]]),
            [
                Track(int(r["track_addr"]), r["range_m"], r["lateral_m"], r["range_rate_mps"])
                for r in rows[own]
            ],
        )


@pytest.mark.parametrize("with_host_speed", [True, False])
def test_the_recorded_lead_is_kept(data: Path, with_host_speed: bool) -> None:
    base = f"{data}/comma2k19_rav4_seg40"
    lead = np.genfromtxt(f"{base}_lead.csv", delimiter=",", names=True)
    speed = np.genfromtxt(f"{base}.speed.csv", delimiter=",", names=True)
    selector, right, ids = LeadSelector(), [], []
    for time, tracks in scans(Path(f"{base}.radar_alltracks.csv")):
        host = float(np.interp(time, speed["t_s"], speed["host_speed_mps"]))
        sample = selector.select(round(time * 1e9), tracks, host if with_host_speed else None)
        if time > 12.0:
            true = np.interp(time, lead["t_s"], lead["range_m"])
            right.append(sample.has_target and abs(sample.clearance - true) < 1.0)
            ids.append(sample.track_id)
    assert len(right) > 900 and np.mean(right) >= 0.98
    assert len(set(ids)) == 1, "no change of lead while the car stays the lead"


@pytest.mark.parametrize("name", ["opencaret_following_car", "opencaret_straight_towards_car"])
def test_another_radar_keeps_its_lead_too(data: Path, name: str) -> None:
    selector = LeadSelector()
    samples = [
        selector.select(round(time * 1e9), tracks)
        for time, tracks in scans(data / f"{name}.radar_alltracks.csv")
    ]
    seen = [s.track_id for s in samples if s.has_target]
    assert len(seen) > 0.8 * len(samples) and len(set(seen)) <= 2
