"""Sensors as cars have them: late, slow, coarse, biased. Healthy, they raise no fault; a fault in
them is still found."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from math import nan
from random import Random

import numpy as np
import pytest
from scipy.signal import savgol_filter

from lfd_diagnosis.verdict import Event, Kind, Outcome, State
from lfd_mpc.samples import ACCELERATION, HOST_SPEED, RADAR, RadarSample, Sample
from lfd_mpc.settings import STEP_NS
from lfd_replay.evaluation.random_sensors import random_sensors_drive
from lfd_replay.faults import FaultInjector, parse_faults
from lfd_replay.generated.generate import drive_truth, generate_drive
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings

Change = Callable[[Sample], Sample]


def late(seconds: float) -> Change:
    return lambda sample: replace(sample, stamp=sample.stamp + round(seconds * 1e9))


def coarse(step: float) -> Change:
    return lambda sample: replace(sample, value=round(sample.value / step) * step)


def coarse_radar(step: float) -> Change:
    return lambda sample: replace(
        sample,
        clearance=round(sample.clearance / step) * step,
        relative_velocity=round(sample.relative_velocity / step) * step,
    )


def dead_below(speed: float) -> Change:
    return lambda sample: replace(sample, value=0.0 if sample.value < speed else sample.value)


def biased(speed: float) -> Change:
    return lambda sample: replace(sample, relative_velocity=sample.relative_velocity + speed)


def changed(samples: Sequence[Sample], name: str, change: Change) -> list[Sample]:
    made = [change(sample) if sample.input == name else sample for sample in samples]
    return sorted(made, key=lambda sample: sample.stamp)


def thinned(samples: Sequence[Sample], name: str, period: float) -> list[Sample]:
    """One input at a longer period, in s."""
    kept, last = [], -1e18
    for sample in samples:
        if sample.input == name:
            if sample.stamp - last < (period - 0.002) * 1e9:
                continue
            last = sample.stamp
        kept.append(sample)
    return kept


def losing(samples: Sequence[Sample], name: str, share: float) -> list[Sample]:
    """One input of which samples are lost now and then."""
    random = Random(7)
    return [s for s in samples if s.input != name or random.random() >= share]


def noisy(samples: Sequence[Sample], name: str, std: float) -> list[Sample]:
    """One input with more white noise."""
    random = Random(7)
    return [
        replace(s, value=s.value + random.gauss(0.0, std)) if s.input == name else s
        for s in samples
    ]


def glitching(samples: Sequence[Sample], name: str, field: str, off: float) -> list[Sample]:
    """One input of which a single sample is off every three seconds, now up, now down."""
    made, last = [], 0
    for s in samples:
        if s.input == name and s.stamp - last > 3e9:
            s, last, off = replace(s, **{field: getattr(s, field) + off}), s.stamp, -off
        made.append(s)
    return made


def outcomes_of(samples: Sequence[Sample]) -> list[Outcome]:
    graph = OfflineGraph(graph_settings("robust"))
    return [outcome for rows in graph.rows(samples) for outcome in graph.outcomes(rows)]


def faults(samples: Sequence[Sample]) -> list[Event]:
    graph = OfflineGraph(graph_settings("robust"))
    events = [event for rows in graph.rows(samples) for event in graph.events(rows)]
    return [event for event in events if event.fault.state == State.FAULT]


@cache
def drive(name: str) -> Sequence[Sample]:
    return generate_drive(name, 1, "esr", -8.0 if name == "braking" else None).samples


@pytest.mark.parametrize(
    ("name", "of", "change"),
    [
        ("cut-in", HOST_SPEED, late(0.1)),
        ("stop-and-go", HOST_SPEED, dead_below(0.5)),
        ("stop-and-go", HOST_SPEED, dead_below(1.0)),
        ("stop-and-go", HOST_SPEED, dead_below(1.4)),
        ("braking", HOST_SPEED, coarse(0.0625)),
        ("hill", HOST_SPEED, coarse(0.2778)),
        ("braking", ACCELERATION, coarse(0.25)),
        ("cut-in", ACCELERATION, late(0.05)),
        ("braking", RADAR, coarse_radar(0.2)),
        ("hill", RADAR, coarse_radar(0.5)),
        ("braking", RADAR, late(0.3)),
        ("hill", RADAR, biased(0.1)),
    ],
)
def test_a_healthy_sensor_is_healthy_whatever_its_habits(name: str, of: str, change) -> None:
    assert faults(changed(drive(name), of, change)) == []


@pytest.mark.parametrize(
    ("name", "of", "period"),
    [
        ("cut-in", HOST_SPEED, 0.1),
        ("braking", HOST_SPEED, 0.05),
        ("braking", RADAR, 0.1),
        ("braking", ACCELERATION, 0.02),
    ],
)
def test_a_slow_sensor_is_healthy(name: str, of: str, period: float) -> None:
    assert faults(thinned(drive(name), of, period)) == []


def said_twice(samples: Sequence[Sample], name: str, period: float) -> list[Sample]:
    """One input of which every value is said again half a `period` (s) later, as in a table."""
    seldom = [s for s in thinned(samples, name, period) if s.input == name]
    again = [replace(s, stamp=s.stamp + round(0.5e9 * period)) for s in seldom]
    others = [s for s in samples if s.input != name]
    return sorted([*others, *seldom, *again], key=lambda s: s.stamp)


@pytest.mark.parametrize("name", ["braking", "stop-and-go"])
@pytest.mark.parametrize("period", [0.04, 0.1, 0.2])
def test_a_speed_that_is_said_twice_is_healthy(name: str, period: float) -> None:
    assert faults(said_twice(drive(name), HOST_SPEED, period)) == []


def test_a_speed_that_is_said_twice_is_told_when_it_is_held() -> None:
    samples = said_twice(drive("braking"), HOST_SPEED, 0.1)
    samples = FaultInjector(parse_faults(["hold:host_speed@20.5-24"]), 0, 1).apply(samples)
    assert {event.signal for event in faults(samples)} == {"host_speed"}


@pytest.mark.parametrize("period", [0.05, 0.1])
@pytest.mark.parametrize("step", [0.01, 0.1, 0.2778])
@pytest.mark.parametrize("into", [-0.3, 0.0, 0.3])
def test_a_seldom_speed_that_is_held_as_the_car_brakes_blames_no_accelerometer(
    period: float, step: float, into: float
) -> None:
    """Both say that they disagree, but cars brake little by little, and sensors do not fail so."""
    truth = drive_truth("braking")
    brakes = truth.time[np.flatnonzero(np.diff(truth.host_speed) < -0.005)[0]]
    samples = changed(thinned(drive("braking"), HOST_SPEED, period), HOST_SPEED, coarse(step))
    text = f"hold:host_speed@{brakes + into:.2f}-{brakes + into + 3.0:.2f}"
    samples = FaultInjector(parse_faults([text]), 0, 1).apply(samples)
    found = faults(samples)
    assert {event.signal for event in found} == {"host_speed"}
    assert found[0].fault.kind == Kind.HOLD
    assert found[0].stamp * 1e-9 < brakes + 1.2


@pytest.mark.parametrize("name", ["braking", "stop-and-go", "cut-in"])
@pytest.mark.parametrize("period", [0.5, 1.0])
def test_a_speed_that_is_told_once_a_second_is_no_evidence(name: str, period: float) -> None:
    """As satellite positioning tells it: what it says is over by then, and is held against
    nothing."""
    samples = thinned(drive(name), HOST_SPEED, period)
    assert faults(samples) == []
    *_, last = outcomes_of(samples)
    assert last.report.host_speed.state == State.NOT_READY
    assert f"a sample every {period:.1f} s only" in last.report.host_speed.reason
    wrong = FaultInjector(parse_faults(["offset:acceleration=4@24-27"]), 0, 1).apply(samples)
    assert {event.signal for event in faults(wrong)} == {"acceleration"}


def test_a_speed_that_is_heard_often_again_is_evidence_again() -> None:
    samples = drive("hill")
    seldom = thinned([s for s in samples if s.stamp < 20e9], HOST_SPEED, 1.0)
    outcome = outcomes_of([*seldom, *(s for s in samples if s.stamp >= 20e9)])
    assert outcome[1900].report.host_speed.state == State.NOT_READY
    assert outcome[2300].report.host_speed.state == State.OK


@pytest.mark.parametrize(("lateness", "step"), [(0.05, 0.01), (0.1, 0.2778)])
def test_a_speed_that_comes_seldom_and_late_is_healthy(lateness: float, step: float) -> None:
    samples = thinned(drive("braking"), HOST_SPEED, 0.1)
    samples = changed(changed(samples, HOST_SPEED, late(lateness)), HOST_SPEED, coarse(step))
    assert faults(samples) == []


@pytest.mark.parametrize("share", [0.1, 0.3])
@pytest.mark.parametrize("name", ["cut-in", "hill"])
def test_a_radar_that_loses_scans_is_healthy(name: str, share: float) -> None:
    assert faults(losing(drive(name), RADAR, share)) == []


def unseen(scan: Sample) -> Sample:
    return RadarSample(scan.stamp, False, nan, nan)


def not_seeing(samples: Sequence[Sample], share: float) -> list[Sample]:
    """A radar that says now and then, for a scan, that there is no lead."""
    random = Random(7)
    return [unseen(s) if s.input == RADAR and random.random() < share else s for s in samples]


@pytest.mark.parametrize(("share", "least", "most"), [(0.05, 0.9, 0.95), (0.2, 0.4, 0.6)])
def test_a_lead_that_is_often_lost_is_seldom_judged(
    share: float, least: float, most: float
) -> None:
    samples = not_seeing(drive("data-1"), share)
    rows = np.concatenate(list(OfflineGraph(graph_settings("robust")).rows(samples)))
    assert least < (rows["outcome"]["clearance"]["state"] == State.OK).mean() < most
    assert not faults(samples)


@pytest.mark.parametrize("share", [0.01, 0.05])
def test_a_lead_that_is_lost_for_a_scan_is_the_same_one(share: float) -> None:
    """What is faulty about it is over with the fault, and then it is judged at once."""
    made = generate_drive("hill", 1, "esr")
    zero = made.zero
    faulty = parse_faults(["offset:clearance=4,relative_velocity=-10@30-34"])
    samples = FaultInjector(faulty, zero, 1).apply(not_seeing(made.samples, share))
    outcomes = outcomes_of(samples)
    flagged = [o.report for o in outcomes if o.report.radar.state == State.FAULT]
    first, last = flagged[0].stamp, flagged[-1].stamp
    assert 30.0 < (first - zero) * 1e-9 < 30.5
    assert 33.8 < (last - zero) * 1e-9 < 35.5
    # One alarm, and it says what is seen just now.
    assert len(flagged) == (last - first) // STEP_NS + 1
    lost = {s.stamp for s in samples if s.input == RADAR and not s.has_target}
    assert {stamp for stamp in lost if first < stamp < last}
    assert any("now the radar sees no lead" in report.radar.reason for report in flagged)
    after = [o.report.clearance.state for o in outcomes if o.report.stamp > zero + 36e9]
    assert State.FAULT not in after
    assert np.mean([state in (State.OK, State.NO_TARGET) for state in after]) > 0.98


@pytest.mark.parametrize("known", [True, False])
def test_a_lead_that_is_lost_and_another_one_is_seen_is_no_fault(known: bool) -> None:
    """`known`: whether targets have ids."""
    made = generate_drive("hill", 1, "esr")
    zero = made.zero
    samples = []
    for s in made.samples:
        now = (s.stamp - zero) * 1e-9
        if s.input == RADAR and 30.0 <= now < 30.3:
            s = unseen(s)
        elif s.input == RADAR and now >= 30.3:
            s = replace(s, clearance=s.clearance + 5.0, track_id=s.track_id + 1)
        samples.append(s if known or s.input != RADAR else replace(s, track_id=-1))
    assert faults(samples) == []


@pytest.mark.parametrize("name", ["bumps", "braking"])
def test_an_accelerometer_that_feels_no_bad_road_blames_no_speed_for_it(name: str) -> None:
    assert faults(noisy(drive(name), ACCELERATION, 0.5)) == []


@pytest.mark.parametrize("name", ["bumps", "hill", "cut-in"])
@pytest.mark.parametrize("period", [0.01, 0.05, 0.1])
@pytest.mark.parametrize("told", [True, False])
def test_an_accelerometer_that_is_shaken_is_healthy_however_seldom_it_speaks(
    name: str, period: float, told: bool
) -> None:
    """`told`: whether the host's speed is. Each sample of a slow sensor counts for long."""
    samples = noisy(thinned(drive(name), ACCELERATION, period), ACCELERATION, 1.0)
    assert faults([s for s in samples if told or s.input != HOST_SPEED]) == []


