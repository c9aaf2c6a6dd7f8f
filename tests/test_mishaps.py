"""What happens to healthy sensors: only what is said of it, and the same for the same seed."""

from itertools import pairwise

import numpy as np
import pytest

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample
from lfd_replay.evaluation.mishaps import (
    CHANGING_IDS,
    IDS,
    MISHAPS,
    MOST,
    PARTS,
    SEEN,
    SILENCES,
    UNSEEN,
)
from lfd_replay.generated.generate import generate_drive

SCAN = 0.05
"""Seconds between two scans, at most 2 ms late."""


@pytest.fixture(scope="module")
def healthy() -> list[Sample]:
    return list(generate_drive("data-1", 1, "esr").samples)


def having(name: str, samples: list[Sample], seed: int = 1) -> list[Sample]:
    return MISHAPS[name](samples, np.random.default_rng(seed))


def runs(scans: list[RadarSample], same) -> list[int]:
    """How many scans in a row are the `same` as the one before."""
    lengths = [0]
    for before, now in pairwise(scans):
        if same(before, now):
            lengths[-1] += 1
        elif lengths[-1]:
            lengths.append(0)
    return lengths


@pytest.mark.parametrize("name", MISHAPS)
def test_a_mishap_is_the_same_for_the_same_seed_and_another_for_another(healthy, name) -> None:
    first = having(name, healthy)
    assert first == having(name, healthy) != having(name, healthy, 2)
    assert first != healthy


@pytest.mark.parametrize(
    ("name", "silent"),
    [
        ("a silent radar", RADAR),
        ("a silent accelerometer", ACCELERATION),
        ("a silent host speed", HOST_SPEED),
    ],
)
def test_a_silent_sensor_says_nothing_for_a_while_and_the_others_everything(
    healthy, name, silent
) -> None:
    made = having(name, healthy)
    assert [s for s in made if s.input != silent] == [s for s in healthy if s.input != silent]
    stamps = [s.stamp * 1e-9 for s in made if s.input == silent]
    gaps = np.diff(stamps)
    assert max(SILENCES) / 2 < gaps.max() < max(SILENCES) + 2 * SCAN
    assert stamps[-1] - stamps[0] > 0.9 * (healthy[-1].stamp - healthy[0].stamp) * 1e-9


def test_a_radar_that_loses_its_lead_goes_on_from_what_it_knew(healthy) -> None:
    made = having("a radar that loses its lead", healthy)
    assert [(s.stamp, s.input) for s in made] == [(s.stamp, s.input) for s in healthy]
    changed = [(a, b) for a, b in zip(healthy, made, strict=True) if a != b]
    assert {b.input for _, b in changed} == {RADAR}
    scans = [s for s in made if s.input == RADAR and s.has_target]
    lost = {b.stamp for _, b in changed}
    unseen = runs(scans, lambda _, now: now.stamp in lost)
    assert 1 <= max(unseen) <= UNSEEN[1] / SCAN + 1
    for before, now in pairwise(scans):
        if now.stamp in lost:
            gone = now.relative_velocity * (now.stamp - before.stamp) * 1e-9
            assert now.relative_velocity == before.relative_velocity
            assert now.clearance - before.clearance == pytest.approx(gone, abs=0.05)


def test_a_radar_that_repeats_itself_says_whole_messages_again(healthy) -> None:
    made = having("a radar that repeats itself", healthy)
    assert [(s.stamp, s.input) for s in made] == [(s.stamp, s.input) for s in healthy]
    changed = {b.stamp for a, b in zip(healthy, made, strict=True) if a != b}
    scans = [s for s in made if s.input == RADAR and s.has_target]
    assert max(runs(scans, lambda _, now: now.stamp in changed)) == MOST
    for before, now in pairwise(scans):
        if now.stamp in changed:
            assert (now.clearance, now.relative_velocity) == (
                before.clearance,
                before.relative_velocity,
            )


def test_a_radar_whose_ids_change_sees_parts_of_one_car(healthy) -> None:
    made = having(CHANGING_IDS, healthy)
    assert [(s.stamp, s.input) for s in made] == [(s.stamp, s.input) for s in healthy]
    scans = [
        (a, b) for a, b in zip(healthy, made, strict=True) if a.input == RADAR and a.has_target
    ]
    farther: dict[int, set[float]] = {}
    for was, now in scans:
        assert now.relative_velocity == was.relative_velocity
        farther.setdefault(now.track_id, set()).add(round(now.clearance - was.clearance, 2))
    assert len(farther) == IDS and -1 not in farther
    for own in farther.values():
        (beyond,) = own
        assert PARTS[0] <= beyond <= PARTS[1]
    assert max(runs([b for _, b in scans], lambda a, b: a.track_id == b.track_id)) >= 1
    changes = sum(a.track_id != b.track_id for (_, a), (_, b) in pairwise(scans))
    assert changes > len(scans) * SCAN / SEEN[1] / 2
