"""A drive in other units, or of another sign, is told from one that is right."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RadarSample, Sample, ScalarSample
from lfd_replay.drive import make_drive, streams_of
from lfd_replay.drive_bag import write_drive
from lfd_replay.generated.generate import generate_drive
from lfd_replay.inspect import main_inspect
from lfd_replay.read_drive import read_drive
from lfd_replay.units import odd_units


def scaled(clearance: float = 1.0, velocity: float = 1.0, felt: float = 1.0, speed: float = 1.0):
    """What puts factors on a sample's values."""
    of = {ACCELERATION: felt, HOST_SPEED: speed}

    def put(sample: Sample) -> Sample:
        if isinstance(sample, RadarSample):
            return replace(
                sample,
                clearance=clearance * sample.clearance,
                relative_velocity=velocity * sample.relative_velocity,
            )
        return replace(sample, value=of.get(sample.input, 1.0) * sample.value)

    return put


def put_into(samples, put: Callable[[Sample], Sample]) -> dict[str, list[Sample]]:
    return streams_of(map(put, samples))


@pytest.mark.parametrize(
    ("factors", "said"),
    [
        ({"velocity": 3.6}, "relative_velocity: the clearance changes by 0.28 .* in km/h"),
        ({"velocity": 2.237}, "relative_velocity: .* in mph"),
        ({"velocity": -1.0}, "relative_velocity: .*-1.0. of what it says, the other way round;"),
        ({"velocity": -3.6}, "relative_velocity: .*the other way round, as if it was in km/h"),
        ({"clearance": 3.281}, "relative_velocity: .*3.[23]. .*the clearance was in feet"),
        ({"clearance": 100.0}, "relative_velocity: .* as in no unit that is known"),
        ({"speed": 3.6}, "acceleration: the host speed changes by .* as if the speed was in km/h"),
        ({"speed": 2.237}, "acceleration: .* as if the speed was in mph"),
        ({"felt": 1.0 / 9.80665}, "acceleration: .* as if the acceleration was in g"),
        ({"felt": -1.0}, "acceleration: .*-[01]... of what it says, the other way round;"),
    ],
)
@pytest.mark.parametrize("name", ["stop-and-go", "normal-02", "recorded"])
def test_another_unit_or_sign_is_named(name: str, factors: dict, said: str, request) -> None:
    if name == "recorded":
        data = request.getfixturevalue("data")
        samples = read_drive(data / "comma2k19_rav4_seg40_lead.csv").samples
    else:
        samples = generate_drive(name, 1, "esr").samples
    (line,) = odd_units(put_into(samples, scaled(**factors)))
    assert re.search(said, line), line


@pytest.mark.parametrize("sensor", ["esr", "coarse", "gnss", "exact"])
@pytest.mark.parametrize("name", ["data-1", "stop-and-go", "cut-in", "hill", "bumps", "braking"])
def test_a_drive_as_it_should_be_contradicts_nothing(name: str, sensor: str) -> None:
    assert not list(odd_units(streams_of(generate_drive(name, 2, sensor).samples)))


def test_nothing_is_made_of_little_or_of_nonsense() -> None:
    samples = generate_drive("stop-and-go", 1, "esr").samples
    noise = np.random.default_rng(1).normal(0.0, 5.0, len(samples)).tolist()
    nonsense = [
        replace(sample, value=value) if isinstance(sample, ScalarSample) else sample
        for sample, value in zip(samples, noise, strict=True)
    ]
    assert not list(odd_units(streams_of(nonsense)))
    wrong = scaled(velocity=3.6, felt=-1.0)
    assert not list(odd_units(put_into(samples[:1000], wrong)))
    assert not list(odd_units({}))
    nothing = [replace(s, clearance=np.nan) for s in samples if isinstance(s, RadarSample)]
    assert not list(odd_units(streams_of(nothing)))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e200, 1e308])
def test_values_too_large_to_be_summed_are_told_of_in_our_own_words(size: float) -> None:
    """numpy's warnings, with lines of its source, reach no user."""
    samples = generate_drive("stop-and-go", 1, "esr").samples
    list(odd_units(put_into(samples, scaled(velocity=size, felt=size))))


def test_a_stamp_far_ahead_and_time_that_begins_again_are_no_contradiction() -> None:
    samples = generate_drive("stop-and-go", 1, "esr").samples
    ahead = [replace(s, stamp=s.stamp + 2**60) if k == 500 else s for k, s in enumerate(samples)]
    assert not list(odd_units(streams_of(ahead)))
    assert not list(odd_units(streams_of([*samples, *samples])))
    twice = odd_units(put_into([*samples, *samples], scaled(velocity=-1.0)))
    assert [line.partition(":")[0] for line in twice] == ["relative_velocity"]


def test_who_reads_and_who_inspects_is_told(tmp_path: Path, capsys) -> None:
    streams = put_into(generate_drive("stop-and-go", 1, "esr").samples, scaled(speed=3.6))
    file = tmp_path / "km_per_h.mcap"
    write_drive(make_drive("km_per_h", streams), file)
    (warning,) = read_drive(file).warnings
    assert "as if the speed was in km/h" in warning
    assert main_inspect([str(file), "--json", str(tmp_path / "found.json")]) == 0
    assert f"note: {warning}" in " ".join(capsys.readouterr().out.split())
    assert json.loads((tmp_path / "found.json").read_text())["remarks"] == [warning]