def shaken(samples: Sequence[Sample]) -> list[Sample]:
    """Wheels that a bad road shakes for 0.9 s now and then."""
    random = Random(5)
    return [
        replace(s, value=s.value + random.gauss(0.0, 0.2))
        if s.input == HOST_SPEED and s.stamp * 1e-9 % 31.0 > 30.1
        else s
        for s in samples
    ]


def without_speed(samples: Sequence[Sample]) -> list[Sample]:
    return [s for s in samples if s.input != HOST_SPEED]


@pytest.mark.parametrize("name", ["traffic-09", "traffic-16", "traffic-61"])
def test_a_car_that_comes_to_rest_blames_nobody_without_its_speed(name: str) -> None:
    """It jerks back, and radars see it stand a moment later."""
    samples = changed(generate_drive(name, 1, "esr").samples, RADAR, late(0.1))
    # Brakes that come on as sharply as the simulated ones still may look like a fault.
    assert [e for e in faults(without_speed(samples)) if not e.fault.size < 0.0] == []


@pytest.mark.parametrize("name", ["hilly-27", "hilly-63"])
def test_a_towns_streets_bend_up_and_down(name: str) -> None:
    assert faults(random_sensors_drive(name, 2).samples) == []


@pytest.mark.parametrize("told", [True, False])
def test_what_an_accelerometer_repeats_in_a_car_that_stands_is_not_held(told: bool) -> None:
    """`told`: whether the host's speed is, as far as it is above 0.6 m/s."""
    samples = changed(standing_still(), ACCELERATION, coarse(0.1))
    samples = changed(samples, HOST_SPEED, dead_below(0.6))
    assert faults(samples if told else without_speed(samples)) == []


