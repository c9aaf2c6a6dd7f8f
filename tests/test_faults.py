"""What each fault does to samples, and how it is scored."""

import math

import numpy as np
import pytest
from test_live_equals_offline import drive

from lfd_diagnosis.verdict import State
from lfd_mpc.errors import UserError
from lfd_mpc.samples import (
    ACCELERATION,
    HOST_SPEED,
    LEAD_ACCELERATION,
    RadarSample,
    ScalarSample,
)
from lfd_replay.command_line import idle_faults
from lfd_replay.drive import LATEST, Drive
from lfd_replay.fault_injector import LiveFaults
from lfd_replay.faults import MEASURED, WITH_VALUE, FaultInjector, parse_faults, truth_windows
from lfd_replay.offline import OfflineGraph
from lfd_replay.profiles import graph_settings
from lfd_replay.score import SIGNALS, Timeline, score, score_sensor, shown, summary_rows

ZERO = 5_000_000_000


def radar(seconds: float, clearance: float = 30.0, velocity: float = -1.0) -> RadarSample:
    return RadarSample(ZERO + round(seconds * 1e9), True, clearance, velocity)


def accel(seconds: float, value: float = 0.5) -> ScalarSample:
    return ScalarSample(ACCELERATION, ZERO + round(seconds * 1e9), value)


def inject(text: str, samples: list, seed: int = 0) -> list:
    return FaultInjector(parse_faults([text]), ZERO, seed).apply(samples)


def values(text: str, times: list[float], of=None) -> list[float]:
    of = of or (lambda t: t)
    return [s.value for s in inject(text, [accel(t, of(t)) for t in times])]


@pytest.mark.parametrize(("at", "faulty"), [(0.99, False), (1.0, True), (1.99, True), (2.0, False)])
def test_start_is_included_and_end_is_not(at: float, faulty: bool) -> None:
    (sample,) = inject("offset:acceleration=4@1-2", [accel(at)])
    assert sample.value == (4.5 if faulty else 0.5)


def test_offset_of_several_signals_acts_on_each() -> None:
    (sample,) = inject("offset:clearance=4,relative_velocity=-10@1-2", [radar(1)])
    assert (sample.clearance, sample.relative_velocity) == (34.0, -11.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("offset:clearance=4@3-4", ""),
        ("offset:acceleration=4@0-1", ""),
        ("dropout:radar@1-2", ""),
        (
            "offset:clearance=4,acceleration=1@1-2",
            "fault 'offset:clearance=4,acceleration=1@1-2' does nothing to clearance: "
            "no sample from 1 to 2 s",
        ),
        (
            "dropout:radar@0-0.5",
            "fault 'dropout:radar@0-0.5' does nothing to clearance and relative_velocity: "
            "no sample from 0 to 0.5 s",
        ),
        ("zero:host_speed@1-2", "fault 'zero:host_speed@1-2' does nothing to host_speed: "),
        (
            "hold:clearance@3-4",
            "fault 'hold:clearance@3-4' does nothing to clearance: no value bef",
        ),
        (
            "hold:acceleration@0-5",
            "fault 'hold:acceleration@0-5' does nothing to acceleration: "
            "no value before 0 s that it could hold",
        ),
        (
            "offset:clearance=0,acceleration=0@0-5",
            "fault 'offset:clearance=0,acceleration=0@0-5' does nothing to clearance and "
            "acceleration: every value from 0 to 5 s stays as it is",
        ),
        (
            "offset:clearance=0,acceleration=1@0-5",
            "fault 'offset:clearance=0,acceleration=1@0-5' d",
        ),
        ("gain:acceleration=1@0-5", "fault 'gain:acceleration=1@0-5' does nothing to acceleration"),
        ("ramp:clearance=0@0-5", "fault 'ramp:clearance=0@0-5' does nothing to clearance"),
        ("noise:clearance=0@0-5", "fault 'noise:clearance=0@0-5' does nothing to clearance"),
        ("delay:acceleration=0.5@0-5", "fault 'delay:acceleration=0.5@0-5' does nothing to accel"),
        (
            "hold:acceleration@1-5",
            "fault 'hold:acceleration@1-5' does nothing to acceleration: eve",
        ),
        ("dropout:clearance@3-4", ""),
        ("dropout:acceleration@1-2", ""),
        ("noise:clearance=1@3-4", ""),
        ("zero:acceleration@1-2", ""),
        ("zero:clearance@5-6", "fault 'zero:clearance@5-6' starts after the end of the drive (4.0"),
    ],
)
def test_a_fault_that_changes_nothing_is_told_of(text: str, said: str) -> None:
    """Not found, it would look like one that was missed."""
    empty = RadarSample(ZERO + 1_000_000_000, False, math.nan, math.nan)
    samples = [accel(0), empty, accel(1), accel(2), radar(3), accel(4)]
    told = idle_faults(Drive("drive", samples), parse_faults([text]))
    assert (told[0] if told else "").startswith(said) and len(told) == bool(said)