def test_a_held_accelerometer_is_found_without_host_speed_as_the_car_nears_its_lead() -> None:
    samples = without_speed(drive("braking"))
    held = FaultInjector(parse_faults(["hold:acceleration@20.5-24"]), 0, 1).apply(samples)
    found = [event for event in faults(held) if event.signal == ACCELERATION]
    assert found[0].fault.kind == Kind.HOLD
    assert 20.5e9 < found[0].stamp < 21.5e9


def derived(samples: Sequence[Sample]) -> list[Sample]:
    """An acceleration that is made of the wheels' speed: it feels nothing of the road."""
    speeds = [s for s in samples if s.input == HOST_SPEED]
    at = np.array([s.stamp for s in speeds]) * 1e-9
    steepness = savgol_filter([s.value for s in speeds], 15, 2, deriv=1, delta=np.diff(at).mean())
    made = [
        replace(s, input=ACCELERATION, value=float(v))
        for s, v in zip(speeds, steepness, strict=True)
    ]
    others = [s for s in samples if s.input != ACCELERATION]
    return sorted([*others, *made], key=lambda s: s.stamp)


@pytest.mark.parametrize("name", ["hill", "cut-in"])
@pytest.mark.parametrize("feels", ["the road", "the wheels"])
def test_a_bad_road_that_not_all_sensors_feel_is_nobodys_fault(name: str, feels: str) -> None:
    samples = shaken(drive(name))
    assert faults(derived(samples) if feels == "the wheels" else samples) == []


def test_a_bad_road_is_nothing_to_a_speed_that_comes_seldom() -> None:
    """From satellites, say: there it is the accelerometer alone that is shaken."""
    random = Random(5)
    samples = [
        replace(s, value=s.value + random.gauss(0.0, 1.5))
        if s.input == ACCELERATION and s.stamp * 1e-9 % 31.0 > 30.1
        else s
        for s in thinned(drive("cut-in"), HOST_SPEED, 0.1)
    ]
    assert faults(samples) == []


@pytest.mark.parametrize(
    ("of", "field", "off"),
    [
        (RADAR, "relative_velocity", 0.7),
        (RADAR, "relative_velocity", 0.8),
        (RADAR, "relative_velocity", 0.9),
        (RADAR, "clearance", 1.2),
        (RADAR, "clearance", 1.5),
        (HOST_SPEED, "value", 0.5),
        (HOST_SPEED, "value", 1.0),
        (HOST_SPEED, "value", 20.0),
        (ACCELERATION, "value", 7.0),
        (ACCELERATION, "value", 30.0),
    ],
)
def test_a_glitch_now_and_then_is_no_fault(of: str, field: str, off: float) -> None:
    assert faults(glitching(drive("hill"), of, field, off)) == []


@pytest.mark.parametrize(
    ("of", "change", "signal", "text"),
    [
        (RADAR, biased(0.1), "clearance", "offset:clearance=4@70-75"),
        (RADAR, coarse_radar(0.2), "relative_velocity", "offset:relative_velocity=-5@70-75"),
        (HOST_SPEED, late(0.1), "acceleration", "offset:acceleration=4@70-75"),
        (HOST_SPEED, coarse(0.2778), "acceleration", "offset:acceleration=4@70-75"),
    ],
)
def test_a_fault_is_found_in_such_company(of: str, change, signal: str, text: str) -> None:
    made = generate_drive("hill", 1, "esr")
    samples = changed(made.samples, of, change)
    samples = FaultInjector(parse_faults([text]), made.zero, 0).apply(samples)
    found = faults(samples)
    assert {event.signal for event in found} - {"radar"} == {signal}
    assert (found[0].stamp - made.zero) * 1e-9 == pytest.approx(70.2, abs=0.2)