def test_ramp_gain_zero_and_spike() -> None:
    assert values("ramp:acceleration=2@1-5", [0.5, 1, 2.5], lambda t: 0.0) == [0, 0, 3]
    assert values("gain:acceleration=-2@1-5", [0.5, 1]) == [0.5, -2]
    assert values("zero:acceleration@1-5", [0.5, 1]) == [0.5, 0]
    assert values("spike:acceleration=9@1-4", [1, 1.5, 2.2, 2.3, 3], lambda t: 0.0) == [
        9,
        0,
        9,
        0,
        9,
    ]


def test_hold_keeps_the_last_value_before_the_start() -> None:
    assert values("hold:acceleration@1-2", [0.5, 0.9, 1.0, 1.5, 2.0]) == [0.5, 0.9, 0.9, 0.9, 2.0]


def test_delay_gives_the_value_of_an_earlier_sample_with_the_present_stamp() -> None:
    assert values("delay:acceleration=0.5@1-3", [0, 0.5, 1, 1.4, 2]) == [0, 0.5, 0.5, 0.5, 1.4]


def test_a_delay_takes_nothing_from_before_time_went_back() -> None:
    times = [0.5 * k for k in range(10)]
    said = iter([10.0 * (k // 10) + times[k % 10] for k in range(20)])
    loops = values("delay:acceleration=0.5@1-3", times + times, lambda t: next(said))
    assert loops[:10] == [0, 0.5, 0.5, 1, 1.5, 2, 3, 3.5, 4, 4.5]
    assert loops[10:] == [10 + value for value in loops[:10]]


def test_a_delay_beyond_all_stamps_is_refused() -> None:
    """No whole number of ns is made of the greatest of them; live it ended the injector."""
    assert values(f"delay:acceleration={LATEST - 1}@1-3", [0, 1, 2]) == [0, 0, 0]
    for seconds in (f"{LATEST}", "1e300"):
        with pytest.raises(UserError, match=f"a delay of less than {LATEST} s is expected"):
            parse_faults([f"delay:clearance={seconds}@5-9"])


@pytest.mark.parametrize("kind", sorted({*WITH_VALUE} - {"delay"}))
@pytest.mark.parametrize("value", ["1e300", "-1e308", "1.7e308"])
@pytest.mark.filterwarnings("error")
def test_no_finite_value_of_a_fault_is_too_much_for_the_graph(kind: str, value: str) -> None:
    if kind == "noise":
        value = value.removeprefix("-")
    graph = OfflineGraph(graph_settings("robust"))
    faults = ",".join(f"{signal}={value}" for signal in MEASURED)
    injector = FaultInjector(parse_faults([f"{kind}:{faults}@1-2"]), 0, seed=0)
    steps = list(graph.run(injector.apply(drive(3.0))))
    assert len(steps) > 250 and math.isfinite(steps[-1].horizon.command)


def test_noise_depends_on_seed_signal_and_stamp_only() -> None:
    once = inject("noise:acceleration=1@1-3", [accel(1), accel(2)])
    again = inject("noise:acceleration=1@1-3", [accel(2)])
    other = inject("noise:acceleration=1@1-3", [accel(2)], seed=1)
    assert once[1] == again[0] != other[0]
    spread = [
        s.value for s in inject("noise:acceleration=2@0-9", [accel(t / 500) for t in range(4000)])
    ]
    mean = sum(spread) / len(spread)
    deviation = math.sqrt(sum((v - mean) ** 2 for v in spread) / len(spread))
    assert deviation == pytest.approx(2.0, rel=0.1) and mean == pytest.approx(0.5, abs=0.15)


def test_dropout_of_the_radar_is_no_message_and_of_one_signal_is_nan() -> None:
    assert inject("dropout:radar@1-2", [radar(1)]) == []
    (sample,) = inject("dropout:clearance@1-2", [radar(1)])
    assert math.isnan(sample.clearance) and sample.relative_velocity == -1.0
    assert inject("dropout:acceleration,host_speed@1-2", [accel(1), accel(2)]) == [accel(2)]


def test_faults_act_in_the_order_given() -> None:
    one = inject("offset:acceleration=1@0-9;gain:acceleration=2@0-9", [accel(1)])
    other = inject("gain:acceleration=2@0-9;offset:acceleration=1@0-9", [accel(1)])
    assert (one[0].value, other[0].value) == (3.0, 2.0)


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        # 0.5 s is the last thing that was said before the silence.
        ("hold:acceleration@2-9", 0.5),
        ("delay:acceleration=1@2-9", 0.5),
        ("spike:acceleration=10@1-9", 12.5),
    ],
)
def test_a_fault_hears_nothing_of_what_an_earlier_one_kept_back(fault: str, said: float) -> None:
    samples = [accel(t, t) for t in (0.5, 1.0, 1.5, 2.5)]
    assert inject(f"dropout:acceleration@1-2;{fault}", samples)[-1].value == said


def test_a_fault_hears_what_a_later_one_keeps_back() -> None:
    samples = [accel(t, t) for t in (0.5, 1.0, 1.5, 2.5)]
    assert inject("hold:acceleration@2-9;dropout:acceleration@1-2", samples)[-1].value == 1.5


def test_an_empty_road_stays_empty() -> None:
    empty = RadarSample(ZERO, False, math.nan, math.nan)
    (sample,) = inject("zero:radar@0-9", [empty])
    assert not sample.has_target and math.isnan(sample.clearance)


def test_the_radar_is_at_fault_where_either_signal_is() -> None:
    faults = parse_faults(["zero:clearance@1-3;zero:relative_velocity@2-4", "zero:host_speed@8-9"])
    assert truth_windows(faults, "radar") == [(1.0, 4.0)]
    assert truth_windows(faults, "clearance") == [(1.0, 3.0)]
    assert truth_windows(faults, HOST_SPEED) == [(8.0, 9.0)]


def flags(*intervals: tuple[float, float]) -> Timeline:
    """Ten seconds in which every signal is faulty in such intervals (s)."""
    stamps = np.arange(1000) * 10_000_000
    time = stamps * 1e-9
    states = np.full(len(stamps), State.OK, dtype=np.int8)
    for start, end in intervals:
        states[(start - 1e-6 <= time) & (time < end - 1e-6)] = State.FAULT
    return Timeline(stamps, {name: states for name in SIGNALS})


def test_a_window_is_found_when_a_flag_starts_inside_it() -> None:
    figures = score_sensor(flags((2.1, 4.2)), "clearance", [(2.0, 4.0)])
    assert figures["detected"] and figures["delay_s"] == pytest.approx(0.1)
    assert figures["flagged_fraction"] == pytest.approx(0.95)
    assert figures["false_events"] == 0
    assert figures["flagged"] == [[pytest.approx(2.1), pytest.approx(4.2)]]


def test_a_flag_that_was_there_before_is_no_finding() -> None:
    figures = score_sensor(flags((1.0, 3.0)), "clearance", [(2.0, 4.0)])
    assert figures["detected"] is False and figures["delay_s"] is None
    assert figures["windows"][0]["already_flagged"]


@pytest.mark.parametrize(("start", "false"), [(4.5, 0), (4.99, 0), (5.0, 1), (7.0, 1)])
def test_a_flag_within_a_second_of_the_end_is_no_false_event(start: float, false: int) -> None:
    figures = score_sensor(flags((start, start + 0.5)), "clearance", [(2.0, 4.0)])
    assert figures["false_events"] == false
    assert figures["false_s"] == pytest.approx(0.5 * false)


def test_a_silence_and_a_fault_of_host_speed_show_in_the_table_alone() -> None:
    stamps = np.arange(0, 10_000_000_000, 10_000_000)
    silent = np.where((stamps >= 2_100_000_000) & (stamps < 4_000_000_000), State.NO_DATA, State.OK)
    wrong = np.where((stamps >= 6_300_000_000) & (stamps < 8_000_000_000), State.FAULT, State.OK)
    states = {name: np.full(len(stamps), State.OK) for name in SIGNALS}
    line = Timeline(stamps, {**states, "acceleration": silent, "host_speed": wrong})
    faults = parse_faults(["dropout:acceleration@2-4", "offset:host_speed=5@6-8"])
    rows = {row[0]: row for row in summary_rows(shown(line, faults))}
    assert rows["acceleration"][2] == "0 of 1, NO_DATA in 1 after 0.10 s"
    assert rows["host_speed"][1:4] == ("6-8 s", "1 of 1", "300 ms")
    assert rows["clearance"][2] == "-"
    figures = score(line, faults)
    assert set(figures) == set(SIGNALS) and "no_data_s" not in figures["acceleration"]
    assert set(shown(line, faults[:1])) == set(SIGNALS), "not injected, not shown"


def through_live(between: dict[int, list]) -> tuple[LiveFaults, list[float]]:
    """Clearances of three seconds under an offset of 4 m; `between`: what else passes before the
    scan of that number."""
    live = LiveFaults(0)
    live.inject_at_first(parse_faults(["offset:clearance=4@0-3"]))
    seen = []
    for scan in range(60):
        for sample in between.get(scan, []):
            live(sample)
        live(accel(0.05 * scan))
        seen.append(live(radar(0.05 * scan)).clearance)
    return live, seen


@pytest.mark.parametrize("off", [-2.0, 3.0, -300.0, 300.0])
def test_another_clock_or_a_wrong_stamp_ends_no_injection(off: float) -> None:
    def word(scan: int) -> ScalarSample:
        return ScalarSample(LEAD_ACCELERATION, ZERO + round((0.05 * scan + off) * 1e9), 0.0)

    for between in (
        {scan: [word(scan)] for scan in range(60)},
        {10: [radar(0.5 + off)]},
        {scan: [ScalarSample(HOST_SPEED, word(scan).stamp, 15.0)] for scan in range(1, 60)},
    ):
        live, seen = through_live(between)
        assert seen == [34.0] * 60
        now = live.inject(parse_faults(["offset:clearance=1@0-1"]))
        assert now == ZERO + round(2.95 * 1e9), "times count from the car's own newest sample"


def test_an_injection_ends_where_another_drive_begins() -> None:
    live, _ = through_live({})
    assert live.inject(parse_faults(["offset:clearance=4@0-300"]))
    assert live(radar(3.0)).clearance == 34.0
    assert [live(accel(-99.0)).value, live(radar(-99.0)).clearance] == [0.5, 30.0]
    assert live(radar(-98.95)).clearance == 30.0


@pytest.mark.parametrize("fault", ["offset:clearance=4@0.1-0.2", "offset:clearance=4@0.05-0.25"])
def test_an_injection_includes_its_start_and_not_its_end(fault: str) -> None:
    times = [0.05, 0.1, 0.15, 0.2, 0.25]
    live = LiveFaults(0)
    live(radar(0))
    live.inject(parse_faults([fault]))
    assert [live(radar(t)) for t in times] == inject(fault, [radar(t) for t in times])


def test_an_injection_from_now_on_begins_with_the_next_sample() -> None:
    live = LiveFaults(0)
    assert live(accel(0, 0.5)).value == 0.5
    live.inject(parse_faults(["hold:acceleration@0-1"]))
    assert [live(accel(t, t)).value for t in (0.01, 0.99, 1.0)] == [0.5, 0.5, 1.0]


@pytest.mark.parametrize(("fault", "said"), [("hold", 34.0), ("delay", 34.5)])
def test_an_injection_hears_what_those_before_it_made(fault: str, said: float) -> None:
    live = LiveFaults(0)
    live.inject_at_first(parse_faults(["offset:clearance=4@0-9"]))
    for t, clearance in ((0.0, 31.0), (0.5, 30.5), (1.0, 30.0)):
        live(radar(t, clearance))
    value = "=1" if fault == "delay" else ""
    live.inject(parse_faults([f"{fault}:clearance{value}@0-9"]))
    assert live(radar(1.5, 20.0)).clearance == said