def standing_still() -> list[Sample]:
    """Stop and go; while the car has stood for a moment every sensor says the very same."""
    truth = drive_truth("stop-and-go")
    made = []
    for sample in drive("stop-and-go"):
        now = min(round(sample.stamp * 1e-7), len(truth.time) - 1)
        lately = slice(max(now - 30, 0), now + 1)
        if not truth.host_speed[lately].any():
            if sample.input != RADAR:
                sample = replace(sample, value=0.0)
            elif abs(truth.relative_velocity[now]) < 0.01:
                clearance = round(float(truth.clearance[now]), 1)
                sample = replace(sample, clearance=clearance, relative_velocity=0.0)
        made.append(sample)
    return made


@pytest.mark.parametrize("start", [40, 86])
@pytest.mark.parametrize("signal", ["clearance", "relative_velocity", "acceleration", "host_speed"])
def test_what_a_standing_car_says_again_and_again_hides_no_held_sensor(signal, start) -> None:
    samples = standing_still()
    assert not faults(samples)
    held = parse_faults([f"hold:{signal}@{start}-{start + 4}"])
    found = faults(FaultInjector(held, 0, 1).apply(samples))
    assert {event.signal for event in found} - {"radar"} == {signal}
    first = next(event for event in found if event.signal == signal)
    assert first.fault.kind == Kind.HOLD
    assert start * 1e9 < first.stamp < (start + 0.8) * 1e9


def test_a_host_speed_in_coarse_steps_tells_nothing_before_it_missed_one() -> None:
    """It stays within a step while the car goes over from driving off to braking."""
    made = random_sensors_drive("traffic-34", 2)
    assert not faults([sample for sample in made.samples if sample.stamp < made.zero + 84 * 10**9])


def test_a_coarse_host_speed_that_was_held_leaps_by_what_it_missed() -> None:
    """That is no acceleration that the accelerometer did not feel."""
    made = random_sensors_drive("traffic-49", 1)
    soon = [sample for sample in made.samples if sample.stamp < made.zero + 44 * 10**9]
    held = parse_faults(["hold:host_speed@37.8012-41.8012"])
    found = faults(FaultInjector(held, made.zero, 1).apply(soon))
    assert "acceleration" not in {event.signal for event in found}


def smoothed(samples: Sequence[Sample], time: float) -> list[Sample]:
    """A host speed that went through a filter of that time constant in s."""
    made, speed, last = [], None, 0
    for sample in samples:
        if sample.input == HOST_SPEED:
            share = 1.0 - np.exp(-(sample.stamp - last) * 1e-9 / time)
            speed = sample.value if speed is None else speed + share * (sample.value - speed)
            last, sample = sample.stamp, replace(sample, value=speed)
        made.append(sample)
    return made


@pytest.mark.parametrize("name", ["braking", "stop-and-go", "cut-in"])
def test_what_a_smoothed_speed_makes_of_a_manoeuvre_is_no_slope_for_long(name: str) -> None:
    """It tells of brakes when they are half on, which is no road that bends."""
    states = [o.report.acceleration.state for o in outcomes_of(smoothed(drive(name), 0.3))]
    assert states.count(State.FAULT) <= 500


def slow_velocity(samples: Sequence[Sample], time: float) -> list[Sample]:
    """A radar whose relative velocity went through a filter of that time constant in s."""
    made, said, last = [], None, 0
    for sample in samples:
        if isinstance(sample, RadarSample) and sample.has_target:
            velocity = sample.relative_velocity
            # Another car is not where the filter was.
            if said is None or abs(velocity - said) > 3.0:
                said = velocity
            said += (1.0 - np.exp(-(sample.stamp - last) * 1e-9 / time)) * (velocity - said)
            last, sample = sample.stamp, replace(sample, relative_velocity=said)
        made.append(sample)
    return made


@pytest.mark.parametrize("name", ["normal-12", "normal-17"])
def test_a_relative_velocity_that_is_smoothed_drifts_nobody_away(name: str) -> None:
    samples = slow_velocity(generate_drive(name, 2, "esr").samples, 0.25)
    assert faults(samples) == []
    samples = FaultInjector(parse_faults(["ramp:clearance=0.5@30-40"]), 0, 1).apply(samples)
    assert {event.signal for event in faults(samples)} == {"clearance", "radar"}
